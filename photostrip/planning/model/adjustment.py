"""Absolute orientation of a model that takes the errors of its relative orientation as unknowns too.

A plain fit of seven parameters leaves the deformation that the elements cause. Here the elements come along as
unknowns with their a-priori variances: the same as generalised least squares with the whole covariance of the
misclosures, and prediction of what the elements do at new points.

Source: [000], where the covariance is meant "for the adjustment of coordinates"; derived.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Floats, Numbers
from photostrip.planning.model.element_errors import free_influence
from photostrip.planning.model.single_model import PARAMETERS, ModelControl, parameter_rows


@dataclass(frozen=True, eq=False)
class AdjustedModel:
    control: ModelControl
    base: float
    parameters: Floats  # (7,): absolute orientation, in the order of `PARAMETERS`
    elements: Floats  # (4,): estimated errors of the relative orientation: dkappa, dbz, dalpha2, domega
    cofactors: Floats  # (11, 11): covariance of both
    # (n, 3, 3): inverse covariances of the misclosures without the elements; zero where a coordinate is not given
    weights: Floats

    def correction(self, points: ArrayLike) -> Floats:
        """Return what is to be subtracted from model points (q, 3): absolute orientation and deformation together."""
        return np.asarray(self._rows(points) @ np.concatenate([self.parameters, self.elements]), float)

    def covariance(self, points: ArrayLike, measured: ArrayLike, row: Numbers | None = None) -> Floats:
        """Covariance (q, 3, 3) of corrected points; the arguments are those of ``single_model.expected_errors``."""
        rows, measuring = self._rows(points), np.array(measured, float)
        if row is not None:
            known = np.flatnonzero(row >= 0)
            measuring[known] = self.control.measured[row[known]]
        found: Floats = measuring + rows @ self.cofactors @ np.swapaxes(rows, 1, 2)
        if row is not None:
            # the measurement of a control point is part of the estimate
            estimated = rows[known] @ self.cofactors @ np.swapaxes(rows[known], 1, 2)
            shared = estimated @ self.weights[row[known]] @ measuring[known]
            found[known] -= shared + np.swapaxes(shared, 1, 2)
        return found

    def _rows(self, points: ArrayLike) -> Floats:
        return np.concatenate([parameter_rows(points, self.control), free_influence(points, self.base)], axis=2)


def adjust_model(control: ModelControl, misclosures: ArrayLike, base: float, elements: ArrayLike) -> AdjustedModel:
    """Orient a model with the errors of its relative orientation as further unknowns.

    misclosures: (n, 3), W: model minus given; coordinates that are not given do not count.
    elements: (4, 4), a-priori covariance of dkappa, dbz, dalpha2, domega.
    """
    rows = np.concatenate([parameter_rows(control.points, control), free_influence(control.points, base)], axis=2)
    counts = np.stack([control.plan, control.plan, control.height], axis=1)
    noise = control.measured + control.given
    off = ~counts
    noise = np.where(off[:, :, None] | off[:, None, :], 0.0, noise)
    noise[off[:, :, None] & np.eye(3, dtype=bool)] = 1.0
    weights = np.asarray(np.linalg.inv(noise), np.float64)
    weights[off[:, :, None] & np.eye(3, dtype=bool)] = 0.0
    weighted = np.swapaxes(rows, 1, 2) @ weights
    normal = (weighted @ rows).sum(axis=0)
    first = len(PARAMETERS)
    normal[first:, first:] += np.linalg.inv(np.asarray(elements, float))
    right = np.einsum("nka,na->k", weighted, np.where(counts, np.asarray(misclosures, float), 0.0))
    size = np.sqrt(np.diag(normal))  # the unknowns differ by many orders of magnitude
    cofactors = np.linalg.inv(normal / np.outer(size, size)) / np.outer(size, size)
    solution = cofactors @ right
    return AdjustedModel(
        control=control,
        base=base,
        parameters=solution[:first],
        elements=solution[first:],
        cofactors=cofactors,
        weights=weights,
    )
