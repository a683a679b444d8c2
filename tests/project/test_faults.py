"""One thing wrong in a project that is right otherwise: the words, the place, and nothing else said."""

from pathlib import Path

import pytest

from photostrip.errors import InputError
from photostrip.project.loading import load_project
from tests.project.samples import FILES, MARKED, MARKED_FILES, PROJECT, C, F, P, Sample, Y, sample

SIGMA = "    sigma: [0.05, 0.06, 0.08]\n"
SECOND_LIST = '  - {file: second.csv, crs: "EPSG:32634", axes: [east, north, up], sigma: [1, 1, 1]}\noutput:'

# The file, what is replaced in it by what, where the fault begins, and words that it must have.
YAML_SYNTAX = [
    (Y, "name: sample", "name: a: b", "project.yaml:2:8:", "colon", "quotation marks"),
    (Y, "name: sample", "name: @a", "project.yaml:2:7:", "cannot begin with @"),
    (Y, "name: sample", "name: `a", "project.yaml:2:7:", "cannot begin with `"),
    (Y, "name: sample", "name: 'a", "project.yaml:2:7:", "quotation mark", "not closed"),
    (Y, "name: sample", 'name: "C:\\qa"', "project.yaml:2:10:", "backslash", "single quotation marks"),
    (Y, "name: sample", "name sample", "project.yaml:3:1:", "without a colon"),
    (Y, "name: sample", "\tname: a", "project.yaml:2:1:", "tab", "blanks"),
    (Y, "cameras:\n  RC30:", "cameras:\n\tRC30:", "project.yaml:4:1:", "tab", "blanks"),
    (Y, "[1001, 1002]", "[1001, 1002", "project.yaml:12:13:", "bracket"),
    (Y, "  - id: B", "    - id: B", "project.yaml:13:5:", "does not fit"),
    (Y, "name: sample", "name: sample\n  deeper: 1", "project.yaml:3:9:", "indentation"),
    (Y, "name: sample", "name: a\x07b", "project.yaml:2:8:", "U+0007"),
]
YAML_MANNERS = [
    (Y, "name: sample", "name: a\nname: b", "project.yaml:3:1: name:", "second time", "line 2"),
    (Y, "    crs:", "    file: c.csv\n    crs:", "project.yaml:23:5: file:", "second time", "line 22"),
    (Y, "gon}", "gon, unit: deg}", "project.yaml:28:48: unit:", "second time", "column 37"),
    (Y, "name: sample", "name: {a: &x b}", "project.yaml:2:7:", "a mapping"),
    (Y, "name: sample", "name: *x", "project.yaml:2:7:", "alias *x stands for nothing", "name a value with &x"),
    (Y, "name: sample", "name: !!int 3", "project.yaml:2:7:", "tag !!int"),
    (Y, "name: sample", "name: !<tag:example.com,2000:x> 3", "project.yaml:2:7:", "tag"),
    (Y, "name: sample", "<<: {name: a}", "project.yaml:2:1:", "merge keys", "extends"),
    (Y, "name: sample", "? [a]\n: 1", "project.yaml:2:3:", "a list is used as a key"),
    (Y, "name: sample", "{{ name }}: 1", "project.yaml:2:2:", "key"),
    (Y, "name: sample", "'': 1", "project.yaml:2:1:", "a key is empty"),
    (Y, "name: sample", "name: a\n---\nname: b", "project.yaml:3:1:", "second document"),
]
SCHEMA = [
    (Y, "photostrip: 1", "photostrip: 2", "project.yaml:1:13: photostrip:", "does not read schema 2", "photostrip: 1"),
    (Y, "photostrip: 1\n", "", "project.yaml:1:1: photostrip:", "is missing"),
    (Y, "name: sample", "nmae: sample", "project.yaml:2:1: nmae:", "not known", "did you mean `name`?"),
    (Y, "name: sample", "grubbs_alpha: 0.1", "project.yaml:2:1: grubbs_alpha:", "belongs in `processing.relative`"),
    (Y, "name: sample", "name:", "project.yaml:2:6: name:", "no value is given"),
    (Y, "name: sample", "name: ''", "project.yaml:2:7: name:", "no value is given"),
    (Y, "name: sample", "name: {a: 1}", "project.yaml:2:7: name:", "a mapping is given here"),
    (Y, "name: sample", 'name: "a\\nb"', "project.yaml:2:7: name:", "line break"),
    (Y, "153.217", "153,217", "project.yaml:5:25: cameras.RC30.principal_distance:", "decimal comma", "153.217"),
    (Y, "153.217", "153.217 mm", "project.yaml:5:25:", "unit in it", "the number alone: 153.217"),
    (Y, "153.217", "-1", "project.yaml:5:25:", "out of range", "larger than 0"),
    (Y, "153.217", "0", "project.yaml:5:25:", "out of range"),
    (Y, "1002]\n", "1002]\n    first_photo: {base: 0}\n", "project.yaml:13:25:", "first_photo.base:", "larger than 0"),
    (Y, "1002]\n", "1002]\n    first_photo: {unit: grad}\n", "project.yaml:13:25: strips[0].first_photo.unit:", "rad"),
    (Y, "processing:", "processing:\n  intersection: right", "project.yaml:30:17: processing.intersection:", "left"),
    (Y, "153.217", ".nan", "project.yaml:5:25:", "not a number"),
    (Y, "153.217", "inf", "project.yaml:5:25:", "not a measured value"),
    (Y, "153.217", "1e999", "project.yaml:5:25:", "too large"),
    (Y, "153.217", "1_53.217", "project.yaml:5:25:", "underscore", "153.217"),
    (Y, "153.217", "１53.217", "project.yaml:5:25:", "ASCII", "153.217"),
    (Y, "153.217", "~", "project.yaml:5:25:", "`~` is not a number"),
    (Y, "153.217", "[153.217]", "project.yaml:5:25:", "a list is given here", "a number"),
    (Y, "    principal_distance: 153.217\n", "", "project.yaml:5:5:", "RC30.principal_distance:", "missing", "[mm]"),
    (Y, "[0.012, -0.004]", "[0.012]", "project.yaml:6:22:", "1 value in the list", "2 values"),
    (Y, "[0.012, -0.004]", "[1, 2, 3]", "project.yaml:6:22:", "3 values in the list", "2 values"),
    (Y, "[0.012, -0.004]", "0.012, -0.004", "project.yaml:6:22:", "a single value", "in brackets"),
    (Y, "-0.004", "x", "project.yaml:6:30: cameras.RC30.principal_point[1]:", "`x` is not a number"),
    (Y, "[230, 230]", "[230, 0]", "project.yaml:7:19: cameras.RC30.format[1]:", "out of range"),
    (Y, ", direction: image_to_ideal", "", "project.yaml:8:17:", "`direction` is missing"),
    (Y, "image_to_ideal", "image-to-ideal", "project.yaml:8:60:", "did you mean `image_to_ideal`?"),
    (Y, "model: brown", "model: brwn", "project.yaml:8:25:", "one of brown, radial-table", "did you mean `brown`"),
    (Y, "model: brown", "model: radial-table", "project.yaml:8:", "`k` does not belong to model radial-table"),
    (Y, "k: [1e-8, 0, 0]", "radius: [1]", "project.yaml:8:", "`radius` does not belong to model brown"),
    (Y, "brown, k: [1e-8, 0, 0]", "radial-table, radius: [0, 9], distortion: [0]", "project.yaml:8:", "as many values"),
    (Y, "brown, k: [1e-8, 0, 0]", "radial-table, radius: [9, 0], distortion: [0, 1]", "project.yaml:8:", "ascend"),
    (Y, PROJECT[PROJECT.index("cameras:") : PROJECT.index("strips:")], "cameras:\n", "project.yaml:3:9:", "no camera"),
    (Y, "processing:", "processing:\n  adjustment: covariance", "project.yaml:30:15:", "is not known", "`bundle`"),
    (Y, "processing:", "processing:\n  covariance: {a: b}", "project.yaml:30:3:", "`adjustment: bundle` took"),
    (Y, "[1001, 1002]", "1001", "project.yaml:12:13:", "a single value", "a list"),
    (Y, "[1001, 1002]", "[1001, [1002]]", "project.yaml:12:20: strips[0].photos[1]:", "a list is given here"),
    (Y, "unit: mm", "unit: cm", "project.yaml:18:9: observations.unit:", "`cm` is not known", "mm, um, 0.1um, px"),
    (Y, "unit: mm", "unit: mm\n  repeated: mean", "project.yaml:19:13: observations.repeated:", "`mean` is not known"),
    (Y, "  unit: mm\n", "", "project.yaml:17:3: observations.unit:", "`unit` is missing"),
    (Y, "y_axis: up", "y_axis: Up", "project.yaml:19:11:", "did you mean `up`?"),
    (Y, "sigma: 0.005", "sigma: 0", "project.yaml:20:10:", "out of range"),
    (Y, "[0.05, 0.06, 0.08]", "0.05", "project.yaml:26:12: control[0].sigma:", "a single value"),
    (Y, "[0.05, 0.06, 0.08]", "[0.05, 0.06]", "project.yaml:26:12:", "2 values in the list", "3 values"),
    (Y, "[east, north, up]", "[east, north]", "project.yaml:24:11: control[0].axes:", "permutation"),
    (Y, "[east, north, up]", "[east, north, east]", "project.yaml:24:11:", "permutation"),
    (Y, "[east, north, up]", "{x: east}", "project.yaml:24:11:", "permutation"),
    (Y, "    axes: [east, north, up]\n", "", "project.yaml:22:5: control[0].axes:", "which of the columns"),
    (Y, "angles: {", "angles: {sytem: a, ", "project.yaml:28:12: output.angles.sytem:", "did you mean `system`?"),
    (Y, "unit: gon", "unit: grad", "project.yaml:28:43:", "one of deg, gon, rad"),
    (Y, "grubbs_alpha: 0.05", "grubbs_alpha: 5", "project.yaml:31:19:", "between 0 and 1"),
    (Y, "relative:\n    grubbs_alpha: 0.05", "refraction: maybe", "project.yaml:30:15:", "neither true nor false"),
    (Y, "check_rms_xy", "check_rms_yx", "project.yaml:32:14: tolerances.check_rms_yx:", "did you mean `check_rms_xy`?"),
    (Y, "0.40", "-0.40", "project.yaml:32:28:", "out of range"),
]
REFERENCES = [
    (Y, "id: B\n    camera: RC30", "id: B\n    camera: RC3O", "project.yaml:14:13:", "no camera `RC3O`", "mean `RC30`"),
    (Y, "id: B", "id: A", "project.yaml:13:9: strips[1].id:", "strip A already exists, in line 10"),
    (Y, "2002]", "1002]", "project.yaml:15:20: strips[1].photos[1]:", "already listed, in strip A", "12:20"),
    (Y, "1002]", "1001]", "project.yaml:12:20: strips[0].photos[1]:", "already listed", "12:14"),
    (Y, "1002]", "1002, 1003]", "project.yaml:12:26: strips[0].photos[2]:", "no point on photo 1003"),
    (Y, "1002]", "1002, 1OO3]", "project.yaml:12:26:", "no point on photo 1OO3"),
    (Y, "unit: mm", "unit: px", "project.yaml:5:5: cameras.RC30.pixel_size:", "has no pixel_size", "in mm"),
    (Y, "processing:", "processing:\n  earth_curvature: image", "project.yaml:30:20:", "counted twice", "EPSG:32633"),
    (Y, "processing:", "processing:\n  earth_curvature: model", "project.yaml:30:20:", "counted twice", "EPSG:32633"),
]
FRAMES = [
    (Y, "EPSG:32633", "EPSG:99999", "project.yaml:23:10: control[0].crs:", "EPSG:99999"),
    (Y, "height: ellipsoidal", "height: orthometric", "project.yaml:25:13: control[0].height:", "geoid"),
    (Y, "height: ellipsoidal", "geoid_undulation: 44", "project.yaml:25:23:", "ellipsoidal"),
    (Y, "height: ellipsoidal", "ellipsoid: {a: 6378137, b: 6356752}", "project.yaml:25:16:", "geocentric"),
    (Y, "output:", "output:\n  crs: local", "project.yaml:28:8: output.crs:", "local"),
    (Y, "output:", "output:\n  axes: [x, y, z]", "project.yaml:28:9: output.axes:", "east, north, up"),
]
FILES_NAMED = [
    (Y, "control.csv", "contrl.csv", "project.yaml:22:11:", "contrl.csv does not exist", "`control.csv`"),
    (Y, "control.csv", "no/control.csv", "project.yaml:22:11:", "no folder `"),
    (Y, "control.csv", ".", "project.yaml:22:11:", "is a folder"),
    (Y, "control.csv", "project.yaml/a.csv", "project.yaml:22:11:", "does not exist"),
    (Y, "observations.csv", "/dev/zero", "project.yaml:17:9:", "/dev/zero is a device or a pipe"),
    (Y, "control.csv", "a" * 300, "project.yaml:22:11:", "cannot be read"),
    (Y, "photostrip: 1", "photostrip: 1\nextends: no.yaml", "project.yaml:2:10: extends:", "no.yaml does not exist"),
    (Y, "photostrip: 1", "photostrip: 1\nextends: ../configs/a.yaml", "project.yaml:2:10:", "no folder", "source tree"),
    (Y, "photostrip: 1", "photostrip: 1\nextends: [a, b]", "project.yaml:2:10:", "only one file"),
    (Y, "photostrip: 1", "photostrip: 1\nextends:", "project.yaml:2:9:", "no value is given"),
    (Y, "photostrip: 1", "photostrip: 1\nextends: ./project.yaml", "project.yaml:2:10:", "extends itself"),
]
TABLES = [
    (P, "photo,point,x,y", "photo,point,x", "observations.csv:1: y:", "no column `y`", "found: photo, point, x"),
    (P, "photo,point,x,y", "photo,pont,x,y", "observations.csv:1: point:", "no column `point`", "did you mean `pont`?"),
    (P, "photo,point,x,y", "photo;point;x;y", "observations.csv:1:", "separated by semicolons", "commas"),
    (P, "photo,point,x,y", "photo\tpoint\tx\ty", "observations.csv:1:", "separated by tabs"),
    (P, "photo,point,x,y\n", "", "observations.csv:1:", "is not a header", "photo,point,x,y"),
    (P, "photo,point,x,y", "photo,point,x,y,s_x", "observations.csv:1:17: s_x:", "did you mean `sx`?"),
    (P, "photo,point,x,y", "photo,point,x,y,sigma", "observations.csv:1:17: sigma:", "use the columns sx, sy"),
    (P, "photo,point,x,y", "photo,point,x,y,x", "observations.csv:1:13: x:", "twice in the header"),
    (P, "-20.25", "-20,25", "observations.csv:2:", "5 fields, the header 4", "decimal points"),
    (P, "10.5,-20.25", "10.5", "observations.csv:2:", "3 fields, the header 4"),
    (P, "1001,P1,10.5,-20.25", "1001;P1;10,5;-20,25", "observations.csv:2:", "the row has 3 fields"),
    (P, "-20.25", '"-20,25"', "observations.csv:2:14: y:", "decimal comma", "write -20.25"),
    (P, "-20.25", "−20.25", "observations.csv:2:14: y:", "ASCII", "write -20.25"),
    (P, "-20.25", "２0.25", "observations.csv:2:14: y:", "ASCII", "write 20.25"),
    (P, "-20.25", "-2_0.25", "observations.csv:2:14: y:", "underscore"),
    (P, "-20.25", "1 000.5", "observations.csv:2:14: y:", "digits in groups"),
    (P, "-20.25", "nan", "observations.csv:2:14: y:", "not a measured value"),
    (P, "-20.25", "-inf", "observations.csv:2:14: y:", "not a measured value"),
    (P, "-20.25", "1e400", "observations.csv:2:14: y:", "too large"),
    (P, "-20.25", "0x10", "observations.csv:2:14: y:", "not a number"),
    (P, "-20.25", "-20.25mm", "observations.csv:2:14: y:", "unit in it"),
    (P, "-20.25", "20°15", "observations.csv:2:14: y:", "decimal degrees"),
    (P, "-20.25", "", "observations.csv:2:14: y:", "no value is given"),
    (P, "-20.25", "  ", "observations.csv:2:", "no value is given"),
    (P, "1001,P1", ",P1", "observations.csv:2:1: photo:", "the photo has no id"),
    (P, "1001,P1", "1001,", "observations.csv:2:6: point:", "the point has no id"),
    (P, "1001,P1", '1001,"P\n1"', "observations.csv:2:6: point:", "control character"),
    (P, "1001,P1", '"1001,P1', "observations.csv:2:", "never closed"),
    (P, "1001,P1", '"10"01,P1', "observations.csv:2:", "closing quotation mark"),
    (P, "1001,P2", "1001,P1", "observations.csv:3:6: point:", "P1 is already measured on photo 1001", "line 2"),
    (P, "1001,P2", "1001, P1", "observations.csv:3:7: point:", "P1 is already measured on photo 1001"),
    (Y, "  sigma: 0.005\n", "", "observations.csv:2: sx:", "8 rows have no standard deviation", "observations.sigma"),
    (C, "xyz", "xyy", "control.csv:2:32: use:", "one of xyz, xy, z, off", "did you mean"),
    (C, "control\n", "chek\n", "control.csv:2:36: role:", "did you mean `check`?"),
    (C, "212.31", "", "control.csv:2:25: z:", "G1 has no z", "use is xyz"),
    (C, "P2", "G1", "control.csv:3:1: point:", "G1 is already given in control.csv:2"),
    (C, "500100.12", "500100.12 m", "control.csv:2:4: x:", "unit in it"),
    (C, "500100.12", "500 100.12", "control.csv:2:4: x:", "digits in groups"),
    (Y, SIGMA, "", "control.csv:2: sx:", "no standard deviation for G1", "sigma: [sx, sy, sz]"),
]
MARKS = [
    (F, "1001,F1", "1001,F3", "fiducials.csv:2:6: mark:", "camera RC30 has no mark F3", "one of F1, F2"),
    (F, "1001,F2", "1001,F1", "fiducials.csv:3:6: mark:", "F1 is already measured on photo 1001"),
    (F, "mark", "point", "fiducials.csv:1: mark:", "no column `mark`"),
    (F, "2002,F1,106.1,-106\n2002,F2,-105.9,-106\n", "", "project.yaml:16:20:", "no fiducial mark on photo 2002"),
    (Y, "    fiducials: {F1: [106, -106], F2: [-106, -106]}\n", "", "project.yaml:5:5:", "camera RC30 has none"),
    (Y, ", F2: [-106, -106]", "", "project.yaml:8:16: cameras.RC30.fiducials:", "one mark alone"),
    (Y, "  y_axis: up", "  origin: center", "project.yaml:20:11: observations.origin:", "means nothing here"),
    (Y, "{file: fiducials.csv}", "{file: fiducials.csv, unit: px}", "project.yaml:5:5:", "has no pixel_size"),
    (Y, "fiducials.csv}", "fiducials.csv, unit: um}", "fiducials.csv:2: sx:", "fiducial_measurements.sigma"),
]
ONE_FAULT = [*YAML_SYNTAX, *YAML_MANNERS, *SCHEMA, *REFERENCES, *FRAMES, *FILES_NAMED, *TABLES]


@pytest.mark.parametrize("case", ONE_FAULT)
def test_a_wrong_project_is_explained(project: Sample, case: tuple[str, ...]) -> None:
    project.refuses(*case)


@pytest.mark.parametrize("case", MARKS)
def test_wrong_fiducial_marks_are_explained(marked: Sample, case: tuple[str, ...]) -> None:
    marked.refuses(*case)


@pytest.mark.parametrize("files", [FILES, MARKED_FILES])
def test_the_samples_are_right(tmp_path: Path, files: dict[str, str]) -> None:
    assert sample(tmp_path, files).lines() == []
    assert (files is FILES) or ("fiducials" in MARKED)


# ten copies of ten copies and so on: a file of 200 characters that would fill any memory
LAUGHS = b"a0: &a0 [1]\n" + b"".join(
    b"a%d: &a%d [%s]\n" % (n, n, b",".join([b"*a%d" % (n - 1)] * 10)) for n in range(1, 10)
)


@pytest.mark.parametrize(
    ("content", "place", "words"),
    [
        (b"", "project.yaml:", "is empty"),
        (b"# nothing but a comment\n", "project.yaml:", "no content"),
        (b"- a\n- b\n", "project.yaml:1:1:", "a list"),
        (b"just text\n", "project.yaml:1:1:", "a single value"),
        (b"photostrip: 1\nname: caf\xe9\n", "project.yaml:2:10:", "0xe9 is not UTF-8"),
        ("photostrip: 1\n".encode("utf-16"), "project.yaml:", "UTF-16"),
        (b"photostrip: 1\0\n", "project.yaml:", "NUL"),
        (b"PK\x03\x04rest", "project.yaml:", "spreadsheet"),
        (b"a: " + b"[" * 100 + b"]" * 100, "project.yaml:1:23:", "nested more than 20 deep"),
        (b"a: [" + b"1," * 100_000 + b"1]", "project.yaml:", "more than 100000 values"),
        (LAUGHS, "project.yaml:", "more than 100000 values"),
    ],
)
def test_what_is_no_project_is_refused(project: Sample, content: bytes, place: str, words: str) -> None:
    project.write("project.yaml", content)
    project.tells(place, words)


def test_a_project_that_is_too_big_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "project.yaml"
    with path.open("wb") as stream:
        stream.truncate(11_000_000)  # a hole: it takes no room
    with pytest.raises(InputError, match=r"has 11 MB; expected at most 10 MB"):
        load_project(path)


def test_a_missing_project_names_its_neighbour(project: Sample) -> None:
    with pytest.raises(InputError, match=r"projct\.yaml: does not exist; did you mean `project\.yaml`\?"):
        load_project(project.folder / "projct.yaml")
    with pytest.raises(InputError, match=r"is a folder; expected a file; did you mean `.*/project\.yaml`\?"):
        load_project(project.folder)


def test_faults_of_all_files_come_together(marked: Sample) -> None:
    marked.change(Y, "name: sample", "nmae: sample\nnmae: twice", "153.217", "153,217", "EPSG:32633", "EPSG:99999")
    marked.change(P, "-20.25", "-20,25", "-79.5", "x")
    marked.change(F, "2002,F1", "2002,F7")
    marked.change(C, "xyz", "yes")
    starts = [line.partition(" ")[0] for line in marked.lines()]
    assert starts == [
        "project.yaml:2:1:",
        "project.yaml:3:1:",
        "project.yaml:6:25:",
        "project.yaml:26:10:",
        "observations.csv:2:",
        "observations.csv:5:9:",
        "fiducials.csv:8:6:",
        "control.csv:2:32:",
    ]


def test_the_same_point_in_two_control_lists_is_refused(project: Sample) -> None:
    project.change("project.yaml", "output:", SECOND_LIST)
    project.write("second.csv", "point,x,y,z\nN1,1,2,3\nG1,4,5,6\n")
    assert project.lines() == [
        "second.csv:3:1: point: point G1 is already given in control.csv:2; keep one, or set use to off in the other"
    ]
    project.change("control.csv", "xyz", "off")
    assert project.lines() == []


def test_a_wrong_export_is_told_once_and_counted(project: Sample) -> None:
    rows = "".join(f"1001,N{i},{i};5,0\n" for i in range(5000))
    project.write("observations.csv", "photo,point,x,y\n" + rows)
    lines = project.lines()
    assert len([line for line in lines if line.startswith("observations.csv:")]) == 201
    assert "observations.csv: and 4800 more faults in this file" in lines


def test_no_photo_of_the_strips_is_measured(project: Sample) -> None:
    table = "photo,point,x,y\nIMG_1.tif,P1,1,2\nIMG_2.tif,P1,1,2\n"
    project.write("observations.csv", table)
    message = "observations.csv has no point on any photo of the strips; its photos are IMG_1.tif, IMG_2.tif"
    fix = "write the ids of the photos the same way in both files"
    assert project.lines() == [f"project.yaml:10:3: strips: {message}; {fix}"]


def test_a_photo_under_another_name_is_suggested(project: Sample) -> None:
    text = (project.folder / "observations.csv").read_text(encoding="utf-8").replace("2002,", "2002.TIF,")
    project.write("observations.csv", text)
    assert project.lines() == [
        "project.yaml:15:20: strips[1].photos[1]: observations.csv has no point on photo 2002; did you mean `2002.TIF`?"
    ]


@pytest.mark.parametrize(
    ("texts", "keys"),
    [
        (
            ("  unit: mm\n  y_axis: up\n", "  unit: px\n", "    format: [230, 230]\n", ""),
            ["cameras.RC30.pixel_size", "cameras.RC30.format", "observations.y_axis"],
        ),
        (("  unit: mm\n", "  unit: mm\n  origin: first-pixel\n"), ["cameras.RC30.pixel_size"]),
    ],
)
def test_pixels_ask_for_everything_they_need(project: Sample, texts: tuple[str, ...], keys: list[str]) -> None:
    project.change(Y, *texts)
    assert [fault.key for fault in project.faults()] == keys


def test_duplicate_keys_do_not_hide_other_faults(project: Sample) -> None:
    project.change(Y, "name: sample", "name: a\nname: b", "unit: mm", "unit: cm")
    assert [fault.code for fault in project.faults()] == ["duplicate-key", "word"]
