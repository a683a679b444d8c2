"""Two zones of plane map coordinates joined through points that are known in both.

Conformal projections of one ellipsoid differ by a conformal transformation, a power series in E + iN. Between Gauss
zones of 6 degrees, within 20 km of a place at the boundary, a similarity leaves 6 m, the second power 1 cm, the third
0.01 mm.

Source: derived.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from photostrip.arrays import Floats

HIGHEST_POWER = 3  # power
FEWEST_COMMON = 2  # points in both zones


@dataclass(frozen=True, eq=False)
class ZoneJoint:
    """A transformation from one zone to another."""

    center: complex  # E + iN of the middle of the common points, in the zone that is left
    size: float  # metres: powers are of (w - center) / size
    coefficients: NDArray[np.complex128]
    residuals: Floats  # (n, 2): transformed minus given, metres
    redundancy: int  # given coordinates that are not needed

    @property
    def degree(self) -> int:
        """Highest power."""
        return len(self.coefficients) - 1

    def __call__(self, plane: Floats) -> Floats:
        """Bring coordinates east, north (n, 2) into the other zone."""
        return _plane(
            np.vander((_complex(plane) - self.center) / self.size, self.degree + 1, increasing=True) @ self.coefficients
        )


def join_zones(source: Floats, target: Floats) -> ZoneJoint:
    """Find the transformation between zones from points given in both, (n, 2) each, at least two.

    The power is the highest, up to the third, that the points determine.
    """
    given = _complex(source)
    center, size = complex(given.mean()), float(np.abs(given - given.mean()).max()) or 1.0
    degree = min(HIGHEST_POWER, len(given) - 1)
    design = np.vander((given - center) / size, degree + 1, increasing=True)
    coefficients = np.asarray(np.linalg.lstsq(design, _complex(target), rcond=None)[0], np.complex128)
    return ZoneJoint(
        center=center,
        size=size,
        coefficients=coefficients,
        residuals=_plane(design @ coefficients) - target,
        redundancy=2 * (len(given) - degree - 1),
    )


def _complex(plane: Floats) -> NDArray[np.complex128]:
    return np.asarray(plane[:, 0] + 1j * plane[:, 1], np.complex128)


def _plane(w: NDArray[np.complex128]) -> Floats:
    return np.column_stack([w.real, w.imag])
