"""k0 of a certificate: the directions of rays are those of its whole polynomial."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.strip.corrections import ideal_from_image
from tests.project.samples import sample

if TYPE_CHECKING:
    from pathlib import Path

F, K0, K, P = 153.217, -3.1e-3, (2.4e-7, -3.0e-12, 5.0e-17), (1.1e-6, -2.3e-6)
XY = np.random.default_rng(3).uniform(-105.0, 105.0, (50, 2))


def polynomial(xy: np.ndarray) -> np.ndarray:
    """The shift as USGS writes it: X (K0 + K1 r^2 + ...) + P1 (r^2 + 2 X^2) + 2 P2 X Y."""
    x, y = xy.T
    r2 = x * x + y * y
    radial = K0 + K[0] * r2 + K[1] * r2**2 + K[2] * r2**3
    decentring = P[0] * (r2 + 2 * x * x) + 2 * P[1] * x * y, P[1] * (r2 + 2 * y * y) + 2 * P[0] * x * y
    return np.column_stack([x * radial + decentring[0], y * radial + decentring[1]])


@pytest.mark.parametrize("direction", ["image_to_ideal", "ideal_to_image"])
def test_rays_have_the_directions_of_the_certificate(tmp_path: Path, direction: str) -> None:
    project = sample(tmp_path)
    lens = f"{{model: brown, k0: {K0}, k: {list(K)}, p: {list(P)}, direction: {direction}}}"
    project.change("project.yaml", "{model: brown, k: [1e-8, 0, 0], direction: image_to_ideal}", lens)
    loaded = project.load()
    camera = loaded.inputs.strips[0].camera
    assert camera.distortion is not None
    ideal, image = (XY + polynomial(XY), XY) if direction == "image_to_ideal" else (XY, XY + polynomial(XY))
    found = ideal_from_image(image, camera.distortion) / camera.principal_distance
    np.testing.assert_allclose(found, ideal / F, rtol=0.0, atol=1e-13)
    (note,) = [each for each in loaded.hints if each.code == "linear-distortion"]
    assert f"153.217 mm becomes {camera.principal_distance:.6g} mm" in note.message
    assert (note.line, note.key) == (8, "cameras.RC30.distortion.k0")
    assert f"k0: {K0}" in loaded.resolved


@pytest.mark.parametrize(
    ("lens", "words"),
    [
        ("{model: brown, k0: 1.5, direction: image_to_ideal}", "1.5 is out of range"),
        (
            "{model: radial-table, k0: 1e-4, radius: [0, 9], distortion: [0, 0], direction: image_to_ideal}",
            "`k0` does not belong to model radial-table",
        ),
    ],
)
def test_what_is_no_k0_is_refused(tmp_path: Path, lens: str, words: str) -> None:
    project = sample(tmp_path)
    project.change("project.yaml", "{model: brown, k: [1e-8, 0, 0], direction: image_to_ideal}", lens)
    (line,) = project.lines()
    assert line.startswith("project.yaml:8:")
    assert words in line
