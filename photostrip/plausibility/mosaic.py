"""Photos laid out side by side in a plane by their common points, whatever their order in the list.

Two photos that share points are linked by a plane similarity, z_b = m z_a + t with complex image coordinates, and by a
mirrored one, z_b = m conj(z_a) + t; the one that fits says whether one of them is a mirror image. Relief and tilts
leave residuals of millimetres, so a link says nothing about accuracy, but much about order, overlap and mistakes.
Links do not depend on the principal distance, on the unit, on the order of the photos, or on control.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.points import PhotoPoints

Complex = NDArray[np.complex128]

LARGEST_LAG = 12  # photos on which a point is followed on; a strip with 90 % end lap has 10
REWEIGHTINGS = 6  # of the reweighting: a gross error must not turn a link
LEAST_COMMON = 2  # common points of a link
LEAST_COMMON_OF_MIRROR = 5  # common points that tell a mirror image
MIRROR_MISFIT_SHARE = 0.25  # of the mirrored to the plain misfit
MOST_MIRROR_MISFIT = 0.12  # of the spread of the points; relief and tilts leave less
LEAST_BREADTH = 0.15  # breadth over length of the common points: mirror images of a line fit as well
# of the spread of the points left by a link: relief leaves 0.1, an oblique mount 0.33, other points 0.9
MOST_SHARE = 0.4
# times as far from the centre of a photo as four fifths of its points: a gross error, which turns any fit
FAR_OUTSIDE = 3.0
FAR_SHARE = 0.8
SCALE_JUMP = 4.0  # ratio of the scales of two photos that neither height nor an oblique mount explains
TINY = 1e-12


@dataclass(frozen=True, eq=False)
class PhotoLinks:
    """Photos of one strip that share points, two and two."""

    photo: Numbers  # (l, 2): places of the two photos in the strip's list, the smaller first
    count: Numbers  # (l,): common points
    # turn, shift: (l,): second photo from first: z_b = turn z_a + shift, or with conj(z_a) where `mirrored`
    turn: Complex
    shift: Complex
    misfit: Floats  # (l,): mean residual, in the unit of the image coordinates
    mirrored: Flags  # (l,): whether one of the two is a mirror image of the other
    share: Floats  # (l,): mean residual over the spread of the points

    @property
    def fits(self) -> Flags:
        """Whether two photos show the same points at all."""
        return np.asarray(self.share < MOST_SHARE)

    @property
    def jumps(self) -> Flags:
        """Whether two photos that show the same points are at scales that no flight explains."""
        return np.asarray(self.fits & (np.abs(np.log(np.maximum(np.abs(self.turn), TINY))) >= np.log(SCALE_JUMP)))

    @property
    def alike(self) -> bool:
        """Whether no photo is a mirror image of another, nor at another scale."""
        return not (self.mirrored.any() or self.jumps.any())

    @cached_property
    def bases(self) -> tuple[Complex, Complex]:
        """Centre of the second photo as it would lie on the first, and of the first on the second."""
        with np.errstate(invalid="ignore"):
            back = -self.shift / np.where(np.abs(self.turn) > TINY, self.turn, np.nan)
        return np.where(self.mirrored, np.conj(back), back), self.shift

    @cached_property
    def index(self) -> dict[tuple[int, int], int]:
        """Row of each link by its two photos."""
        return {(a, b): row for row, (a, b) in enumerate(self.photo.tolist())}


def link(observations: PhotoPoints, photos: Sequence[str]) -> PhotoLinks:
    """Link every two photos of a strip that have at least two common points.

    observations: image points of the project, in any unit.
    photos: photos of the strip; a photo that is listed twice counts where it stands first.
    """
    common = _common_points(observations, photos)
    order = np.argsort(common.pair, kind="stable")
    pair = common.pair[order]
    first = np.flatnonzero(np.diff(pair, prepend=-1))
    count = np.diff(first, append=len(pair))
    enough = count >= LEAST_COMMON
    rows = order[np.repeat(enough, count)]
    z_a, z_b, near = common.z_a[rows], common.z_b[rows], common.near[rows]
    pairs, count = pair[first[enough]], count[enough]
    if not len(pairs):
        none, nowhere = np.zeros(0), np.zeros(0, complex)
        return PhotoLinks(
            photo=np.zeros((0, 2), np.intp),
            count=np.zeros(0, np.intp),
            turn=nowhere,
            shift=nowhere,
            misfit=none,
            mirrored=np.zeros(0, bool),
            share=none,
        )
    plain = _similar(z_a, z_b, near, count)
    turn, shift, misfit = plain.turn, plain.shift, plain.misfit
    spread, _ = _shape(z_b, plain.weight, count)
    mirrored = np.zeros(len(pairs), bool)
    # where the plain one leaves no more than relief and tilts do, the mirrored one leaves far more
    asked = np.flatnonzero((count >= LEAST_COMMON_OF_MIRROR) & (misfit > MOST_MIRROR_MISFIT * spread))
    if len(asked):
        points = np.isin(np.repeat(np.arange(len(pairs)), count), asked)
        mirror = _similar(np.conj(z_a[points]), z_b[points], near[points], count[asked])
        of_mirror, narrow = _shape(z_b[points], mirror.weight, count[asked])
        better = (mirror.misfit < MIRROR_MISFIT_SHARE * misfit[asked]) & ~narrow
        better &= mirror.misfit < MOST_MIRROR_MISFIT * of_mirror
        mirrored[asked] = better
        for values, of_mirrored in (
            (turn, mirror.turn),
            (shift, mirror.shift),
            (misfit, mirror.misfit),
            (spread, of_mirror),
        ):
            values[mirrored] = of_mirrored[better]
    return PhotoLinks(
        photo=np.column_stack(np.divmod(pairs, len(photos))).astype(np.intp),
        count=count.astype(np.intp),
        turn=turn,
        shift=shift,
        misfit=misfit,
        mirrored=mirrored,
        share=misfit / np.maximum(spread, TINY),
    )


class _CommonPoints(NamedTuple):
    """Points of two photos, one row for each point of each two photos."""

    pair: Numbers  # first photo times the number of photos, plus the second
    # z_a, z_b: complex image coordinates on the first and on the second photo
    z_a: Complex
    z_b: Complex
    near: Floats  # weight of each: nothing where it lies far outside one of the photos


def _common_points(observations: PhotoPoints, photos: Sequence[str]) -> _CommonPoints:
    """Follow every point from photo to photo."""
    place: dict[str, int] = {}
    for number, name in enumerate(photos):
        place.setdefault(name, number)
    position = np.array([place.get(name, -1) for name in observations.photo_ids], np.intp)[observations.photo]
    inside = np.flatnonzero(position >= 0)
    order = inside[np.argsort(observations.point[inside] * len(photos) + position[inside], kind="stable")]
    point, position = observations.point[order], position[order]
    z = observations.xy[order, 0] + 1j * observations.xy[order, 1]
    near = _near(np.abs(z), position)
    ones, others = [np.zeros(0, np.intp)], [np.zeros(0, np.intp)]
    for lag in range(1, LARGEST_LAG + 1):
        rows = np.flatnonzero((point[lag:] == point[:-lag]) & (position[lag:] > position[:-lag]))
        if not len(rows):
            break
        ones.append(rows)
        others.append(rows + lag)
    one, other = np.concatenate(ones), np.concatenate(others)
    return _CommonPoints(
        pair=position[one] * len(photos) + position[other],
        z_a=z[one],
        z_b=z[other],
        near=np.minimum(near[one], near[other]),
    )


def _near(size: Floats, photo: Numbers) -> Floats:
    """Weights of image points, by their distances from the centres of their photos: next to nothing far outside."""
    count = np.bincount(photo)
    within = (FAR_SHARE * (count - 1)).astype(np.intp)
    outer = np.bincount(photo[FAR_OUTSIDE * size >= size.max(initial=0.0)], minlength=len(count))
    asked = outer < count - within  # the others reach far enough for the farthest point of all photos
    rows = np.flatnonzero(asked[photo])
    order = rows[np.lexsort((size[rows], photo[rows]))]
    held = np.where(asked, count, 0)
    last = np.cumsum(held) - held + within
    reach = np.full(len(count), np.inf)
    reach[asked] = size[order[last[asked]]]
    return np.where(size > FAR_OUTSIDE * reach[photo], TINY, 1.0)


class _Similarities(NamedTuple):
    """Plane similarities z_b = turn z_a + shift, one for each pair of photos."""

    turn: Complex
    shift: Complex
    misfit: Floats  # mean residual
    weight: Floats  # of each point, which falls with its residual


def _similar(z_a: Complex, z_b: Complex, near: Floats, count: Numbers) -> _Similarities:
    """Fit a plane similarity to each segment of so many points, with weights that fall with the residual."""
    segment, starts = np.repeat(np.arange(len(count)), count), np.cumsum(count) - count
    weight = near
    turn, shift = np.zeros(len(starts), complex), np.zeros(len(starts), complex)
    misfit = np.zeros(len(starts))
    for _ in range(REWEIGHTINGS):
        total = np.add.reduceat(weight, starts)
        mean_a, mean_b = (np.add.reduceat(weight * z, starts) / total for z in (z_a, z_b))
        d_a, d_b = z_a - mean_a[segment], z_b - mean_b[segment]
        squares = np.add.reduceat(weight * np.abs(d_a) ** 2, starts)
        turn = np.asarray(np.add.reduceat(weight * np.conj(d_a) * d_b, starts) / np.maximum(squares, TINY**2), complex)
        shift = mean_b - turn * mean_a
        size = np.abs(d_b - turn[segment] * d_a)
        misfit = np.add.reduceat(weight * size, starts) / total
        weight = near / np.maximum(size / np.maximum(misfit, TINY)[segment], 0.5)
    return _Similarities(turn=turn, shift=shift, misfit=misfit, weight=weight)


def _shape(z: Complex, weight: Floats, count: Numbers) -> tuple[Floats, Flags]:
    """Rms distance from the centre, and whether the points stand nearly on one line; by the points that a fit kept."""
    segment, starts = np.repeat(np.arange(len(count)), count), np.cumsum(count) - count
    total = np.add.reduceat(weight, starts)
    d = z - (np.add.reduceat(weight * z, starts) / total)[segment]
    squares = np.add.reduceat(weight * np.abs(d) ** 2, starts)
    skew = np.abs(np.add.reduceat(weight * d**2, starts))  # length squared minus breadth squared
    with np.errstate(divide="ignore", invalid="ignore"):
        breadth = np.sqrt((squares - skew) / (squares + skew))
    return np.sqrt(squares / total), ~(breadth > LEAST_BREADTH)


@dataclass(frozen=True, eq=False)
class Mosaic:
    """Photos of a strip in one plane: Z = factor z + offset, with conj(z) for mirrored photos."""

    part: Numbers  # (n,): which connected part each photo belongs to; the largest part is 0
    factor: Complex  # (n,)
    offset: Complex  # (n,): centre of each photo in the plane of its part
    mirrored: Flags  # (n,): photos that are mirror images of most of the others of their part
    # (n,): how many times larger the coordinates of a photo are than those of most others; changes of a few ten percent
    # from photo to photo, which are changes of the flying height, do not count
    size: Floats


def lay_out(links: PhotoLinks, photos: int) -> Mosaic:
    """Bring the photos of a strip into one plane, along the links with most points."""
    around: list[list[tuple[int, int]]] = [[] for _ in range(photos)]
    for row, (a, b) in enumerate(links.photo.tolist()):
        around[a].append((row, b))
        around[b].append((row, a))
    plane = Mosaic(
        part=np.full(photos, -1, np.intp),
        factor=np.ones(photos, complex),
        offset=np.zeros(photos, complex),
        mirrored=np.zeros(photos, bool),
        size=np.ones(photos),
    )
    for start in range(photos):
        if plane.part[start] < 0:
            plane.part[start] = plane.part.max() + 1
            _grow(start, around, links, plane)
    for number in range(int(plane.part.max(initial=-1)) + 1):
        inside = plane.part == number
        if 2 * plane.mirrored[inside].sum() > inside.sum():  # most photos count as not mirrored: turn the plane over
            plane.factor[inside], plane.offset[inside] = np.conj(plane.factor[inside]), np.conj(plane.offset[inside])
            plane.mirrored[inside] = ~plane.mirrored[inside]
        plane.size[inside] /= np.median(plane.size[inside])
    sizes = np.bincount(plane.part, minlength=1)
    rank = np.empty(len(sizes), np.intp)
    rank[np.argsort(-sizes, kind="stable")] = np.arange(len(sizes))
    return replace(plane, part=rank[plane.part])


def _grow(start: int, around: Sequence[Sequence[tuple[int, int]]], links: PhotoLinks, plane: Mosaic) -> None:
    """Place all photos that hang together with one, strongest links first; the rows of `plane` are filled in."""
    jumps, links_mirrored = links.jumps.tolist(), links.mirrored.tolist()
    turns, shifts, rank = links.turn.tolist(), links.shift.tolist(), np.where(links.fits, -links.count, 0).tolist()
    queue = [(rank[row], row, start, other) for row, other in around[start]]
    heapq.heapify(queue)
    while queue:
        _, row, known, new = heapq.heappop(queue)
        if plane.part[new] >= 0:
            continue
        plane.part[new] = plane.part[known]
        turn, shift, mirrored = turns[row], shifts[row], links_mirrored[row]
        if known < new:  # z_new = turn z_known + shift, so z_known = (z_new - shift) / turn
            turn, shift = (1.0 / turn, -shift / turn) if abs(turn) > TINY else (0j, 0j)
            if mirrored:
                turn, shift = turn.conjugate(), shift.conjugate()
        # z_known = turn z_new + shift, or of conj(z_new)
        if plane.mirrored[known]:  # the plane takes conj(z_known)
            turn, shift = turn.conjugate(), shift.conjugate()
        plane.mirrored[new] = plane.mirrored[known] ^ mirrored
        plane.size[new] = plane.size[known] * (1 / max(abs(turn), TINY) if jumps[row] else 1.0)
        plane.factor[new] = plane.factor[known] * turn
        plane.offset[new] = plane.factor[known] * shift + plane.offset[known]
        for link_row, other in around[new]:
            if plane.part[other] < 0:
                heapq.heappush(queue, (rank[link_row], link_row, new, other))
