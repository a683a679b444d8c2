"""Self-calibration: what the parameters of a camera change at an image point."""

from __future__ import annotations

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.frozen import dataclass
from photostrip.triangulation.bundle.observations.problem import BundleCameras
from photostrip.triangulation.bundle.settings import CALIBRATION

PRINCIPAL_DISTANCE = list(CALIBRATION).index("c")


@dataclass(frozen=True, eq=False)
class Calibrated:
    """Which parameters of which cameras are unknown."""

    # camera, kind: (c,): camera and number within ``CALIBRATION`` of each parameter
    camera: Numbers
    kind: Numbers
    sigma: Floats  # (c,): a-priori standard deviations; infinite: free

    def __len__(self) -> int:
        return len(self.kind)


def parameters(cameras: BundleCameras) -> Calibrated:
    sigma = np.zeros((len(cameras.focal), len(CALIBRATION))) if cameras.sigma is None else cameras.sigma
    camera, kind = np.nonzero(sigma > 0.0)
    return Calibrated(camera, kind, sigma[camera, kind])


def corrections(xy: Floats) -> Floats:
    """Corrections of ideal image coordinates (2, ...) in mm by each parameter at one, shape (10, 2, ...).

    Zero for the principal distance. With the ideal coordinates x, y as given, r2 = x^2 + y^2, and all parameters zero
    at the start, what a ray should have measured is found from

        x + Dx = -(f + c) u / w    Dx = -x0 + x (k1 r2 + k2 r2^2 + k3 r2^3) + p1 (r2 + 2 x^2) + 2 p2 x y + b1 x + b2 y
        y + Dy = -(f + c) v / w    Dy = -y0 + y (k1 r2 + k2 r2^2 + k3 r2^3) + p2 (r2 + 2 y^2) + 2 p1 x y

    so that c, x0, y0 (mm) are corrections of the principal distance and the principal point, k and p are those of
    Brown's model from image to ideal coordinates, b1 is the affinity and b2 the shear.
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
