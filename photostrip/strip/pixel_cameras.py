"""Cameras in pixels, as other programs give them, and the same cameras in millimetres.

All of them divide a point of the camera, x to the right, y down, z ahead, by its depth, distort what comes out and
multiply with the focal length. They differ in the order of the two decentring coefficients, in where pixels count from,
and in what is multiplied with what. Millimetres here are pixels times the size of one, y up.

Source: [Brown 1966] for the coefficients; the documentation of each program, docs/files/cameras-in-pixels.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from photostrip.camera import Camera, Distortion
from photostrip.errors import Fault, InputError

PIXEL_SIZE = 0.001  # mm, where nothing says how large a pixel is: a micrometre of a report is a pixel then


class Convention(NamedTuple):
    """What a program calls its coefficients, and how it counts."""

    radial: tuple[str, ...]  # of r^2, r^4, r^6 at focal length one
    decentring: tuple[str, str]
    swapped: bool  # whether the first one bends y: 2 p1 x y + p2 (r^2 + 2 x^2)
    # where the principal point counts from: ``corner`` of the first pixel, ``first-pixel``: its centre, ``middle``
    origin: str
    affine: tuple[str, ...] = ()  # coefficients of an image that is stretched and sheared along x, in pixels
    by_side: bool = False  # whether lengths are parts of the larger side of the photo
    others: tuple[str, ...] = ()  # coefficients that no camera here has: they must be zero


_K, _P = ("k1", "k2", "k3"), ("p1", "p2")
_OPENCV = Convention(_K, _P, swapped=True, origin="first-pixel", others=("k4", "k5", "k6", "s1", "s2", "s3", "s4"))
CONVENTIONS = {
    "opencv": _OPENCV,
    "colmap": _OPENCV._replace(origin="corner", others=("k4", "k5", "k6")),
    "metashape": Convention(_K, _P, swapped=False, origin="middle", affine=("b1", "b2"), others=("k4", "p3", "p4")),
    "opensfm": Convention(_K, _P, swapped=True, origin="middle", by_side=True),
    "pix4d": Convention(("r1", "r2", "r3"), ("t1", "t2"), swapped=True, origin="corner"),
}


@dataclass(frozen=True)
class PixelCamera:
    """A camera as a program that counts in pixels has it."""

    convention: str  # a key of ``CONVENTIONS``
    image_size: tuple[float, float]  # width, height in pixels
    focal_length: tuple[float, float]  # along x and y, in pixels or in parts of the larger side
    principal_point: tuple[float, float]  # x to the right, y down, in the same unit
    distortion: Mapping[str, float] = field(default_factory=dict)  # coefficients by their names there; else zero


def in_millimetres(name: str, given: PixelCamera, pixel_size: float = PIXEL_SIZE) -> Camera:
    """Return a camera in millimetres.

    Different focal lengths, and b1 and b2, are pixels that are no squares: x of the image in millimetres is made from
    pixels so that both axes have the focal length of y. Nothing is neglected.

    Raises InputError for a coefficient that is not zero and that no camera here has.
    """
    way = CONVENTIONS[given.convention]
    known = (*way.radial, *way.decentring, *way.affine)
    for each, value in given.distortion.items():
        if each not in known and (value or each not in way.others):
            message = f"the coefficient {each} of {given.convention} has no counterpart: {', '.join(known)} have"
            fix = "calibrate the camera without it, or take undistorted photos"
            raise InputError(Fault(message, "camera-model", key=f"distortion.{each}", fix=fix))
    side = max(given.image_size) * pixel_size if way.by_side else pixel_size
    fx, fy = (side * each for each in given.focal_length)
    b1, b2 = (given.distortion.get(each, 0.0) * side / fy for each in way.affine or ("", ""))
    affinity = (1.0 + b1) * fx / fy - 1.0, -b2  # y down is y up the other way round
    middle = _middle(given, way)
    x0, y0 = ((each - half) * side for each, half in zip(given.principal_point, middle, strict=True))
    k = tuple(given.distortion.get(each, 0.0) / fy ** (2 * power) for power, each in enumerate(way.radial, 1))
    first, second = (given.distortion.get(each, 0.0) / fy for each in way.decentring)
    p = (second, -first) if way.swapped else (first, -second)
    distortion = Distortion("brown", "ideal_to_image", k=(k[0], k[1], k[2]), p=p) if any((*k, *p)) else None
    width, height = given.image_size
    return Camera(
        name=name,
        principal_distance=fy,
        principal_point=((x0 + affinity[1] * y0) / (1.0 + affinity[0]), 0.0 - y0),
        format=(width * pixel_size, height * pixel_size),
        pixel_size=pixel_size,
        pixel_affinity=affinity,
        distortion=distortion,
        unit="px",
    )


def in_pixels(camera: Camera, convention: str, image_size: tuple[float, float]) -> PixelCamera:
    """Return a camera in millimetres as a program that counts in pixels has it; the inverse of ``in_millimetres``.

    Raises InputError for what such a program cannot have: a distortion from image to ideal coordinates, a table.
    """
    way, lens = CONVENTIONS[convention], camera.distortion
    size = camera.pixel_size or PIXEL_SIZE
    if lens is not None and (lens.model != "brown" or lens.direction != "ideal_to_image" or any(lens.b)):
        message = f"the distortion of camera {camera.name} goes from the image to ideal coordinates, or is a table"
        raise InputError(Fault(message, "camera-model", key=f"cameras.{camera.name}.distortion"))
    side = max(image_size) * size if way.by_side else size
    f, (stretch, shear), (x, y) = camera.principal_distance, camera.pixel_affinity, camera.principal_point
    if shear and not way.affine:
        message = f"pixels of camera {camera.name} are sheared, which {convention} does not know"
        raise InputError(Fault(message, "camera-model", key=f"cameras.{camera.name}"))
    x0, y0 = (1.0 + stretch) * x + shear * y, -y
    empty = PixelCamera(convention, image_size, focal_length=(0.0, 0.0), principal_point=(0.0, 0.0))
    middle = _middle(empty, way)
    found = dict.fromkeys((*way.radial, *way.decentring, *way.affine), 0.0)
    if lens is not None:
        found |= {each: k * f ** (2 * power) for power, (each, k) in enumerate(zip(way.radial, lens.k, strict=True), 1)}
        first, second = (-lens.p[1], lens.p[0]) if way.swapped else (lens.p[0], -lens.p[1])
        found |= dict(zip(way.decentring, (first * f, second * f), strict=True))
    if way.affine:
        found |= dict(zip(way.affine, (stretch * f / side, -shear * f / side), strict=True))
    fx = f if way.affine else (1.0 + stretch) * f
    return PixelCamera(
        convention=convention,
        image_size=image_size,
        focal_length=(fx / side, f / side),
        principal_point=(x0 / side + middle[0], y0 / side + middle[1]),
        distortion=found,
    )


def _middle(given: PixelCamera, way: Convention) -> tuple[float, float]:
    """Middle of the photo from where its principal point counts."""
    if way.origin == "middle":
        return 0.0, 0.0
    width, height = given.image_size
    half = 0.5 if way.origin == "first-pixel" else 0.0
    return width / 2.0 - half, height / 2.0 - half
