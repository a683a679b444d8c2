"""The centre of the distortion goes with the principal point that is estimated."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

import photostrip

if TYPE_CHECKING:
    from pathlib import Path

TRUE = (0.10, -0.06)
SPEC: dict[str, Any] = {
    "seed": 3,
    "flight": {"photos": 8, "strips": 4, "flying_height": 100, "end_lap_percent": 75, "side_lap_percent": 60},
    "terrain": {"relief": 20},
    "control": {"layout": "random", "count": 8, "sigma": [0.005, 0.005, 0.005], "check": 40},
    "ground": {"crs": "local"},
    "image": {"unit": "px", "y_axis": "down", "sigma_um": 1.0},
}


def calibrated(folder: Path, direction: str, given: tuple[float, float]) -> dict[str, Any]:
    """Adjust a block whose certificate has another principal point than its camera, and ask for it."""
    lens = {"model": "brown", "k": [-1.2e-3, 1e-5, 0], "p": [1e-4, -2e-4], "direction": direction}
    camera = {"preset": "digital", "principal_distance": 8.8, "principal_point": list(TRUE), "format": [13.2, 8.8],
              "pixel_size": 0.0024, "distortion": lens}  # fmt: skip
    photostrip.simulate({**SPEC, "camera": camera}).write(folder)
    path = folder / "project.yaml"
    text = path.read_text(encoding="utf-8").replace(f"principal_point: {list(TRUE)}", f"principal_point: {list(given)}")
    assert f"principal_point: {list(given)}" in text
    text += "processing: {adjustment: bundle, self_calibration: [principal_point]}\n"
    path.write_text(text, encoding="utf-8")
    return photostrip.run(path).document


@pytest.mark.parametrize("direction", ["ideal_to_image", "image_to_ideal"])
def test_a_certificate_125_pixels_off_costs_nothing(tmp_path: Path, direction: str) -> None:
    known = calibrated(tmp_path / "known", direction, TRUE)
    found = calibrated(tmp_path / "found", direction, (-0.2, 0.2))
    # residuals are those of image points without the given distortion, which lay elsewhere: weights differ by 0.5 %
    assert found["bundle"]["sigma0"] == pytest.approx(known["bundle"]["sigma0"], abs=5e-4)
    values = [each["value"] for each in found["bundle"]["calibration"]]
    expected = [each["value"] for each in known["bundle"]["calibration"]]
    assert values == pytest.approx([0.3 + expected[0], -0.26 + expected[1]], abs=2e-4)  # half a standard deviation
    for name in "xyz":
        at = [each[name] for each in found["points"]]
        assert at == pytest.approx([each[name] for each in known["points"]], abs=1e-3)
