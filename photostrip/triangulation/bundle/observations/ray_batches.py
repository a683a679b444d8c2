"""How the rays lie in memory: points on the same photos stand side by side.

Eliminating a point leaves a dense square over its photos in the normal equations of the photos. Points with the same
photos fill the same square, so their contributions are one product of matrices: a few thousand products instead
of one for every point, and no index arithmetic inside. A *batch* holds points with the same number of rays;
within it, a *run* holds groups of the same size, each group the points of one set of photos. Groups are filled up with
*dummies* (copies of a point with zero weights) to a few sizes, so that a run is a plain three-dimensional array.

Batches are cut so small that what is computed for one stays in the cache of the processor.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.frozen import NamedTuple, dataclass
from photostrip.triangulation.bundle.observations.problem import ImageObservations

LARGEST_GROUP = 64  # points; larger groups are split
RAYS_OF_BATCH = 6144  # the arrays of a batch then fill some 2 MB
_SIZES = np.array([1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 28, 32, 40, 48, 56, LARGEST_GROUP])


@dataclass(frozen=True, eq=False)
class RayBatch:
    """Points with the same number of rays k, in S slots."""

    point: Numbers  # (S,): point of each slot; that of a dummy is a point of its group
    real: Numbers  # (r,): slots that are not dummies
    dummy: Numbers  # (S - r,): the others
    photo: Numbers  # (k, S): photos of each slot, as numbered by the order of the band, ascending
    row: Numbers  # (k, S): row of each ray in the observations
    xy: Floats  # (2, k, S): image coordinates, mm
    weight: Floats  # (2, k, S): reciprocal sigmas, 1/mm; zero for dummies
    # first and last slot, number of groups, points of a group, for each run
    runs: tuple[tuple[int, int, int, int], ...]
    sets: Numbers  # (groups, k): photos of each group
    control: Numbers  # (c,): slots with control
    control_normal: Floats  # (3, 3, c): normal matrices of the control of these slots, 1/m^2
    control_right: Floats  # (3, c): these matrices times the given positions, 1/m


@dataclass(frozen=True, eq=False)
class SortedRays:
    """Rays sorted by point, then photo."""

    row: Numbers  # (n,): rows of the observations in this order
    photo: Numbers  # (n,): photos of these, as places in the band
    point: Numbers  # (n,): points of these
    counts: Numbers  # (q,): number of rays of each point


def sort_rays(images: ImageObservations, points: int, rank: Numbers) -> SortedRays:
    """Sort rays by point, then photo, whose places in the band are ``rank`` (m,)."""
    photo = rank[images.photo]
    row = np.argsort(images.point * np.intp(len(rank)) + photo)
    return SortedRays(
        row=row, photo=photo[row], point=images.point[row], counts=np.bincount(images.point, minlength=points)
    )


def arrange(images: ImageObservations, rays: SortedRays, photos: int) -> tuple[RayBatch, ...]:
    """Arrange sorted rays of so many photos in batches, without control."""
    first = np.cumsum(rays.counts) - rays.counts
    batches: list[RayBatch] = []
    for count in np.flatnonzero(np.bincount(rays.counts)).tolist():
        if count:
            members = np.flatnonzero(rays.counts == count)
            at = first[members] + np.arange(count)[:, None]
            batches += _batches(images, members, rays.photo[at], rays.row[at], photos)
    return tuple(batches)


def _batches(images: ImageObservations, members: Numbers, photo: Numbers, row: Numbers, photos: int) -> list[RayBatch]:
    """Arrange points with the same number of rays; `photo` and `row` have shape (k, points)."""
    sets = _groups(photo, photos)
    count = sets.size
    pieces = -(-count // LARGEST_GROUP)
    size = -(-count // pieces)
    slots = _SIZES[np.searchsorted(_SIZES, size)]
    # A row for each piece of a group, pieces of one size together.
    group = np.repeat(np.arange(len(count)), pieces)
    piece = np.arange(len(group)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    begin = sets.first[group] + piece * size[group]
    length = np.minimum(size[group], sets.first[group] + count[group] - begin)
    by_size = np.argsort(slots[group], kind="stable")
    begin, length, slots = begin[by_size], length[by_size], slots[group][by_size]
    ends = np.cumsum(slots)
    batch = (ends - 1) * len(photo) // RAYS_OF_BATCH
    cuts = [0, *(np.flatnonzero(np.diff(batch)) + 1).tolist(), len(slots)]
    return [
        _batch(images, members, photo, row, sets.order, _Pieces(begin[a:b], length[a:b], slots[a:b]))
        for a, b in pairwise(cuts)
    ]


class _Groups(NamedTuple):
    """Points by their sets of photos."""

    order: Numbers  # points in the order of their sets
    first: Numbers  # first place of each set in this order
    size: Numbers  # points of each set


class _Pieces(NamedTuple):
    begin: Numbers  # first place in the order of the points
    length: Numbers  # number of points
    slots: Numbers  # number of slots


def _groups(photo: Numbers, photos: int) -> _Groups:
    """Sort points by their sets of photos: a set is a number to the base of the number of photos."""
    key = photo[0].astype(np.int64)
    largest = photos
    for column in photo[1:]:
        if largest > np.iinfo(np.int64).max // photos:
            key, largest = np.unique(key, return_inverse=True)[1], len(key)
        key = key * photos + column
        largest *= photos
    order = np.argsort(key, kind="stable")
    ordered = key[order]
    first = np.flatnonzero(np.concatenate([[True], ordered[1:] != ordered[:-1]]))
    return _Groups(order, first, np.diff(first, append=len(order)))


def _batch(
    images: ImageObservations,
    members: Numbers,
    photo: Numbers,
    row: Numbers,
    order: Numbers,
    groups: _Pieces,
) -> RayBatch:
    """Fill the slots of one batch with the points of its groups."""
    begin, length, slots = groups
    start = np.cumsum(slots) - slots
    place = np.arange(slots.sum()) - np.repeat(start, slots)
    held = np.repeat(length, slots)
    real = place < held
    member = order[np.repeat(begin, slots) + np.where(real, place, 0)]
    rows = row[:, member]
    weight = np.zeros((2, *rows.shape))
    shown = rows[:, real]
    weight[:, :, real] = 1.0 / np.moveaxis(images.sigma[shown], 2, 0)
    changes = [0, *(np.flatnonzero(np.diff(slots)) + 1).tolist(), len(slots)]
    edges = np.append(start, slots.sum())
    return RayBatch(
        point=members[member],
        real=np.flatnonzero(real),
        dummy=np.flatnonzero(~real),
        photo=np.ascontiguousarray(photo[:, member]),
        row=rows,
        xy=np.ascontiguousarray(np.moveaxis(images.xy[rows], 2, 0)),
        weight=weight,
        runs=tuple((int(edges[a]), int(edges[b]), b - a, int(slots[a])) for a, b in pairwise(changes)),
        sets=np.ascontiguousarray(photo[:, order[begin]].T),
        control=np.zeros(0, np.intp),
        control_normal=np.zeros((3, 3, 0)),
        control_right=np.zeros((3, 0)),
    )
