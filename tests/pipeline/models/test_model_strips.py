"""Strips of independent models from their coordinates to the ground: truth, precision, what is refused."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.errors import InputError
from photostrip.network.problem import BundleSettings
from photostrip.pipeline.inputs import Inputs, Settings
from photostrip.pipeline.results import StripResult
from photostrip.pipeline.run import triangulate
from photostrip.simulation import Control, Flight, Ground, Models, Points, Spec, simulate
from photostrip.strip import control_screening
from photostrip.strip.linked_models import LinkSettings
from tests.loops import nonempty
from tests.models import inputs, truth
from tests.simulated import inputs_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.points import ModelPoints

    Floats = NDArray[np.float64]

EXACT = 1e-6  # m
FREE = (0.0, 0.0, 0.0)
PLAIN = Settings(adjustment="similarity")


def with_points(given: Inputs, points: ModelPoints) -> Inputs:
    assert given.models is not None
    return replace(given, models=replace(given.models, points=points))


def linked(given: Inputs, settings: Settings = PLAIN) -> StripResult:
    (strip,) = triangulate(given, settings).strips
    return strip


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
    assert np.abs(result.points.cartesian - simulated.truth.points.xyz[result.points.number]).max() < EXACT
    place = {photo: row for row, photo in enumerate(simulated.truth.photo_ids)}
    for strip in nonempty(result.strips):
        found = strip.intermediate.cartesian_from_intermediate(strip.placed.centers)
        assert np.abs(found - simulated.truth.centers[[place[photo] for photo in strip.strip.photos]]).max() < EXACT
    assert len(result.ties.number) > 3
    assert np.abs(result.ties.difference).max() < EXACT


@pytest.mark.parametrize("coordinates", [100, 27])
def test_a_wrong_control_point_is_named(monkeypatch: pytest.MonkeyPatch, coordinates: int) -> None:
    """In sections, too."""
    monkeypatch.setattr(control_screening, "LARGEST_SECTION", coordinates)
    given = truth(8, 3, 4)
    noise = np.random.default_rng(1).normal(size=(len(given.model), 3))
    whole = inputs(given, given.measured(noise), bands=5)
    enu = whole.control.enu.copy()
    row = int(np.flatnonzero(~whole.control.check)[4])
    enu[row, 2] += 5.0
    strip = linked(replace(whole, control=replace(whole.control, enu=enu)))
    assert [(each.row, each.axes) for each in strip.wrong_control] == [
        (strip.control.ids.index(whole.control.ids[row]), (2,))
    ]
    assert strip.wrong_control[0].size[2] == pytest.approx(5.0, abs=1.0)


# ---------------------------------------------------------------------------------------------------- precision


SEARCHED_FOR_NOTHING = Settings(links=LinkSettings("none"))


@pytest.mark.slow
@pytest.mark.usefixtures("_no_findings")
def test_standard_deviations_are_those_of_repetitions() -> None:
    """The squares of errors at right angles that have their own size add up to the variance of what is linear."""
    given, rng = truth(3, 3, 1), np.random.default_rng(5)
    first = inputs(given, given.measured(rng.normal(size=(len(given.model), 3))), bands=2)
    settings = replace(SEARCHED_FOR_NOTHING, bundle=BundleSettings(test="baarda"))
    whole = triangulate(first, settings)
    assert whole.precision is not None
    assert whole.precision.basis == ("a-priori",)
    points, places = [], []
    taken = ~first.control.check
    values = 3 * len(given.model) + 3 * int(taken.sum())
    for drawn in np.linalg.qr(rng.normal(size=(values, values)))[0] * np.sqrt(values):
        of_models, of_control = np.split(drawn.reshape(-1, 3), [len(given.model)])
        again = with_points(first, given.measured(of_models))
        enu = first.control.enu.copy()
        enu[taken] += 0.02 * of_control
        found = triangulate(replace(again, control=replace(first.control, enu=enu)), settings)
        (strip,) = found.strips
        points.append(found.points.cartesian - given.points[found.points.number])
        places.append(strip.intermediate.cartesian_from_intermediate(strip.placed.centers) - given.centers)
    for samples, covariances in (
        (np.array(points), whole.precision.points),
        (np.array(places), whole.precision.photos[0][:, :3, :3]),
    ):
        ratio = np.sqrt((samples**2).mean(axis=0) / np.diagonal(covariances, axis1=1, axis2=2))
        assert ratio.min() > 0.99
        assert ratio.max() < 1.01


# ------------------------------------------------------------------------------------------------- mistakes


def mistaken(kind: str) -> Inputs:
    """A strip with one mistake in it."""
    given = inputs_of(
        simulate(Spec(seed=4, flight=Flight(photos=10), points=Points(extra_per_model=4), models=Models()))
    )
    assert given.models is not None
    points, control = given.models.points, given.control
    xyz, enu, sigma = points.xyz.copy(), control.enu.copy(), points.sigma
    inside = points.node < len(points.point_ids)
    twice = [k for k in np.flatnonzero((points.model == 3) & inside) if (points.node == points.node[k]).sum() == 2]
    if kind == "a model in metres":
        xyz[points.model == 2] /= 1000
    elif kind == "one id for two points":
        xyz[twice[0]] = xyz[twice[-1]] + [3.0, -2.0, 0.1]
    elif kind == "sigma in mm":
        sigma = sigma * 1000
    elif kind == "sigma in m":
        sigma = sigma / 1000
    elif kind == "centers below":
        for model in range(len(points.model_ids)):
            rows = points.model == model
            ground = xyz[rows & inside, 2].mean()
            xyz[rows & ~inside, 2] = 2 * ground - xyz[rows & ~inside, 2]
    elif kind == "control swapped":
        enu = enu[:, [1, 0, 2]]
    elif kind == "a digit":
        enu[np.flatnonzero(~control.check)[3], 0] += 1000.0
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


@pytest.mark.parametrize(("kind", "finding"), [("control swapped", "P401"), ("centers below", "P401")])
def test_mistakes_that_stop_a_run(kind: str, finding: str) -> None:
    with pytest.raises(InputError) as told:
        triangulate(mistaken(kind), Settings(precision=False))
    assert [fault.code for fault in told.value.faults] == ["left-handed-models"]
    assert finding in {each.code for each in told.value.findings}
