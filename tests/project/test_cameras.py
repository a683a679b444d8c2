"""Cameras of a project: distances between fiducial marks, k0 of a certificate, cameras in pixels."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import photostrip
from photostrip.cli.main import main
from photostrip.strip.corrections import ideal_from_image
from tests.project.samples import Sample, Y

GIVEN = "    fiducials: {F1: [106, -106], F2: [-106, -106]}\n"
LENS = "{model: brown, k: [1e-8, 0, 0], direction: image_to_ideal}"
PLACES = "    fiducial_places: {F1: bottom-right, F2: bottom-left, F3: top-left, F4: top-right}\n"
SIDES = "[F1, F2, 211.98], [F2, F3, 212.01], [F3, F4, 211.99], [F4, F1, 212.02]"
DIAGONALS = "[F1, F3, 299.82], [F2, F4, 299.80]"


def with_distances(places: str, distances: str) -> tuple[str, str]:
    return GIVEN, f"{places}    fiducial_distances: [{distances}]\n"


def certified(marked: Sample, places: str, distances: str) -> list[str]:
    marked.change(Y, *with_distances(places, distances))
    return marked.lines()


@pytest.mark.parametrize(
    "places",
    [PLACES, "    fiducials: {F1: [106, -106], F2: [-106, -106], F3: [-106, 106], F4: [106, 106]}\n"],
    ids=["places", "nominal coordinates"],
)
def test_the_camera_gets_coordinates_and_their_quality_is_told(marked: Sample, places: str) -> None:
    assert certified(marked, places, f"{SIDES}, {DIAGONALS}") == []
    project = marked.load()
    for name, xy in (("F1", (106.0, -106.0)), ("F3", (-106.0, 106.0)), ("F4", (106.0, 106.0))):
        assert project.inputs.strips[0].camera.fiducials[name] == pytest.approx(xy, abs=0.05)
    (note,) = [note for note in project.hints if note.code == "certificate"]
    assert note.message.startswith("camera RC30: 4 fiducial marks from 6 distances, standard deviation of one ")
    assert (note.severity, note.line) == ("note", 9)


def test_a_distance_that_does_not_fit_is_a_warning(marked: Sample) -> None:
    assert certified(marked, PLACES, f"{SIDES}, {DIAGONALS}".replace("299.80", "301.80")) == []
    (note,) = [note for note in marked.load().hints if note.code == "certificate"]
    assert note.severity == "warning"


FOCAL, K0, RADIAL, DECENTRING = 153.217, -3.1e-3, (2.4e-7, -3.0e-12, 5.0e-17), (1.1e-6, -2.3e-6)
XY = np.random.default_rng(3).uniform(-105.0, 105.0, (50, 2))


def polynomial(xy: np.ndarray) -> np.ndarray:
    """The shift as USGS writes it: X (K0 + K1 r^2 + ...) + P1 (r^2 + 2 X^2) + 2 P2 X Y."""
    x, y = xy.T
    r2 = x * x + y * y
    radial = K0 + RADIAL[0] * r2 + RADIAL[1] * r2**2 + RADIAL[2] * r2**3
    decentring = (
        DECENTRING[0] * (r2 + 2 * x * x) + 2 * DECENTRING[1] * x * y,
        DECENTRING[1] * (r2 + 2 * y * y) + 2 * DECENTRING[0] * x * y,
    )
    return np.column_stack([x * radial + decentring[0], y * radial + decentring[1]])


@pytest.mark.parametrize("direction", ["image_to_ideal", "ideal_to_image"])
def test_rays_have_the_directions_of_the_certificate(project: Sample, direction: str) -> None:
    lens = f"{{model: brown, k0: {K0}, k: {list(RADIAL)}, p: {list(DECENTRING)}, direction: {direction}}}"
    project.change(Y, LENS, lens)
    loaded = project.load()
    camera = loaded.inputs.strips[0].camera
    assert camera.distortion is not None
    ideal, image = (XY + polynomial(XY), XY) if direction == "image_to_ideal" else (XY, XY + polynomial(XY))
    found = ideal_from_image(image, camera.distortion) / camera.principal_distance
    np.testing.assert_allclose(found, ideal / FOCAL, rtol=0.0, atol=1e-13)
    (note,) = [each for each in loaded.hints if each.code == "linear-distortion"]
    assert f"153.217 mm becomes {camera.principal_distance:.6g} mm" in note.message
    assert (note.line, note.key) == (8, "cameras.RC30.distortion.k0")
    assert f"k0: {K0}" in loaded.resolved


TABLE = "{model: radial-table, k0: 1e-4, radius: [0, 9], distortion: [0, 0], direction: image_to_ideal}"


@pytest.mark.parametrize(
    ("texts", "words"),
    [
        (with_distances(PLACES, SIDES), "fiducial_distances: 4 independent distances do not fix a figure of 4 marks"),
        (with_distances(PLACES, f"{SIDES}, [F1, F9, 1.0]"), "RC30.fiducial_distances[4]: the camera has no mark F9"),
        (with_distances(PLACES.replace("top-left", "middle"), SIDES), "fiducial_places.F3: `middle` is not known"),
        (with_distances(PLACES, SIDES.replace("211.98", "-2")), "fiducial_distances[0][2]: -2 is out of range"),
        (with_distances(PLACES, SIDES.replace("211.98", "nan")), "fiducial_distances[0][2]"),
        (with_distances(PLACES, "[F1, F2]"), "fiducial_distances[0]"),
        (with_distances("", SIDES), "distances alone do not say which mark is where"),
        (with_distances(GIVEN + PLACES, SIDES), "places of fiducial marks are for distances between them without"),
        ((LENS, "{model: brown, k0: 1.5, direction: image_to_ideal}"), "RC30.distortion.k0: 1.5 is out of range"),
        ((LENS, TABLE), "RC30.distortion.k0: `k0` does not belong to model radial-table"),
    ],
)
def test_certificates_that_are_wrong(marked: Sample, texts: tuple[str, str], words: str) -> None:
    marked.change(Y, *texts)
    marked.tells("project.yaml:", words)


SPEC = {
    "flight": {"photos": 5, "flying_height": 100},
    "camera": {
        "preset": "digital",
        "principal_distance": 8.8,
        "principal_point": [0.024, -0.012],
        "format": [13.2, 8.8],
        "pixel_size": 0.0024,
        "distortion": {"model": "brown", "k": [-2e-4, 0, 0], "p": [1e-5, -2e-5], "direction": "ideal_to_image"},
    },
    "image": {"unit": "px", "y_axis": "down", "sigma_um": 1.2},
}
K1, P1, P2 = -2e-4 * 8.8**2, 1e-5 * 8.8, 2e-5 * 8.8
IN_PIXELS: dict[str, list[object]] = {  # principal point, distortion of the same camera
    "opencv": [[2750 + 10 - 0.5, 1833 + 1 / 3 + 5 - 0.5], {"k1": K1, "p1": P2, "p2": P1}],
    "metashape": [[10, 5], {"k1": K1, "p1": P1, "p2": P2}],
}


def in_pixels(folder: Path, given_as: str = "", measured: tuple[str, str] = ("", ""), **changes: object) -> Path:
    """Write a simulated project; with a convention its camera is given in pixels."""
    simulation = photostrip.simulate(SPEC)
    simulation.write(folder)
    path = folder / "project.yaml"
    if given_as:
        point, lens = IN_PIXELS[given_as]
        keys = {"unit": "px", "convention": given_as, "image_size": [5500, 3666.6666666666665],
                "focal_length": 8.8 / 0.0024, "principal_point": point, "distortion": lens}  # fmt: skip
        lines = [f"    {name}: {value}".replace("'", "") for name, value in {**keys, **changes}.items()]
        before, _, rest = path.read_text(encoding="utf-8").partition("    principal_distance:")
        text = "\n".join([before.rstrip(), *lines, rest[rest.index("strips:") :]])
        path.write_text(text.replace(*measured), encoding="utf-8")
    return path


@pytest.mark.parametrize("convention", IN_PIXELS)
def test_the_result_is_that_of_the_same_camera_in_millimetres(tmp_path: Path, convention: str) -> None:
    known = photostrip.run(in_pixels(tmp_path / "mm"))
    found = photostrip.run(in_pixels(tmp_path / "px", convention))
    for name in "xyz":
        assert [each[name] for each in found.document["points"]] == pytest.approx(
            [each[name] for each in known.document["points"]], abs=2e-4
        )


def test_the_size_of_a_pixel_changes_micrometres_only(tmp_path: Path) -> None:
    known = photostrip.run(in_pixels(tmp_path / "small", "opencv"))
    found = photostrip.run(in_pixels(tmp_path / "large", "opencv", pixel_size=0.0024))
    ratio = found.document["summary"]["image_rms_um"] / known.document["summary"]["image_rms_um"]
    assert ratio == pytest.approx(2.4, rel=0.1)  # rounded to 0.1 µm
    one, other = ([each["z"] for each in result.document["points"]] for result in (known, found))
    assert one == pytest.approx(other, abs=2e-4)


CORNER = "it is counted from the corner, and the `convention` counts from the middle"
WRONG = [  # what is changed, the exit codes of check and run, what is told
    ({"image_size": "[4000, 3000]"}, 2, "image_size: P101", "`image_size` is [4000, 3000]; ", "give `image_size`"),
    ({"image_size": "[3667, 5500]"}, 2, "image_size: P101", "width and height: `image_size: [5500, 3667]`"),
    ({"convention": "opencvv"}, 2, "cameras.digital.convention: `opencvv` is not known"),
    ({"focal_length": "[1, 2, 3]"}, 2, "cameras.digital.focal_length: a list is given here"),
    ({"focal_length": 0}, 2, "cameras.digital.focal_length: 0 is out of range"),
    ({"distortion": "{k4: 0.1}"}, 2, "cameras.digital.distortion: the coefficient k4 of opencv has no counterpart"),
    ({"distortion": "{q1: 0.1}"}, 2, "cameras.digital.distortion: the coefficient q1 of opencv has no counterpart"),
    ({"format": "[1, 1]"}, 2, "cameras.digital.format: the key `format` is not known"),
    ({"measured": ("unit: px\n  y", "unit: mm\n  y")}, 2, "is given in pixels, the image coordinates are not"),
    ({"focal_length": 8.8}, 2, "focal_length: P105", "8.8 px and a format of 5500 x 3666.67 px", "1740 px to"),
    ({"focal_length": 8.8, "pixel_size": 0.0024}, 2, "focal_length: P105", "is it 3667 px? `focal_length` is in"),
    ({"measured": ("y_axis: down", "y_axis: up")}, 2, "y_axis: P101", "y is counted the other way", "`y_axis: down`"),
    ({"convention": "metashape"}, 2, "principal_point: P111", "lies +2760 px in x and -1838 px in y (up)", CORNER),
    ({"principal_point": "[27500, 18330]"}, 2, "P111", "+24750 px in x and -16497 px in y", "count it from where the"),
    ({"principal_point": "[2100, 1832]"}, 0, "P111", "lies -650 px in x", "`accept: [P111]`"),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "code", "words"), [(changes, code, told) for changes, code, *told in WRONG])
def test_what_is_wrong_is_told_in_pixels(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], changes: dict[str, Any], code: int, words: list[str]
) -> None:
    path = str(in_pixels(tmp_path, "opencv", **changes))
    for command in ("check", "run"):
        assert main([command, path]) in {code, code and 2}
        printed = " ".join("".join(capsys.readouterr()).split())
        assert [word for word in words if word not in printed] == []
        assert "multiplied by 1 " not in printed


def test_no_size_of_a_pixel_is_invented(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, result = in_pixels(tmp_path, "opencv", focal_length=3560), tmp_path / "result"
    assert main(["check", str(path)]) == 0
    assert " 0.5 px; " in capsys.readouterr().out
    assert main(["run", str(path), "-o", str(result), "--verbose"]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert re.findall(r"[0-9] mm|mm\^", printed) == []
    assert "at a principal distance of 3650.8 px (standard deviation 9.7 px); 3560 px is given" in printed
    page = tmp_path / "report.html"
    assert main(["report", str(result), "-o", str(page)]) == 0
    for text in (printed, page.read_text(encoding="utf-8")):
        assert "principal distance 3560 px, principal point 10, -5 px from the middle" in text
        assert "format 5500 x 3666.67 px" in text
        assert "pixels of" not in text
    for name in ("cameras.yaml", "cameras.opencv.yaml", "cameras.metashape.yaml"):
        assert main(["convert", str(result), str(tmp_path / name)]) == 0
        written = (tmp_path / name).read_text(encoding="utf-8")
        assert "px by the calibration" in written
        assert "image_size: [5500, 3666.66" in written
        assert "pixel_size" not in written
