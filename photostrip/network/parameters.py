"""A problem made ready: what does not change during the adjustment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import reverse_cuthill_mckee

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.network.problem import BundleProblem, ImageObservations, ModelObservations, Parameters

TOGETHER = 64  # points that are worked on together: twice and half as many take as long
COMPARED = 8  # first photos by which points are put beside others on the same ones


class NearPoints(NamedTuple):
    """Some points on nearly the same photos: their photos are few, and fill a small dense matrix."""

    points: Numbers  # (s,): the points
    photos: Numbers  # (u,): their photos, by rank
    ray: Numbers  # (n,): rays of these points
    # (n,): photo and point of each of them, as places in the above
    photo: Numbers
    point: Numbers


@dataclass(frozen=True, eq=False)
class PreparedProblem:
    """A problem with everything about it that does not change during the adjustment."""

    problem: BundleProblem
    calibrated: int  # how many of the common parameters are those of cameras; they come first
    prior: Floats  # (p,): a-priori sigmas of all common parameters
    measured: Flags  # (q,): points with rays
    joined: csr_array  # (m, m): how many points each pair of photos shares; every photo with itself
    rank: Numbers  # (m,): place of each photo in an order in which photos that share points are near each other
    # row, column: (b,): pairs of photos that share points, by rank, row >= column, sorted
    row: Numbers
    column: Numbers
    own: Numbers  # (m,): which of the pairs is each photo with itself
    near: tuple[NearPoints, ...]

    @property
    def begun(self) -> Parameters:
        """The start values, all common parameters zero."""
        start = self.problem.start
        return Parameters(
            centers=start.centers,
            rotations=start.rotations,
            scales=np.ones(len(start.centers)) if start.scales is None else start.scales,
            points=start.points,
            common=np.zeros(len(self.prior)),
        )

    def pair(self, row: Numbers, column: Numbers) -> Numbers:
        """Which of the pairs two photos are, by rank; -1: they share no point, or row < column."""
        size = len(self.rank)
        keys, wanted = self.row * size + self.column, row * size + column
        place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        return np.where(keys[place] == wanted, place, -1)


def prepare(problem: BundleProblem) -> PreparedProblem:
    """Find what does not change during the adjustment."""
    of_cameras = np.zeros(0) if problem.cameras.sigma is None else problem.cameras.sigma
    drifts = (problem.positions.offset_sigma, problem.positions.drift_sigma)
    sigmas = [sigma[sigma > 0.0] for sigma in (of_cameras, *drifts)]
    images, m, q = problem.images, problem.photos, problem.points
    shown = csr_array((np.ones(len(images)), (images.photo, images.point)), shape=(m, q))
    joined = csr_array(shown @ shown.T + csr_array((np.ones(m), (np.arange(m), np.arange(m))), shape=(m, m)))
    rank = _order(joined)
    one, other = (rank[each] for each in joined.nonzero())
    row, column = np.divmod(np.sort((one * m + other)[one >= other]), m)
    own = np.flatnonzero(row == column)
    return PreparedProblem(
        problem=problem,
        calibrated=len(sigmas[0]),
        prior=np.concatenate(sigmas),
        measured=np.bincount(images.point, minlength=q) > 0,
        joined=joined,
        rank=rank,
        row=row,
        column=column,
        own=own[rank],
        near=tuple(_near_points(images, rank, q)),
    )


def _order(joined: csr_array) -> Numbers:
    """Place of each photo in the narrower of two orders: as given, and reverse Cuthill-McKee."""
    row, column = joined.nonzero()
    rank = np.empty(joined.shape[0], np.intp)
    rank[reverse_cuthill_mckee(joined, symmetric_mode=True)] = np.arange(len(rank))
    narrower = np.abs(rank[row] - rank[column]).max(initial=0) < np.abs(row - column).max(initial=0)
    return rank if narrower else np.arange(len(rank))


def _near_points(images: ImageObservations | ModelObservations, rank: Numbers, points: int) -> list[NearPoints]:
    """Cut the points with rays into pieces on nearly the same photos."""
    photo = rank[images.photo]
    rays = np.lexsort((photo, images.point))
    count = np.bincount(images.point, minlength=points)
    place = np.arange(len(rays)) - np.repeat(np.cumsum(count) - count, count)
    first = np.full((COMPARED, points), -1)
    shown = place < COMPARED
    first[place[shown], images.point[rays[shown]]] = photo[rays[shown]]
    by_photos = np.lexsort(first[::-1])
    by_photos = by_photos[count[by_photos] > 0]
    at = np.empty(points, np.intp)
    at[by_photos] = np.arange(len(by_photos))
    rays = np.argsort(at[images.point], kind="stable")
    edges = np.searchsorted(at[images.point[rays]], np.arange(TOGETHER, len(by_photos), TOGETHER))
    found = []
    for piece, ray in enumerate(np.split(rays, edges)):
        photos, own = np.unique(photo[ray], return_inverse=True)
        begin = piece * TOGETHER
        some = by_photos[begin : begin + TOGETHER]
        place = at[images.point[ray]] - begin
        found.append(NearPoints(points=some, photos=photos, ray=ray, photo=own, point=place))
    return found
