"""Film deformation that the transformation of the fiducial marks leaves: interpolated from their residuals.

A thin plate spline goes through the residuals of the marks: the surface that bends least. It takes the scatter of the
marks for deformation, too, so it helps only where film is deformed by more than marks are measured well, and where
there are marks enough to see it, best eight.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from photostrip.arrays import Floats, Numbers

LEAST_MARKS = 4  # three carry the plane that every transformation has already
FLAT = 0.01  # ratio of the extents of the marks below which they stand on one line


@dataclass(frozen=True, eq=False)
class FilmDeformation:
    # (m, 2): transformed coordinates of the marks of each photo, mm; none where they do not show a deformation
    nodes: tuple[Floats, ...]
    shifts: tuple[Floats, ...]  # (m, 2): corrections there, calibrated minus transformed, mm

    @classmethod
    def from_residuals(cls, calibrated: Sequence[Floats], residuals: Sequence[Floats]) -> FilmDeformation:
        """Interpret the residuals of the marks of each photo, transformed minus calibrated (m, 2), as deformation."""
        usable = [_spread(each) for each in calibrated]
        none = np.zeros((0, 2))
        nodes = [c + r if s else none for c, r, s in zip(calibrated, residuals, usable, strict=True)]
        return cls(tuple(nodes), tuple(-r if s else none for r, s in zip(residuals, usable, strict=True)))

    def unseen(self) -> Numbers:
        """Return the photos whose marks do not show a deformation."""
        return np.flatnonzero([len(each) == 0 for each in self.nodes])

    def corrected(self, photo: Numbers, xy: Floats) -> Floats:
        """Correct transformed coordinates (n, 2) of points, each on its photo.

        Source: [Kraus], interpolation of the residuals of fiducial marks; the spline is that of scipy.interpolate.
        """
        from scipy.interpolate import RBFInterpolator

        found = np.array(xy, float)
        order = np.argsort(photo, kind="stable")
        for rows in np.split(order, np.flatnonzero(np.diff(photo[order])) + 1):
            if len(rows) and len(nodes := self.nodes[photo[rows[0]]]):
                shift = RBFInterpolator(nodes, self.shifts[photo[rows[0]]], kernel="thin_plate_spline")
                found[rows] += shift(found[rows])
        return found


def _spread(marks: Floats) -> bool:
    """Whether marks are enough, and not on one line."""
    if len(marks) < LEAST_MARKS:
        return False
    extent = np.linalg.svd(marks - marks.mean(axis=0), compute_uv=False)
    return bool(extent[1] > FLAT * extent[0])
