"""Blocks of independent models: strips without control of their own, free blocks, wrong rows and wrong control."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.pipeline.inputs import Inputs, Settings
from photostrip.pipeline.run import triangulate
from photostrip.result.document import document_of
from photostrip.simulation import Control, Flight, Models, Points, Simulation, Spec, simulate
from tests.loops import nonempty
from tests.simulated import inputs_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

EXACT = 1e-5  # m
FREE = (0.0, 0.0, 0.0)


def block(*, noise: bool = False, strips: int = 3) -> Simulation:
    models = Models(axes="any") if noise else Models(sigma_um=FREE, center_sigma_um=FREE, axes="any")
    control = Control() if noise else Control(noise=FREE)
    points = Points(extra_per_model=4)
    return simulate(Spec(seed=7, flight=Flight(photos=9, strips=strips), points=points, control=control, models=models))


def controlled_in(simulated: Simulation, strip: int) -> Inputs:
    """Leave the control of one strip only; the others become new points."""
    given = inputs_of(simulated)
    assert given.models is not None
    models, points = given.models.strips[strip].models, given.models.points
    rows = np.isin(points.model, [points.model_ids.index(name) for name in models])
    names = {points.name(node) for node in points.node[rows].tolist()}
    alone = np.array([name in names for name in given.control.ids], bool)
    return replace(given, control=given.control.take(alone | given.control.check))


def test_strips_without_control_are_carried_by_the_others() -> None:
    simulated = block()
    result = triangulate(controlled_in(simulated, 1), Settings())
    assert result.bundle is not None
    off = result.points.cartesian - simulated.truth.points.xyz[result.points.number]
    assert np.abs(off).max() < EXACT
    place = {photo: row for row, photo in enumerate(simulated.truth.photo_ids)}
    for strip in nonempty(result.strips):
        found = strip.intermediate.cartesian_from_intermediate(strip.placed.centers)
        assert np.abs(found - simulated.truth.centers[[place[photo] for photo in strip.strip.photos]]).max() < EXACT


def test_wrong_rows_and_wrong_control_are_named() -> None:
    """A row 2 mm off in one of three models and more, and a control point 5 m too high: these, and nothing else."""
    given = inputs_of(block(noise=True))
    assert given.models is not None
    points, rng = given.models.points, np.random.default_rng(3)
    times = np.bincount(points.node, minlength=len(points.point_ids))[points.node]
    held = [name in given.control.ids for name in points.point_ids]
    inside = np.flatnonzero((points.node < len(points.point_ids)) & (times > 2))
    wrong = rng.choice([row for row in inside if not held[points.node[row]]], 3, replace=False)
    xyz, enu = points.xyz.copy(), given.control.enu.copy()
    xyz[wrong] += [2.0, -1.0, 1.0]
    (high, *_) = np.flatnonzero(~given.control.check)
    enu[high, 2] += 5.0
    spoiled = replace(
        given,
        models=replace(given.models, points=replace(points, xyz=xyz)),
        control=replace(given.control, enu=enu),
    )
    result = triangulate(spoiled, Settings())
    assert result.bundle is not None
    selection, block_rows = result.bundle.screened.selection, result.bundle.block.rows
    assert sorted(block_rows[~selection.images].tolist()) == sorted(wrong.tolist())
    (note,) = [note for note in result.notes if note.code == "control-rejected"]
    assert note.points == (given.control.ids[high],)
    document = document_of(result)
    out = [row for row in document["rejected"] if row["stage"] == "bundle" and row.get("models")]
    names = {(points.model_ids[points.model[row]], points.point_ids[points.node[row]]) for row in wrong.tolist()}
    assert {(row["models"][0], row["point"]) for row in out if not row["readmitted"]} == names
