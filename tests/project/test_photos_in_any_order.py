"""Photos that are listed in no order: how a project gives them their cameras, and what is wrong with one."""

import json
from pathlib import Path

import pytest

from photostrip.cli.main import main
from photostrip.formats.result_json import read_result
from photostrip.project.loading import Project
from tests.project.samples import FILES, OBSERVATIONS, PROJECT, P, Sample, Y, sample
from tests.results import spec, write_project

STRIPS = PROJECT[PROJECT.index("strips:") : PROJECT.index("observations:")]
SECOND = "  - id: B\n    camera: RC30\n    photos: [2001, 2002]\n"
TWO_CAMERAS = "  RC30: {principal_distance: 153}\n  RMK: {principal_distance: 152}\n"


def with_photos(folder: Path, photos: str, strips: str = "") -> Sample:
    """The sample with `photos` beside some strips, or in place of all."""
    return sample(folder, {**FILES, "project.yaml": PROJECT.replace(STRIPS, f"{strips}photos: {photos}\n")})


def flights(project: Project) -> list[tuple[str, tuple[str, ...], bool]]:
    return [(strip.id, strip.photos, strip.listed) for strip in project.inputs.strips]


ALL = [(name, (name,), False) for name in ("1001", "1002", "2001", "2002")]


@pytest.mark.parametrize(
    "photos",
    [
        "{camera: RC30}",
        "[{camera: RC30}]",
        "{camera: RC30, photos: [2002, 1001, 2001, 1002]}",
        "\n  - {camera: RC30, photos: [2001]}\n  - camera: RC30\n",
    ],
)
def test_one_camera_and_many(tmp_path: Path, photos: str) -> None:
    assert flights(with_photos(tmp_path, photos).load()) == ALL


def test_those_that_no_strip_has_are_the_rest(tmp_path: Path) -> None:
    strips = STRIPS.replace(SECOND, "")
    project = with_photos(tmp_path, "{camera: RC30}", strips).load()
    assert flights(project) == [("A", ("1001", "1002"), True), *ALL[2:]]
    assert {note.code for note in project.hints}.isdisjoint({"photo-in-no-strip", "unused-camera"})


def test_ids_are_counted_as_people_count(tmp_path: Path) -> None:
    project = with_photos(tmp_path, "{camera: RC30}")
    project.write(P, OBSERVATIONS.replace("1001", "A10").replace("2002", "A9"))
    assert [name for name, _, _ in flights(project.load())] == ["1002", "2001", "A9", "A10"]


def test_each_group_has_its_camera(tmp_path: Path) -> None:
    project = with_photos(tmp_path, "[{camera: RMK, photos: [1002]}, {camera: RC30}]")
    project.change(Y, PROJECT[PROJECT.index("  RC30:") : PROJECT.index("strips:")], TWO_CAMERAS)
    loaded = project.load()
    assert [strip.camera.name for strip in loaded.inputs.strips] == ["RC30", "RMK", "RC30", "RC30"]


def test_the_resolved_project_lists_them_and_reads_as_the_same(tmp_path: Path) -> None:
    project = with_photos(tmp_path, "{camera: RC30}")
    assert 'photos: ["1001", "1002", "2001", "2002"]' in project.reads_as_the_same()
    assert flights(project.load()) == ALL


# What `photos` is, beside which strips, where the fault begins, and words that it must have.
WRONG = [
    ("{camra: RC30}", "", "project.yaml:9:10: photos.camra:", "not known", "did you mean `camera`?"),
    ("{photos: [1001]}", "", "project.yaml:9:9: photos.camera:", "`camera` is missing"),
    ("{camera: RC3}", "", "project.yaml:9:18: photos.camera:", "there is no camera `RC3`", "did you mean `RC30`?"),
    ("[{camera: RC30, photos: [1001]}, {camera: X}]", "", "project.yaml:9:51: photos[1].camera:", "no camera `X`"),
    ("[]", "", "project.yaml:9:9: photos:", "there is no photo", "at least 1 photo"),
    ("{camera: RC30, photos: []}", "", "project.yaml:9:32: photos.photos:", "there is no photo"),
    ("", "", "project.yaml:9:8: photos:", "no value is given"),
    ("RC30", "", "project.yaml:9:9: photos:", "a single value is given here", "a list"),
    ("[1001, 1002]", "", "project.yaml:9:10: photos[0]:", "a single value is given here", "a mapping"),
    ("{camera: RC30, photos: [1001, 1001]}", "", "project.yaml:9:39: photos.photos[1]:", "already listed, in `photos`"),
    ("{camera: RC30, photos: [1001]}", STRIPS, "project.yaml:16:33: photos.photos[0]:", "already listed, in strip A"),
    ("{camera: RC30, photos: [1003]}", "", "project.yaml:9:33: photos.photos[0]:", "no point on photo 1003", "remove"),
    ("[{camera: RC30}, {camera: RC30}]", "", "project.yaml:9:26: photos[1]:", "second entry", "list its photos"),
    (
        "{camera: RC30}",
        "strips:\n" + SECOND.replace("B", "1001"),
        "project.yaml:13:18: photos.camera:",
        "has the id of a strip",
    ),
]


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_with_photos(tmp_path: Path, case: tuple[str, ...]) -> None:
    photos, strips, place, *words = case
    with_photos(tmp_path, photos, strips).tells(place, *words)


def test_without_photos_of_any_kind(tmp_path: Path) -> None:
    project = sample(tmp_path, {**FILES, "project.yaml": PROJECT.replace(STRIPS, "")})
    missing = "project.yaml:1:1: strips: `strips` is missing; expected photos in flight order by strips;"
    project.tells(missing, alone=True)
    project.change(Y, "name: sample", "stripes: []")
    project.tells("", "stripes: the key `stripes` is not known; did you mean `strips`?", alone=True)


def test_methods_that_need_strips_are_refused(tmp_path: Path) -> None:
    message = "processing.adjustment: photos in no given order need the bundle adjustment"
    cure = "expected auto or bundle; or list the photos in flight order in `strips`"
    with_photos(tmp_path, "{camera: RC30}").tells("", message, cure, overrides=["processing.adjustment=polynomial"])


def test_a_drift_of_photos_in_no_order_needs_times(tmp_path: Path) -> None:
    project = with_photos(tmp_path, "{camera: RC30}")
    positions = "camera_positions: {file: gnss.csv, crs: local, axes: [east, north, up], sigma: [1, 1, 1]}\ncontrol:"
    project.change(Y, "control:", positions.replace("]}", "], correction: drift}"), "EPSG:32633", "local")
    project.write("gnss.csv", "photo,x,y,z\n1001,1,2,3\n1002,1,2,3\n")
    message = "camera_positions.correction: a drift of photos in no given order needs times"
    project.tells("", message, "; fill its column time, or write `correction: offset`", alone=True)
    project.write("gnss.csv", "photo,x,y,z,time\n1001,1,2,3,1\n1002,1,2,3,2\n")
    assert project.lines() == []


def test_check_counts_photos_in_no_order_and_names_one_that_hangs_on_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    project = with_photos(tmp_path, "{camera: RC30}", STRIPS.replace(SECOND, ""))
    more = "".join(f"{photo},N{n},{10 * n},{n * n}\n" for photo in ("1001", "1002", "2001") for n in range(8))
    project.write(P, OBSERVATIONS + more)
    assert main(["check", str(tmp_path / "project.yaml"), "--format", "json"]) == 2
    (found,) = json.loads(capsys.readouterr().out)["projects"]
    assert found["counts"]["strips"] == 1
    assert found["counts"]["in_no_order"] == 2
    (fault,) = [each for each in found["findings"] if each["severity"] == "error"]
    assert fault["message"].startswith("photo 2002 has 2 points of the control or of other photos")
    assert main(["check", str(tmp_path / "project.yaml")]) == 2
    assert "2 in 1 strip, 2 in no given order" in capsys.readouterr().out


def test_a_folder_of_photos_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """On the command line: two lines of five photos, of which the report tells what was found."""
    project = write_project(tmp_path, spec(strips=2))
    text = project.read_text(encoding="utf-8")
    strips = text[text.index("strips:") : text.index("observations:")]
    project.write_text(text.replace(strips, "photos: {camera: film}\n"), encoding="utf-8")
    assert main(["run", str(project), "-o", str(tmp_path / "out"), "--html"]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "10 in 2 strips, 8 models" in printed
    assert "10 photos in no given order: 2 strips found among them, 1001-1005 (5 photos), 2001-2005" in printed
    photos = read_result(str(tmp_path / "out" / "result.json"))["photos"]
    assert [photo["strip"] for photo in photos] == ["1001-1005"] * 5 + ["2001-2005"] * 5
