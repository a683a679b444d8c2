"""Coordinates of one datum brought to another, and back."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from photostrip.arrays import Floats
    from photostrip.geodesy.proj_operation import ProjOperation


@dataclass(frozen=True, eq=False)
class DatumShift:
    """Longitude, latitude (radians) and height of one datum into those of another, and back."""

    operation: ProjOperation
    source_unit: float  # radians per unit of the geographic CRS
    target_unit: float

    def _apply(self, geodetic: Floats, *, inverse: bool) -> Floats:
        """Run the operation in the units of the two CRSs."""
        units = (self.source_unit, self.target_unit)
        given, wanted = units[::-1] if inverse else units
        moved = self.operation.apply(geodetic / (given, given, 1.0), inverse=inverse)
        return moved * (wanted, wanted, 1.0)

    def forward(self, geodetic: Floats) -> Floats:
        """From the frame's own datum to that of the Cartesian frame."""
        return geodetic if self.operation.idle else self._apply(geodetic, inverse=False)

    def inverse(self, geodetic: Floats) -> Floats:
        """Undo ``forward``.

        PROJ inverts a seven-parameter shift to first order in its angles, 0.1 mm for one arc second and centimetres
        for ten; one step of iteration makes the way back exact.
        """
        if self.operation.idle:
            return geodetic
        first = self._apply(geodetic, inverse=True)
        miss = first - self._apply(self._apply(first, inverse=False), inverse=True)
        miss[:, 0] = wrapped_longitude(miss[:, 0])
        return first + miss


def wrapped_longitude(angle: Floats) -> Floats:
    """Bring differences of longitude into [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi
