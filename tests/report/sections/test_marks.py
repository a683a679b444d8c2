"""What digital cameras need in a report: marks in pixels, what a pixel covers, what was estimated of the camera."""

from __future__ import annotations

from statistics import median
from typing import TYPE_CHECKING

import numpy as np
import pytest

import photostrip
from photostrip.report.html import to_html
from photostrip.report.page.layout import to_text
from photostrip.report.page.parts import Facts, Table
from photostrip.report.sections.accuracy_report import chosen_sections
from tests.foreign.colmap_models import SPEC
from tests.loops import nonempty
from tests.reports import saved
from tests.results import rotation

if TYPE_CHECKING:
    from photostrip.notes import Document

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


def test_a_mark_beside_its_point_stands_first_in_the_short_report(block: Document) -> None:
    (section,) = (each for each in chosen_sections(block, width=100) if each.title == "Marks of given points")
    (table,) = (part for part in section.parts if isinstance(part, Table))
    point, _, photo, x, *_, state = table.rows[0]
    assert (point, photo, state) == ("K05", "2002", "not used")
    assert float(x) == pytest.approx(30.0, abs=2.0)
    assert "more marks: --section marks" in table.note
    assert "Marks of given points" in to_html(block)


def test_marks_of_film_are_shown_in_micrometres() -> None:
    (section,) = chosen_sections(saved(), names=["marks"])
    (table,) = (part for part in section.parts if isinstance(part, Table))
    assert table.rows
    assert [column.unit for column in table.columns if column.name.startswith("v ")] == ["µm", "µm"]
    assert "gsd" not in saved()["summary"]


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
    said = printed(block)
    assert f"principal distance {distance['value']:.4g} mm" in said
    assert f", {distance['value'] * 1000 / PIXEL_UM:.3g} px, not significant)" in said
    others = list(rows)
    pairs = {(a, b): rows[a]["correlations"][n] for a in rows for n, b in enumerate(others) if a != b}
    (first, second), value = max(pairs.items(), key=lambda pair: abs(pair[1]))
    assert f"largest correlation {value:+.2f}, {first} with {second}".replace("_", " ") in said
    assert "highly correlated" in said
    section = to_text("", chosen_sections(block, names=["bundle"]), 100)
    (line,) = (line for line in section.splitlines() if line.startswith("4 k1"))
    assert line.split()[2:] == [f"{each:+.2f}" for each in k1["correlations"][:3]]
