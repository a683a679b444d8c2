"""Measured tables as people have them: forms of writing, pairs, points measured again, names of columns, units."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from photostrip.foreign.simulated import project_files
from photostrip.formats.files import write_files
from photostrip.pipeline.run import triangulate
from photostrip.points import PhotoPoints
from photostrip.project.loading import Project, load_project
from photostrip.simulation.simulation import simulate
from photostrip.simulation.spec import Flight, Spec
from tests.project.samples import CONTROL, FIDUCIALS, OBSERVATIONS, C, P, Sample, Y, sample

PAIRS = """\
pair,point,x,y,p,q
1001-1002,P1,10.5,-20.25,91.0,0.25
1001-1002,P2,11.5,20.25,91.0,0.25
2001-2002,P2,10,20,90,0
2001-2002,G1,30,40,90,0
"""
BOTH = """\
left,right,point,xl,yl,xr,yr
1001,1002,P1,10.5,-20.25,-80.5,-20.5
1001,1002,P2,11.5,20.25,-79.5,20.0
2001,2002,P2,10,20,-80,20
2001,2002,G1,30,40,-60,40
"""
AVERAGE = "  unit: mm\n  repeated: average\n"
AGAIN = OBSERVATIONS + "1001,P1,10.504,-20.254\n1001,P1,10.508,-20.252\n"


HEADER, *ROWS = [line.split(",") for line in OBSERVATIONS.splitlines()]
NUMBERED = "columns={photo: 1, point: 2, x: 3, y: 4}"


def written(separator: str, *rows: list[str], decimal: str = ".") -> str:
    return "".join(separator.join(cell.replace(".", decimal) for cell in row) + "\n" for row in rows)


def in_columns(*rows: list[str]) -> str:
    return "".join("  " + "".join(f"{cell:>12}" for cell in row) + "  \n" for row in rows)


def measured(project: Project) -> dict[tuple[str, str], tuple[float, ...]]:
    points: PhotoPoints = project.inputs.observations
    return {
        (points.photo_ids[photo], points.point_ids[point]): (*xy, *sigma)
        for photo, point, xy, sigma in zip(points.photo, points.point, points.xy, points.sigma, strict=True)
    }


@pytest.mark.parametrize("text", [PAIRS, BOTH, PAIRS.replace("-100", "/100"), PAIRS.replace("pair,", "Model,")])
def test_a_list_of_pairs_is_the_table_of_its_photos(project: Sample, text: str) -> None:
    usual = measured(project.load())
    project.write(P, text)
    assert measured(project.load()) == usual


def test_the_photos_of_a_pair_may_have_dashes(project: Sample) -> None:
    usual = measured(project.load())
    project.change(Y, "1001", "10-01")
    project.write(P, PAIRS.replace("1001-1002", "10-01-1002"))
    found = measured(project.load())
    assert {(photo.replace("10-01", "1001"), point) for photo, point in found} == set(usual)


@pytest.mark.parametrize(
    ("old", "new", "place", "words"),
    [
        (
            "2001-2002,P2",
            "2001_2003,P2",
            "observations.csv:4:1: pair:",
            "pair 2001_2003 does not name two photos of the",
        ),
        (
            "1001-1002",
            "1-1-1-1",
            "observations.csv:2:1: pair:",
            "may be photos 1 and 1-1-1 or 1-1 and 1-1 or 1-1-1 and 1",
        ),
        ("p,q", "p", "observations.csv:1: q:", "no column `q`; expected a header `pair,point,x,y,p,q`"),
    ],
)
def test_a_list_of_pairs_that_is_wrong(project: Sample, old: str, new: str, place: str, words: str) -> None:
    project.change(Y, "1001, 1002", "1, 1-1, 1-1-1" if new == "1-1-1-1" else "1001, 1002")
    project.write(P, PAIRS.replace(old, new))
    first, *_ = project.lines()
    assert first.startswith(place)
    assert words in first


@pytest.mark.slow
def test_a_strip_from_a_stereocomparator_is_that_of_its_photos(tmp_path: Path) -> None:
    """Every photo but the first and the last is measured in two pairs; the means are what was measured."""
    simulation = simulate(Spec(flight=Flight(photos=6)))
    write_files(tmp_path, project_files(simulation))
    first = load_project(tmp_path / "project.yaml")
    points, place = first.inputs.observations, {name: n for n, name in enumerate(first.inputs.strips[0].photos)}
    seen: dict[int, dict[int, tuple[float, float]]] = {}
    for photo, point, xy in zip(points.photo, points.point, points.xy.tolist(), strict=True):
        seen.setdefault(place[points.photo_ids[photo]], {})[int(point)] = tuple(xy)
    names = list(place)
    rows = ["left,right,point,x,y,p,q"] + [
        f"{names[n]},{names[n + 1]},{points.point_ids[point]},{x!r},{y!r},{x - seen[n + 1][point][0]!r},"
        f"{y - seen[n + 1][point][1]!r}"
        for n in range(len(names) - 1)
        for point, (x, y) in seen[n].items()
        if point in seen[n + 1]
    ]
    (tmp_path / "observations.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    second = load_project(tmp_path / "project.yaml")
    assert [note.code for note in second.hints].count("measurements-averaged") == 1
    results = [triangulate(each.inputs, each.settings) for each in (first, second)]
    ids = [[r.inputs.observations.point_ids[n] for n in r.points.number] for r in results]
    order = [np.argsort(each) for each in ids]
    assert [ids[0][n] for n in order[0]] == [ids[1][n] for n in order[1]]
    # a mean of two has half the variance and counts more, so that the results agree within the noise only
    apart = results[0].points.cartesian[order[0]] - results[1].points.cartesian[order[1]]
    assert np.abs(apart).max() < 0.1


def test_points_measured_again_are_averaged_and_their_spread_told(project: Sample) -> None:
    project.write(P, AGAIN)
    project.change(Y, "  unit: mm\n", AVERAGE)
    loaded = project.load()
    x, y, sx, sy = measured(loaded)["1001", "P1"]
    assert [x, y] == pytest.approx([10.504, -20.252])
    assert [sx, sy] == pytest.approx([0.005 / np.sqrt(3)] * 2)
    assert measured(loaded)["1001", "P2"] == (11.5, 20.25, 0.005, 0.005)
    note = next(note for note in loaded.hints if note.code == "measurements-averaged")
    assert "1 point measured up to 3 times" in note.message
    assert "scatters by 0.004 in x and 0.002 in y" in note.message
    assert "worst is point P1 on photo 1001, 0.004 beside the mean of its measurements" in note.message


def test_the_mean_is_weighted(project: Sample) -> None:
    text = "photo,point,x,y,sx,sy\n" + "".join(f"{row},,\n" for row in OBSERVATIONS.splitlines()[1:])
    project.write(P, text + "1001,P1,10.51,-20.25,0.01,0.01\n")
    project.change(Y, "  unit: mm\n", AVERAGE)
    x, _, sx, _ = measured(project.load())["1001", "P1"]
    weights = np.array([1 / 0.005**2, 1 / 0.01**2])
    assert x == pytest.approx(weights @ [10.5, 10.51] / weights.sum())
    assert sx == pytest.approx(weights.sum() ** -0.5)


def test_measurements_that_are_not_of_one_point_are_refused(project: Sample) -> None:
    project.write(P, OBSERVATIONS + "1001,P1,10.5,-20.05\n")
    project.change(Y, "  unit: mm\n", AVERAGE)
    message = "point P1 is measured 2 times on photo 1001 (lines 2, 10), up to 0.2 in y apart: 20 standard deviations"
    fix = " from the mean; remove the wrong one, or give the other point an id of its own"
    assert project.lines() == [f"observations.csv:10:6: point: {message}{fix}"]


@pytest.mark.parametrize(
    ("text", "columns"),
    [
        (OBSERVATIONS.replace("photo,point,x,y", "Bild,Punkt,xs,ys"), "{photo: Bild, point: PUNKT, x: xs, y: ys}"),
        # a declared column goes before the usual name
        (
            written(",", ["x", *HEADER[:2], "y", "x refined"], *(["0", *row[:2], row[3], row[2]] for row in ROWS)),
            "{x: x refined}",
        ),
    ],
)
def test_columns_may_have_other_names(project: Sample, text: str, columns: str) -> None:
    usual = measured(project.load())
    project.write(P, text)
    assert measured(project.load([f"observations.columns={columns}"])) == usual


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ("{photo: Bild}", ("observations.csv:1", "there is no column `bild`")),
        ("{foto: Bild}", ("project.yaml:19", "`foto` is no column of this table", "did you mean `photo`?")),
        ("[photo]", ("project.yaml:19", "columns")),
        ("{photo: }", ("project.yaml:19", "photo")),
    ],
)
def test_declared_columns_that_are_wrong(project: Sample, columns: str, words: tuple[str, ...]) -> None:
    project.change(Y, "  unit: mm\n", f"  unit: mm\n  columns: {columns}\n")
    project.tells(*words)


def test_tenths_of_micrometres(project: Sample) -> None:
    usual = measured(project.load())
    rows = ([*row[:2], *(f"{float(each) * 1e4:.0f}" for each in row[2:])] for row in ROWS)
    project.write(P, written(",", HEADER, *rows))
    project.change(Y, "  unit: mm\n", "  unit: 0.1um\n", "sigma: 0.005", "sigma: 50")
    found = measured(project.load())
    assert {key: pytest.approx(value) for key, value in usual.items()} == found


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
def test_the_same_image_points_come_of_it(project: Sample, way: str) -> None:
    text, said = WAYS[way]
    usual = measured(project.load())
    project.write(P, text)
    found = measured(project.load([f"observations.{each}" for each in said]))
    assert list(found.items()) == list(usual.items())


def test_every_table_of_given_coordinates_can_be_written_so(tmp_path: Path) -> None:
    expected = sample(tmp_path / "plain").load().inputs.control
    project = sample(tmp_path / "way")
    project.write(C, CONTROL.partition("\n")[2].replace(",", ";").replace(".", ","))
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


def test_tables_of_cameras_can_be_written_so(project: Sample) -> None:
    text = (project.folder / "project.yaml").read_text(encoding="utf-8").partition("processing:")[0]
    project.write(Y, text + GIVEN)
    project.write("gnss.txt", "1001  500012.4  4649871.4  2012.3\n")
    row = ["1001", "500012.4", "4649871.4", "2012.3", "9", "0.5", "90"]
    project.write("imu.txt", written("\t", ["Bild", "x", "y", "z", "Querneigung", "omega", "kappa"], row, decimal=","))
    inputs = project.load().inputs
    assert inputs.positions is not None
    assert inputs.orientations is not None
    np.testing.assert_array_equal(inputs.positions.enu, [[500012.4, 4649871.4, 2012.3]])
    np.testing.assert_array_equal(inputs.orientations.enu, [[500012.4, 4649871.4, 2012.3]])


def test_several_files_are_one_table(project: Sample) -> None:
    usual = measured(project.load())
    turned = [[y, x, point, photo] for photo, point, x, y in ROWS[4:]]
    project.write("a.csv", written(",", HEADER, *ROWS[:4]))
    project.write("b.csv", written(",", ["y", "x", "point", "photo"], *turned))
    read = project.load(["observations.file=[a.csv, b.csv]"])
    assert list(measured(read).items()) == list(usual.items())
    assert yaml.safe_load(read.resolved)["observations"]["file"] == ["a.csv", "b.csv"]
    assert [path.name for path in read.files] == ["project.yaml", "a.csv", "b.csv", "control.csv"]


def test_several_files_of_pairs_and_of_marks(marked: Sample) -> None:
    one = marked.load()
    head, *rows = FIDUCIALS.splitlines(keepends=True)
    marked.write("a.csv", head + "".join(rows[:3]))
    marked.write("b.csv", head + "".join(rows[3:]))
    head, *rows = BOTH.splitlines(keepends=True)
    marked.write("c.csv", head + "".join(rows[:2]))
    marked.write("d.csv", head + "".join(rows[2:]))
    found = marked.load(["fiducial_measurements.file=[a.csv, b.csv]", "observations.file=[c.csv, d.csv]"])
    assert found.inputs.fiducials is not None
    assert one.inputs.fiducials is not None
    np.testing.assert_array_equal(found.inputs.fiducials.xy, one.inputs.fiducials.xy)
    assert measured(found) == measured(one)


@pytest.mark.parametrize(
    ("rows", "said", "place", "words"),
    [
        (BOTH, [], "b.csv:1: ", "holds points of pairs, but "),
        ("1001,P9,x,1\n", [], "b.csv:2:9: x:", "`x` is not a number"),
        ("1001,P1,1,1\n", [], "b.csv:2:6: point:", "already measured on photo 1001, in line 2 of "),
        ("1001,P1,50,1\n", ["observations.repeated=average"], "b.csv:2:6:", "(line 2 of "),
    ],
)
def test_faults_of_several_files_have_their_own_place(
    project: Sample, rows: str, said: list[str], place: str, words: str
) -> None:
    project.write("b.csv", rows if rows == BOTH else "photo,point,x,y\n" + rows)
    project.tells(place, words, overrides=["observations.file=[observations.csv, b.csv]", *said], alone=True)


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
    project: Sample, text: str, said: list[str], place: str, words: str, fix: str
) -> None:
    project.write(P, text)
    first, *_ = project.lines([f"observations.{each}" for each in said])
    assert first.startswith(place)
    assert words in first
    assert fix in first.partition(words)[2]
