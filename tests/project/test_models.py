"""Projects of model coordinates: what is read, and every way to get it wrong, with message and place."""

from pathlib import Path

import numpy as np
import pytest

from photostrip.pipeline.run import triangulate
from photostrip.points import ModelPoints
from photostrip.project.check import check_project
from tests.loops import nonempty
from tests.project.samples import sample

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


REFUSED = "needs-image-coordinates"
PLAIN_SIGMA, IMAGES = "  sigma: [0.01, 0.01, 0.02]\n", "observations: {file: a.csv, unit: mm, sigma: 1}\n"


def said(*texts: str) -> dict[str, str]:
    """The project with texts replaced, each by the one after it."""
    text = PROJECT
    for old, new in zip(texts[::2], texts[1::2], strict=True):
        assert old in text
        text = text.replace(old, new)
    return {P: text}


def listing(models: str) -> dict[str, str]:
    """The project with the models of its strip listed."""
    return said("photos: [1, 2, 3]", f"photos: [1, 2, 3]\n    models: {models}")


def measured(folder: Path, files: dict[str, str] | None = None) -> ModelPoints:
    """Load the project with some files in place of others."""
    models = sample(folder, FILES | (files or {})).load().inputs.models
    assert models is not None
    return models.points


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
    found, plain = measured(tmp_path, said("unit: mm", f"unit: {unit}")), measured(tmp_path)
    np.testing.assert_allclose(found.xyz, plain.xyz * factor, rtol=1e-12)
    np.testing.assert_allclose(found.sigma, plain.sigma * factor, rtol=1e-12)


def test_covariances_become_correlations_in_the_axes_of_the_models(tmp_path: Path) -> None:
    project = said(PLAIN_SIGMA, "  sigma: [0.01, 0.02, 0.03]\n  axes: left-handed\n")
    lines = [line + ",0.01,0.02,0.03,0.0001,,-0.0003" for line in MODELS.splitlines()[1:]]
    header = "model,point,x,y,z,sx,sy,sz,cov_xy,cov_xz,cov_yz"
    found = measured(tmp_path, {**project, M: "\n".join([header, *lines]) + "\n"}).correlation
    assert found is not None
    expected = [[1.0, -0.5, 0.0], [-0.5, 1.0, 0.5], [0.0, 0.5, 1.0]]  # y is turned over
    np.testing.assert_allclose(found, np.tile(expected, (16, 1, 1)))


@pytest.mark.parametrize(
    ("cells", "words"), [("0.01,0.02,0.03,0.0002,,", "is not positive"), (",,,0.0001,,", "no standard deviations")]
)
def test_covariances_of_no_coordinates_are_refused(tmp_path: Path, cells: str, words: str) -> None:
    lines = MODELS.splitlines()
    lines[0] += ",sx,sy,sz,cov_xy,cov_xz,cov_yz"
    lines[1:] = [line + ",,,,,," for line in lines[1:]]
    lines[3] = MODELS.splitlines()[3] + "," + cells
    (fault,) = sample(tmp_path, FILES | {M: "\n".join(lines) + "\n"}).faults()
    assert (fault.code, fault.line, words in fault.message) == ("wrong-covariance", 4, True)


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
    apart = measured(tmp_path, {P: text, M: rest, "centers.csv": centers})
    assert sorted(apart.node.tolist()) == sorted(measured(tmp_path / "other").node.tolist())
    assert apart.sigma[apart.node >= 9].tolist() == [[0.03, 0.03, 0.04]] * 4


def test_the_resolved_project_reads_as_the_same(tmp_path: Path) -> None:
    resolved = sample(tmp_path, FILES | listing("['12', '23']")).reads_as_the_same()
    assert "links:" in resolved
    assert "relative:" not in resolved


def test_other_names_of_columns_and_rows_of_their_own(tmp_path: Path) -> None:
    text = PROJECT.replace("  unit: mm", "  columns: {point: Punkt, z: H}\n  unit: mm").replace(
        "  sigma: [0.01, 0.01, 0.02]\n", ""
    )
    lines = table("model,Punkt,x,y,H").splitlines()
    own = [f"{lines[0]},sx,sy,sz", *(f"{line},0.01,0.02,0.03" for line in lines[1:])]
    assert measured(tmp_path, {P: text, M: "\n".join(own) + "\n"}).sigma[3].tolist() == [0.01, 0.02, 0.03]
    told = check_project(tmp_path / P).document["model_sigma"]
    assert (told["rows_with_own"], told["rows_with_default"]) == (len(lines) - 1, 0)


def blocks() -> str:
    lines: list[str] = []
    for model in ("12", "23"):
        rows = [line.split(",")[1:] for line in MODELS.splitlines() if line.startswith(f"{model},")]
        lines += [f"{model} ", *("  ".join([*row, "1"]) for row in rows), "-99"]
    return "\n".join(lines) + "\n"


def test_a_file_of_blocks_is_the_same(tmp_path: Path) -> None:
    given, plain = measured(tmp_path, {M: blocks()}), measured(tmp_path / "plain")
    assert given.xyz.tolist() == plain.xyz.tolist()
    assert given.node.tolist() == plain.node.tolist()


def test_faults_of_blocks_have_their_line(tmp_path: Path) -> None:
    faults = sample(tmp_path, FILES | {M: blocks().replace("B2  89.000000", "B2  89,0")}).faults()
    lines = enumerate(blocks().splitlines(), 1)
    assert {fault.line for fault in faults} == {number for number, line in lines if line.startswith("B2  89")}


def without(*starts: str) -> str:
    return "\n".join(line for line in MODELS.splitlines() if not line.startswith(starts)) + "\n"


@pytest.mark.parametrize(
    ("files", "code", "place", "words"),
    [
        ({M: "model,point,x,y,z\n"}, "no-rows", "models.csv:1", "no rows"),
        ({M: MODELS[:-30]}, "row-length", "models.csv:17", "fields"),
        ({M: MODELS.replace("50.000000", "nan", 1)}, "number", "models.csv:2:", "not a measured value"),
        ({M: MODELS.replace("0.000000,50.000000", '0.000000,"50,0"', 1)}, "number", "models.csv:2:", "50,0"),
        ({M: table("model,point,x,y,h")}, "missing-column", "models.csv:1", "`z`"),
        ({M: MODELS + "23,C1,1,2,3\n"}, "measured-twice", "models.csv:18:4", "measured in model 23, in line 13"),
        ({M: MODELS + without("model", "12")}, "model-twice", "models.csv:18", "model 23 appears twice"),
        (said("unit: mm", "unit: cm"), "word", "project.yaml:8:9", "cm"),
        (said("  unit: mm\n", ""), "missing-key", "project.yaml", "`unit` is missing"),
        (said("unit: mm", "unit: mm\n  axes: up"), "word", "project.yaml:9:9", "right-handed"),
        (said(PLAIN_SIGMA, ""), "no-sigma", "models.csv:2", "models.sigma"),
        (said("[0.01, 0.01, 0.02]", "[0.01, 0, 0.02]"), "range", "project.yaml:9:17", "larger"),
        ({P: PROJECT + "processing: {links: {alpha: 2}}\n"}, "range", "project.yaml:15:29", "between 0 and 1"),
        ({M: without("12,2,")}, "no-model", "project.yaml:5:17", "photos 1 and 2"),
        ({M: MODELS.replace("12,2,", "12,3,")}, "no-model", "project.yaml:5:17", "photos 1 and 2"),
        ({M: MODELS + "23,1,5,5,5\n"}, "too-many-centers", "models.csv:18", "3 perspective centres"),
        ({M: MODELS + "9,2,1,2,3\n9,3,1,2,4\n9,B1,3,3,3\n"}, "model-twice", "project.yaml:5:20", "models 23, 9 have"),
        (
            {P: PROJECT + IMAGES, "a.csv": "photo,point,x,y\n1,A1,0,0\n"},
            "photos-and-models",
            "project.yaml:15",
            "exclude each other",
        ),
        ({P: PROJECT + "processing: {refraction: true}\n"}, REFUSED, "project.yaml:15", "refraction"),
        (said("id: A\n", "id: A\n    first_photo: {base: 92}\n"), REFUSED, "project.yaml:5:18", "first_photo"),
        (
            listing("['23', '12']"),
            "wrong-center",
            "project.yaml:6",
            "between photos 1 and 2, and has the perspective centre of 3",
        ),
        (listing("['12']"), "length", "project.yaml:6", "1 model listed for 3 photos"),
        (listing("['12', '32']"), "unknown-model", "project.yaml:6", "model 32 is not measured"),
        (listing("['12', '12']"), "model-twice", "project.yaml:6", "model 12 appears twice in the strips"),
    ],
)
def test_what_is_refused(tmp_path: Path, files: dict[str, str], code: str, place: str, words: str) -> None:
    project = sample(tmp_path, FILES | files)
    project.tells(place, words)
    assert code in {fault.code for fault in project.faults()}


def test_the_keys_of_images_are_still_asked_for(tmp_path: Path) -> None:
    project = sample(
        tmp_path, FILES | said("models:\n  file: models.csv\n  unit: mm\n  sigma: [0.01, 0.01, 0.02]\n", "")
    )
    assert {fault.key for fault in project.faults() if fault.code == "missing-key"} == {
        "cameras",
        "observations",
        "strips[0].camera",
    }


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
    [(without("23,B2", "23,B3", "23,2"), "broken-link"), (MODELS.replace("23,2,", "23,Q,"), "no-model")],
)
def test_check_tells_links_that_cannot_be(tmp_path: Path, models: str, code: str) -> None:
    sample(tmp_path, FILES | {M: models} | (listing("['12', '23']") if code == "broken-link" else {}))
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
