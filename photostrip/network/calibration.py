"""Self-calibration: what the parameters of a camera change at an image point."""

from __future__ import annotations

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.camera import Distortion
from photostrip.network.problem import BundleCameras
from photostrip.network.settings import CALIBRATION
from photostrip.strip.image_coordinates import lens_distortion

PRINCIPAL_DISTANCE = list(CALIBRATION).index("c")
STEPS_TO_IMAGE = 2  # a misfit is small, and each step leaves the square of what was left
POINT, K, P, AFFINE = [1, 2], [3, 4, 5], [6, 7], [8, 9]  # columns of parameters that belong together


def values_of(cameras: BundleCameras, common: Floats) -> Floats:
    """Calibration parameters camera by camera, (cameras, 10); 0 for what is not estimated."""
    place = cameras.unknown
    return np.where(place >= 0, np.append(common, 0.0)[place], 0.0)


def corrected(cameras: BundleCameras, values: Floats, xy: Floats, camera: Numbers) -> Floats:
    """Correct ideal image coordinates (n, 2) of photos of cameras (n,) by the values (cameras, 10) of parameters.

    With x, y from the corrected principal point, x0 and y0 from the given one, r2 = x^2 + y^2 and all parameters zero
    at the start, what a ray should have measured is found from

        X + Dx = -(f + c) u / w    Dx = -x0' + x (k1 r2 + k2 r2^2 + k3 r2^3) + p1 (r2 + 2 x^2) + 2 p2 x y + b1 x + b2 y
        Y + Dy = -(f + c) v / w    Dy = -y0' + y (k1 r2 + k2 r2^2 + k3 r2^3) + p2 (r2 + 2 y^2) + 2 p1 x y

    so that c, x0, y0 (mm) are corrections of the principal distance and the principal point, k and p are those of
    Brown's model from image to ideal coordinates, b1 is the affinity and b2 the shear. Distortion has its centre in the
    principal point: that which is given moves with it, (x0', y0') = J (x0, y0) with J of ``by_image`` half way, right
    but for third powers of x0 and y0.
    """
    found = xy.copy()
    for number in np.unique(camera):
        some = camera == number
        own, center = values[number], values[number, POINT]
        shifted = by_image(cameras, number, xy[some], center / 2.0) @ center
        bends = corrections((xy[some] - center).T)
        found[some] += np.einsum("kan,k->na", bends[POINT[-1] + 1 :], own[POINT[-1] + 1 :]) - shifted
    return found


def uncorrected(
    cameras: BundleCameras, values: Floats, ideal: Floats, xy: Floats, camera: Numbers
) -> tuple[Floats, Floats]:
    """Find the image points that ``corrected`` takes to computed ones (n, 2), and their derivatives by these (n, 2, 2).

    xy: (n, 2), measured: where the step to each of them starts.

    The corrections have to be those at the computed points. At the measured ones they hold measuring errors, which the
    misfits hold as well: the products of both do not vanish in the mean, and thousands of rays make a distortion of
    them that is not there.
    """
    found, by_ideal = ideal.copy(), np.broadcast_to(np.eye(2), (len(xy), 2, 2)).copy()
    for number in np.flatnonzero((values != 0.0).any(axis=1)).tolist():
        some = camera == number
        own, at = camera[some], xy[some]
        for _ in range(STEPS_TO_IMAGE):
            off = ideal[some] - corrected(cameras, values, at, own)
            at = at + np.linalg.solve(_slope(values[number], at), off[..., None])[..., 0]
        found[some], by_ideal[some] = at, np.linalg.inv(_slope(values[number], at))
    return found, by_ideal


def _slope(own: Floats, xy: Floats) -> Floats:
    """Differentiate the image coordinates that values (10,) of parameters correct by what is corrected: (n, 2, 2)."""
    estimated = Distortion("brown", "image_to_ideal", k=tuple(own[K]), p=tuple(own[P]), b=tuple(own[AFFINE]))
    return lens_distortion.jacobian(xy - own[POINT], estimated)


def by_image(cameras: BundleCameras, camera: int, xy: Floats, center: Floats) -> Floats:
    """Differentiate ideal image coordinates (n, 2) by measured ones: (n, 2, 2), the given distortion's part.

    It is that at the points once the principal point of their distortion has moved to ``center``.
    """
    given = cameras.distortion[camera] if cameras.distortion else None
    if given is None:
        return np.broadcast_to(np.eye(2), (len(xy), 2, 2))
    slope = lens_distortion.jacobian(xy, given)
    if given.direction == "image_to_ideal":
        image = xy - np.linalg.solve(slope, lens_distortion.shift(xy, given)[..., None])[..., 0]
        return lens_distortion.jacobian(image - center, given)
    moved = xy - np.linalg.solve(slope, np.broadcast_to(center, xy.shape)[..., None])[..., 0]
    return np.asarray(np.linalg.inv(lens_distortion.jacobian(moved, given)), float)


def partials(cameras: BundleCameras, values: Floats, camera: int, xy: Floats, ratio: Floats) -> Floats:
    """Differentiate computed minus corrected image coordinates (n, 2) of a camera by its parameters: (10, 2, n).

    ``ratio`` (n, 2) is the computed image point divided by the principal distance.
    """
    own, center = values[camera], values[camera, POINT]
    found = -corrections((xy - center).T)
    found[PRINCIPAL_DISTANCE] = ratio.T
    slope = _slope(own, xy) - np.eye(2)
    found[POINT] = (by_image(cameras, camera, xy, center) + slope).transpose(2, 1, 0)
    return found


def corrections(xy: Floats) -> Floats:
    """Corrections of image coordinates (2, ...) from the principal point in mm by each parameter at one: (10, 2, ...).

    As in ``corrected``; zero for the principal distance.
    """
    x, y = xy
    r2 = x * x + y * y
    one, zero = np.ones_like(x), np.zeros_like(x)
    return np.array(
        [
            [zero, zero],
            [-one, zero],
            [zero, -one],
            [x * r2, y * r2],
            [x * r2**2, y * r2**2],
            [x * r2**3, y * r2**3],
            [r2 + 2.0 * x * x, 2.0 * x * y],
            [2.0 * x * y, r2 + 2.0 * y * y],
            [x, zero],
            [y, zero],
        ]
    )
