"""Two results beside each other: differences of known size come out with that size, in the right kind and place."""

from __future__ import annotations

import copy
import math
from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyproj import Geod
from scipy.spatial.transform import Rotation

from photostrip import comparison
from photostrip.comparison import SetTolerance, Tolerance, Tolerances, baseline_of
from photostrip.comparison.comparison import UNITS
from photostrip.errors import InputError
from photostrip.library.comparison import compare
from photostrip.result.distances import plan_and_height
from photostrip.result.numbers import MATRIX
from tests.loops import nonempty
from tests.results import by_rows, case, in_tables, rotation

if TYPE_CHECKING:
    from collections.abc import Callable

    Document = dict[str, Any]


def documents(frame: str = "projected") -> tuple[Document, Document]:
    """Give a result twice, with rows that may be changed."""
    return by_rows(case(frame).document), by_rows(case(frame).document)


def compare_results(
    now: Document, before: Document, tolerances: Tolerances | None = None, files: tuple[str, str] = ("", "")
) -> Document:
    """Compare two results whose rows were changed."""
    return comparison.compare_results(in_tables(now), in_tables(before), tolerances, files)


def kind(found: Document, name: str) -> Document:
    row: Document = next(each for each in found["kinds"] if each["kind"] == name)
    return row


@pytest.mark.parametrize("frame", ["projected", "north first", "geographic", "geocentric", "local"])
def test_a_result_agrees_with_itself_and_with_its_short_form(frame: str) -> None:
    now, before = documents(frame)
    left_out = {"version", "statement", "residuals", "correlations"}
    assert before.keys() - baseline_of(before).keys() == left_out
    zero = Tolerances()
    for name in UNITS:
        zero = replace(zero, **{name: Tolerance()})  # type: ignore[arg-type]
    for other in (before, baseline_of(before)):
        found = compare_results(now, other, zero)
        assert found["status"] == "same"
        assert found["differences"] == []
        assert kind(found, "plan")["compared"] == kind(found, "height")["compared"] > 40
        assert all(
            kind(found, name)["compared"] > 0 for name in ("rotation", "sigma0", "scale", "statistics", "counts")
        )


def without_precision(document: Document) -> Document:
    """Give a result whose points and photos have no standard deviations."""
    found = copy.deepcopy(document)
    for photo in found["photos"]:
        photo.update(dict.fromkeys(key for key in photo if key.startswith("sigma_")))
    for point in found["points"]:
        point.update(dict.fromkeys(("sigma_x", "sigma_y", "sigma_z")))
    return found


def test_precision_that_one_of_the_two_lacks_is_a_difference_for_points_and_photos() -> None:
    now, before = documents()
    per_photo = 3 + 3  # coordinates, angles
    expected = {
        "photos": per_photo * sum(photo["sigma_x"] is not None for photo in now["photos"]),
        "points": 3 * sum(point["sigma_x"] is not None for point in now["points"]),
    }
    assert all(expected.values())
    for one, other in ((without_precision(now), before), (now, without_precision(before))):
        found = compare_results(one, other)
        assert found["status"] == "different"
        assert Counter(row["block"] for row in found["differences"]) == expected
        assert {row["difference"] for row in found["differences"]} == {None}
        assert found["lacking"] == []


def test_a_quantity_that_the_result_lacks_is_a_difference_and_one_that_the_baseline_lacks_is_named() -> None:
    now, before = documents()
    del now["summary"]["photo_scale"]
    photo = now["junctions"].pop()["photo"]
    lacking = {("summary", "photo_scale"), ("junctions", "factor"), ("junctions", "points_used")}
    for one, other, file, status in ((now, before, "result", "different"), (before, now, "baseline", "same")):
        found = compare_results(one, other)
        assert found["status"] == status
        assert {row["file"] for row in found["lacking"]} == {file}
        assert lacking <= {(row["block"], row["name"]) for row in found["lacking"]}
        assert all(row["numbers"] == 1 for row in nonempty(found["lacking"]))
        assert photo not in {row["id"] for row in found["differences"]}
    ignored = replace(Tolerances(), **{name: Tolerance(ignore=True) for name in UNITS})  # type: ignore[arg-type]
    assert compare_results(now, before, ignored)["status"] == "same"


def test_a_given_point_that_counts_in_plan_only_is_compared_in_plan() -> None:
    now, before = documents()
    for document in (now, before):
        document["control"][0]["dz"] = None
    now["control"][0]["dx"] += 0.5
    found = compare_results(now, before)
    assert [(row["kind"], row["block"]) for row in found["differences"]] == [("plan", "control")]
    now["control"][0]["dz"] = 0.01  # it appears
    assert [row["difference"] for row in compare_results(now, before)["differences"]] == [None, 0.5]


@pytest.mark.parametrize(
    ("frame", "key", "step"),
    [
        ("projected", "x", 0.003), ("projected", "z", -0.003), ("north first", "x", 0.003), ("local", "y", 0.002),
        ("geographic", "x", 1e-7), ("geographic", "y", 1e-7), ("geocentric", "z", 0.01),
    ],
)  # fmt: skip
def test_a_moved_point_is_found_with_its_size(frame: str, key: str, step: float) -> None:
    now, before = documents(frame)
    row, size = now["points"][7], abs(step)
    moved = {axis: row[axis] + step * (key == axis) for axis in "xyz"}
    if frame == "geographic":  # east, north
        size = Geod(ellps="WGS84").inv(row["x"], row["y"], moved["x"], moved["y"])[2]
    if frame == "geocentric":  # up: the normal of x^2/a^2 + y^2/a^2 + z^2/b^2 = 1, its gradient; WGS 84
        normal = np.array([row[axis] for axis in "xyz"]) / np.array([6378137.0, 6378137.0, 6356752.314245]) ** 2
        normal /= np.linalg.norm(normal)
        moved = {axis: row[axis] + step * n for axis, n in zip("xyz", normal.tolist(), strict=True)}
    row.update(moved)
    found = compare_results(now, before)
    part, other = ("height", "plan") if key == "z" else ("plan", "height")
    assert [(row["kind"], row["id"], row["unit"]) for row in found["differences"]] == [(part, row["id"], "m")]
    assert found["differences"][0]["difference"] == pytest.approx(size, rel=2e-4)  # 300 m up: 5e-5
    assert frame == "geocentric" or kind(found, other)["worst"] is None


def test_the_short_way_across_the_meridian_of_180_degrees_and_feet_in_metres() -> None:
    frame = {"kind": "geographic", "axes": ["north", "east", "up"], "plan_factor": math.radians(1.0)}
    frame |= {"height_factor": 1.0, "ellipsoid": [6378137.0, 6378137.0 * (1 - 1 / 298.257223563)]}
    plan, height = plan_and_height(frame, np.array([[0.0, -179.9999999, 5.0]]), np.array([[0.0, 179.9999999, 4.0]]))
    assert plan[0] == pytest.approx(2e-7 * 111_319.49, rel=1e-6)
    assert height[0] == pytest.approx(1.0)
    frame = {"kind": "projected", "axes": ["east", "north", "up"], "plan_factor": 0.3048, "height_factor": 0.3048}
    plan, height = plan_and_height(frame, np.array([[3.0, 4.0, 1.0]]), np.zeros((1, 3)))
    assert (plan[0], height[0]) == pytest.approx((1.524, 0.3048))


@pytest.mark.slow
@given(angle=st.floats(1e-7, 170.0), axis=st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: math.hypot(*v) > 0.1))
def test_a_rotation_is_told_by_its_angle(angle: float, axis: tuple[float, float, float]) -> None:
    now, before = documents()
    turn = Rotation.from_rotvec(np.array(axis) / math.hypot(*axis) * angle, degrees=True).as_matrix()
    photo = now["photos"][2]
    photo.update(zip(MATRIX, (turn @ rotation(photo)).ravel().tolist(), strict=True))
    found = kind(compare_results(now, before), "rotation")["worst"]
    assert found["id"] == photo["id"]
    assert found["difference"] == pytest.approx(angle, rel=1e-4, abs=1e-9)


def change(path: str, step: float) -> Callable[[Document], None]:
    """Give a change of the number at a path."""

    def apply(document: Document) -> None:
        *way, last = path.split(".")
        place: Any = document
        for each in way:
            place = place[int(each)] if isinstance(place, list) else place[each]
        place[last] += step

    return apply


@pytest.mark.parametrize(
    ("path", "step", "expected"),
    [
        ("summary.sigma0_um", 0.5, ("sigma0", "um", "")),
        ("models.1.sigma0_um", -0.5, ("sigma0", "um", "1002 – 1003")),
        ("models.2.scale_factor", 1e-6, ("scale", "", "1003 – 1004")),
        ("junctions.0.factor", 1e-6, ("scale", "", "1002")),
        ("absolute.0.scale", 0.1, ("scale", "", "A")),
        ("models.0.elements_omega2", 1e-4, ("rotation", "deg", "1001 – 1002")),
        ("summary.check.plan.rms", 0.1, ("statistics", "m", "")),
        ("summary.image_rms_um", 0.5, ("statistics", "um", "")),
        ("summary.check_rms_um.z", 5.0, ("statistics", "um", "")),
        ("summary.check.normalised", 0.05, ("statistics", "", "")),
        ("junctions.1.spread_ppm", 50.0, ("statistics", "ppm", "1003")),
        ("counts.image_points_used", 1, ("counts", "", "")),
        ("points.4.rays", 1, ("counts", "", None)),
        ("photos.1.z", 0.01, ("height", "m", "1002")),
        ("control.2.dz", 0.01, ("height", "m", None)),
    ],
)
def test_every_kind_of_number_is_watched(path: str, step: float, expected: tuple[str, str, str | None]) -> None:
    now, before = documents()
    change(path, step)(now)
    found = compare_results(now, before)
    assert found["status"] == "different"
    name, unit, where = expected
    assert [(row["kind"], row["unit"]) for row in found["differences"]] == [(name, unit)]
    assert where is None or found["differences"][0]["id"] == where
    assert found["differences"][0]["difference"] == pytest.approx(abs(step), rel=1e-3)


def test_a_number_that_is_gone_is_a_difference_and_an_ignored_kind_never_differs() -> None:
    now, before = documents()
    now["models"][0]["sigma0_um"] = None
    found = compare_results(now, before, Tolerances(sigma0=Tolerance(absolute=1e6)))
    assert [(row["id"] != "", row["difference"], row["now"]) for row in found["differences"]] == [(True, None, None)]
    now, before = documents()
    now["summary"]["sigma0_um"] += 3.0
    now["status"] = "failed"
    ignoring = Tolerances(sigma0=Tolerance(ignore=True), choices=SetTolerance(ignore=True))
    found = compare_results(now, before, ignoring)
    assert found["status"] == "same"
    assert kind(found, "sigma0")["worst"]["difference"] == pytest.approx(3.0)


def test_sets_are_told_by_what_is_missing_and_new() -> None:
    now, before = documents()
    gone = now["points"].pop(next(n for n, row in enumerate(now["points"]) if row["role"] == "new"))
    now["photos"][0]["id"] = "another"
    now["rejected"].append(
        {"strip": "A", "photo": "1", "other_photo": "2", "point": "P", "stage": "relative", "readmitted": False}
    )
    now["notes"].append({"severity": "warning", "code": "weak", "strip": "A", "photos": [], "points": ["P"]})
    finding = {"severity": "error", "code": "P101", "title": "unit", "strips": ["A"], "photos": [], "points": []}
    now["findings"] = [*now["findings"], finding]
    now["polynomials"][0]["degree"] += 1
    found = compare_results(now, before)
    assert "points" not in {each["block"] for each in found["lacking"]}  # a set counts it
    sets = {each["kind"]: each for each in found["sets"]}
    assert f"point {gone['id']}" in [row["what"] for row in sets["ids"]["missing"]]
    assert "photo another" in [row["what"] for row in sets["ids"]["new"]]
    assert [row["what"] for row in sets["rejected"]["new"]] == ["P on 1 – 2, relative"]
    assert [row["what"] for row in sets["findings"]["new"]] == [
        "error P101, unit: strip A",
        "warning weak: strip A, point P",
    ]
    assert len(sets["choices"]["missing"]) == len(sets["choices"]["new"]) == 1
    assert all(each["differs"] for each in nonempty(sets.values()))
    loose = SetTolerance(missing=0, new=1)
    again = {each["kind"]: each for each in compare_results(now, before, Tolerances(rejected=loose))["sets"]}
    assert not again["rejected"]["differs"]


def test_what_was_taken_back_is_not_rejected_and_the_case_of_a_crs_does_not_matter() -> None:
    now, before = documents()
    now["frame"]["crs"] = "epsg:32633"
    row = {"strip": "A", "photo": "1", "other_photo": None, "point": "P", "stage": "rays", "readmitted": True}
    now["rejected"].append(row)
    assert compare_results(now, before)["status"] == "same"


@pytest.mark.slow
@given(step=st.floats(0.0, 1.0), allowed=st.floats(0.0, 1.0), relative=st.floats(0.0, 0.1))
def test_the_larger_part_of_a_tolerance_counts(step: float, allowed: float, relative: float) -> None:
    tolerances = Tolerances(sigma0=Tolerance(absolute=allowed, relative=relative))
    before = 4.0
    limit = max(allowed, 4.0 * relative)
    assert tolerances.allowed("sigma0", "um", before) == pytest.approx(limit)
    now, then = documents()
    then = {**then, "summary": {**then["summary"], "sigma0_um": before}}
    now["summary"]["sigma0_um"] = before + step
    found = [row for row in compare_results(now, then, tolerances)["differences"] if row["block"] == "summary"]
    if abs(step - limit) > 1e-12:
        assert bool(found) is (step > limit)


ELSEWHERE = {"crs": "EPSG:32634", "axes": ["north", "east", "up"], "plan_unit": "US survey foot", "kind": "local"}


@pytest.mark.parametrize(("key", "value"), [*ELSEWHERE.items(), ("heights", "orthometric"), ("height_unit", "foot")])
def test_other_frames_are_not_compared(key: str, value: object) -> None:
    now, before = documents()
    now["frame"][key] = value
    with pytest.raises(InputError) as refused:
        compare_results(now, before, files=("now.json", "before.json"))
    places = [(fault.code, fault.key, fault.file, fault.line, fault.column) for fault in refused.value.faults]
    assert places == [("not-comparable", f"frame.{key}", "now.json", 0, 0)]


def test_another_strip_is_not_compared_nor_a_document_that_is_not_whole() -> None:
    now, before = documents()
    for row in now["points"]:
        row["id"] = f"other {row['id']}"
    with pytest.raises(InputError, match="no point is in both"):
        compare_results(now, before)
    del now["models"]
    with pytest.raises(InputError, match="the result: models: is missing"):
        compare(in_tables(now), in_tables(before))


def test_worst_comes_first() -> None:
    now, before = documents()
    now["points"][1]["z"] += 0.01  # 50 times what is allowed
    now["points"][2]["x"] += 0.02  # 100 times
    now["photos"][0].update({name: -now["photos"][0][name] for name in MATRIX})
    found = compare_results(now, before)["differences"]
    assert [row["block"] for row in found] == ["photos", "points", "points"]
    assert [row["id"] for row in found[1:]] == [before["points"][2]["id"], before["points"][1]["id"]]
