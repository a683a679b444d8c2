"""Independent models from their coordinates to the ground: truth, precision, what is named and what is refused."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.errors import InputError
from photostrip.network.problem import BundleSettings
from photostrip.pipeline.inputs import Inputs, Settings
from photostrip.pipeline.run import triangulate
from photostrip.result.document import document_of
from photostrip.simulation import Control, Flight, Ground, Models, Points, Simulation, Spec, simulate
from photostrip.strip import control_screening
from photostrip.strip.linked_models import LinkSettings
from tests.models import inputs, truth
from tests.pipeline.blocks import centers, errors, moved, note, used_rows
from tests.simulated import inputs_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.points import ModelPoints

    Floats = NDArray[np.float64]


EXACT = 1e-6  # m
FREE = (0.0, 0.0, 0.0)


def with_points(given: Inputs, points: ModelPoints) -> Inputs:
    assert given.models is not None
    return replace(given, models=replace(given.models, points=points))


@pytest.mark.parametrize(
    ("crs", "adjustment", "hand"),
    [
        ("EPSG:32633", "polynomial", "right-handed"),
        ("local", "similarity", "left-handed"),
        ("geocentric", "polynomial", "left-handed"),
        ("geocentric", "similarity", "right-handed"),
    ],
)
def test_models_without_errors_come_back_to_the_truth(crs: str, adjustment: str, hand: str) -> None:
    axes = ("x", "y", "z") if crs == "geocentric" else ("east", "north", "up")
    asked = Models(sigma_um=FREE, center_sigma_um=FREE, axes="any", hand=hand)
    spec = Spec(ground=Ground(crs, axes), flight=Flight(photos=7, strips=2), control=Control(noise=FREE), models=asked)
    simulated = simulate(spec)
    result = triangulate(inputs_of(simulated), Settings(adjustment=adjustment))
    assert np.abs(errors(simulated, result)).max() < EXACT
    assert np.abs(centers(result) - simulated.truth.centers).max() < EXACT
    assert len(result.ties.number) > 3
    assert np.abs(result.ties.difference).max() < EXACT


@pytest.mark.parametrize("seed", [3, 4, 5])
def test_a_narrow_strip_without_centres_may_lie_either_way_up(seed: int) -> None:
    asked = Models(sigma_um=FREE, axes="any", centers=False)
    simulated = simulate(Spec(seed=seed, flight=Flight(photos=20), control=Control(noise=FREE), models=asked))
    assert np.abs(errors(simulated, triangulate(inputs_of(simulated), Settings(precision=False)))).max() < EXACT


@pytest.mark.parametrize("coordinates", [100, 27])
def test_a_wrong_control_point_is_named(monkeypatch: pytest.MonkeyPatch, coordinates: int) -> None:
    """In sections, too."""
    monkeypatch.setattr(control_screening, "LARGEST_SECTION", coordinates)
    given = truth(8, 3, 4)
    noise = np.random.default_rng(1).normal(size=(len(given.model), 3))
    whole = inputs(given, given.measured(noise), bands=5)
    row = used_rows(whole)[4:5]
    (strip,) = triangulate(moved(whole, row, [0.0, 0.0, 5.0]), Settings(adjustment="similarity")).strips
    (wrong,) = strip.wrong_control
    assert (strip.control.ids[wrong.row], wrong.axes) == (whole.control.ids[row[0]], (2,))
    assert wrong.size[2] == pytest.approx(5.0, abs=1.0)


@pytest.mark.slow
@pytest.mark.usefixtures("_no_findings")
def test_standard_deviations_are_those_of_repetitions() -> None:
    """The squares of errors at right angles that have their own size add up to the variance of what is linear."""
    given, rng = truth(3, 3, 1), np.random.default_rng(5)
    first = inputs(given, given.measured(rng.normal(size=(len(given.model), 3))), bands=2)
    settings = Settings(links=LinkSettings("none"), bundle=BundleSettings(test="baarda"))
    whole = triangulate(first, settings)
    assert whole.precision is not None
    assert whole.precision.basis == ("a-priori",)
    points, places = [], []
    taken = used_rows(first)
    values = 3 * len(given.model) + 3 * len(taken)
    for drawn in np.linalg.qr(rng.normal(size=(values, values)))[0] * np.sqrt(values):
        of_models, of_control = np.split(drawn.reshape(-1, 3), [len(given.model)])
        again = with_points(first, given.measured(of_models))
        found = triangulate(moved(again, taken, 0.02 * of_control), settings)
        points.append(found.points.cartesian - given.points[found.points.number])
        places.append(centers(found) - given.centers)
    for samples, covariances in (
        (np.array(points), whole.precision.points),
        (np.array(places), whole.precision.photos[0][:, :3, :3]),
    ):
        ratio = np.sqrt((samples**2).mean(axis=0) / np.diagonal(covariances, axis1=1, axis2=2))
        assert ratio.min() > 0.99
        assert ratio.max() < 1.01


def mistaken(kind: str) -> Inputs:
    """A strip with one mistake in it."""
    given = inputs_of(
        simulate(Spec(seed=4, flight=Flight(photos=10), points=Points(extra_per_model=4), models=Models()))
    )
    assert given.models is not None
    points, control = given.models.points, given.control
    xyz, enu, sigma = points.xyz.copy(), control.enu.copy(), points.sigma
    inside = points.node < len(points.point_ids)
    if kind == "a model in metres":
        xyz[points.model == 2] /= 1000
    elif kind.startswith("sigma"):
        sigma = sigma * {"sigma in mm": 1000.0, "sigma in m": 0.001}[kind]
    elif kind == "centers below":
        for model in range(len(points.model_ids)):
            rows = points.model == model
            ground = xyz[rows & inside, 2].mean()
            xyz[rows & ~inside, 2] = 2 * ground - xyz[rows & ~inside, 2]
    elif kind == "control swapped":
        enu = enu[:, [1, 0, 2]]
    elif kind == "a digit":
        enu[used_rows(given)[3], 0] += 1000.0
    elif kind == "heights in feet":
        enu[:, 2] /= 0.3048
    whole = replace(given, control=replace(control, enu=enu))
    return with_points(whole, replace(points, xyz=xyz, sigma=sigma))


@pytest.mark.parametrize(
    ("kind", "notes", "findings"),
    [
        ("nothing", set(), set()),
        ("a model in metres", {"odd-scale"}, set()),
        ("sigma in mm", {"sigma-unit", "unit-weight"}, set()),
        ("sigma in m", {"sigma-unit", "sigma-contradicted", "unit-weight"}, set()),
        ("a digit", {"control-rejected"}, {"P406"}),
        ("heights in feet", {"control-doubtful", "unit-weight"}, {"P405"}),
    ],
)
def test_mistakes_that_a_result_tells(kind: str, notes: set[str], findings: set[str]) -> None:
    result = triangulate(mistaken(kind), Settings(precision=False))
    assert {note.code for note in result.notes} - {"weak-link"} == notes
    assert {finding.code for finding in result.findings} == findings


@pytest.mark.parametrize("kind", ["control swapped", "centers below"])
def test_mistakes_that_stop_a_run(kind: str) -> None:
    with pytest.raises(InputError) as told:
        triangulate(mistaken(kind), Settings(precision=False))
    assert [fault.code for fault in told.value.faults] == ["left-handed-models"]
    assert "P401" in {each.code for each in told.value.findings}


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
    assert np.abs(errors(simulated, result)).max() < 10 * EXACT
    assert np.abs(centers(result) - simulated.truth.centers).max() < 10 * EXACT


def test_wrong_rows_and_wrong_control_are_named() -> None:
    """A row 2 mm off in one of three models and more, and a control point 5 m too high: these, and nothing else."""
    given = inputs_of(block(noise=True))
    assert given.models is not None
    points, rng = given.models.points, np.random.default_rng(3)
    times = np.bincount(points.node, minlength=len(points.point_ids))[points.node]
    held = [name in given.control.ids for name in points.point_ids]
    inside = np.flatnonzero((points.node < len(points.point_ids)) & (times > 2))
    wrong = rng.choice([row for row in inside if not held[points.node[row]]], 3, replace=False)
    xyz, high = points.xyz.copy(), used_rows(given)[:1]
    xyz[wrong] += [2.0, -1.0, 1.0]
    result = triangulate(moved(with_points(given, replace(points, xyz=xyz)), high, [0.0, 0.0, 5.0]), Settings())
    assert result.bundle is not None
    selection, block_rows = result.bundle.screened.selection, result.bundle.block.rows
    assert sorted(block_rows[~selection.images].tolist()) == sorted(wrong.tolist())
    assert note(result, "control-rejected").points == (given.control.ids[high[0]],)
    document = document_of(result)
    out = [row for row in document["rejected"] if row["stage"] == "bundle" and row.get("models")]
    names = {(points.model_ids[points.model[row]], points.point_ids[points.node[row]]) for row in wrong.tolist()}
    assert {(row["models"][0], row["point"]) for row in out if not row["readmitted"]} == names
