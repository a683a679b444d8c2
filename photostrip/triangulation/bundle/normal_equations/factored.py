"""Reduced normal equations in factors, and the elements of their inverse within the band."""

from __future__ import annotations

from functools import cached_property
from typing import Self

import numpy as np

from photostrip.arrays import Floats, Numbers, distinct
from photostrip.errors import GeometryError
from photostrip.frozen import dataclass
from photostrip.triangulation.bundle.normal_equations import datum
from photostrip.triangulation.bundle.normal_equations.reduced import Factor, Reduced, factored
from photostrip.triangulation.bundle.observations.collinearity import PHOTO
from photostrip.triangulation.bundle.parameters import Parameters, PreparedProblem


@dataclass(frozen=True, eq=False)
class Inverse:
    """Inverse normal matrix of photos and common parameters, as far as it is known."""

    band: Factor  # elements within the band, or at pairs, of the inverse of the photos' part alone
    cross: Floats  # (m, 6, p): that inverse times the border
    common: Floats  # (p, p): cofactors of the common parameters
    factor: Factor  # factor of the photos' part: for photos farther apart than the band is wide

    def cofactors(self, sets: Numbers, more: int) -> Floats:
        """Joint cofactors (g, 6 k + more, 6 k + more) of sets of photos and the first common parameters.

        ``sets`` (g, k) holds places in the band; photos count in their own axes and signs. With Z of the photos alone,
        W = Z times the border and C of the common parameters: [Z + W C W', -W C; -C W', C].
        """
        groups, n = len(sets), PHOTO * sets.shape[1]
        whole = np.empty((groups, n + more, n + more))
        whole[:, :n, :n] = self.blocks(sets).swapaxes(2, 3).reshape(groups, n, n)
        if len(self.common):
            cross = self.cross[sets].reshape(groups, n, -1)
            whole[:, :n, :n] += cross @ self.common @ cross.swapaxes(1, 2)
            whole[:, :n, n:] = -cross @ self.common[:, :more]
            whole[:, n:, :n] = whole[:, :n, n:].swapaxes(1, 2)
            whole[:, n:, n:] = self.common[:more, :more]
        return whole

    def blocks(self, sets: Numbers) -> Floats:
        """Blocks (g, k, k, 6, 6) of Z between the photos of sets (g, k) of places in the band."""
        row, column = np.broadcast_arrays(sets[:, :, None], sets[:, None, :])
        near = self.band.holds(row, column)
        if near.all():
            return self.band.blocks(row, column)
        found = np.empty((*row.shape, PHOTO, PHOTO))
        found[near] = self.band.blocks(row[near], column[near])
        far, m = distinct(column[~near]), self.factor.size // PHOTO
        unit = np.zeros((m, PHOTO, len(far), PHOTO))
        unit[far, :, np.arange(len(far))] = np.eye(PHOTO)
        solved = self.factor.solve(unit.reshape(m * PHOTO, -1)).reshape(unit.shape)
        found[~near] = solved[row[~near], :, np.searchsorted(far, column[~near])]
        return found


@dataclass(frozen=True, eq=False)
class Factored:
    reduced: Reduced
    band: Factor

    @classmethod
    def of(cls, prepared: PreparedProblem, state: Parameters, reduced: Reduced, *, free: bool) -> Self:
        """Factor the reduced normal equations; ``bundle-rank`` where they are singular."""
        blocks = reduced.blocks[prepared.structure.diagonal]
        band = factored(prepared, reduced, datum.anchor(prepared, state, blocks) if free else None)
        if band is None:
            raise GeometryError("the normal matrix is singular at the solution", code="bundle-rank")
        return cls(reduced, band)

    @cached_property
    def inverse(self) -> Inverse:
        p = len(self.reduced.corner) - 1
        border = self.reduced.border.reshape(-1, p + 1)[:, :p]
        cross = self.band.solve(border) if p else np.zeros_like(border)
        common = np.linalg.inv(self.reduced.corner[:p, :p] - border.T @ cross)
        cross = cross.reshape(len(self.reduced.border), PHOTO, p)
        return Inverse(band=self.band.inverse(), cross=cross, common=0.5 * (common + common.T), factor=self.band)


def solved_for(equations: Factored, right: Floats, corner: Floats) -> tuple[Floats, Floats]:
    """Solve for right-hand sides of photos (m, 6, c) and common parameters (p, c)."""
    reduced, band, p = equations.reduced, equations.band, len(corner)
    border = reduced.border.reshape(-1, p + 1)[:, :p]
    alone = band.solve(right.reshape(-1, right.shape[-1]))
    if not p:
        return alone.reshape(right.shape), corner
    cross = band.solve(border)
    common = np.linalg.solve(reduced.corner[:p, :p] - border.T @ cross, corner - border.T @ alone)
    photos: Floats = (alone - cross @ common).reshape(right.shape)
    return photos, np.asarray(common, float)
