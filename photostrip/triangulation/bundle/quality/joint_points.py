"""Joint cofactors of some points, however far apart: for what is said of several points together."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.frozen import NamedTuple
from photostrip.triangulation.bundle.normal_equations.factored import solved_for
from photostrip.triangulation.bundle.observations.collinearity import PHOTO
from photostrip.triangulation.bundle.solution import BundleSolution


def joint_cofactors(solution: BundleSolution, wanted: Numbers) -> Floats:
    """Return the joint cofactors (3n, 3n), m^2, of n points in ascending order; not of a free network.

    With T and L of ``point_elimination`` for each point, G = L^-T T' and Z the inverse of the normal matrix of photos
    and common parameters: G_i Z G_j', and for i = j also L^-T L^-1.
    """
    more, n = len(solution.prepared.calibrated), len(wanted)
    of_photos = np.zeros((len(solution.prepared.structure.order), PHOTO, n, 3))  # G', by photos
    of_common = np.zeros((len(solution.common), n, 3))
    alone = np.zeros((n, 3, n, 3))
    for photo, at, root, pulls in _carried(solution, wanted):
        for ray, photos in enumerate(photo):
            of_photos[photos, :, at] += pulls[:, PHOTO * ray : PHOTO * (ray + 1)]
        of_common[:more, at] += pulls[:, PHOTO * len(photo) :].swapaxes(0, 1)
        alone[at, :, at] = np.einsum("acs,bcs->sab", root, root)
    photos, common = of_photos.reshape(-1, 3 * n), of_common.reshape(-1, 3 * n)
    by_photos, by_common = solved_for(solution.factored, photos.reshape(-1, PHOTO, 3 * n), common)
    joint = photos.T @ by_photos.reshape(-1, 3 * n) + common.T @ by_common + alone.reshape(3 * n, 3 * n)
    return np.asarray(0.5 * (joint + joint.T), float)


def sum_cofactors(solution: BundleSolution, wanted: Numbers, factors: Floats) -> Floats:
    """Return the cofactors (k, k) of k sums of the coordinates of n points, with factors (n, 3, k); as above."""
    more, sums = len(solution.prepared.calibrated), factors.shape[2]
    of_photos = np.zeros((len(solution.prepared.structure.order), PHOTO, sums))
    of_common, alone = np.zeros((len(solution.common), sums)), np.zeros((sums, sums))
    for photo, at, root, pulls in _carried(solution, wanted):
        pulled = np.einsum("spa,sak->spk", pulls, factors[at])
        for ray, photos in enumerate(photo):
            np.add.at(of_photos, photos, pulled[:, PHOTO * ray : PHOTO * (ray + 1)])
        of_common[:more] += pulled[:, PHOTO * len(photo) :].sum(axis=0)
        own = np.einsum("acs,sak->csk", root, factors[at])
        alone += np.einsum("csi,csj->ij", own, own)
    by_photos, by_common = solved_for(solution.factored, of_photos, of_common)
    found = of_photos.reshape(-1, sums).T @ by_photos.reshape(-1, sums) + of_common.T @ by_common + alone
    return np.asarray(0.5 * (found + found.T), float)


class _Carried(NamedTuple):
    """Some points of a batch."""

    photo: Numbers  # (k, s): places of their photos in the band
    at: Numbers  # (s,): which of those wanted they are
    root: Floats  # (3, 3, s): L^-T
    pulls: Floats  # (s, 6 k + more, 3): T L^-1


def _carried(solution: BundleSolution, wanted: Numbers) -> Iterator[_Carried]:
    for batch, eliminated in zip(solution.prepared.structure.batches, solution.factored.reduced.points, strict=True):
        slots = batch.real[np.isin(batch.point[batch.real], wanted)]
        root = np.repeat(np.eye(3)[:, :, None], len(batch.point), axis=2)
        eliminated.root.backward(root)
        root = root[:, :, slots]
        pulls = np.einsum("acs,pcs->spa", root, eliminated.rows[:-1, :, slots])
        at = np.searchsorted(wanted, batch.point[slots])
        yield _Carried(photo=batch.photo[:, slots], at=at, root=root, pulls=pulls)
