"""What a run says of its control, of curvature, and of points beyond the control or under one id."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest

import photostrip
from photostrip.geodesy.frame_spec import FrameSpec
from photostrip.geodesy.tying import tie_frames
from photostrip.pipeline.frames import orient_interior, tie_ground_frames
from photostrip.pipeline.inputs import Inputs, Settings
from photostrip.pipeline.results import Result
from photostrip.pipeline.run import heights_of, triangulate
from photostrip.pipeline.strip_notes import polynomial_notes
from photostrip.result.verdict import GOOD, LOOK, UNVERIFIED
from photostrip.simulation import Control, Flight, Ground, Points, Spec, simulate
from tests.loops import nonempty
from tests.pipeline.blocks import centers, measured, moved
from tests.results import solved, spec
from tests.simulated import inputs_of, settings_of
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from photostrip.notes import Note
    from photostrip.pipeline.inputs import Strip
    from photostrip.strip.polynomial import Polynomial


@pytest.mark.parametrize(
    ("begin", "end", "beyond"),
    [(-1000.0, 5000.0, None), (-1200.0, 5000.0, 700), (0.0, 5650.0, 650), (-1600.0, 5600.0, 1100)],
)
def test_points_beyond_the_control_are_told_with_how_far(begin: float, end: float, beyond: int | None) -> None:
    """The control reaches from -500 m to 5000 m; a tenth of that is 550 m: more is told, less is not."""
    asked = SimpleNamespace(asked="auto", degree=2, reach=(-500.0, 5000.0), axes=[SimpleNamespace(redundancy=9)])
    correction = cast("Polynomial", asked)
    adjusted = np.array([[begin, 0.0, 0.0], [2000.0, 0.0, 0.0], [end, 0.0, 0.0]])
    notes = list(polynomial_notes(cast("Strip", SimpleNamespace(id="A")), correction, adjusted))
    assert [note.code for note in notes] == ([] if beyond is None else ["extrapolation"])
    points = "2 points lie" if begin < -500.0 and end > 5000.0 else "1 point lies"
    words = "" if beyond is None else f"{points} up to {beyond} m beyond the control"
    assert words in " ".join(note.message for note in notes)


def of_curvature(photos: int, curvature: str = "auto", scale: float = 10_000.0, adjustment: str = "auto") -> list[Note]:
    """Remarks on curvature of a strip whose map coordinates are given as local ones."""
    simulation = simulate(Spec(seed=2, flight=Flight(photos=photos, scale=scale), control=Control(bands=3)))
    inputs, settings = inputs_of(simulation), replace(settings_of(simulation), adjustment=adjustment)
    inputs = replace(inputs, frames=(replace(inputs.frames[0], crs="local"),))
    settings = replace(settings, absolute=replace(settings.absolute, earth_curvature=curvature))
    return [note for note in triangulate(inputs, settings).notes if note.code == "curvature-left-out"]


def test_what_is_left_out_is_said_with_the_key_that_takes_it_in() -> None:
    """Eleven bases of 920 m: the middle lies 5.1 km from the ends."""
    (note,) = of_curvature(12)
    assert "2.1" in note.message
    assert "`earth_curvature: model`" in note.message
    assert note.severity == "note"


@pytest.mark.parametrize("adjustment", ["similarity", "polynomial", "bundle"])
def test_a_strip_that_bends_as_the_earth_does_is_warned_of(adjustment: str) -> None:
    (note,) = of_curvature(23, scale=30_000.0, adjustment=adjustment)
    assert (note.severity, "bends over its control as the Earth does" in note.message) == ("warning", True)


@pytest.mark.parametrize(("photos", "curvature"), [(3, "auto"), (12, "model"), (12, "none")])
def test_nothing_is_said_where_it_is_small_or_decided(photos: int, curvature: str) -> None:
    """A strip of 2 km falls by 0.1 m."""
    assert of_curvature(photos, curvature) == []


def test_heights_are_those_of_the_whole_run() -> None:
    inputs, settings = inputs_of(simulate(spec())), Settings()
    ground, result = tie_ground_frames(inputs, settings, None), triangulate(inputs, settings)
    found = heights_of(orient_interior(inputs, settings).observations, inputs, settings, ground)
    flying, terrain = (ground.output.geodetic(xyz)[:, 2].mean() for xyz in (centers(result), result.points.cartesian))
    assert found.flying == pytest.approx(flying, abs=1e-6)
    assert found.ground == pytest.approx(terrain, abs=1e-6)


LONG = Spec(
    seed=4, flight=Flight(photos=30), points=Points(rows=5, extra_per_model=10), control=Control(every=8, check=0)
)


@cache
def adjusted(adjustment: str, *, twice: bool) -> tuple[Result, str]:
    """Adjust a strip without a point on its last photos, or with this point under the id of one on the first."""
    simulation = simulate(LONG)
    inputs, table = inputs_of(simulation), simulation.observations
    new = [number for number, name in enumerate(table.point_ids) if name not in inputs.control.ids]
    on = {number: np.flatnonzero(table.point == number) for number in new}
    first = next(number for number in new if len(on[number]) == 2 and table.photo[on[number]].max() < 3)
    last = next(number for number in new if len(on[number]) == 2 and table.photo[on[number]].min() >= 27)
    point = np.where(table.point == last, first, table.point)
    kept = np.arange(len(point)) if twice else np.flatnonzero(table.point != last)
    inputs = replace(inputs, observations=measured(replace(table, point=point), kept))
    return triangulate(inputs, replace(settings_of(simulation), adjustment=adjustment)), table.point_ids[first]


@pytest.mark.parametrize("adjustment", ["similarity", "polynomial", "bundle"])
def test_the_strip_is_adjusted_and_the_id_is_named(adjustment: str) -> None:
    sound, _ = adjusted(adjustment, twice=False)
    result, name = adjusted(adjustment, twice=True)
    assert [(found.code, found.points) for found in result.findings] == [("P301", (name,))]
    assert sound.findings == ()
    assert np.array_equal(result.points.number, sound.points.number)
    off = np.linalg.norm(result.points.cartesian - sound.points.cartesian, axis=1)
    assert off.max() < 0.1  # the second place orients one pair by one point more
    assert result.precision is not None
    assert sound.precision is not None
    sigma = [np.sqrt(np.trace(each.points, axis1=1, axis2=2)) for each in (result.precision, sound.precision)]
    assert sigma[0] == pytest.approx(sigma[1], rel=0.05)


SAMPLE = ROOT / "sample_data/simulated-20/project.yaml"


def lens_of(**processing: str) -> list[dict[str, Any]]:
    """Give what is found of the lens where the map coordinates of a sample of 18 km are called local."""
    result = photostrip.run(SAMPLE, **{"control[0].crs": "local"}, processing=processing)
    return [dict(row) for row in result.findings.where(code="P110")]


def test_curvature_is_a_rival_of_the_lens() -> None:
    (found,) = lens_of()
    k1 = 1533.0 / (2 * 6_371_000.0 * 153.0**2)  # mm^-2: H / (2 R f^2)
    assert found["evidence"]["k1_of_curvature"] == pytest.approx(k1, rel=0.01)
    assert found["evidence"]["k1"] == pytest.approx(k1, abs=2 * found["evidence"]["k1_standard_deviation"])
    assert "The Earth's curvature, which local coordinates taken as they are leave out" in found["message"]
    assert found["fix"].startswith(
        "are these map coordinates: name their crs, or set `processing.earth_curvature: model`"
    )


def test_it_is_none_where_it_is_taken_into_account_or_said_not_to_be() -> None:
    assert lens_of(earth_curvature="model") == []
    (found,) = lens_of(earth_curvature="none")
    assert "k1_of_curvature" not in found["evidence"]


def test_another_lens_is_no_curvature() -> None:
    lens = {"model": "brown", "k": [3e-8, 0, 0], "direction": "image_to_ideal"}
    simulation = photostrip.simulate({}, flight={"photos": 12}, ground={"crs": "local"}, camera={"distortion": lens})
    result = simulation.project.overridden(cameras={"film": {"distortion": lens | {"k": [0, 0, 0]}}}).run()
    (found,) = result.findings.where(code="P110")
    assert "k1_of_curvature" not in found["evidence"]


def unchecked(control: Control, method: str, photos: int) -> list[str]:
    """Messages on control that does not check itself."""
    simulation = simulate(Spec(seed=4, flight=Flight(photos=photos), control=control))
    result = triangulate(inputs_of(simulation), replace(settings_of(simulation), adjustment=method))
    return [each.message for each in result.notes if each.code == "unchecked-control"]


@pytest.mark.parametrize(("method", "photos"), [("polynomial", 8), ("bundle", 15)])
def test_five_points_hardly_check_each_other_and_three_bands_of_three_do(method: str, photos: int) -> None:
    """One of five may be wrong by metres in height: the strip bends with it."""
    (message,) = unchecked(Control(layout="corners+centre"), method, photos)
    assert "m in height" in message
    assert unchecked(Control(bands=3), method, 8) == []


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
    np.testing.assert_allclose(centers(in_space), centers(on_map), rtol=0, atol=MILLIMETRE)
    on_map_sigma, in_space_sigma = (each.strips[0].absolute.sigma0 for each in both)
    assert in_space_sigma == pytest.approx(on_map_sigma, rel=1e-6)


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
        tables = alone["control"], alone["precision"]["check"]["points"], alone["points"]
        given, tested, point = (next(row for row in table if row["id"] == name) for table in tables)
        expected = {key: given[key] for key in ("dx", "dy", "dz", "plan", "height", "plan_um", "height_um")}
        expected |= {"z_plan": tested["plan"], "z_height": tested["height"]}
        expected |= {f"sigma_{axis}": point[f"sigma_{axis}"] for axis in "xyz"}
        assert {key: rows[name][key] for key in expected} == expected


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
    for key in ("status", "verdict", "statement"):
        del document[key], plain[key]
    assert document == plain


@pytest.mark.slow
@pytest.mark.parametrize(("metres", "status"), [(0.0, GOOD), (3.0, LOOK)])
def test_a_wrong_height_among_five_points_is_not_good(metres: float, status: str) -> None:
    """Corners and middle: what control cannot check itself is seen where it is left out."""
    inputs = without_checks()
    control = moved(inputs, np.array([4]), [0.0, 0.0, metres]).control.take([0, 2, 4, 6, 8])
    document = solved(replace(inputs, control=control), TURNED).document
    assert document["status"] == status, document["verdict"]
