"""Cameras in pixels in a project file."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

import photostrip
from photostrip.project.check import check_project

if TYPE_CHECKING:
    from pathlib import Path

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


def project(folder: Path, given_as: str = "", **changes: object) -> Path:
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
        path.write_text("\n".join([before.rstrip(), *lines, rest[rest.index("strips:") :]]), encoding="utf-8")
    return path


@pytest.mark.parametrize("convention", IN_PIXELS)
def test_the_result_is_that_of_the_same_camera_in_millimetres(tmp_path: Path, convention: str) -> None:
    known = photostrip.run(project(tmp_path / "mm"))
    found = photostrip.run(project(tmp_path / "px", convention))
    for name in "xyz":
        assert [each[name] for each in found.document["points"]] == pytest.approx(
            [each[name] for each in known.document["points"]], abs=2e-4
        )


def test_the_size_of_a_pixel_changes_micrometres_only(tmp_path: Path) -> None:
    known = photostrip.run(project(tmp_path / "small", "opencv"))
    found = photostrip.run(project(tmp_path / "large", "opencv", pixel_size=0.0024))
    ratio = found.document["summary"]["image_rms_um"] / known.document["summary"]["image_rms_um"]
    assert ratio == pytest.approx(2.4, rel=0.1)  # rounded to 0.1 µm
    one, other = ([each["z"] for each in result.document["points"]] for result in (known, found))
    assert one == pytest.approx(other, abs=2e-4)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"convention": "opencvv"}, "cameras.digital.convention: `opencvv` is not known"),
        ({"focal_length": "[1, 2, 3]"}, "cameras.digital.focal_length: a list is given here"),
        ({"focal_length": 0}, "cameras.digital.focal_length: 0 is out of range"),
        ({"distortion": "{k4: 0.1}"}, "cameras.digital.distortion: the coefficient k4 of opencv has no counterpart"),
        ({"distortion": "{q1: 0.1}"}, "cameras.digital.distortion: the coefficient q1 of opencv has no counterpart"),
        ({"format": "[1, 1]"}, "cameras.digital.format: the key `format` is not known"),
    ],
)
def test_faults_have_their_place(tmp_path: Path, changes: dict[str, object], told: str) -> None:
    faults = check_project(project(tmp_path, "opencv", **changes)).faults
    assert len(faults) == 1
    assert told in str(faults[0])
    assert faults[0].line


def test_a_camera_in_pixels_needs_measurements_in_pixels(tmp_path: Path) -> None:
    path = project(tmp_path, "opencv")
    text = path.read_text(encoding="utf-8").replace("unit: px\n  y_axis", "unit: mm\n  y_axis")
    path.write_text(text, encoding="utf-8")
    (fault,) = [each for each in check_project(path).faults if each.code == "unit-elsewhere"]
    assert "is given in pixels, the image coordinates are not" in fault.message
