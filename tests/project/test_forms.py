"""Tables as people have them: the project says how they are written, and the same inputs come of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
import yaml

from tests.project.samples import CONTROL, FIDUCIALS, MARKED_FILES, OBSERVATIONS, sample

if TYPE_CHECKING:
    from pathlib import Path

HEADER, *ROWS = [line.split(",") for line in OBSERVATIONS.splitlines()]
NUMBERED = "columns={photo: 1, point: 2, x: 3, y: 4}"


def written(separator: str, *rows: list[str], decimal: str = ".") -> str:
    return "".join(separator.join(cell.replace(".", decimal) for cell in row) + "\n" for row in rows)


def in_columns(*rows: list[str]) -> str:
    return "".join("  " + "".join(f"{cell:>12}" for cell in row) + "  \n" for row in rows)


# a table of image coordinates, and what is said of it
WAYS = {
    "semicolons": (written(";", HEADER, *ROWS), ["separator=semicolon"]),
    "decimal commas": (written(";", HEADER, *ROWS, decimal=","), ["separator=semicolon", "decimal=comma"]),
    "tabs": (written("\t", HEADER, *ROWS), ["separator=tab"]),
    "tabs and decimal commas": (written("\t", HEADER, *ROWS, decimal=","), ["separator=tab", "decimal=comma"]),
    "columns of blanks": (in_columns(HEADER, *ROWS), ["separator=blank"]),
    "blanks and tabs": (written(" \t ", HEADER, *ROWS), ["separator=blank"]),
    "blanks and decimal commas": (in_columns(HEADER, *ROWS).replace(".", ","), ["separator=blank", "decimal=comma"]),
    "lines above": ("comparator 7, read by N. N.\n\n" + OBSERVATIONS, ["skip=2"]),
    "by number": (written(",", *ROWS), [NUMBERED]),
    "by number, in columns of blanks": ("\n" + in_columns(*ROWS), ["separator=blank", NUMBERED]),
    "by number, others beside": (
        written(";", *([y, x, "7", point, photo, ""] for photo, point, x, y in ROWS), decimal=","),
        ["separator=semicolon", "decimal=comma", "columns={photo: 5, point: 4, x: 2, y: 1}"],
    ),
    "by number, below a header": (OBSERVATIONS, ["skip=1", NUMBERED]),
    "in quotation marks": (written(";", HEADER, *ROWS).replace("P1", '"P1"'), ["separator=semicolon"]),
}


@pytest.mark.parametrize("way", WAYS)
def test_the_same_image_points_come_of_it(tmp_path: Path, way: str) -> None:
    text, said = WAYS[way]
    expected = sample(tmp_path / "plain").load().inputs.observations
    project = sample(tmp_path / "way")
    project.write("observations.csv", text)
    found = project.load([f"observations.{each}" for each in said]).inputs.observations
    assert (found.photo_ids, found.point_ids) == (expected.photo_ids, expected.point_ids)
    np.testing.assert_array_equal(found.xy, expected.xy)


def test_every_table_of_given_coordinates_can_be_written_so(tmp_path: Path) -> None:
    expected = sample(tmp_path / "plain").load().inputs.control
    project = sample(tmp_path / "way")
    project.write("control.csv", CONTROL.partition("\n")[2].replace(",", ";").replace(".", ","))
    columns = "{point: 1, x: 2, y: 3, z: 4, use: 5, role: 6}"
    said = ["separator=semicolon", "decimal=comma", f"columns={columns}"]
    found = project.load([f"control[0].{each}" for each in said]).inputs.control
    assert found.ids == expected.ids
    np.testing.assert_array_equal(found.enu, expected.enu)
    np.testing.assert_array_equal(found.check, expected.check)


GIVEN = """\
processing: {adjustment: bundle}
camera_positions:
  {file: gnss.txt, crs: "EPSG:32633", axes: [east, north, up], sigma: [1, 1, 1], separator: blank,
   columns: {photo: 1, x: 2, y: 3, z: 4}}
orientations:
  {file: imu.txt, crs: "EPSG:32633", axes: [east, north, up], sigma: [1, 1, 1], sigma_angles: [1, 1, 1],
   separator: tab, decimal: comma, columns: {photo: Bild, alpha: Querneigung}}
"""


def test_tables_of_cameras_can_be_written_so(tmp_path: Path) -> None:
    project = sample(tmp_path)
    text = (tmp_path / "project.yaml").read_text(encoding="utf-8").partition("processing:")[0]
    project.write("project.yaml", text + GIVEN)
    project.write("gnss.txt", "1001  500012.4  4649871.4  2012.3\n")
    project.write(
        "imu.txt", "Bild\tx\ty\tz\tQuerneigung\tomega\tkappa\n1001\t500012,4\t4649871,4\t2012,3\t9\t0,5\t90\n"
    )
    inputs = project.load().inputs
    assert inputs.positions is not None
    assert inputs.orientations is not None
    np.testing.assert_array_equal(inputs.positions.enu, [[500012.4, 4649871.4, 2012.3]])
    np.testing.assert_array_equal(inputs.orientations.enu, [[500012.4, 4649871.4, 2012.3]])


def test_several_files_are_one_table(tmp_path: Path) -> None:
    expected = sample(tmp_path / "one").load().inputs.observations
    project = sample(tmp_path / "several")
    turned = [[y, x, point, photo] for photo, point, x, y in ROWS[4:]]
    project.write("a.csv", written(",", HEADER, *ROWS[:4]))
    project.write("b.csv", written(",", ["y", "x", "point", "photo"], *turned))
    read = project.load(["observations.file=[a.csv, b.csv]"])
    found = read.inputs.observations
    assert (found.photo_ids, found.point_ids) == (expected.photo_ids, expected.point_ids)
    np.testing.assert_array_equal(found.xy, expected.xy)
    assert yaml.safe_load(read.resolved)["observations"]["file"] == ["a.csv", "b.csv"]
    assert [path.name for path in read.files] == ["project.yaml", "a.csv", "b.csv", "control.csv"]


def test_several_files_of_pairs_and_of_marks(tmp_path: Path) -> None:
    plain, project = sample(tmp_path / "one", MARKED_FILES), sample(tmp_path / "several", MARKED_FILES)
    head, *rows = FIDUCIALS.splitlines(keepends=True)
    project.write("a.csv", head + "".join(rows[:3]))
    project.write("b.csv", head + "".join(rows[3:]))
    pairs = "left,right,point,xl,yl,xr,yr\n"
    project.write("c.csv", pairs + "1001,1002,P1,10.5,-20.25,-80.5,-20.5\n1001,1002,P2,11.5,20.25,-79.5,20.0\n")
    project.write("d.csv", pairs + "2001,2002,P2,10,20,-80,20\n2001,2002,G1,30,40,-60,40\n")
    one = plain.load().inputs
    found = project.load(["fiducial_measurements.file=[a.csv, b.csv]", "observations.file=[c.csv, d.csv]"]).inputs
    assert found.fiducials is not None
    assert one.fiducials is not None
    np.testing.assert_array_equal(found.fiducials.xy, one.fiducials.xy)
    np.testing.assert_array_equal(
        sorted(map(tuple, found.observations.xy.tolist())), sorted(map(tuple, one.observations.xy.tolist()))
    )


@pytest.mark.parametrize(
    ("rows", "said", "place", "words"),
    [
        ("1001,P9,x,1\n", [], "b.csv:2:9: x:", "`x` is not a number"),
        ("1001,P1,1,1\n", [], "b.csv:2:6: point:", "already measured on photo 1001, in line 2 of "),
        ("1001,P1,50,1\n", ["observations.repeated=average"], "b.csv:2:6:", "(line 2 of "),
    ],
)
def test_faults_of_several_files_have_their_own_place(
    tmp_path: Path, rows: str, said: list[str], place: str, words: str
) -> None:
    project = sample(tmp_path)
    project.write("b.csv", "photo,point,x,y\n" + rows)
    (line,) = project.lines(["observations.file=[observations.csv, b.csv]", *said])
    assert line.startswith(place)
    assert words in line


@pytest.mark.parametrize(
    ("text", "said", "place", "words", "fix"),
    [
        (WAYS["semicolons"][0], [], "observations.csv:1:", "separated by semicolons", "`separator: semicolon`"),
        (WAYS["tabs"][0], [], "observations.csv:1:", "separated by tabs", "`separator: tab`"),
        (in_columns(HEADER, *ROWS), [], "observations.csv:1:", "separated by blanks", "`separator: blank`"),
        (OBSERVATIONS, ["separator=tab"], "observations.csv:1:", "separated by commas", "`separator: comma`"),
        (WAYS["decimal commas"][0], ["separator=semicolon"], "observations.csv:2:9: x:", "decimal comma", "`decimal: "),
        (WAYS["semicolons"][0], WAYS["decimal commas"][1], "observations.csv:2:9: x:", "has a point", "comma"),
        (OBSERVATIONS, ["decimal=comma"], "", "commas cannot stand between the fields", "`separator`"),
        (OBSERVATIONS, [NUMBERED], "observations.csv:1:13: x:", "`x` is not a number", "`skip: 1`"),
        (OBSERVATIONS, [NUMBERED.replace("4", "5")], "observations.csv:1:", "no field 5 for `y`", "4 fields"),
        (OBSERVATIONS, [NUMBERED.replace("4", "3")], "observations.csv:1:", "no field 3 for `y`", ""),
        (OBSERVATIONS, ["columns={photo: 1, point: 2, x: 3}"], "observations.csv:1:", "no number for `y`", "add `y`"),
        (OBSERVATIONS, ["columns={photo: 1, point: punkt}"], "", "`punkt` is no number of a field", "by number"),
        (OBSERVATIONS, ["skip=-1"], "", "-1 is no number of lines", ""),
        (OBSERVATIONS, ["skip=99"], "observations.csv:1:", "has no header", ""),
        (OBSERVATIONS, ["file=[]"], "", "no file is named", ""),
        (OBSERVATIONS, ["file=[observations.csv, observations.csv]"], "", "named twice", "remove one"),
        (
            in_columns(HEADER, ["1001", "P 1", "1", "2"]),
            ["separator=blank"],
            "observations.csv:2:",
            "5 fields",
            "blank",
        ),
    ],
)
def test_what_is_wrong_is_explained(
    tmp_path: Path, text: str, said: list[str], place: str, words: str, fix: str
) -> None:
    project = sample(tmp_path)
    project.write("observations.csv", text)
    first, *_ = project.lines([f"observations.{each}" for each in said])
    assert first.startswith(place)
    assert words in first
    assert fix in first.partition(words)[2]


def test_points_of_pairs_below_points_of_photos_are_refused(tmp_path: Path) -> None:
    project = sample(tmp_path)
    project.write("b.csv", "left,right,point,xl,yl,xr,yr\n1001,1002,P7,1,2,3,4\n")
    (line,) = project.lines(["observations.file=[observations.csv, b.csv]"])
    assert line.startswith("b.csv:1: holds points of pairs, but ")
