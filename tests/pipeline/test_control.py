"""Control that cannot check itself says so, whatever its residuals.

Control in geocentric coordinates and the same control on a map are one thing.

Cross-validation: each point of the control is what it is to a run that has not seen it.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from photostrip.geodesy.frame_spec import FrameSpec
from photostrip.geodesy.tying import tie_frames
from photostrip.pipeline.inputs import Inputs, Settings
from photostrip.pipeline.results import Result
from photostrip.pipeline.run import triangulate
from photostrip.result.verdict import GOOD, LOOK, UNVERIFIED
from photostrip.simulation import Control, Flight, Ground, Spec, simulate
from tests.loops import nonempty
from tests.results import solved, spec
from tests.simulated import inputs_of, settings_of


def remarks(control: Control, method: str, photos: int = 8, strips: int = 1) -> list[str]:
    """Messages on control that does not check itself."""
    simulation = simulate(Spec(seed=4, flight=Flight(photos=photos, strips=strips), control=control))
    result = triangulate(inputs_of(simulation), replace(settings_of(simulation), adjustment=method))
    return [each.message for each in result.notes if each.code == "unchecked-control"]


@pytest.mark.parametrize(("method", "photos"), [("polynomial", 8), ("bundle", 15)])
def test_five_points_hardly_check_each_other(method: str, photos: int) -> None:
    """One of them may be wrong by metres in height: the strip bends with it."""
    (message,) = remarks(Control(layout="corners+centre"), method, photos)
    assert "m in height" in message


@pytest.mark.parametrize("method", ["polynomial", "bundle"])
def test_three_bands_of_three_check_each_other(method: str) -> None:
    """An error of any of them stands out."""
    assert remarks(Control(bands=3), method) == []


MILLIMETRE = 1e-3  # m
SIGMA = (0.05, 0.05, 0.05)  # alike in all directions: turning the axes changes nothing
LOW_LATITUDE = Ground(crs="EPSG:32633", center_deg=(15.0, 5.0))  # up is nearly along X here, not along Z
SPEC = Spec(seed=7, ground=LOW_LATITUDE, flight=Flight(photos=9), control=Control(bands=3, sigma=SIGMA))


def geocentric(inputs: Inputs) -> Inputs:
    """Give the same inputs with X, Y, Z for east, north and height."""
    (frame,), _ = tie_frames(inputs.frames)
    xyz = frame.cartesian_from_ground(inputs.control.enu)
    spec = FrameSpec("geocentric", ("x", "y", "z"))
    return replace(inputs, control=replace(inputs.control, enu=xyz), frames=(spec,), output=inputs.frames[0])


@pytest.fixture(scope="module")
def both() -> tuple[Result, Result]:
    done = simulate(SPEC)
    inputs, settings = inputs_of(done), replace(settings_of(done), adjustment="polynomial")
    return triangulate(inputs, settings), triangulate(geocentric(inputs), settings)


@pytest.mark.slow
def test_points_and_photos_are_the_same(both: tuple[Result, Result]) -> None:
    on_map, in_space = both
    np.testing.assert_allclose(in_space.points.ground, on_map.points.ground, rtol=0, atol=MILLIMETRE)
    first, second = (r.strips[0] for r in both)
    np.testing.assert_allclose(
        second.intermediate.cartesian_from_intermediate(second.resection.centers),
        first.intermediate.cartesian_from_intermediate(first.resection.centers),
        rtol=0,
        atol=MILLIMETRE,
    )
    assert second.absolute.sigma0 == pytest.approx(first.absolute.sigma0, rel=1e-6)


def test_misclosures_are_east_north_and_up(both: tuple[Result, Result]) -> None:
    first, second = (np.linalg.norm(r.strips[0].absolute.misclosures[:, :2], axis=1) for r in both)
    np.testing.assert_allclose(second, first, rtol=0, atol=MILLIMETRE)
    up = [r.strips[0].absolute.misclosures[:, 2] for r in both]
    np.testing.assert_allclose(up[1], up[0], rtol=0, atol=MILLIMETRE)


TURNED = Settings(cross_validation=True)


@cache
def without_checks(bands: int = 3, strips: int = 1) -> Inputs:
    wanted = spec("projected", strips, 5.0, bands=bands)
    return inputs_of(simulate(replace(wanted, seed=12, control=replace(wanted.control, check=0))))


@pytest.mark.slow
@pytest.mark.parametrize(("adjustment", "strips"), [("similarity", 1), ("bundle", 1), ("polynomial", 2)])
def test_a_fold_is_the_run_without_its_point(adjustment: str, strips: int) -> None:
    inputs, settings = without_checks(strips=strips), Settings(adjustment=adjustment)
    document = solved(inputs, replace(settings, cross_validation=True)).document
    rows = {row["id"]: row for row in document["cross_validation"]["points"]}
    assert set(rows) == {row["id"] for row in document["control"] if row["measured"]}
    for fold in nonempty(document["cross_validation"]["folds"][::4]):
        name = fold["left_out"][-1]
        check = np.isin(inputs.control.ids, fold["left_out"])
        alone = solved(replace(inputs, control=replace(inputs.control, check=check)), settings).document
        (given,) = (row for row in alone["control"] if row["id"] == name)
        (tested,) = (row for row in alone["precision"]["check"]["points"] if row["id"] == name)
        keys = ("dx", "dy", "dz", "plan", "height", "plan_um", "height_um")
        (point,) = (row for row in alone["points"] if row["id"] == name)
        expected = {key: given[key] for key in keys}
        expected |= {"z_plan": tested["plan"], "z_height": tested["height"]}
        expected |= {f"sigma_{axis}": point[f"sigma_{axis}"] for axis in "xyz"}
        found = {key: rows[name][key] for key in expected}
        assert found == expected


@pytest.mark.slow
def test_it_verifies_what_has_no_check_points() -> None:
    plain = solved(without_checks()).document
    assert plain["status"] == UNVERIFIED
    assert "cross_validation" not in plain
    document = solved(without_checks(), TURNED).document
    assert document["status"] == GOOD, document["verdict"]["look_at"]
    assert document["verdict"]["verification"] == "9 control points in plan and 9 in height, left out in turn"
    assert document["verdict"]["accuracy"].endswith("at control points left out in turn")
    # nothing else is another than without it
    del document["cross_validation"]
    by_verdict = {"status", "verdict", "statement"}
    assert {key: value for key, value in document.items() if key not in by_verdict} == {
        key: value for key, value in plain.items() if key not in by_verdict
    }


@pytest.mark.slow
@pytest.mark.parametrize(("metres", "status"), [(0.0, GOOD), (3.0, LOOK)])
def test_a_wrong_height_among_five_points_is_not_good(metres: float, status: str) -> None:
    """Corners and middle: what control cannot check itself is seen where it is left out."""
    inputs = without_checks()
    enu = inputs.control.enu.copy()
    enu[4, 2] += metres
    control = replace(inputs.control, enu=enu).take(np.array([0, 2, 4, 6, 8]))
    document = solved(replace(inputs, control=control), TURNED).document
    assert document["status"] == status, document["verdict"]
