"""Self-calibration: what the parameters of a camera change at an image point, and their partials."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.frozen import dataclass
from photostrip.triangulation.bundle.observations.problem import CALIBRATION, BundleCameras

if TYPE_CHECKING:
    from photostrip.arrays import Floats, Numbers

PRINCIPAL_DISTANCE = CALIBRATION.index("c")


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

    See ``problem.CALIBRATION`` for the formula; zero for the principal distance.
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


def partials(wanted: Calibrated, xy: Floats, ratio: Floats, camera: Numbers) -> Floats:
    """Differentiate the computed image coordinates by the parameters: (c, 2, ...), mm by the unit.

    ``ratio`` is the computed image point divided by the principal distance. A correction of the measurement counts as
    a change of the computed coordinate with the opposite sign.
    """
    table = -corrections(xy)
    table[PRINCIPAL_DISTANCE] = ratio
    return np.asarray(table[wanted.kind] * (camera == wanted.camera.reshape(-1, *[1] * camera.ndim))[:, None])
