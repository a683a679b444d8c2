"""A strip after its fit to the control: what image coordinates and control do to points and photos.

The error of a point is that of the formed strip minus what the fit takes away of it, which is made of errors of the
same image coordinates and of the control: D' = D - Phi M D_c by the image coordinates, Phi M by the control (eq. 5),
and so D' D'^T and Phi M S M^T Phi^T make up every covariance (eq. 6). What precedes a point is as long as the strip,
and so the work grows by the square of its length.

Source: derived; see docs/precision.md, eq. 5 and 6.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from photostrip.arrays import Floats, Numbers
from photostrip.strip.error_propagation.control_errors import FitOperator, Misclosures
from photostrip.strip.error_propagation.photo_errors import NUMBERS, PhotoErrors
from photostrip.strip.error_propagation.strip_errors import StripErrors, entries_of

AT_A_TIME = 50_000  # numbers of points or photos, times models, worked on together: 5 MB for each table of them


@dataclass(frozen=True, eq=False)
class FittedStrip:
    """A strip fitted to its control, with a variance factor of its image coordinates; that of the control is 1."""

    errors: StripErrors
    control: Misclosures
    fit: FitOperator
    xyz: Floats  # (q, 3): points after the similarity, where the fit takes away its influence, metres
    factor: float

    @cached_property
    def _parameters(self) -> csr_array:
        """The fitted parameters (t, ...) as sparse rows of the strip, M D_c."""
        return csr_array(self.fit.operator) @ self.errors.along(self.control.row, self.control.direction)

    @cached_property
    def _with_parameters(self) -> Floats:
        """Covariances (..., t) of whatever a column of sparse rows stands for with the parameters."""
        return self.errors.with_everything(self._parameters)

    @cached_property
    def _spread(self) -> Floats:
        """Covariances (t, t) of the parameters, by image coordinates and control."""
        by_control = self.fit.operator * np.sqrt(self.control.variance / self.factor)
        return np.asarray(self._parameters @ self._with_parameters + by_control @ by_control.T, float)

    def covariances_of_points(self, points: Numbers) -> Floats:
        """Covariances (n, 3, 3) of some points, metres^2."""
        result = np.empty((len(points), 3, 3))
        for some in self._pieces(np.argsort(self.xyz[points, 0], kind="stable"), 3):  # neighbours have frames in common
            rows, influence = self.errors.points(points[some]), self.fit.influence(self.xyz[points[some]])
            result[some] = self._covariances(rows, influence)
        return result

    def covariances_of_photos(self, oriented: PhotoErrors, photos: Numbers) -> Floats:
        """Covariances (n, 6, 6) of centres and small rotations of some photos, metres^2 and radians^2."""
        result = np.empty((len(photos), NUMBERS, NUMBERS))
        for some in self._pieces(np.arange(len(photos)), NUMBERS):
            numbers = entries_of(photos[some], NUMBERS).ravel()
            by_point = oriented.by_point[numbers]
            points = np.asarray(np.unique(by_point.indices // 3), np.intp)
            by_point = by_point[:, entries_of(points, 3).ravel()]  # type: ignore[index]
            rows = by_point @ self.errors.points(points) + oriented.by_image[numbers]
            influence = by_point @ self.fit.influence(self.xyz[points]).reshape(3 * len(points), -1)
            result[some] = self._covariances(rows, influence.reshape(len(some), NUMBERS, -1))
        return result

    def joint_covariance(self, points: Numbers, directions: Floats) -> Floats:
        """Covariances (n, n) of points along directions (n, 3), metres^2."""
        influence = np.einsum("ni,nit->nt", directions, self.fit.influence(self.xyz[points]))
        rows = self.errors.along(points, directions)
        return self._after_fit(self.errors.joint_covariance(rows), rows, influence)

    def _covariances(self, rows: csr_array, influence: Floats) -> Floats:
        """Covariances (n, d, d) of things of d neighbouring rows each; influence is (n, d, t)."""
        return self._after_fit(self.errors.covariances(rows, influence.shape[1]), rows, influence)

    def _after_fit(self, covariance: Floats, rows: csr_array, influence: Floats) -> Floats:
        """Add to covariances (..., d, d) of the formed strip what the fit takes away by its influence (..., d, t)."""
        back = np.swapaxes(influence, -1, -2)
        mixed = (rows @ self._with_parameters).reshape(influence.shape) @ back
        found = covariance - mixed - np.swapaxes(mixed, -1, -2) + influence @ self._spread @ back
        return np.asarray(found * self.factor, float)

    def _pieces(self, order: Numbers, size: int) -> Iterator[Numbers]:
        """Cut things of so many numbers each into pieces of bounded memory."""
        most = max(AT_A_TIME // (size * self.errors.models), 1)
        for start in range(0, len(order), most):
            yield order[start : start + most]
