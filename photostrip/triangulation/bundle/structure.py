"""Which photos share points, in which order their normal equations are a narrow band, and where a block goes in it."""

from __future__ import annotations

from functools import cache

import numpy as np

from photostrip.arrays import Floats, Numbers, distinct
from photostrip.frozen import NamedTuple, dataclass, replace
from photostrip.triangulation.bundle.observations.problem import BundleProblem, ControlObservations
from photostrip.triangulation.bundle.observations.ray_batches import RayBatch, SortedRays, arrange, sort_rays

NARROW = 12  # photos: a band as narrow as this is not worth another order
TABLE = 3_000  # photos: up to here pairs are marked in a square table, which is faster than sorting them


@dataclass(frozen=True, eq=False)
class BlockSums:
    """Sum of blocks that go to the same place."""

    target: Numbers  # (t,): places, each once
    # (b,), or None: blocks in the order of their targets; None when every block has its own target, in order
    order: Numbers | None
    first: Numbers  # (t,): first block of each target in that order

    def add(self, blocks: Floats, total: Floats) -> None:
        """Add blocks (b, ...) to the rows of `total`, in place."""
        flat = blocks.reshape(len(blocks), -1)
        if self.order is not None:
            flat = np.add.reduceat(flat[self.order], self.first, axis=0)
        total.reshape(len(total), -1)[self.target] += flat


@dataclass(frozen=True, eq=False)
class BandStructure:
    """Shape of the normal equations."""

    order: Numbers  # (m,): photos in the order of the band
    rank: Numbers  # (m,): place of each photo in that order
    # rows, columns: (b,): pairs of photos that share points (places in the band, row >= column), every photo with
    # itself among them
    rows: Numbers
    columns: Numbers
    diagonal: Numbers  # (m,): which of the pairs is each photo with itself
    width: int
    batches: tuple[RayBatch, ...]
    # pairs, singles: for each batch: of its blocks to the pairs (by pair within the set of photos, then group), and of
    # its rays to photos (by ray, then group)
    pairs: tuple[BlockSums, ...]
    singles: tuple[BlockSums, ...]


def band_structure(problem: BundleProblem) -> BandStructure:
    """Find which photos share points, an order in which they are a narrow band, and the batches of the points."""
    m = problem.photos
    rank = np.arange(m)
    rays = sort_rays(problem.images, problem.points, rank)
    rows, columns = _pairs(rays, m)
    if (rows - columns).max(initial=0) > NARROW:
        better = _narrower(rows, columns, m)
        if better is not None:
            rank = better
            rays = sort_rays(problem.images, problem.points, rank)
            one, other = rank[rows], rank[columns]
            rows, columns = np.maximum(one, other), np.minimum(one, other)
    key = np.sort(rows * m + columns)
    rows, columns = np.divmod(key, m)
    control = control_normals(problem.control, problem.points)
    batches = tuple(_with_control(batch, control) for batch in arrange(problem.images, rays, m))
    sets = ((batch.sets.T, *triangle(len(batch.photo))) for batch in batches)
    of_sets = ((photo[later] * m + photo[earlier]).ravel() for photo, later, earlier in sets)
    return BandStructure(
        order=np.argsort(rank),
        rank=rank,
        rows=rows,
        columns=columns,
        diagonal=np.flatnonzero(rows == columns),
        width=int((rows - columns).max(initial=0)),
        batches=batches,
        pairs=tuple(_gather(pairs, key) for pairs in of_sets),
        singles=tuple(_gather(batch.sets.T.ravel(), None) for batch in batches),
    )


@cache
def triangle(rays: int) -> tuple[Numbers, Numbers]:
    """Pairs of a set of photos, the later one first: positions within the set."""
    row, column = np.tril_indices(rays)
    return row, column


def _gather(wanted: Numbers, keys: Numbers | None) -> BlockSums:
    """Make the sum of blocks with the keys `wanted`, to their places in `keys` (sorted; None: the key is the place)."""
    order = np.argsort(wanted, kind="stable")
    ordered = wanted[order]
    first = np.flatnonzero(np.concatenate([[True], ordered[1:] != ordered[:-1]]))
    if len(first) == len(wanted):
        target = wanted if keys is None else np.searchsorted(keys, wanted)
        return BlockSums(target, None, first)
    target = ordered[first] if keys is None else np.searchsorted(keys, ordered[first])
    return BlockSums(target, order, first)


def _pairs(rays: SortedRays, photos: int) -> tuple[Numbers, Numbers]:
    """Pairs of photos that share a point, each once, the later photo first; every photo with itself."""
    alone = np.arange(photos) * (photos + 1)
    table = np.zeros(photos * photos, bool) if photos <= TABLE else None
    found = [alone]
    longest = int(rays.counts.max(initial=1))
    for lag in range(1, longest):
        same = rays.point[lag:] == rays.point[:-lag]
        keys = (rays.photo[lag:] * photos + rays.photo[:-lag])[same]
        if table is None:
            found.append(distinct(keys))
        else:
            table[keys] = True
    if table is None:
        keys = distinct(np.concatenate(found))
    else:
        table[alone] = True
        keys = np.flatnonzero(table)
    row, column = np.divmod(keys, photos)
    return row, column


def _narrower(rows: Numbers, columns: Numbers, photos: int) -> Numbers | None:
    """Return the rank of the photos in the reverse Cuthill-McKee order, or None when that is not narrower."""
    near: list[list[int]] = [[] for _ in range(photos)]
    for one, other in zip(rows.tolist(), columns.tolist(), strict=True):
        near[one].append(other)
        near[other].append(one)
    degree = list(map(len, near))
    order: list[int] = []
    seen: set[int] = set()
    for seed in sorted(range(photos), key=degree.__getitem__):  # one for each connected part
        waiting = [seed] if seed not in seen else []
        seen.add(seed)
        for photo in waiting:  # grows
            order.append(photo)
            new = sorted(set(near[photo]) - seen, key=lambda each: (degree[each], each))
            seen.update(new)
            waiting += new
    rank = np.empty(photos, np.intp)
    rank[order[::-1]] = np.arange(photos)
    narrower = np.abs(rank[rows] - rank[columns]).max() < np.abs(rows - columns).max()
    return rank if narrower else None


class ControlNormals(NamedTuple):
    """Normal equations of the c points with control."""

    normal: Floats  # (c, 3, 3): sum of A^T W A over the rows of a point, 1/m^2
    right: Floats  # (c, 3): these matrices times the given positions, 1/m
    where: Numbers  # (q,): row of each point in these; -1: no control


def _with_control(batch: RayBatch, control: ControlNormals) -> RayBatch:
    if not len(control.normal):
        return batch
    slots = batch.real[control.where[batch.point[batch.real]] >= 0]
    at = control.where[batch.point[slots]]
    return replace(
        batch,
        control=slots,
        control_normal=np.ascontiguousarray(control.normal[at].transpose(1, 2, 0)),
        control_right=np.ascontiguousarray(control.right[at].T),
    )


def control_normals(control: ControlObservations, points: int) -> ControlNormals:
    controlled, row = np.unique(control.point, return_inverse=True)
    where = np.full(points, -1)
    where[controlled] = np.arange(len(controlled))
    normals = np.einsum("nai,na,naj->nij", control.axes, control.sigma**-2.0, control.axes)
    normal, right = np.zeros((len(controlled), 3, 3)), np.zeros((len(controlled), 3))
    np.add.at(normal, row, normals)
    np.add.at(right, row, np.einsum("nij,nj->ni", normals, control.xyz))
    return ControlNormals(normal, right, where)
