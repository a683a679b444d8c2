"""Projects of model coordinates: what is read, and every way to get it wrong, with message and place."""

from pathlib import Path

import numpy as np
import pytest

from photostrip.errors import InputError
from photostrip.pipeline.run import triangulate
from photostrip.project.check import check_project
from photostrip.project.loading import load_project
from tests.loops import nonempty
from tests.project.samples import Sample, sample

PROJECT = """\
photostrip: 1
name: plotted
strips:
  - id: A
    photos: [1, 2, 3]
models:
  file: models.csv
  unit: mm
  sigma: [0.01, 0.01, 0.02]
control:
  - file: control.csv
    crs: local
    axes: [east, north, up]
    sigma: [0.05, 0.05, 0.05]
"""
# ground in metres, times 0.1 mm: models are turned by 0 and 90 degrees about the vertical
GROUND = {
    "A1": (0, 500, 10), "A2": (0, 0, 20), "A3": (0, -500, 5), "B1": (900, 520, 0), "B2": (890, 10, 30),
    "B3": (910, -480, 15), "C1": (1800, 500, 10), "C2": (1790, 0, 0), "C3": (1810, -500, 40),
}  # fmt: skip
CENTERS = {"1": (0, 0, 1500), "2": (900, 0, 1510), "3": (1800, 0, 1490)}


def table(header: str = "model,point,x,y,z") -> str:
    rows = [header]
    for model, points, photos in (("12", "AB", "12"), ("23", "BC", "23")):
        here = {**{k: v for k, v in GROUND.items() if k[0] in points}, **{k: CENTERS[k] for k in photos}}
        for name, (x, y, z) in here.items():
            turned = (x, y, z) if model == "12" else (-y, x, z)
            rows.append(f"{model},{name}," + ",".join(f"{0.1 * value:.6f}" for value in turned))
    return "\n".join(rows) + "\n"


MODELS = table()
CONTROL = "point,x,y,z\n" + "".join(f"{k},{x},{y},{z}\n" for k, (x, y, z) in GROUND.items() if k[0] != "B")
FILES = {"project.yaml": PROJECT, "models.csv": MODELS, "control.csv": CONTROL}
P, M, C = "project.yaml", "models.csv", "control.csv"
CENTER_ROWS = [line for line in MODELS.splitlines() if line.split(",")[1] in CENTERS]


def test_the_sample_is_right(tmp_path: Path) -> None:
    project = sample(tmp_path, FILES).load()
    assert project.inputs.models is not None
    (strip,) = project.inputs.models.strips
    assert (strip.photos, strip.models) == (("1", "2", "3"), ("12", "23"))
    points = project.inputs.models.points
    assert (len(points), points.photo_ids) == (16, ("1", "2", "3"))
    assert points.sigma[0].tolist() == [0.01, 0.01, 0.02]
    result = triangulate(project.inputs, project.settings)
    for name, xyz in nonempty(zip(result.refined.observations.point_ids, result.points.ground, strict=True)):
        assert np.abs(xyz - GROUND[name]).max() < 1e-4  # the table has six decimals
    assert check_project(tmp_path / P).everything == ()


@pytest.mark.parametrize(("unit", "factor"), [("um", 1e-3), ("m", 1e3)])
def test_units(tmp_path: Path, unit: str, factor: float) -> None:
    found = sample(tmp_path, {**FILES, P: PROJECT.replace("unit: mm", f"unit: {unit}")}).load().inputs.models
    plain = sample(tmp_path, FILES).load().inputs.models
    assert found is not None
    assert plain is not None
    np.testing.assert_allclose(found.points.xyz, plain.points.xyz * factor, rtol=1e-12)
    np.testing.assert_allclose(found.points.sigma, plain.points.sigma * factor, rtol=1e-12)


def test_covariances_become_correlations_in_the_axes_of_the_models(tmp_path: Path) -> None:
    text = PROJECT.replace("  sigma: [0.01, 0.01, 0.02]\n", "  sigma: [0.01, 0.02, 0.03]\n  axes: left-handed\n")
    lines = [line + ",0.01,0.02,0.03,0.0001,,-0.0003" for line in MODELS.splitlines()[1:]]
    header = "model,point,x,y,z,sx,sy,sz,cov_xy,cov_xz,cov_yz"
    models = sample(tmp_path, {**FILES, P: text, M: "\n".join([header, *lines]) + "\n"}).load().inputs.models
    assert models is not None
    assert models.points.correlation is not None
    expected = [[1.0, -0.5, 0.0], [-0.5, 1.0, 0.5], [0.0, 0.5, 1.0]]  # y is turned over
    np.testing.assert_allclose(models.points.correlation, np.tile(expected, (16, 1, 1)))


@pytest.mark.parametrize(
    ("cells", "words"), [("0.01,0.02,0.03,0.0002,,", "is not positive"), (",,,0.0001,,", "no standard deviations")]
)
def test_covariances_of_no_coordinates_are_refused(tmp_path: Path, cells: str, words: str) -> None:
    lines = MODELS.splitlines()
    lines[0] += ",sx,sy,sz,cov_xy,cov_xz,cov_yz"
    lines[1:] = [line + ",,,,,," for line in lines[1:]]
    lines[3] = MODELS.splitlines()[3] + "," + cells
    with pytest.raises(InputError, match=words) as told:
        sample(tmp_path, {**FILES, M: "\n".join(lines) + "\n"}).load()
    assert [(fault.code, fault.line) for fault in told.value.faults] == [("wrong-covariance", 4)]


def test_left_handed_axes_are_turned_over(tmp_path: Path) -> None:
    lines = MODELS.splitlines()
    exchanged = [lines[0], *(f"{m},{p},{y},{x},{z}" for m, p, x, y, z in (line.split(",") for line in lines[1:]))]
    text = PROJECT.replace("unit: mm", "unit: mm\n  axes: left-handed")
    project = sample(tmp_path, {**FILES, P: text, M: "\n".join(exchanged) + "\n"}).load()
    result = triangulate(project.inputs, project.settings)
    assert np.abs(result.control_differences).max() < 1e-4


def test_centers_in_a_table_of_their_own(tmp_path: Path) -> None:
    rest = "\n".join(line for line in MODELS.splitlines() if line not in CENTER_ROWS) + "\n"
    text = PROJECT.replace(
        "  unit: mm", "  centers: {file: centers.csv}\n  center_sigma: [0.03, 0.03, 0.04]\n  unit: mm"
    )
    centers = "\n".join(["model,photo,x,y,z", *CENTER_ROWS]) + "\n"
    apart = sample(tmp_path, {**FILES, P: text, M: rest, "centers.csv": centers}).load().inputs.models
    together = sample(tmp_path / "other", FILES).load().inputs.models
    assert apart is not None
    assert together is not None
    assert sorted(apart.points.node.tolist()) == sorted(together.points.node.tolist())
    assert apart.points.sigma[apart.points.node >= 9].tolist() == [[0.03, 0.03, 0.04]] * 4


def test_the_resolved_project_reads_as_the_same(tmp_path: Path) -> None:
    text = PROJECT.replace("photos: [1, 2, 3]", "photos: [1, 2, 3]\n    models: ['12', '23']")
    first = sample(tmp_path, {**FILES, P: text}).load()
    assert "links:" in first.resolved
    assert "relative:" not in first.resolved
    (tmp_path / P).write_text(first.resolved, encoding="utf-8")
    assert Sample(tmp_path).load().resolved == first.resolved


def test_other_names_of_columns_and_rows_of_their_own(tmp_path: Path) -> None:
    text = PROJECT.replace("  unit: mm", "  columns: {point: Punkt, z: H}\n  unit: mm").replace(
        "  sigma: [0.01, 0.01, 0.02]\n", ""
    )
    lines = table("model,Punkt,x,y,H").splitlines()
    own = [f"{lines[0]},sx,sy,sz", *(f"{line},0.01,0.02,0.03" for line in lines[1:])]
    found = sample(tmp_path, {**FILES, P: text, M: "\n".join(own) + "\n"}).load().inputs.models
    assert found is not None
    assert found.points.sigma[3].tolist() == [0.01, 0.02, 0.03]
    told = check_project(tmp_path / P).document["model_sigma"]
    assert (told["rows_with_own"], told["rows_with_default"]) == (len(lines) - 1, 0)


def blocks() -> str:
    lines: list[str] = []
    for model in ("12", "23"):
        rows = [line.split(",")[1:] for line in MODELS.splitlines() if line.startswith(f"{model},")]
        lines += [f"{model} ", *("  ".join([*row, "1"]) for row in rows), "-99"]
    return "\n".join(lines) + "\n"


def test_a_file_of_blocks_is_the_same(tmp_path: Path) -> None:
    given = sample(tmp_path, {**FILES, M: blocks()}).load().inputs.models
    plain = sample(tmp_path / "plain", FILES).load().inputs.models
    assert given is not None
    assert plain is not None
    assert given.points.xyz.tolist() == plain.points.xyz.tolist()
    assert given.points.node.tolist() == plain.points.node.tolist()


def test_faults_of_blocks_have_their_line(tmp_path: Path) -> None:
    with pytest.raises(InputError) as told:
        sample(tmp_path, {**FILES, M: blocks().replace("B2  89.000000", "B2  89,0")}).load()
    lines = blocks().splitlines()
    assert {fault.line for fault in told.value.faults} == {
        k for k, line in enumerate(lines, 1) if line.startswith("B2  89")
    }


def without(*starts: str) -> str:
    return "\n".join(line for line in MODELS.splitlines() if not line.startswith(starts)) + "\n"


FAULTS = [
    ("missing file", {M: None}, "file-missing", "project.yaml:7:9", "models.file"),
    ("empty", {M: ""}, "file-empty", "project.yaml:7:9", "models.csv is empty"),
    ("header alone", {M: "model,point,x,y,z\n"}, "no-rows", "models.csv:1", "no rows"),
    ("binary", {M: "\x00\x01\x02PK"}, "binary", "project.yaml:7:9", "NUL bytes"),
    ("truncated", {M: MODELS[:-30]}, "row-length", "models.csv:17", "fields"),
    ("no number", {M: MODELS.replace("50.000000", "nan", 1)}, "number", "models.csv:2:", "not a measured value"),
    ("a comma", {M: MODELS.replace("0.000000,50.000000", '0.000000,"50,0"', 1)}, "number", "models.csv:2:", "50,0"),
    ("column missing", {M: table("model,point,x,y,h")}, "missing-column", "models.csv:1", "`z`"),
    (
        "a point twice",
        {M: MODELS + "23,C1,1,2,3\n"},
        "measured-twice",
        "models.csv:18:4",
        "already measured in model 23, in line 13",
    ),
    ("a model twice", {M: MODELS + without("model", "12")}, "model-twice", "models.csv:18", "model 23 appears twice"),
    ("unknown key", {P: PROJECT.replace("unit: mm", "unit: mm\n  scal: 3")}, "unknown-key", "project.yaml:9:3", "scal"),
    ("unit", {P: PROJECT.replace("unit: mm", "unit: cm")}, "word", "project.yaml:8:9", "cm"),
    ("no unit", {P: PROJECT.replace("  unit: mm\n", "")}, "missing-key", "project.yaml", "`unit` is missing"),
    ("axes", {P: PROJECT.replace("unit: mm", "unit: mm\n  axes: up")}, "word", "project.yaml:9:9", "right-handed"),
    ("no sigma", {P: PROJECT.replace("  sigma: [0.01, 0.01, 0.02]\n", "")}, "no-sigma", "models.csv:2", "models.sigma"),
    ("sigma 0", {P: PROJECT.replace("[0.01, 0.01, 0.02]", "[0.01, 0, 0.02]")}, "range", "project.yaml:9:17", "larger"),
    ("alpha", {P: PROJECT + "processing: {links: {alpha: 2}}\n"}, "range", "project.yaml:15:29", "between 0 and 1"),
    ("no center", {M: without("12,2,")}, "no-model", "project.yaml:5:17", "photos 1 and 2"),
    ("another center", {M: MODELS.replace("12,2,", "12,3,")}, "no-model", "project.yaml:5:17", "photos 1 and 2"),
    ("three centers", {M: MODELS + "23,1,5,5,5\n"}, "too-many-centers", "models.csv:18", "3 perspective centres"),
    (
        "two models of a pair",
        {M: MODELS + "9,2,1,2,3\n9,3,1,2,4\n9,B1,3,3,3\n"},
        "model-twice",
        "project.yaml:5:20",
        "models 23, 9 have the perspective centres",
    ),
    (
        "images as well",
        {P: PROJECT + "observations: {file: a.csv, unit: mm, sigma: 1}\n", "a.csv": "photo,point,x,y\n1,A1,0,0\n"},
        "photos-and-models",
        "project.yaml:15",
        "exclude each other",
    ),
    (
        "refraction",
        {P: PROJECT + "processing: {refraction: true}\n"},
        "needs-image-coordinates",
        "project.yaml:15",
        "refr",
    ),
    (
        "first photo",
        {P: PROJECT.replace("id: A\n", "id: A\n    first_photo: {base: 92}\n", 1)},
        "needs-image-coordinates",
        "project.yaml:",
        "first_photo",
    ),
]


@pytest.mark.parametrize(("files", "code", "place", "words"), [each[1:] for each in FAULTS], ids=[f[0] for f in FAULTS])
def test_what_is_refused(tmp_path: Path, files: dict[str, str | None], code: str, place: str, words: str) -> None:
    given = {name: text for name, text in {**FILES, **files}.items() if text is not None}
    tmp_path.mkdir(exist_ok=True)
    for name, text in given.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as told:
        load_project(tmp_path / P)
    found = [fault for fault in told.value.faults if fault.code == code]
    assert found, [str(fault) for fault in told.value.faults]
    text = str(found[0]).replace(f"{tmp_path}/", "")
    assert text.startswith(place), text
    assert words in text


LISTED = "photos: [1, 2, 3]\n    models: {}"


@pytest.mark.parametrize(
    ("models", "code", "words"),
    [
        ("['23', '12']", "wrong-center", "is listed between photos 1 and 2, and has the perspective centre of 3"),
        ("['12']", "length", "1 model listed for 3 photos"),
        ("['12', '32']", "unknown-model", "model 32 is not measured"),
        ("['12', '12']", "model-twice", "model 12 appears twice in the strips"),
    ],
)
def test_models_that_are_listed_wrongly(tmp_path: Path, models: str, code: str, words: str) -> None:
    text = PROJECT.replace("photos: [1, 2, 3]", LISTED.format(models))
    with pytest.raises(InputError) as told:
        sample(tmp_path, {**FILES, P: text}).load()
    assert [fault.code for fault in told.value.faults if words in fault.message] == [code]


def test_the_keys_of_images_are_still_asked_for(tmp_path: Path) -> None:
    text = PROJECT.replace("models:\n  file: models.csv\n  unit: mm\n  sigma: [0.01, 0.01, 0.02]\n", "")
    with pytest.raises(InputError) as told:
        sample(tmp_path, {**FILES, P: text}).load()
    missing = {fault.key for fault in told.value.faults if fault.code == "missing-key"}
    assert missing == {"cameras", "observations", "strips[0].camera"}


def test_what_is_not_used_is_told(tmp_path: Path) -> None:
    models = MODELS + "77,A1,1,2,3\n"
    control = CONTROL + "X9,1,2,3\n"
    project = sample(tmp_path, {**FILES, M: models, C: control}).load()
    codes = {note.code: note.message for note in project.hints}
    assert "77" in codes["model-in-no-strip"]
    assert "not measured in any model: X9" in codes["control-not-measured"]
    rows = check_project(tmp_path / P).document["rows"]
    assert [(each["rows"], each["used"]) for each in rows] == [(17, 16), (7, 6)]


@pytest.mark.parametrize(
    ("models", "code"),
    [
        (without("23,B2", "23,B3", "23,2"), "broken-link"),
        (MODELS.replace("23,2,", "23,Q,"), "no-model"),
    ],
)
def test_check_tells_links_that_cannot_be(tmp_path: Path, models: str, code: str) -> None:
    text = PROJECT.replace("photos: [1, 2, 3]", "photos: [1, 2, 3]\n    models: ['12', '23']")
    if code == "no-model":
        text = PROJECT
    sample(tmp_path, {**FILES, P: text, M: models})
    assert code in {fault.code for fault in check_project(tmp_path / P).faults}


def test_check_tells_models_whose_link_no_equation_gives(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows of pure noise may lead there."""

    def singular(*_: object) -> None:
        raise np.linalg.LinAlgError("Singular matrix")

    monkeypatch.setattr("photostrip.strip.linked_models.np.linalg.inv", singular)
    sample(tmp_path, FILES)
    (fault,) = check_project(tmp_path / P).faults
    assert fault.code == "singular"
    assert "cannot be linked" in fault.message


def test_a_check_tells_rows_with_and_without_standard_deviations_of_their_own(tmp_path: Path) -> None:
    rows = MODELS.splitlines()
    own = [f"{row},0.02,0.02,0.03" if number in {1, 4, 5} else f"{row},,," for number, row in enumerate(rows)]
    own[0] = "model,point,x,y,z,sx,sy,sz"
    sample(tmp_path, FILES | {M: "\n".join(own) + "\n"})
    told = check_project(tmp_path / P).document["model_sigma"]
    assert (told["rows_with_own"], told["rows_with_default"]) == (3, len(rows) - 1 - 3)


@pytest.mark.parametrize(("height_only", "enough"), [("C1", True), ("", False)])
def test_two_points_in_plan_and_three_in_height_are_enough(tmp_path: Path, *, height_only: str, enough: bool) -> None:
    rows = [f"{row},xyz" for row in CONTROL.splitlines() if row[:2] in {"A1", "C3"}]
    rows += [f"{row},z" for row in CONTROL.splitlines() if row[:2] == height_only]
    sample(tmp_path, FILES | {C: "\n".join(["point,x,y,z,use", *rows]) + "\n"})
    codes = {fault.code for fault in check_project(tmp_path / P).faults}
    assert ("too-little-control" not in codes) is enough
