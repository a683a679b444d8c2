"""Joint cofactors of some points, however far apart: for what is said of several points together."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.triangulation.bundle.observations.collinearity import PHOTO
from photostrip.triangulation.bundle.quality.cofactors import at_solution, solved_for

if TYPE_CHECKING:
    from photostrip.arrays import Floats, Numbers
    from photostrip.triangulation.bundle.solution import BundleSolution


def joint_cofactors(solution: BundleSolution, wanted: Numbers) -> Floats:
    """Return the joint cofactors (3n, 3n), m^2, of n points in ascending order; not of a free network.

    With T and L of ``point_elimination`` for each point, G = L^-T T' and Z the inverse of the normal matrix of photos
    and common parameters: G_i Z G_j', and for i = j also L^-T L^-1.
    """
    prepared = solution.prepared
    state, reduced, band = at_solution(solution)
    more, n = len(prepared.calibrated), len(wanted)
    of_photos = np.zeros((len(prepared.structure.order), PHOTO, n, 3))  # G', by photos
    of_common = np.zeros((len(state.common), n, 3))
    alone = np.zeros((n, 3, n, 3))
    for batch, eliminated in zip(prepared.structure.batches, reduced.points, strict=True):
        slots = batch.real[np.isin(batch.point[batch.real], wanted)]
        at, k = np.searchsorted(wanted, batch.point[slots]), len(batch.photo)
        root = np.repeat(np.eye(3)[:, :, None], len(batch.point), axis=2)
        eliminated.root.backward(root)  # L^-T
        root = root[:, :, slots]
        pulls = np.einsum("acs,pcs->spa", root, eliminated.rows[:-1, :, slots])
        for ray in range(k):
            of_photos[batch.photo[ray, slots], :, at] += pulls[:, PHOTO * ray : PHOTO * (ray + 1)]
        of_common[:more, at] += pulls[:, PHOTO * k :].swapaxes(0, 1)
        alone[at, :, at] = np.einsum("acs,bcs->sab", root, root)
    photos, common = of_photos.reshape(-1, 3 * n), of_common.reshape(-1, 3 * n)
    by_photos, by_common = solved_for(reduced, band, photos.reshape(-1, PHOTO, 3 * n), common)
    joint = photos.T @ by_photos.reshape(-1, 3 * n) + common.T @ by_common + alone.reshape(3 * n, 3 * n)
    return np.asarray(0.5 * (joint + joint.T), float)
