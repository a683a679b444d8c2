"""Terrestrial projects: what they mean, and every way in which they can be wrong, with its place."""

# ruff: noqa: E501 (a message stands on one line, as the user reads it)
import zipfile
from pathlib import Path

import numpy as np
import pytest

from photostrip.errors import InputError
from photostrip.project.reading import read_keys
from photostrip.project.terrestrial import CamerasFile, known_presets, load_survey
from photostrip.terrestrial.monitoring import monitor
from photostrip.terrestrial.normal_case import Phototheodolite
from tests.loops import nonempty
from tests.terrestrial.simulated import CENTERS, TRUTH, coordinates, project, pseudo_parallaxes, write
from tests.test_packaging import build


def read_presets(file: str) -> dict[str, Phototheodolite]:
    _, reading = read_keys(CamerasFile, None, [f"presets={file}"])
    known = known_presets(reading)
    reading.findings.stop()
    return known


EPOCHS = "epochs: [{id: epoch 0, time: 0}, {id: epoch 1, time: 1}, {id: epoch 2, time: 2}]\n"


def faults(path: Path, *overrides: str) -> list[str]:
    """Give what is wrong with a project, without the folder."""
    with pytest.raises(InputError) as caught:
        load_survey(path, overrides)
    assert caught.value.exit_code == 2
    return [str(fault).replace(f"{path.parent}/", "") for fault in caught.value.faults]


def replaced(old: str, new: str) -> str:
    text = project()
    assert text.count(old) >= 1, old
    return text.replace(old, new, 1)


def test_a_project_says_what_was_simulated(tmp_path: Path) -> None:
    survey = load_survey(write(tmp_path))
    truth = TRUTH.measure(1)
    np.testing.assert_allclose(survey.pair.rotations, TRUTH.pair.rotations, atol=1e-12)
    np.testing.assert_allclose(survey.pair.centers, CENTERS)
    assert survey.pair.principal_distances == (190.0, 100.0)
    np.testing.assert_allclose(survey.series.coordinates, truth.coordinates, atol=5.1e-5)  # four decimals
    np.testing.assert_allclose(survey.series.of_epoch, 0.005**2)
    assert survey.series.points == truth.points
    assert survey.series.epochs == truth.epochs
    assert survey.series.stable.tolist() == [True] * 6 + [False] * 6
    assert survey.series.times is not None
    assert survey.series.times.tolist() == [0, 1, 2]
    assert [camera.name for camera in survey.cameras] == ["long", "wide"]
    assert (survey.frame.axes, survey.frame.order, survey.name) == (("east", "north", "up"), (0, 1, 2), "quarry")
    assert [file.rpartition("/")[2] for file in survey.files] == ["survey.yaml", "coordinates.csv"]
    assert survey.notes == ()


def test_pseudo_parallaxes_and_coordinates_give_the_same_displacements(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    first = load_survey(write(tmp_path / "a", table=coordinates(decimals=9)))
    text = replaced("coordinates: coordinates.csv", "pseudo_parallaxes: pseudo.csv")
    text = text.replace("sigma: 0.005", f"sigma: 0.005, sigma_d: {0.005 * 2**0.5}")
    second = load_survey(write(tmp_path / "b", text, pseudo_parallaxes(), "pseudo.csv"))
    np.testing.assert_allclose(second.series.coordinates, first.series.coordinates, atol=1e-8)
    assert (second.series.of_epoch[0] == 0).all()
    np.testing.assert_allclose(second.series.shared, 0.005**2)
    one = monitor(first.series, first.pair, first.settings)
    two = monitor(second.series, second.pair, second.settings)
    np.testing.assert_allclose(two.positions[0].values, one.positions[0].values, atol=1e-6)
    # the turns and the meeting of rays weigh the same measurements alike, so the displacements agree
    np.testing.assert_allclose(two.since_first[0].values, one.since_first[0].values, atol=1e-5)
    np.testing.assert_allclose(two.since_first[0].sigma, one.since_first[0].sigma, rtol=0.01)


def test_north_first_axes_gon_micrometres_and_z_downwards(tmp_path: Path) -> None:
    rows = [line.split(",") for line in coordinates(decimals=9).splitlines()]
    table = [rows[0], *([*row[:3], f"{float(row[3]) * 1e3:.6f}", f"{-float(row[4]) * 1e3:.6f}"] for row in rows[1:])]
    text = project("gon").replace("[east, north, up]", "[north, east, up]\nangle_unit: gon")
    text = text.replace("[1000.0, 2000.0, 150.0]", "[2000.0, 1000.0, 150.0]")
    text = text.replace("[1040.0, 2005.0, 152.0]", "[2005.0, 1040.0, 152.0]")
    text = text.replace("unit: mm, sigma: 0.005", "unit: um, z_axis: down, sigma: 5")
    path = write(tmp_path, text, "\n".join(map(",".join, table)) + "\n")
    survey = load_survey(path)
    np.testing.assert_allclose(survey.pair.rotations, TRUTH.pair.rotations, atol=1e-12)
    np.testing.assert_allclose(survey.pair.centers, CENTERS)
    np.testing.assert_allclose(survey.series.coordinates, TRUTH.measure(1).coordinates, atol=1e-8)
    np.testing.assert_allclose(survey.series.of_epoch, 0.005**2)
    assert survey.frame.order == (1, 0, 2)


def test_principal_points_are_taken_off(tmp_path: Path) -> None:
    text = replaced("principal_distance: 190.0,", "principal_distance: 190.0, principal_point: [0.1, -0.2],")
    survey = load_survey(write(tmp_path, text))
    plain = TRUTH.measure(1).coordinates - np.array([0.1, -0.2, 0, 0])
    np.testing.assert_allclose(survey.series.coordinates, plain, atol=5.1e-5)


def test_standard_deviations_of_rows_count_before_that_of_the_project(tmp_path: Path) -> None:
    lines = coordinates().splitlines()
    lines[0] += ",sx,sz"
    lines[1:] = [line + ",," for line in lines[1:]]
    lines[1] = lines[1][:-2] + ",0.01,0.02"
    survey = load_survey(write(tmp_path, table="\n".join(lines) + "\n"))
    np.testing.assert_allclose(survey.series.of_epoch[0, 0], [0.01**2, 0.02**2, 0.005**2, 0.005**2])


def test_epochs_may_be_left_out_or_named_in_another_order(tmp_path: Path) -> None:
    survey = load_survey(write(tmp_path, replaced(EPOCHS, "")))
    assert survey.series.epochs == ("epoch 0", "epoch 1", "epoch 2")
    assert survey.series.times is None
    survey = load_survey(write(tmp_path, replaced(EPOCHS, "epochs: [epoch 2, epoch 0]\n")))
    assert survey.series.epochs == ("epoch 2", "epoch 0")
    (note,) = survey.notes
    assert "24 rows of epochs that the project does not name: epoch 1" in note.message


def test_overrides_and_extends(tmp_path: Path) -> None:
    path = write(tmp_path)
    survey = load_survey(path, ["processing.significance=0.01", "processing.moved_camera=never"])
    assert (survey.settings.significance, survey.settings.moved_camera) == (0.01, "never")
    (child := tmp_path / "child.yaml").write_text("extends: survey.yaml\nname: child\n", encoding="utf-8")
    survey = load_survey(child)
    assert survey.name == "child"
    assert len(survey.files) == 3


NORMAL = """\
photostrip_terrestrial: 1
cameras: {A: {principal_distance: 1000}}
stations: {left: {camera: A}, right: {camera: A}}
base: 50
measurements: {pseudo_parallaxes: pseudo.csv, unit: mm, sigma: 0.005}
"""
PSEUDO = "point,x,z,p,dx,dz,dx_right\n1,30,-12,80,0.35,-0.2,0.1\n"


def test_the_normal_case_reproduces_the_published_form(tmp_path: Path) -> None:
    survey = load_survey(write(tmp_path, NORMAL, PSEUDO, "pseudo.csv"))
    assert survey.frame.axes == ("right", "ahead", "up")
    assert survey.series.epochs == ("first", "second")
    result = monitor(survey.series, survey.pair, survey.settings)
    np.testing.assert_allclose(result.positions[0].values[0], [18.75, 625.0, -7.5], rtol=1e-12)
    np.testing.assert_allclose(
        result.since_first[0].values[0], [0.15965732087227413, -1.9470404984423673, -0.10124610591900313], rtol=1e-10
    )
    np.testing.assert_allclose(  # those of the source, and what errors of the reference photos add to a displacement
        result.since_first[0].sigma[0], [0.0022672490109924693, 0.0548990620189282, 0.0031864501687681726], rtol=1e-3
    )


def test_reference_coordinates_may_stand_once(tmp_path: Path) -> None:
    table = "point,epoch,x,z,p,dx,dz,dx_right\n1,b,30,-12,80,0.35,-0.2,0.1\n1,c,,,,0.4,-0.3,0.1\n"
    survey = load_survey(write(tmp_path, NORMAL, table, "pseudo.csv"))
    np.testing.assert_allclose(survey.series.coordinates[:, 0, 0], [30.0, 30.35, 30.4])


def test_the_cameras_of_the_source_are_there() -> None:
    known = known_presets()
    assert (known["Photheo 19/1318"].principal_distance, known["UMK 10/1318"].principal_distance) == (190.0, 100.0)
    assert known["UMK 10/1318"].format == (160.0, 120.0)


@pytest.mark.slow
def test_the_list_of_cameras_is_installed_with_the_program(tmp_path: Path) -> None:
    with zipfile.ZipFile(build("wheel", tmp_path)) as wheel:
        assert "photostrip/terrestrial/phototheodolites.yaml" in wheel.namelist()


PRESETS = """\
photostrip_cameras: 1
cameras:
  P32: {principal_distance: 64.12, principal_point: [0.01, 0.02], format: [80, 60]}
  UMK 10/1318: {principal_distance: 99.07}
"""


def test_a_list_of_the_user_adds_and_replaces(tmp_path: Path) -> None:
    (file := tmp_path / "mine.yaml").write_text(PRESETS, encoding="utf-8")
    known = read_presets(str(file))
    assert list(known) == ["Photheo 19/1318", "UMK 10/1318", "P32"]
    assert known["UMK 10/1318"].principal_distance == 99.07
    assert known["P32"].principal_point == (0.01, 0.02)
    text = replaced("name: quarry", "name: quarry\npresets: mine.yaml").replace("190.0, format: [160, 120]", "64.12")
    survey = load_survey(write(tmp_path, text))
    assert survey.cameras[1].principal_distance == 99.07
    assert [each.rpartition("/")[2] for each in survey.files] == ["survey.yaml", "mine.yaml", "coordinates.csv"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("cameras: {}\n", ["mine.yaml:1:1: photostrip_cameras: `photostrip_cameras` is missing", "there is no camera"]),
        (
            "photostrip_cameras: 2\ncameras: {A: {principal_distance: 1}}\n",
            ["mine.yaml:1:21: photostrip_cameras: this"],
        ),
        (
            "photostrip_cameras: 1\ncameras:\n  A: {principal_distance: -3}\n  B: {principal_distanc: 3}\n",
            ["mine.yaml:3:27: cameras.A.principal_distance: -3 is out of range", "mine.yaml:4:", "did you mean"],
        ),
        ("photostrip_cameras: 1\ncameras: {A: {principal_distance: 1, format: [1]}}\n", ["1 value in the list"]),
        ("- a\n", ["the file holds a list"]),
    ],
)
def test_a_wrong_list_is_told_with_its_place(tmp_path: Path, text: str, expected: list[str]) -> None:
    (file := tmp_path / "mine.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_presets(str(file))
    told = str(caught.value)
    for part in nonempty(expected):
        assert part in told


VALUES = [
    ("terrestrial: 1", "terrestrial: 2", "survey.yaml:1:25: photostrip_terrestrial: this version of photostrip does not read schema 2; expected photostrip_terrestrial: 1"),
    ("camera: long", "camera: lnog", "survey.yaml:8:18: stations.left.camera: there is no camera `lnog`; expected one of long, wide; did you mean `long`?"),
    ("preset: UMK 10/1318", "preset: UMK 10", "survey.yaml:5:18: cameras.wide.preset: there is no preset `UMK 10`; expected one of Photheo 19/1318, UMK 10/1318; did you mean `UMK 10/1318`?"),
    ("{preset: UMK 10/1318}", "{principal_point: [0, 0]}", "survey.yaml:5:9: cameras.wide: nothing says what the camera is; expected `preset`, or `principal_distance` in mm"),
    ("axes: [east, north, up]\n", "", "survey.yaml:1:1: nothing says which coordinate of a station is east; expected axes: [east, north, up], or [north, east, up] where x points north"),
    ("[east, north, up]", "[x, y, z]", "survey.yaml:6:7: axes: the axes of the stations are not on the ground; expected a permutation of [east, north, up]"),
    ("[east, north, up]", "[east, up, up]", "survey.yaml:6:7: axes: [east, up, up] does not say which column is which"),
    ("axes: [east, north, up]", "axes: [east, north, up]\nbase: 40", "survey.yaml:7:7: base: the base follows from the positions of the stations; remove it"),
    ("position: [1000.0, 2000.0, 150.0], ", "", "survey.yaml:8:9: stations.left: `alpha` is given and `position` is not; expected both, or neither in the normal case"),
    ("150.0]", "150.0m]", "survey.yaml:8:51: stations.left.position[2]: `150.0m` has a unit in it; expected a number; write the number alone: 150.0"),
    ("time: 1}", "time: 3}", "survey.yaml:10:78: epochs[2].time: the time 2 is not later than that of the epoch before, 3; expected ascending times"),
    ("{id: epoch 1, time: 1}", "epoch 1", "survey.yaml:10:34: epochs[1]: the epoch has no time, others have; give all epochs a time, or none"),
    ("id: epoch 1,", "id: epoch 3,", "survey.yaml:10:34: epochs[1]: coordinates.csv has no measurement of epoch epoch 3; did you mean `epoch 1`?"),
    ("id: epoch 1,", "id: epoch 0,", "survey.yaml:10:9: epochs: epoch epoch 0 is named 2 times; remove one"),
    ("P5]", "P55]", "survey.yaml:12:30: stable[5]: coordinates.csv has no point P55; did you mean `P5`?"),
    (", sigma: 0.005", "", "coordinates.csv:2: sx: 72 rows have no standard deviation (sx, sz), and none is given for all; set `measurements.sigma` in the project, or fill the column sx, sz"),
    ("sigma: 0.005", "sigma: 0.005, sigma_d: 1", "survey.yaml:11:79: measurements.sigma_d: coordinates have no pseudo-parallaxes that could have a standard deviation; remove it; use `sigma`"),
    ("coordinates: coordinates.csv, ", "", "survey.yaml:11:15: measurements: no table is named; expected either `coordinates` or `pseudo_parallaxes`"),
    ("coordinates: c", "pseudo_parallaxes: p.csv, coordinates: c", "survey.yaml:11:15: measurements: two tables are named; expected either `coordinates` or `pseudo_parallaxes`"),
    ("coordinates.csv", "coordinate.csv", "survey.yaml:11:29: measurements.coordinates: coordinate.csv does not exist; did you mean `coordinates.csv`?"),
    ("name: quarry", "presets: mine.yaml", "survey.yaml:2:10: presets: mine.yaml does not exist"),
]  # fmt: skip


TABLE = coordinates().splitlines()


def table(line: int, text: str) -> str:
    return "\n".join([*TABLE[: line - 1], *([text] if text else []), *TABLE[line:]]) + "\n"


ROWS = [
    (table(1, "epoch,photo,point,x"), "coordinates.csv:1: z: there is no column `z`"),
    (table(3, "epoch 0,middle,P0,1,2"), "coordinates.csv:3:9: photo: `middle` is not known; expected one of left, right"),
    (table(3, "epoch 0,left,P0,1,2"), "coordinates.csv:3:14: point: point P0 stands in line 2 already for the same photo and epoch; keep one of the two, or give one another id"),
    (table(4, "epoch 0,left,P1,1,5;3"), "coordinates.csv:4:19: z: `5;3` is not a number; expected a number"),
    (table(4, "epoch 0,left,,1,5"), "coordinates.csv:4:14: point: the point has no id; expected an id on one line"),
    ("\n".join(TABLE[:25]) + "\n", "survey.yaml:10:34: epochs[1]: coordinates.csv has no measurement of epoch epoch 1; its epochs are epoch 0"),
    ("", "survey.yaml:11:29: measurements.coordinates: coordinates.csv is empty"),
]  # fmt: skip
OF_NORMAL_CASE = [
    (NORMAL, "point,x,z,p,dx,dz\n1,1,1,1,1,1\n", "pseudo.csv:1: dx_right: there is no column `dx_right`"),
    (NORMAL, "point,x,z,p,dx,dz,dx_right\n1,1,,5,1,1,1\n", "pseudo.csv:2:5: z: z of point 1 stands in no row; expected a number"),
    (NORMAL, "point,x,z,p,dx,dz,dx_right\n1,1,1,5,1,1,1\n1,1,1,5,1,1,1\n", "pseudo.csv:3:1: point: point 1 stands in line 2 already; keep one of the two, or give one another id"),
    (NORMAL, "point,epoch,x,z,p,dx,dz,dx_right\n1,b,1,1,5,1,1,1\n1,c,2,,,1,1,1\n", "pseudo.csv:3:5: x: x of point 1 is 1 in line 2, here 2; write the coordinates of the reference epoch once, or alike"),
    (NORMAL + "epochs: [a, b]\n", "point,epoch,x,z,p,dx,dz,dx_right\n1,a,1,1,5,1,1,1\n", "pseudo.csv:2:3: epoch: epoch a is the reference, against which pseudo-parallaxes are measured"),
    (NORMAL + "epochs: [a]\n", PSEUDO, "survey.yaml:6:9: epochs: the list has only one epoch, a; expected two or more"),
    (NORMAL.replace(", sigma: 0.005", ""), PSEUDO, "pseudo.csv:2: sigma: 1 row has no standard deviation (sigma), and none is given for all"),
    (NORMAL.replace("base: 50\n", ""), PSEUDO, "survey.yaml:1:1: nothing says how far apart the stations are; expected `base` for the normal case, or position and alpha of both stations"),
    (NORMAL.replace("base: 50", "base: 50\naxes: [east, north, up]"), PSEUDO, "survey.yaml:5:7: axes: the normal case has axes of its own: right, ahead, up; remove it"),
    (NORMAL.replace("left: {camera: A}", "left: {camera: A, omega: 3}"), PSEUDO, "survey.yaml:3:18: stations.left: angles are given without a position; expected position and alpha too"),
    (NORMAL.replace("left: {camera: A}", "left: {camera: A, position: [1, 2, 3], alpha: 3}"), PSEUDO, "survey.yaml:3:11: stations: the right station has no position; expected both or none"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("files", "expected"),
    [
        *(((replaced(old, new),), expected) for old, new, expected in VALUES),
        *(((project(), content), expected) for content, expected in ROWS),
        *(((text, content, "pseudo.csv"), expected) for text, content, expected in OF_NORMAL_CASE),
    ],
)
def test_what_is_wrong_is_told_with_its_place(tmp_path: Path, files: tuple[str, ...], expected: str) -> None:
    told = faults(write(tmp_path, *files))
    assert any(each.startswith(expected) for each in told), told


def test_faults_of_the_project_and_of_its_table_are_told_together(tmp_path: Path) -> None:
    told = faults(write(tmp_path, replaced("name: quarry", "nmae: quarry"), table(4, "epoch 0,left,P1,1,x")))
    assert [each.partition(":")[0] for each in told] == ["survey.yaml", "coordinates.csv"]


def test_one_epoch_in_the_table_is_too_few(tmp_path: Path) -> None:
    told = faults(write(tmp_path, replaced(EPOCHS, ""), "\n".join(TABLE[:25]) + "\n"))
    assert told == [
        "survey.yaml:10:29: measurements.coordinates: coordinates.csv has only one epoch, epoch 0; expected two or more"
    ]
