"""Cameras in pixels: the same pixels as the other program's own formula gives, and the same numbers back."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.camera import Camera, Distortion
from photostrip.errors import InputError
from photostrip.strip.corrections import image_from_ideal
from photostrip.strip.pixel_cameras import CONVENTIONS, PixelCamera, in_millimetres

if TYPE_CHECKING:
    from photostrip.arrays import Floats

SIZE = (4000.0, 3000.0)
RADIAL, DECENTRING = (-0.11, 0.023, 0.0013), (1.3e-3, -2.1e-3)
PLACES = np.random.default_rng(7).uniform(-0.6, 0.6, (200, 2))  # x to the right, y down, at depth one


def given(convention: str) -> PixelCamera:
    """Give a camera with everything that a convention has."""
    way = CONVENTIONS[convention]
    names = (*way.radial, *way.decentring)
    coefficients = dict(zip(names, (*RADIAL, *DECENTRING), strict=True)) | dict.fromkeys(way.others, 0.0)
    if convention == "metashape":
        coefficients |= {"b1": 1.7, "b2": -0.9}
    focal = {"metashape": (3100.0, 3100.0), "opensfm": (0.77, 0.76)}.get(convention, (3100.0, 3085.0))
    point = {"metashape": (12.5, -7.5), "opensfm": (0.003, -0.002)}.get(convention, (2011.0, 1488.0))
    return PixelCamera(convention, SIZE, focal_length=focal, principal_point=point, distortion=coefficients)


def by_documentation(camera: PixelCamera) -> Floats:
    """Pixels from the corner of the first one, as the documentation of each program writes them."""
    x, y = PLACES.T
    r2 = x * x + y * y
    p1, p2 = DECENTRING
    radial = 1.0 + RADIAL[0] * r2 + RADIAL[1] * r2**2 + RADIAL[2] * r2**3
    (fx, fy), (cx, cy) = camera.focal_length, camera.principal_point
    if camera.convention == "metashape":
        u = x * radial + p1 * (r2 + 2 * x * x) + 2 * p2 * x * y
        v = y * radial + p2 * (r2 + 2 * y * y) + 2 * p1 * x * y
        return np.stack([SIZE[0] * 0.5 + cx + u * fx + u * 1.7 + v * -0.9, SIZE[1] * 0.5 + cy + v * fy], axis=-1)
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    if camera.convention == "opensfm":
        side = max(SIZE)
        return np.stack([(u * fx + cx) * side + SIZE[0] / 2, (v * fy + cy) * side + SIZE[1] / 2], axis=-1)
    half = 0.5 if camera.convention == "opencv" else 0.0
    return np.stack([u * fx + cx + half, v * fy + cy + half], axis=-1)


def by_us(camera: Camera) -> Floats:
    """Pixels from the corner of the first one, by the camera in millimetres."""
    ideal = PLACES * (camera.principal_distance, -camera.principal_distance)
    x, y = (image_from_ideal(ideal, camera.distortion or Distortion("brown", "ideal_to_image"))).T
    x, y = x + camera.principal_point[0], y + camera.principal_point[1]
    b1, b2 = camera.pixel_affinity
    assert camera.pixel_size
    return np.stack([((1 + b1) * x + b2 * y) / camera.pixel_size + SIZE[0] / 2, SIZE[1] / 2 - y / camera.pixel_size]).T


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_pixels_are_those_of_the_documentation(convention: str) -> None:
    camera = given(convention)
    assert by_us(in_millimetres("c", camera, 0.004)) == pytest.approx(by_documentation(camera), abs=1e-9)


@pytest.mark.parametrize(
    ("model", "parameters"),
    [
        ("OPENCV", [3100.0, 3085.0, 2011.0, 1488.0, RADIAL[0], RADIAL[1], *DECENTRING]),
        ("FULL_OPENCV", [3100.0, 3085.0, 2011.0, 1488.0, RADIAL[0], RADIAL[1], *DECENTRING, RADIAL[2], 0.0, 0.0, 0.0]),
    ],
)
def test_pixels_are_those_of_colmap(model: str, parameters: list[float]) -> None:
    import pycolmap

    peer = pycolmap.Camera(model=model, width=4000, height=3000, params=parameters)
    camera = given("colmap")
    if model == "OPENCV":
        camera.distortion["k3"] = 0.0  # type: ignore[index]
    expected = peer.img_from_cam(np.column_stack([PLACES, np.ones(len(PLACES))]))
    assert by_us(in_millimetres("c", camera)) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(("convention", "name"), [("opencv", "k4"), ("colmap", "k6"), ("metashape", "p3")])
def test_what_has_no_counterpart_is_refused_by_name(convention: str, name: str) -> None:
    camera = PixelCamera(convention, SIZE, (3100.0, 3100.0), principal_point=(0.0, 0.0), distortion={name: 0.01})
    with pytest.raises(InputError, match=f"the coefficient {name} of {convention} has no counterpart"):
        in_millimetres("c", camera)
