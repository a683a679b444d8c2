"""What an adjustment took up and estimated is said; what digital cameras need: marks in pixels, what a pixel covers."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import cache
from statistics import median
from typing import TYPE_CHECKING

import numpy as np
import pytest

import photostrip
from benchmarks import planted
from photostrip.geometry.rotation import angles
from photostrip.pipeline.inputs import GivenOrientations
from photostrip.pipeline.run import triangulate
from photostrip.report.html import to_html
from photostrip.report.page.layout import to_markdown, to_text
from photostrip.report.page.parts import Facts, Table
from photostrip.report.sections import points
from photostrip.report.sections.accuracy_report import chosen_sections, title_of
from photostrip.result.document import document_of
from photostrip.simulation import Control, Flight, Spec
from photostrip.simulation.simulation import simulate
from photostrip.simulation.spec import Gnss
from tests.foreign.colmap_models import SPEC
from tests.loops import nonempty
from tests.pipeline.blocks import with_camera
from tests.results import by_rows, in_tables, rotation
from tests.simulated import settings_of

if TYPE_CHECKING:
    from photostrip.notes import Document

TWICE_IN_RADIANS = np.pi / 180.0


@cache
def adjusted(
    *, east: float = 0.0, distance: float = 1.0, correction: str = "none", start_angles: float = 0.0
) -> Document:
    """Adjust a block whose camera positions are shifted, or whose principal distance is given wrong.

    start_angles: factor of the angles that are given as a start; 0: none are given.
    """
    made = simulate(Spec(seed=7, flight=Flight(photos=10, strips=2), control=Control(bands=2), gnss=Gnss()))
    truth, inputs = made.truth, planted.with_gnss(np.random.default_rng(), made)
    inputs = with_camera(inputs, principal_distance=inputs.strips[0].camera.principal_distance * distance)
    assert inputs.positions is not None
    count, enu = len(truth.photo_ids), inputs.positions.enu + np.array([east, 0.0, 0.0])
    inputs = replace(inputs, positions=replace(inputs.positions, enu=enu, correction=correction))
    if start_angles:
        given, unknown = angles(truth.rotations_local, "omega-phi-kappa") * start_angles, np.full((count, 3), np.nan)
        start = GivenOrientations(
            truth.photo_ids, inputs.frames[0], truth.centers_ground, given, "omega-phi-kappa", unknown, unknown, False
        )
        inputs = replace(inputs, orientations=start)
    return document_of(triangulate(inputs, replace(settings_of(made), adjustment="bundle")))


def said(document: Document, label: str) -> list[str]:
    """Return what the stages say under a label."""
    (stages,) = (each for each in chosen_sections(in_tables(document), width=400) if each.title == "Stages")
    (facts,) = stages.parts
    return [value for name, value in facts.rows if name == label]  # type: ignore[union-attr]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wrong", "cause", "value"),
    [
        ({"east": 10.0}, "offset of the camera positions of the block", "camera positions of the block: added -9.9"),
        ({"distance": 1.01}, "principal distance of camera film", "camera film: added -1.5"),
    ],
)
def test_beside_an_error_it_is_said_all_the_same(wrong: dict[str, float], cause: str, value: str) -> None:
    """Start angles in another unit are an error; then no finding names what the adjustment went on with."""
    document = adjusted(**wrong, start_angles=TWICE_IN_RADIANS)
    assert [each["code"] for each in document["findings"]] == ["P601"]
    assert said(document, "cause found") == [cause]
    (estimated,) = said(document, "estimated")
    assert estimated.startswith(value)
    assert "(σ 0.0" in estimated
    sections = chosen_sections(document, width=100)
    assert cause in to_markdown(title_of(document), sections)
    assert cause in to_html(document)


@pytest.mark.slow
def test_what_the_project_asks_for_is_estimated_and_not_taken_up_and_the_most_significant_shown() -> None:
    """Fifty strips with an offset each do not fill the page."""
    document = adjusted(east=10.0, correction="offset")
    assert document["bundle"]["taken_up"] == []
    assert said(document, "cause found") == []
    first, second = said(document, "estimated")
    assert first.startswith("camera positions of strip A: added -9.")
    assert second.startswith("camera positions of strip B: added -")
    document = by_rows(document)
    rows = [row for row in document["bundle"]["corrections"] if row["group"] == "strip A"]
    document["bundle"]["corrections"] = [
        {**row, "group": f"strip {n}", "whole": float(n % 31)} for n in range(50) for row in rows
    ]
    *shown, more = said(document, "estimated")
    assert [each.split(":")[0] for each in shown] == [f"camera positions of strip {n}" for n in (28, 29, 30)]
    assert more == "47 more cameras or groups of positions, less significant: --section camera, bundle"


@pytest.mark.slow
def test_a_drift_is_told_by_what_it_is_from_the_first_to_the_last() -> None:
    document = adjusted(correction="drift")
    for row in nonempty(document["bundle"]["corrections"]):
        times = 9.0 if row["kind"] == "drift" else 1.0  # from the first of ten photos to the last
        assert row["whole"] == pytest.approx(times * row["value"], abs=1e-4)
        assert row["whole_sigma"] == pytest.approx(times * row["sigma"], abs=1e-3)
    first, _ = said(document, "estimated")
    assert "; from the first to the last " in first


@pytest.mark.slow
def test_like_causes_share_a_line_and_name_what_explains_as_much() -> None:
    document = by_rows(adjusted(east=10.0, correction="offset"))
    of_photos = [{"cause": "shift of a photo", "of": f"{n}", "rivals": []} for n in range(9)]
    of_list: Document = {"cause": "control list", "of": "control[1]", "rivals": ["control list"]}
    of_list |= dict.fromkeys(f"{name}_{axis}" for name in ("shift", "sigma") for axis in ("east", "north"))
    of_list |= {"shift_up": 0.612, "sigma_up": 0.021}
    document["bundle"]["taken_up"] = [*of_photos, of_list]
    assert said(document, "cause found") == [
        "shift of photos 0, 1, 2 and 6 more",
        (
            "without control[1], which lies +0.612 m up (σ 0.021 m) beside all else; another control list would "
            "explain it nearly as well"
        ),
    ]


PIXEL_UM = 2.4
ESTIMATED = ["principal_distance", "principal_point", "k1", "k2"]


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Document:
    """Adjust a block of a digital camera; the mark of K05 on photo 2002 is 30 px beside it."""
    folder = tmp_path_factory.mktemp("block")
    photostrip.simulate(SPEC).write(folder)
    rows = [line.split(",") for line in (folder / "observations.csv").read_text(encoding="utf-8").splitlines()]
    (wrong,) = (row for row in rows if row[:2] == ["2002", "K05"])
    wrong[2] = str(float(wrong[2]) + 30.0)
    (folder / "observations.csv").write_text("\n".join(map(",".join, rows)), encoding="utf-8")
    return photostrip.run(folder / "project.yaml", processing={"self_calibration": ESTIMATED}).document


def printed(document: Document) -> str:
    """Return the short report, each paragraph in one line."""
    return to_text("", chosen_sections(document, width=2000), 2000)


def test_the_marks_of_given_points_are_shown_in_pixels(block: Document) -> None:
    (section,) = chosen_sections(block, names=["marks"])
    _, facts, table = section.parts
    assert isinstance(table, Table)
    shown = {(row[0], row[2]): row for row in table.rows}
    given, used = {row["id"]: row["role"] for row in block["control"]}, []
    for ray in nonempty(block["residuals"].where(point=set(given))):
        _, role, _, x, y, *_, state = shown.pop((ray["point"], ray["photo"]))
        assert (role, state) == (given[ray["point"]], "" if ray["used"] else "not used")
        v = [ray["vx_um"], ray["vy_um"]]
        assert [float(x), float(y)] == pytest.approx([each / PIXEL_UM for each in v], abs=0.006)
        used += v if ray["used"] and role == "control" else []
    assert shown == {}
    assert [column.unit for column in table.columns if column.name.startswith("v ")] == ["px", "px"]
    assert isinstance(facts, Facts)
    rms = np.sqrt(np.mean(np.square(used))) / PIXEL_UM
    assert facts.rows[0][1].startswith(f"{len(used) // 2} marks, rms {rms:.2f} px; largest ")


def test_many_marks_are_summed_up_point_by_point(block: Document, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(points, "MOST_MARKS", 10)
    (section,) = chosen_sections(block, names=["marks"])
    by_point, worst = (part for part in section.parts if isinstance(part, Table))
    seen = block["residuals"].where(point=set(block["control"].values("id")))["point"].tolist()
    assert {row[0]: int(row[2]) for row in by_point.rows} == Counter(seen)
    assert f"the worst {len(worst.rows)} of {len(seen)}" in worst.note


def test_a_mark_beside_its_point_stands_first_in_the_short_report(block: Document) -> None:
    (section,) = (each for each in chosen_sections(block, width=100) if each.title == "Marks of given points")
    (table,) = (part for part in section.parts if isinstance(part, Table))
    point, _, photo, x, *_, state = table.rows[0]
    assert (point, photo, state) == ("K05", "2002", "not used")
    assert float(x) == pytest.approx(30.0, abs=2.0)
    assert "more marks: --section marks" in table.note
    assert "Marks of given points" in to_html(block)


def test_the_ground_that_a_pixel_covers_is_that_of_depth_and_principal_distance(block: Document) -> None:
    points = {row["id"]: np.array([row[axis] for axis in "xyz"]) for row in block["points"]}
    sizes = []
    for photo in nonempty(block["photos"]):
        axes, center = rotation(photo), np.array([photo[axis] for axis in "xyz"])
        seen = block["residuals"].where(photo=photo["id"], used=True)["point"]
        depths = [-((points[point] - center) @ axes)[2] for point in seen]
        sizes.append(median(depths) * PIXEL_UM / 8800.0)
    size = block["summary"]["gsd"]
    assert [size["median"], size["least"], size["largest"]] == pytest.approx(
        [median(sizes), min(sizes), max(sizes)], rel=1e-3
    )
    assert f"ground sample  {size['median']:.3g} m" in printed(block)


def test_the_estimated_camera_has_pixels_significance_and_correlations(block: Document) -> None:
    rows = {row["parameter"]: row for row in block["bundle"]["calibration"]}
    distance, k1 = rows["principal_distance"], rows["k1"]
    camera, said = block["cameras"][0], " ".join(printed(block).split())
    assert distance["given"] == camera["principal_distance_mm"]
    assert distance["adjusted"] == pytest.approx(distance["given"] + distance["value"], abs=1e-6)
    corner = np.hypot(*(np.array(camera["format_mm"]) / 2 + np.abs(camera["principal_point_mm"]))) * 1000.0
    moved = abs(np.array([distance["value"] / distance["given"], k1["value"] * (corner / 1000.0) ** 2])) * corner
    assert [distance["corner_um"], k1["corner_um"]] == pytest.approx(moved, rel=0.01)
    assert f"added {distance['value']:.4g} mm to principal distance" in said
    assert f", {distance['value'] * 1000 / PIXEL_UM:.3g} px, not significant)" in said
    assert "highly correlated" in said
    section = to_text("", chosen_sections(block, names=["camera"]), 100)
    (line,) = (line for line in section.splitlines() if line.startswith("4 k1"))
    assert line.split()[2:] == [f"{each:+.2f}" for each in k1["correlations"][:3]]
