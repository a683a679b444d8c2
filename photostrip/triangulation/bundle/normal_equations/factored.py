"""Reduced normal equations in factors, and the elements of their inverse within the band."""

from __future__ import annotations

from functools import cached_property
from typing import Self

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.errors import GeometryError
from photostrip.frozen import dataclass
from photostrip.triangulation.bundle.normal_equations import datum
from photostrip.triangulation.bundle.normal_equations.reduced import Factor, Reduced, factored, reduce
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
        number = (PHOTO * sets[:, :, None] + np.arange(PHOTO)).reshape(groups, n)
        row, column = number[:, :, None], number[:, None, :]
        whole = np.empty((groups, n + more, n + more))
        late, early = np.maximum(row, column), np.minimum(row, column)
        near = self.band.holds(late, early)
        if near.all():
            whole[:, :n, :n] = self.band.at(late, early)
        else:
            whole[:, :n, :n][near] = self.band.at(late[near], early[near])
            far = np.unique(number[~near.all(axis=(1, 2))])
            columns = self.factor.solve(np.eye(self.factor.size)[:, far])
            row, column = np.broadcast_arrays(row, column)
            whole[:, :n, :n][~near] = columns[row[~near], np.searchsorted(far, column[~near])]
        if len(self.common):
            cross = self.cross[sets].reshape(groups, n, -1)
            whole[:, :n, :n] += cross @ self.common @ cross.swapaxes(1, 2)
            whole[:, :n, n:] = -cross @ self.common[:, :more]
            whole[:, n:, :n] = whole[:, :n, n:].swapaxes(1, 2)
            whole[:, n:, n:] = self.common[:more, :more]
        return whole


@dataclass(frozen=True, eq=False)
class Factored:
    reduced: Reduced
    band: Factor

    @classmethod
    def at(cls, prepared: PreparedProblem, state: Parameters, *, free: bool) -> Self:
        """Factor the reduced normal equations at given values; ``bundle-rank`` where they are singular."""
        reduced = reduce(prepared, state)
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
