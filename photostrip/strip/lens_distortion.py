"""Lens distortion, in both directions of definition, and its inverse.

A calibration gives a shift D of image points, as a function of the image point or of the ideal one; the other
direction is found by iteration. Both models have the form
``D = X g(r) + decentering``, X reduced to the principal point.

Between the radii of a table stands a cubic spline made for what is tabulated: distortion is an odd function of the
radius, so the spline starts with value and curvature zero in the middle, and it is smooth. Of a lens with 8 um of
distortion, tabulated every 20 mm, it is 0.1 um off; a monotone interpolation, which flattens where the curve turns,
0.5 um, straight lines 1.1 um. Beyond the last radius nothing is known, and nothing is computed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Floats
from photostrip.camera import Camera, Distortion
from photostrip.errors import Fault, GeometryError, InputError

CONVERGED = 1e-12  # mm
ITERATIONS = 30
FORWARD = "image_to_ideal"
RADII, AZIMUTHS = 201, 24  # of the points in which a distortion is tried
EDGE = 1e-9  # mm beyond the last radius of a table that rounding may cost


class _Radial(NamedTuple):
    """Radial distortion at some radii: ``g = d / r``, and its derivative by the radius over the radius."""

    factor: Floats
    slope: Floats


def ideal_from_image(xy: ArrayLike, distortion: Distortion) -> Floats:
    """Remove the distortion of image points (n, 2) reduced to the principal point, exact to 1e-9 mm.

    Raises InputError when a point lies beyond the last radius of a table.
    Raises GeometryError when no ideal point has this image.

    Source: [Brown 1966] for the polynomials.
    """
    points = np.asarray(xy, float)
    _refuse_beyond(points, reach(distortion)[0])
    return points + shift(points, distortion) if distortion.direction == FORWARD else _inverse(points, distortion)


def image_from_ideal(xy: ArrayLike, distortion: Distortion) -> Floats:
    """Apply the distortion to ideal points (n, 2); the inverse of ``ideal_from_image``, with the same errors."""
    points = np.asarray(xy, float)
    _refuse_beyond(points, reach(distortion)[1])
    return _inverse(points, distortion) if distortion.direction == FORWARD else points + shift(points, distortion)


def shift(xy: Floats, distortion: Distortion) -> Floats:
    """Distortion D as the calibration gives it, mm, at points (n, 2) of the kind in which it is defined.

    Beyond the last radius of a table its last piece is continued, which only iterations may use.

    Source: [Brown 1966], radial and decentering distortion; [Fraser 1997], affinity and shear.
    """
    x, y = xy[..., 0], xy[..., 1]
    square = x**2 + y**2
    p1, p2 = distortion.p
    b1, b2 = distortion.b
    factor = _radial(np.sqrt(square), distortion).factor
    dx = x * factor + p1 * (square + 2 * x**2) + 2 * p2 * x * y + b1 * x + b2 * y
    dy = y * factor + p2 * (square + 2 * y**2) + 2 * p1 * x * y
    return np.stack([dx, dy], -1)


def jacobian(xy: Floats, distortion: Distortion) -> Floats:
    """Differentiate ``X + D(X)`` by X, (n, 2, 2)."""
    x, y = xy[..., 0], xy[..., 1]
    p1, p2 = distortion.p
    b1, b2 = distortion.b
    factor, slope = _radial(np.hypot(x, y), distortion)
    xx = 1 + factor + slope * x**2 + 6 * p1 * x + 2 * p2 * y + b1
    yy = 1 + factor + slope * y**2 + 6 * p2 * y + 2 * p1 * x
    xy_ = slope * x * y + 2 * p1 * y + 2 * p2 * x
    return np.stack([np.stack([xx, xy_ + b2], -1), np.stack([xy_, yy], -1)], -2)


def reach(distortion: Distortion) -> tuple[float, float]:
    """Return the radii up to which the distortion of image and of ideal points is known; infinite for polynomials."""
    if distortion.model != "radial-table":
        return np.inf, np.inf
    last = distortion.radius[-1]
    shifted = last + distortion.distortion[-1]
    return (last, shifted) if distortion.direction == FORWARD else (shifted, last)


def faults(camera: Camera, farthest: float = 0.0) -> list[Fault]:
    """Find what is wrong with the distortion of a camera.

    Tables that are no tables, and distortion that folds the photo up to the radius `farthest` and the corners of the
    format: two ideal points with one image, or the other way round, so that it has no inverse.
    """
    distortion = camera.distortion
    if distortion is None:
        return []
    key = f"cameras.{camera.name}.distortion"
    if distortion.model == "radial-table" and (text := _bad_table(distortion)):
        return [Fault(f"camera {camera.name}: {text}", code="distortion-table", key=key)]
    radius = _fold(distortion, max(farthest, _format_reach(camera)))
    if radius is None:
        return []
    message = f"camera {camera.name}: the distortion has no inverse: the image folds {radius:.1f} mm from the "
    message += "principal point"
    fix = "check signs and units of the coefficients: k1 in mm^-2, k2 in mm^-4, k3 in mm^-6, p in mm^-1, tables in mm"
    return [Fault(message, code="distortion-folds", key=key, fix=fix)]


def _bad_table(distortion: Distortion) -> str:
    radius, values = np.array(distortion.radius, float), np.array(distortion.distortion, float)
    if len(radius) != len(values) or not radius.any():
        return f"{len(radius)} radii and {len(values)} distortions: equally many are needed, and a radius above 0"
    if radius[0] < 0 or (np.diff(radius) <= 0).any():
        return "the radii of the distortion table must increase from 0 or above"
    if radius[0] == 0 and values[0] != 0:
        return f"the distortion at radius 0 is {values[0]:g} mm; it must be 0"
    return ""


def _format_reach(camera: Camera) -> float:
    """Distance of the farthest corner of the format from the principal point, mm; 0 when the format is unknown."""
    if camera.format is None:
        return 0.0
    return float(np.hypot(*(np.array(camera.format) / 2 + np.abs(camera.principal_point))))


def _fold(distortion: Distortion, farthest: float) -> float | None:
    """Find the radius at which ``X + D(X)`` folds, out to an image radius of `farthest`; None when it does not."""
    if farthest <= 0:
        return None
    forward = distortion.direction == FORWARD
    # an ideal radius may be larger than that of its image, but not twice: such a lens is no central projection
    radii = np.linspace(0, min(farthest if forward else 2 * farthest, _last_radius(distortion)), RADII)
    azimuth = np.linspace(0, 2 * np.pi, AZIMUTHS, endpoint=False)
    direction = np.stack([np.cos(azimuth), np.sin(azimuth)], -1)
    points = radii[:, None, None] * direction
    slopes = jacobian(points, distortion)
    radial = np.einsum("ai,raij,aj->ra", direction, slopes, direction)
    folded = ((np.linalg.det(slopes) <= 0) | (radial <= 0)).any(1)
    if not folded.any():
        return None
    first = int(np.argmax(folded))
    image = np.linalg.norm(points + (0 if forward else shift(points, distortion)), axis=-1).min(1)
    if not forward and image[:first].max(initial=0.0) >= farthest:
        return None
    return float(radii[first])


def _last_radius(distortion: Distortion) -> float:
    return distortion.radius[-1] if distortion.model == "radial-table" else np.inf


def _refuse_beyond(points: Floats, limit: float) -> None:
    radius = np.hypot(points[..., 0], points[..., 1])
    if (radius > limit + EDGE).any():
        raise InputError(
            f"a point {radius.max():.3f} mm from the principal point lies beyond the distortion table, {limit:.3f} mm"
        )


def _inverse(target: Floats, distortion: Distortion) -> Floats:
    """Solve ``X + D(X) = target`` by Newton's iteration, from the inverse of the radial part."""
    radius = np.hypot(target[..., 0], target[..., 1])
    farthest = 2 * float(radius.max(initial=0.0))
    if farthest == 0:
        return target.copy() if not np.any((distortion.p, distortion.b)) else _newton(target, target, distortion)
    radii = np.linspace(0, min(farthest, _last_radius(distortion)), RADII)
    images = np.maximum.accumulate(radii * (1 + _radial(radii, distortion).factor))
    scale = np.interp(radius, images, radii) / np.where(radius > 0, radius, 1.0)
    return _newton(target * scale[..., None], target, distortion)


def _newton(start: Floats, target: Floats, distortion: Distortion) -> Floats:
    found = start
    for _ in range(ITERATIONS):
        slopes = jacobian(found, distortion)
        if not (np.linalg.det(slopes) > 0).all():
            break
        step = np.linalg.solve(slopes, (found + shift(found, distortion) - target)[..., None])[..., 0]
        found = found - step
        if (np.abs(step) <= CONVERGED).all():
            return found
    raise GeometryError("the distortion has no inverse at some point", code="distortion-folds")


def _radial(radius: Floats, distortion: Distortion) -> _Radial:
    if distortion.model == "radial-table":
        return _spline(radius, distortion)
    k1, k2, k3 = distortion.k
    square = radius**2
    return _Radial(
        square * (k1 + square * (k2 + square * k3)),
        2 * (k1 + square * (2 * k2 + square * 3 * k3)),
    )


def _spline(radius: Floats, distortion: Distortion) -> _Radial:
    """Evaluate the cubic spline through a table; the first interval is odd, so that its division by r is exact."""
    from scipy.interpolate import CubicSpline

    nodes, values = np.array(distortion.radius, float), np.array(distortion.distortion, float)
    if nodes[0] > 0:
        nodes, values = np.append(0.0, nodes), np.append(0.0, values)
    spline = CubicSpline(nodes, values, bc_type=("natural", "not-a-knot"))
    cubic, _, linear, _ = spline.c[:, 0]
    inner = radius < nodes[1]
    safe = np.where(inner, 1.0, radius)
    factor = np.where(inner, linear + radius**2 * cubic, spline(radius) / safe)
    return _Radial(factor, np.where(inner, 2 * cubic, (spline(radius, 1) - factor) / safe**2))
