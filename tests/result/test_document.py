"""The document of a result against other libraries, the measurements, and what each key is defined to be."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING, Literal

import numpy as np
import pytest
from pyproj import CRS, Transformer
from scipy.spatial.transform import Rotation

from photostrip.notes import Note
from photostrip.pipeline.inputs import Settings
from photostrip.result.document import document_of
from photostrip.result.numbers import MATRIX, natural
from photostrip.result.summary import TOLERANCES, counts_of
from photostrip.result.table import Table, plain_of
from photostrip.simulation.simulation import simulate
from photostrip.simulation.spec import Flight, GrossError
from tests.loops import nonempty
from tests.results import FRAMES, NORTH_FIRST, Case, case, rotation, solved, spec, written_to
from tests.simulated import inputs_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from photostrip.pipeline.inputs import Inputs
    from photostrip.points import PhotoPoints
    from tests.results import Document

    Floats = NDArray[np.float64]

GEOCENTRIC = CRS.from_epsg(4978)
OTHER_ZONE = "+proj=tmerc +lon_0=12 +k=1 +x_0=4500000 +datum=WGS84 +units=m"
GROUND_STEP = 1e-4  # m, the last digit that is written
MICROMETRE_STEP = 0.03  # um: last digits of residuals, and of two ground points 1500 m apart, seen in the photo


def xyz(row: Document) -> list[float]:
    return [row["x"], row["y"], row["z"]]


def in_order(document: Document, values: list[float]) -> Floats:
    """Bring coordinates in the order of frame.axes into east, north, up."""
    axes = document["frame"]["axes"]
    names = NORTH_FIRST[1], NORTH_FIRST[0], "up"
    return np.array([values[axes.index(name)] for name in names]) if "east" in axes else np.array(values)


def leaves(value: object) -> Iterator[object]:
    if isinstance(value, dict):
        for each in value.values():
            yield from leaves(each)
    elif isinstance(value, list | tuple | Table):
        for each in value:
            yield from leaves(each)
    else:
        yield value


# ------------------------------------------------------------------------------------------- the fixed contract


# keys that other programs read; what stands there is described, and every result keeps its description
FIXED = {
    "frame": "crs axes",
    "angles": "system unit",
    "photos": "id strip x y z r11 angle_1",
    "points": "id role x y z rays",
    "models": "left right elements_kappa1 sigma0_um max_parallax_um points_used scale_factor",
    "control": "id role use dx dy dz",
    "summary": "sigma0_um control_rms check_rms photo_scale",
    "polynomials": "degree",
    "rejected": "photo point stage test value limit reason",
}


@pytest.mark.parametrize("frame", FRAMES)
def test_the_fixed_keys_are_there_and_numbers_are_finite_and_never_minus_zero(frame: str) -> None:
    document = case(frame).document
    assert document.keys() >= {"name", "status", "adjustment", *FIXED}
    for block, keys in nonempty(FIXED.items()):
        there = document[block].columns if isinstance(document[block], Table) else document[block]
        assert set(keys.split()) <= set(there)
    assert document["photostrip_result"] == 2
    assert document["frame"]["crs"] == FRAMES[frame].crs
    assert document["frame"]["axes"] == list(FRAMES[frame].axes)
    assert {row["role"] for row in document["points"]} == {"new", "control", "check"}
    assert set(MATRIX) <= set(document["photos"].columns)
    for leaf in nonempty(leaves(document)):
        assert leaf is None or isinstance(leaf, str | bool | int | float)
        if isinstance(leaf, float):
            assert math.isfinite(leaf)
            assert leaf != 0 or math.copysign(1, leaf) > 0
    json.dumps(plain_of(document), allow_nan=False)


# --------------------------------------------------------------------- photos and points belong together, anywhere


def geocentric(document: Document, places: Floats) -> Floats:
    """Cartesian coordinates by pyproj; a local frame has its own."""
    crs = document["frame"]["crs"]
    if crs == "local":
        return places
    return places if crs == "geocentric" else np.column_stack(to_geocentric(crs).transform(*places.T.tolist()))


@cache
def to_geocentric(crs: str) -> Transformer:
    return Transformer.from_crs(CRS.from_user_input(crs).to_3d(), GEOCENTRIC, always_xy=True)


def axes_at(document: Document, place: Floats) -> Floats:
    """Rows east, north, up at a place: where one gets by going along the coordinate lines, by pyproj."""
    crs = document["frame"]["crs"]
    if crs in {"local", "geocentric"}:
        return np.eye(3)
    way = to_geocentric(crs)
    middle = np.array(way.transform(place[0], place[1], place[2], direction="INVERSE"))
    step = 100.0 if CRS.from_user_input(crs).is_projected else 1e-3
    east, north = (
        np.subtract(way.transform(*(middle + step * axis)), way.transform(*(middle - step * axis)))
        for axis in np.eye(3)[:2]
    )
    east /= np.linalg.norm(east)
    up = np.cross(east, north / np.linalg.norm(north))
    return np.array([east, np.cross(up, east), up])


def worst_reprojection(found: Case) -> float:
    """Largest difference, um, of points projected through photos[], and what was measured and left over."""
    document, focal = found.document, found.inputs.strips[0].camera.principal_distance
    ground = {row["id"]: in_order(document, xyz(row)) for row in document["points"]}
    names = list(ground)
    place = dict(zip(names, geocentric(document, np.array([ground[name] for name in names])), strict=True))
    measured, worst, rays = found.measured, 0.0, 0
    photos = {photo["id"]: photo for photo in document["photos"]}
    for name, photo in photos.items():
        center = geocentric(document, in_order(document, xyz(photo))[None])[0]
        turn = rotation(photo).T @ axes_at(document, center)
        for ray in document["residuals"].where(photo=name):
            x, y, z = turn @ (place[ray["point"]] - center)
            assert z < 0, "the camera looks along -z"
            projected = -focal * np.array([x, y]) / z
            residual = (measured[name, ray["point"]] - projected) * 1000
            worst = max(worst, float(np.abs(residual - [ray["vx_um"], ray["vy_um"]]).max()))
            rays += 1
    assert rays > 50
    return worst


@pytest.mark.slow
@pytest.mark.parametrize("frame", [*FRAMES, "EPSG:32632", OTHER_ZONE, "EPSG:4979", "geocentric, of a grid"])
def test_points_project_through_the_photos_to_where_they_were_measured(frame: str) -> None:
    """Also in a frame that is not that of the control."""
    axes = ("x", "y", "z") if frame.startswith("geocentric,") else NORTH_FIRST
    found = case(frame) if frame in FRAMES else written_to(frame.partition(",")[0], axes)
    assert frame in FRAMES or found.document["frame"]["axes"] == list(axes)
    assert worst_reprojection(found) < MICROMETRE_STEP


def test_residuals_are_those_of_the_cameras_that_searches_have_freed() -> None:
    """The stated sigma hides a lens distortion of 15 um; that of the variance components shows it."""

    def bent(inputs: Inputs, k1: float, p1: float, p2: float) -> Inputs:
        (x, y), o = inputs.observations.xy.T, inputs.observations
        radial = k1 * (x**2 + y**2) + 2.0 * (p1 * x + p2 * y)
        beside = np.outer(x**2 + y**2, (p1, p2))
        return replace(inputs, observations=replace(o, xy=o.xy + o.xy * radial[:, None] + beside, sigma=3.0 * o.sigma))

    inputs = bent(inputs_of(simulate(spec("local"))), -2e-8, -1.5e-6, 1.5e-6)
    found = solved(inputs, Settings(bundle=replace(Settings().bundle, variance_components=True)))
    block, rays = found.document["bundle"], found.document["residuals"].where(used=True)
    assert block["taken_up"].values("cause") == ["decentred lens", "lens distortion"]
    lens = dict(zip(*map(block["calibration"].values, ("parameter", "value")), strict=True))
    corrected = bent(inputs, lens["k1"], lens["p1"], lens["p2"])
    assert worst_reprojection(replace(found, inputs=corrected)) < 0.1
    rms = np.sqrt(np.mean([rays["vx_um"] ** 2, rays["vy_um"] ** 2]))
    assert rms == pytest.approx(found.document["summary"]["image_rms_um"], abs=0.01)
    size = block["reliability"]["image_sigma_um"] * np.sqrt(rays["redundancy_x"]) * block["screening"]["unit"]
    tested = np.isfinite(rays["test_x"])
    assert (rays["test_x"] * size)[tested] == pytest.approx(rays["vx_um"][tested], abs=0.05)
    assert tested.sum() > 30


@pytest.mark.parametrize("unit", ["deg", "gon", "rad"])
@pytest.mark.parametrize(
    ("system", "moved", "sign"),
    [("alpha-omega-kappa", "YXZ", -1), ("phi-omega-kappa", "YXZ", 1), ("omega-phi-kappa", "XYZ", 1)],
)
def test_angles_are_those_of_the_rotation(system: str, moved: Literal["YXZ", "XYZ"], sign: int, unit: str) -> None:
    document = solved(case("local").inputs, Settings(angle_system=system, angle_unit=unit)).document
    per_radian = {"deg": 180 / math.pi, "gon": 200 / math.pi, "rad": 1.0}[unit]
    for photo in nonempty(document["photos"]):
        expected = Rotation.from_matrix(rotation(photo)).as_euler(moved)
        expected[0] *= sign
        assert [photo[f"angle_{k}"] for k in (1, 2, 3)] == pytest.approx(expected * per_radian, abs=1e-6)
    assert document["angles"] == {"system": system, "unit": unit}


# ------------------------------------------------------------------------------------------------- given points


@pytest.mark.parametrize("frame", ["local", "projected", "north first", "geocentric", "geographic"])
def test_differences_are_adjusted_minus_given_and_those_of_longitudes_metres_on_the_ground(frame: str) -> None:
    found = case(frame)
    points = {row["id"]: in_order(found.document, xyz(row)) for row in found.document["points"]}
    given = dict(zip(found.inputs.control.ids, found.inputs.control.enu, strict=True))
    to_utm = Transformer.from_crs("EPSG:4326", "EPSG:32633", always_xy=True)
    for row in nonempty(found.document["control"]):
        shown, point, before = (
            in_order(found.document, [row[f"d{axis}"] for axis in "xyz"]),
            points[row["id"]],
            given[row["id"]],
        )
        if frame == "geographic":
            plan = np.subtract(to_utm.transform(*point[:2]), to_utm.transform(*before[:2]))
            assert math.hypot(*shown[:2]) == pytest.approx(math.hypot(*plan), abs=1e-3)
            assert shown[2] == pytest.approx(point[2] - before[2], abs=2 * GROUND_STEP)
        else:
            assert shown == pytest.approx(point - before, abs=2 * GROUND_STEP)


def test_control_in_a_grid_and_a_geocentric_result_give_the_same_plan_and_height() -> None:
    grid, space = case("projected").document, written_to("geocentric", ("x", "y", "z")).document
    for a, b in nonempty(zip(grid["control"], space["control"], strict=True)):
        assert b["plan"] == pytest.approx(a["plan"], abs=2 * GROUND_STEP)
        assert b["height"] == pytest.approx(a["height"], abs=2 * GROUND_STEP)
        length = math.hypot(a["dx"], a["dy"], a["dz"])
        assert math.hypot(b["dx"], b["dy"], b["dz"]) == pytest.approx(length, abs=2 * GROUND_STEP)
    assert space["summary"]["check"]["height"]["rms"] == pytest.approx(
        grid["summary"]["check"]["height"]["rms"], abs=2 * GROUND_STEP
    )


def partial() -> Case:
    """A point for each way in which coordinates may count."""
    inputs = inputs_of(simulate(spec("projected", 1, 5.0, bands=4)))
    control = inputs.control
    use = control.use.copy()
    use[0] = [True, True, False]
    use[1] = [False, False, True]
    use[2] = False
    ids = (*control.ids[:3], "nowhere", *control.ids[4:])
    enu = np.where(use, control.enu, np.nan)
    return solved(replace(inputs, control=replace(control, ids=ids, use=use, enu=enu)))


def test_what_does_not_count_has_no_difference() -> None:
    found = partial()
    rows = {row["id"]: row for row in found.document["control"]}
    plan, height, off = (rows[found.inputs.control.ids[n]] for n in range(3))
    assert (plan["use"], plan["dz"], plan["height"], plan["height_um"]) == ("xy", None, None, None)
    assert plan["dx"] is not None
    assert (height["use"], height["dx"], height["dy"], height["plan"]) == ("z", None, None, None)
    assert height["dz"] == height["height"]
    assert (off["use"], off["dx"], off["dy"], off["dz"]) == ("off", None, None, None)
    assert rows["nowhere"]["measured"] is False
    assert rows["nowhere"]["strips"] == []
    assert rows["nowhere"]["dx"] is None
    counts = found.document["counts"]
    assert counts["given_not_measured"] == 1
    refused = replace(found.result, not_determined={"nowhere": "rays contradict each other"})
    assert counts_of(refused, 0)["given_not_measured"] == 0  # its rays were measured, and rejected
    assert (counts["control_plan"], counts["control_height"], counts["control_points"]) == (9, 9, 10)
    summary = found.document["summary"]["control"]
    assert (summary["plan"]["count"], summary["height"]["count"]) == (9, 9)


@pytest.mark.parametrize("role", ["control", "check"])
def test_the_summary_is_that_of_the_rows(role: str) -> None:
    document = case("projected", 2).document
    rows = [row for row in document["control"] if row["role"] == role]
    summary = document["summary"]
    for axis in "xyz":
        values = np.array([row[f"d{axis}"] for row in rows])
        assert summary[f"{role}_rms"][axis] == pytest.approx(math.sqrt(np.mean(values**2)), abs=2 * GROUND_STEP)
        assert summary[f"{role}_mean"][axis] == pytest.approx(values.mean(), abs=2 * GROUND_STEP)
    for part in ("plan", "height"):
        worst = max(rows, key=lambda row: abs(row[part]))
        assert summary[role][part]["worst"] == worst["id"]
        assert summary[role][part]["max"] == abs(worst[part])
        assert summary[role][part]["max_um"] == pytest.approx(abs(worst[f"{part}_um"]))
        squares = [row[f"{part}_um"] ** 2 for row in rows]
        assert summary[role][part]["rms_um"] == pytest.approx(math.sqrt(np.mean(squares)), abs=0.1)


def test_micrometres_at_photo_scale_and_the_ratio_of_point_and_model() -> None:
    document = case("local").document
    (strip,) = document["strips"]
    for row in nonempty(document["control"]):
        assert row["plan_um"] == pytest.approx(math.hypot(row["dx"], row["dy"]) / strip["photo_scale"] * 1e6, abs=0.1)
    f = case("local").inputs.strips[0].camera.principal_distance / 1000
    assert strip["photo_scale"] == pytest.approx(strip["flying_height"] / f, abs=0.1)
    assert strip["photo_scale"] == pytest.approx(10_000, rel=0.03)
    for row in nonempty(document["control"]):
        point = (strip["precision_plan"], strip["precision_plan"], strip["precision_height"])
        expected = [math.hypot(row[f"sigma_{k}"], size) for k, size in enumerate(point, 1)]
        assert [row[f"sigma_fit_{k}"] for k in (1, 2, 3)] == pytest.approx(expected, abs=2 * GROUND_STEP)
        found = max(abs(row[k]) / s for k, s in zip(("dx", "dy", "dz"), expected, strict=True))
        assert row["normalised"] == pytest.approx(found, abs=0.02)


# ------------------------------------------------------------------------------------------------- pairs, joints


def test_sigma0_and_what_a_model_says_follow_from_the_parallaxes() -> None:
    document = case("projected", 2).document
    parallaxes = document["residuals"]["q_um"]
    used = parallaxes[np.isfinite(parallaxes)]
    squares = float((used**2).sum())
    redundancy = len(used) - 5 * len(document["models"])
    assert document["summary"]["redundancy"] == redundancy
    assert document["summary"]["sigma0_um"] == pytest.approx(math.sqrt(squares / 2 / redundancy), abs=0.02)
    assert document["summary"]["sigma0_um"] == pytest.approx(5.0, rel=0.35)
    for model in nonempty(document["models"]):
        rays = document["residuals"].where(photo=model["left"])
        used = {ray["point"]: ray["q_um"] for ray in rays if ray["q_um"] is not None}
        assert model["points_used"] == len(used)
        assert model["max_parallax_um"] == max(map(abs, used.values()))
        assert abs(used[model["max_parallax_point"]]) == model["max_parallax_um"]
        assert model["rms_parallax_um"] == pytest.approx(math.sqrt(np.mean(np.square(list(used.values())))), abs=0.02)
    assert document["models"].units["elements_kappa1"] == "deg"


def test_bases_are_the_distances_of_the_photos_and_scale_factors_products_of_the_ratios() -> None:
    document = case("local").document
    photos = {photo["id"]: np.array(xyz(photo)) for photo in document["photos"]}
    for model in nonempty(document["models"]):
        distance = np.linalg.norm(photos[model["right"]] - photos[model["left"]])
        assert model["base"] == pytest.approx(distance, abs=2 * GROUND_STEP)
    factors = [model["scale_factor"] for model in document["models"]]
    assert factors[0] == 1.0
    for (before, after), joint in nonempty(zip(pairwise(factors), document["junctions"], strict=True)):
        assert after / before == pytest.approx(joint["factor"], rel=1e-9)


def test_models_without_errors_agree_and_discrepancies_are_at_photo_scale_too() -> None:
    document = case("local", 1, 0.0).document
    for joint in nonempty(document["junctions"]):
        assert joint["spread_ppm"] < 0.1
        assert max(joint[f"discrepancy_{name}"] for name in ("along", "across", "up")) < GROUND_STEP
    assert document["summary"]["image_rms_um"] < 0.01
    document = case("projected", 2).document
    scales = {strip["id"]: strip["photo_scale"] for strip in document["strips"]}
    for joint in nonempty(document["junctions"]):
        scale = scales[joint["strip"]]
        assert joint["discrepancy_um_up"] == pytest.approx(joint["discrepancy_up"] / scale * 1e6, abs=0.1)


def test_a_gross_error_is_rejected_and_its_size_stands_in_the_residuals() -> None:
    wanted = spec("local", 1, 5.0, GrossError("image", size_um=300.0, axis="y"))
    inputs = inputs_of(simulate(replace(wanted, seed=5)))  # it hits a point that a third photo has, too
    document = solved(inputs, Settings(relative=replace(Settings().relative, screening="parallax+grubbs"))).document
    big = [row for row in document["rejected"] if abs(row["parallax_um"] or 0) > 100]
    assert big
    (point,) = {row["point"] for row in big}
    for row in nonempty(big):
        assert (row["stage"], row["test"], row["unit"]) == ("relative", "parallax", "um")
        assert row["value"] > row["limit"]
    unused = [
        (ray["photo"], ray["vy_um"])
        for ray in document["residuals"].where(point=point, used=False)
        if ray["vy_um"] is not None
    ]
    shown = {row["photo"] for row in big} | {row["other_photo"] for row in big}
    assert all(photo in shown and abs(vy) == pytest.approx(300, abs=60) for photo, vy in nonempty(unused))
    counts = document["counts"]
    assert counts["rejected_in_pairs"] == len(
        [r for r in document["rejected"] if r["stage"] == "relative" and not r["readmitted"]]
    )


# ----------------------------------------------------------------------------------------------- strips and ties


def only(observations: PhotoPoints, photos: tuple[str, ...]) -> PhotoPoints:
    kept = np.array([photo in photos for photo in observations.photo_ids])[observations.photo]
    place = {photo: n for n, photo in enumerate(photos)}
    number = np.array([place.get(photo, -1) for photo in observations.photo_ids])
    o = observations
    return replace(
        o, photo_ids=photos, photo=number[o.photo[kept]], point=o.point[kept], xy=o.xy[kept], sigma=o.sigma[kept]
    )


def test_ties_are_the_differences_of_strips_computed_alone() -> None:
    """Each strip is run as a project of its own."""
    both = case("projected", 2)
    alone = []
    for strip in both.inputs.strips:
        single = solved(
            replace(both.inputs, strips=(strip,), observations=only(both.inputs.observations, strip.photos)),
            Settings(adjustment="polynomial"),
        ).document
        alone.append({row["id"]: np.array(xyz(row)) for row in single["points"]})
    points = {row["id"]: np.array(xyz(row)) for row in both.document["points"]}
    ties = both.document["ties"]
    assert {tie["id"] for tie in ties} == alone[0].keys() & alone[1].keys()
    for tie in nonempty(ties):
        first, second = alone[0][tie["id"]], alone[1][tie["id"]]
        assert [tie["dx"], tie["dy"], tie["dz"]] == pytest.approx(second - first, abs=0.0015)  # scale of the map
        assert points[tie["id"]] == pytest.approx((first + second) / 2, abs=2 * GROUND_STEP)
        assert tie["plan"] == pytest.approx(math.hypot(tie["dx"], tie["dy"]), abs=2 * GROUND_STEP)


def test_the_polynomial_moves_the_control_by_the_stated_misclosures() -> None:
    """Misclosure plus polynomial at a control point is what is left there: plan along the strip's own axes."""
    document = solved(case("local").inputs, Settings(adjustment="polynomial")).document
    (absolute,) = document["absolute"]
    axes, origin = frame_of(absolute)
    points = {row["id"]: np.array(xyz(row)) for row in document["points"]}
    left = {row["id"]: np.array([row["dx"], row["dy"], row["dz"]]) for row in document["control"]}
    for row in nonempty(document["misclosures"]):
        before = np.array([row["east"], row["north"], row["up"]])
        place = axes.T @ (points[row["id"]] - (left[row["id"]] - before) - origin)
        correction = [polynomial(document, axis, place[0], place[1]) for axis in "xyz"]
        assert axes @ correction == pytest.approx(left[row["id"]] - before, abs=5 * GROUND_STEP)


def frame_of(absolute: Document) -> tuple[Floats, Floats]:
    """Give axes and origin of the intermediate frame."""
    axes = np.array([absolute[name.replace("r", "a")] for name in MATRIX]).reshape(3, 3)
    return axes, np.array([absolute[f"origin_{axis}"] for axis in "xyz"])


def polynomial(document: Document, axis: str, x: float, y: float) -> float:
    powers = {"1": (0, 0), "X": (1, 0), "Y": (0, 1), "XY": (1, 1), "X^2": (2, 0), "X^3": (3, 0)}
    terms = [(row["coefficient"], *powers[row["term"]]) for row in document["polynomial_terms"].where(axis=axis)]
    return float(sum(c * x**a * y**b for c, a, b in terms))


def test_the_drift_found_is_the_slope_of_the_polynomial() -> None:
    inputs = case("local").inputs
    document = solved(inputs, Settings("polynomial", polynomial=replace(Settings().polynomial, degree="2"))).document
    (absolute,), (strip,) = document["absolute"], document["strips"]
    axes, origin = frame_of(absolute)
    start, end = (axes.T @ (np.array(xyz(document["photos"][n])) - origin) for n in (0, -1))
    terms = document["polynomial_terms"].where(axis="x")
    slope = dict(zip(terms["term"], terms["coefficient"], strict=True))
    assert "X^2" in slope
    assert strip["scale_drift_found_ppm"] == pytest.approx(2e6 * slope["X^2"] * (end[0] - start[0]), abs=0.2)
    assert terms["t"] == pytest.approx(terms["coefficient"] / terms["sigma"], rel=1e-2, abs=0.01)


def test_one_polynomial_for_each_strip() -> None:
    document = case("projected", 2).document
    assert [block["strip"] for block in document["polynomials"]] == [strip["id"] for strip in document["strips"]]
    without = solved(case("local").inputs, Settings(adjustment="similarity")).document
    assert without["adjustment"] == "similarity"
    assert "polynomials" not in without
    assert without["strips"][0]["scale_drift_found_ppm"] is None


# -------------------------------------------------------------------------------------------------- order, notes


def test_photos_stand_in_flight_order_and_points_in_natural_order() -> None:
    found = case("projected", 2)
    flown = [photo for strip in found.inputs.strips for photo in strip.photos]
    assert [photo["id"] for photo in found.document["photos"]] == flown
    residuals = found.document["residuals"]
    assert list(dict.fromkeys(residuals["photo"])) == flown
    of_rays = (residuals.where(photo=photo)["point"] for photo in flown)
    for names in (found.document["points"]["id"], found.document["control"]["id"], *of_rays):
        assert list(names) == sorted(names, key=natural)


@pytest.mark.slow
def test_the_order_of_the_rows_does_not_matter() -> None:
    inputs = case("projected", 2).inputs
    o = inputs.observations
    order = np.random.default_rng(1).permutation(len(o))
    shuffled = replace(o, photo=o.photo[order], point=o.point[order], xy=o.xy[order], sigma=o.sigma[order])
    a = case("projected", 2).document
    b = solved(replace(inputs, observations=shuffled), Settings(adjustment="polynomial")).document
    for key in ("points", "photos", "control", "models"):
        for first, second in zip(a[key], b[key], strict=True):
            for x, y in zip(leaves(first), leaves(second), strict=True):
                assert x == (pytest.approx(y, abs=1e-3, rel=1e-3) if isinstance(y, float) else y)


def test_notes_of_the_reading_come_first() -> None:
    note = Note("hint", "something about a file", severity="note", points=("A",))
    document = document_of(case("local").result, [note])
    expected = {"code": "hint", "severity": "note", "strip": "", "photos": [], "points": ["A"]}
    expected["message"] = "something about a file"
    assert {key: document["notes"][0][key] for key in expected} == expected
    assert document["notes"][1:] == case("local").document["notes"]


# ------------------------------------------------------------------------------------------ tolerances and verdict


def judged(**tolerances: float) -> Document:
    return solved(case("local").inputs, Settings(adjustment="polynomial", tolerances=tolerances)).document


def test_tolerances_are_kept_or_come_first() -> None:
    document = judged(**dict.fromkeys(TOLERANCES, 1e6))
    assert len(document["tolerances"]) == len(TOLERANCES)
    assert all(row["passed"] and row["value"] > 0 for row in nonempty(document["tolerances"]))
    assert document["status"] != "failed"
    values = {row["name"]: row["value"] for row in document["tolerances"]}
    assert values["check_rms_xy"] == document["summary"]["check"]["plan"]["rms"]
    assert values["check_rms_z"] == document["summary"]["check_rms"]["z"]
    assert values["sigma0_um"] == document["summary"]["sigma0_um"]
    document = judged(check_rms_xy=5.0, check_max_z=0.0001)
    assert [row["passed"] for row in document["tolerances"]] == [False, True]
    assert document["status"] == "failed"
    assert document["verdict"]["look_at"][0].startswith("check_max_z is ")


def test_a_tolerance_that_cannot_be_tested_is_not_kept() -> None:
    inputs = case("local").inputs
    control = inputs.control.take(np.flatnonzero(~inputs.control.check))
    document = solved(replace(inputs, control=control), Settings(tolerances={"check_rms_xy": 1.0})).document
    assert document["tolerances"] == [
        {"name": "check_rms_xy", "value": None, "limit": 1.0, "unit": "m", "passed": False}
    ]
    assert document["status"] == "failed"
    assert "cannot be tested" in document["verdict"]["look_at"][0]
    assert document["verdict"]["verified"] is False


@pytest.mark.parametrize(
    ("role", "said"),
    [
        ("check", "check point K03 (23."),
        ("control", "control point G03 contradicts the strip and the other control: east by about +23."),
    ],
)
def test_a_wrong_given_point_is_worth_a_look_and_a_check_point_changes_nothing(role: str, said: str) -> None:
    inputs = case("projected").inputs
    control, enu = inputs.control, inputs.control.enu.copy()
    enu[np.flatnonzero(control.check == (role == "check"))[2], 0] += 23.4
    wrong = replace(inputs, control=replace(control, enu=enu))
    document = solved(wrong, Settings(adjustment="polynomial")).document
    assert document["status"] == "look"
    (text,) = document["verdict"]["look_at"]
    assert text.startswith(said)
    if role == "check":
        assert all(document[key] == case("projected").document[key] for key in ("points", "photos"))
        return
    (row,) = (row for row in document["control"] if row["rejected"])
    assert (row["id"], row["rejected"], row["use"]) == ("G03", "xy", "xyz")
    assert row["dx"] == pytest.approx(-23.4, abs=0.5)
    # what is left at control that was found wrong says nothing about the fit
    summary = document["summary"]
    assert max(summary["control_rms"].values()) < 0.5
    assert summary["control"]["plan"]["count"] == summary["control"]["height"]["count"] - 1
    assert summary["control"]["normalised"] < 5


# --------------------------------------------------------------------------------------------------- corrections


def test_curvature_says_how_it_was_treated_and_by_formula_has_its_size() -> None:
    local = case("local").document["corrections"]["earth_curvature"]
    told = "none: the local frame is taken as truly Cartesian"
    assert local == {"asked": "auto", "treatment": told, "largest": 0.0}
    grid = case("projected").document["corrections"]["earth_curvature"]
    assert grid["treatment"].startswith("carried by the frames")
    assert 0.05 < grid["largest"] < 1.0  # D^2 / 2R for 0.8 to 3.5 km
    settings = Settings(absolute=replace(Settings().absolute, earth_curvature="model"))
    document = solved(case("local").inputs, settings).document
    found = document["corrections"]["earth_curvature"]
    control = [row for row in document["control"] if row["role"] == "control"]
    points = {row["id"]: np.array(xyz(row)[:2]) for row in document["points"]}
    middle = np.mean([points[row["id"]] for row in control], axis=0)
    largest = max(float(((place - middle) ** 2).sum()) for place in points.values()) / 2 / 6_371_000
    assert found["largest"] == pytest.approx(largest, abs=0.002)
    assert "6371000 m" in found["treatment"]


# ----------------------------------------------------------------------------------------- errors along the base


def test_a_wrong_ray_among_many_is_named() -> None:
    """One of the rays of a point is shifted along the base, where no y parallax shows it."""
    inputs = inputs_of(simulate(replace(spec("local"), flight=Flight(photos=7, end_lap_percent=80.0))))
    o = inputs.observations
    given = set(inputs.control.ids)
    count = np.bincount(o.point, minlength=len(o.point_ids))
    (point, *_) = (n for n in range(len(count)) if count[n] == 5 and o.point_ids[n] not in given)
    row = np.flatnonzero(o.point == point)[1]
    xy = o.xy.copy()
    xy[row, 0] += 0.3  # mm
    document = solved(replace(inputs, observations=replace(o, xy=xy))).document
    sight = {"photo": o.photo_ids[o.photo[row]], "point": o.point_ids[point]}
    (found,) = (row for row in document["rejected"] if row["stage"] == "rays")
    assert {key: found[key] for key in sight} == sight
    assert found["value"] > found["limit"]
    assert "meet without it" in found["reason"]
    (ray,) = document["residuals"].where(**sight)
    assert ray["used"] is False
    assert ray["vx_um"] == pytest.approx(300, rel=0.1)
    assert document["counts"]["rejected_for_rays"] == 1
