"""Stereopairs of a strip: the points that neighbouring photos have in common.

The measurements of all pairs stand in flat columns ordered by pair; sums over a pair are segment sums, so that a
thousand pairs cost little more than one.

Elements of relative orientation by least squares on the y parallaxes, all pairs in one batch.

The five elements are (alpha1', kappa1', alpha2', omega2', kappa2'), angles of the left and the right photo relative to
the base frame: x' along the base, omega1' = 0. The rays of a point meet when its y parallax in that frame vanishes;
Gauss-Newton steps from the mean direction of the parallaxes, with other azimuths where that leads astray.

Source: [001] for the elements; condition, derivatives, start values and retries are derived.

Relative orientation of stereopairs: oriented pairs, how good they are, and which cannot be used.

Source: [001] for the elements; precision and criteria are derived.

Six standard points: the precision of their relative orientation, to the first order.

The points, in the left photo: 1 (0, 0), 2 (b, 0), 3 (0, a), 4 (b, a), 5 (0, -a), 6 (b, -a) with the photo base b.
Elements are those of ``relative``: alpha1', kappa1', alpha2', omega2', kappa2'.

Source: derived from the linear condition; the weight numbers of the dependent pair are those of [Hallert].

Standard zones of a pair: which of the six standard (Gruber) positions a point stands for.

The positions are those of the base frame, in the left photo, numbered as in the literature::

    3 (0, a)    4 (b, a)
    1 (0, 0)    2 (b, 0)
    5 (0, -a)   6 (b, -a)

with the photo base b and the spread a of the pair's own points. The numbers do not change when photos are turned.

Source: [004a], [001]; base and spread from the points are chosen here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from photostrip.arrays import Flags, Floats, Numbers, pieces
from photostrip.errors import GeometryError
from photostrip.geometry.rotation import from_alpha_omega_kappa
from photostrip.notes import counted
from photostrip.points import PhotoPoints, frozen_alike, take_rows

MINIMUM_POINTS = 5  # as many as elements
COLUMNS_BY_ROW = ("pair", "left", "right", "weight", "point", "rows")


@dataclass(frozen=True, eq=False)
class Pairs:
    """What is measured in stereopairs: flat columns, ordered by pair."""

    starts: Numbers  # (p,): first row of each pair
    pair: Numbers  # (m,): pair of each row
    # left, right: (m, 2): image coordinates in mm, reduced to the principal point
    left: Floats
    right: Floats
    weight: Floats  # (m,): weight of the y parallax; 0 takes a point out
    focal: float  # principal distance in mm
    point: Numbers  # (m,): point of each row
    rows: Numbers  # (m, 2): rows of the measurements on the left and right photo in the table of image points

    @property
    def size(self) -> int:
        return len(self.starts)

    def rows_of(self, numbers: Numbers) -> Numbers:
        """Rows of some pairs, ascending."""
        wanted = np.zeros(self.size, bool)
        wanted[numbers] = True
        return np.flatnonzero(wanted[self.pair])

    def take(self, numbers: Numbers) -> Pairs:
        """Take some of the pairs, given by ascending numbers; they are renumbered from 0."""
        part = take_rows(self, self.rows_of(numbers), COLUMNS_BY_ROW)
        pair = np.searchsorted(numbers, part.pair)
        return replace(part, pair=pair, starts=np.searchsorted(pair, np.arange(len(numbers))))

    def without(self, gone: Flags) -> Pairs:
        """Leave out rows; each pair must keep one."""
        if not gone.any():
            return self
        left = take_rows(self, ~gone, COLUMNS_BY_ROW)
        return replace(left, starts=np.searchsorted(left.pair, np.arange(self.size)))

    def some_points(self, most: int) -> Numbers:
        """Draw points of which each pair has as many as that, or all it has."""
        points = int(self.point.max(initial=-1)) + 1
        order = np.random.default_rng(0).permutation(points)[self.point]  # the same in all its pairs
        rows = np.lexsort((order, self.pair))
        rank = np.arange(len(rows)) - self.starts[self.pair]
        return np.unique(self.point[rows[rank < most]])

    def sums(self, values: Floats) -> Floats:
        """Sum columns over each pair: values by row, shape (..., m), become sums by pair, shape (..., p)."""
        return np.add.reduceat(values, self.starts, axis=-1)


def collect_pairs(observations: PhotoPoints, photos: Sequence[str], focal: float) -> Pairs:
    """Points measured on neighbouring photos of a strip, as pairs.

    photos: photos of the strip in flight order; pair i is made of photos i and i+1.
    Returns measurements; weights are 1 where the standard deviations across the base are the strip's median.
    Raises GeometryError when a pair has fewer than five common points.
    """
    place = {photo: number for number, photo in enumerate(photos)}
    order_of = np.array([place.get(photo, -1) for photo in observations.photo_ids], np.intp)
    position = order_of[observations.photo]
    inside = np.flatnonzero(position >= 0)
    order = inside[np.lexsort((position[inside], observations.point[inside]))]
    point, position = observations.point[order], position[order]
    both = np.flatnonzero((point[1:] == point[:-1]) & (position[1:] == position[:-1] + 1))
    both = both[np.argsort(position[both], kind="stable")]
    rows = np.column_stack([order[both], order[both + 1]])
    pair = position[both]
    counts = np.bincount(pair, minlength=len(photos) - 1)
    _require_points(counts, photos)
    left, right = observations.xy[rows[:, 0]], observations.xy[rows[:, 1]]
    variance = observations.sigma**2
    x, y = (np.bincount(pair, shift, len(counts)).astype(float) for shift in (left - right).T)
    across = _across(x, y)[pair]
    of_parallax = (variance[rows, 1] + (variance[rows, 0] - variance[rows, 1]) * across[:, None]).sum(axis=1)
    return Pairs(
        starts=np.concatenate([[0], np.cumsum(counts)[:-1]]),
        pair=pair,
        left=left,
        right=right,
        weight=frozen_alike(2 * np.median(observations.sigma[inside]) ** 2 / of_parallax, float, (len(rows),)),
        focal=focal,
        point=observations.point[rows[:, 0]],
        rows=rows,
    )


def _across(x: Floats, y: Floats) -> Floats:
    """Shares (p,) of x in a variance across the base, along which common points shift by x, y (p,) between photos."""
    squares = x**2 + y**2
    return np.divide(y**2, squares, out=np.zeros(len(x)), where=squares > 0.0)


def _require_points(counts: Numbers, photos: Sequence[str]) -> None:
    for number in np.flatnonzero(counts < MINIMUM_POINTS).tolist():
        names = photos[number : number + 2]
        msg = (
            f"relative orientation of photos {names[0]} and {names[1]}: "
            f"{counted(int(counts[number]), 'common point')}, at least {MINIMUM_POINTS} are necessary (12 are "
            "recommended); measure more points or correct the order of the photos"
        )
        raise GeometryError(msg, photos=names, code="too-few-common-points")


ELEMENTS = ("alpha1", "kappa1", "alpha2", "omega2", "kappa2")
CONVERGED = 1e-10  # rad
ITERATIONS = 30
HOPELESS = (12, 0.01)  # steps after which a step in rad is too long: those that converge are below 0.002 by then
LARGEST_STEP = 0.5  # rad; a longer step is shortened, far starts swing otherwise
RIDGE = 1e-13  # relative; keeps a singular pair from stopping the batch, changes no digit of a regular one
RETRY_AZIMUTHS = np.radians([15, -15, 30, -30, 60, -60, 90, -90, 180])
RETRY_RMS = 1e-3  # of the base in the photo: a larger rms y parallax is a false minimum or a gross error


class Solved(NamedTuple):
    """Elements of pairs, as the iteration found them."""

    elements: Floats  # (p, 5), rad
    converged: Flags  # (p,): whether the last step was below ``CONVERGED``
    iterations: Numbers  # (p,): steps made


class Linearised(NamedTuple):
    """The condition of relative orientation near given elements."""

    parallax: Floats  # (m,): residual y parallaxes q, mm
    jacobian: Floats  # (5, m): dq/de, mm per radian


def turns(elements: Floats) -> tuple[Floats, Floats]:
    """Rotations of the left and the right photo against the base frame, (p, 3, 3) each."""
    al1, ka1, al2, om2, ka2 = elements.T
    return from_alpha_omega_kappa(al1, 0.0, ka1), from_alpha_omega_kappa(al2, om2, ka2)


def base_rays(elements: Floats, pairs: Pairs) -> tuple[Floats, Floats]:
    """Image rays of the left and the right photo in the base frame, X, Y, Z in mm, shape (3, m) each.

    Source: [001] eq. 132-133, 137, relative to the base.
    """
    turned: list[Floats] = []
    for rotation, xy in zip(turns(elements), (pairs.left, pairs.right), strict=True):
        rays = np.empty((3, len(xy)))
        for row, (a, b, c) in enumerate(rotation.transpose(1, 2, 0)):
            along = a.take(pairs.pair) * xy[:, 0] + b.take(pairs.pair) * xy[:, 1]
            rays[row] = along - (c * pairs.focal).take(pairs.pair)  # eq. 137
        turned.append(rays)
    return turned[0], turned[1]


def y_parallaxes(elements: Floats, pairs: Pairs) -> Floats:
    """Residual y parallaxes q = y1 - y2 of the photos turned into the base frame, mm at photo scale, shape (m,)."""
    return _parallaxes(*base_rays(elements, pairs), pairs.focal)


def _parallaxes(left: Floats, right: Floats, focal: float) -> Floats:
    return np.asarray(-focal * (left[1] / left[2] - right[1] / right[2]), float)


def linearised_parallaxes(elements: Floats, pairs: Pairs) -> Linearised:
    """Residual y parallaxes and their exact derivatives by the five elements.

    With q = -f (Y1/Z1 - Y2/Z2) each derivative is that of a ratio: dq = -f (dY Z - Y dZ) / Z^2 for the left photo,
    with the other sign for the right one.
    """
    f = pairs.focal
    (lx, ly, lz), (rx, ry, rz) = base_rays(elements, pairs)
    sines, cosines = np.sin(elements), np.cos(elements)
    sa1, sk1, sa2, so2, sk2 = sines.T[:, pairs.pair]
    _, ck1, ca2, co2, ck2 = cosines.T[:, pairs.pair]
    u = ck2 * pairs.right[:, 0] - sk2 * pairs.right[:, 1]
    v = sk2 * pairs.right[:, 0] + ck2 * pairs.right[:, 1]
    left_scale, right_scale = -f / lz**2, f / rz**2
    jacobian = np.empty((5, len(lx)))
    jacobian[0] = -left_scale * ly * lx
    jacobian[1] = left_scale * ((ck1 * pairs.left[:, 0] - sk1 * pairs.left[:, 1]) * lz + ly * sa1 * ly)
    jacobian[2] = -right_scale * ry * rx
    jacobian[3] = right_scale * ((co2 * f - so2 * v) * rz - ry * ca2 * ry)
    jacobian[4] = right_scale * (co2 * u * rz - ry * (ca2 * so2 * u - sa2 * v))
    return Linearised(-f * (ly / lz - ry / rz), jacobian)


def normal_matrices(jacobian: Floats, pairs: Pairs) -> Floats:
    """Form the normal matrices J^T W J of all pairs, shape (p, 5, 5), from the derivatives, shape (5, m)."""
    normal = np.empty((pairs.size, 5, 5))
    for row, weighted in enumerate(jacobian * pairs.weight):
        normal[:, row, row:] = pairs.sums(weighted * jacobian[row:]).T
        normal[:, row:, row] = normal[:, row, row:]
    return normal


def gauss_newton_steps(line: Linearised, pairs: Pairs, ridge: float, longest: float) -> tuple[Floats, Floats]:
    """Compute changes of the elements, shape (p, 5), none longer than ``longest``, and their sizes before that, rad.

    The normal matrices are scaled to unit diagonals, on which ``ridge`` is added. A pair that has lost all meaning
    gets a step of zero and the size NaN.
    """
    diagonal = np.arange(5)
    normal = normal_matrices(line.jacobian, pairs)
    scale = 1 / np.sqrt(np.maximum(normal[:, diagonal, diagonal], 1e-300))
    normal *= scale[:, :, None] * scale[:, None, :]
    normal[:, diagonal, diagonal] += ridge
    right = pairs.sums(line.jacobian * (pairs.weight * line.parallax)).T * scale
    sound = np.isfinite(normal).all(axis=(1, 2)) & np.isfinite(right).all(axis=1)
    normal[~sound], right[~sound] = np.eye(5), 0.0
    step = -np.linalg.solve(normal, right[:, :, None])[:, :, 0] * scale
    largest = np.abs(step).max(axis=1)
    step *= np.minimum(1.0, longest / np.maximum(largest, longest))[:, None]
    return step, np.where(sound, largest, np.nan)


def start_values(pairs: Pairs) -> Floats:
    """Elements (0, kappa0, 0, 0, kappa0) that turn both photos so that the mean parallax runs along x."""
    x, y = _base_in_photo(pairs)
    start = np.zeros((pairs.size, 5))
    start[:, 1] = start[:, 4] = -np.arctan2(y, x)
    return start


def _base_in_photo(pairs: Pairs) -> Floats:
    """Mean parallaxes (2, p) of pairs as they were measured, along x and y of the photos, mm."""
    parallax = ((pairs.left - pairs.right) * pairs.weight[:, None]).T
    return np.asarray(pairs.sums(parallax) / np.maximum(pairs.sums(pairs.weight), 1e-300))


def iterate_elements(
    elements: Floats, pairs: Pairs, watch: Callable[[Numbers, Floats, Floats, Floats], None] | None = None
) -> Solved:
    """Gauss-Newton iteration of all pairs from given elements; converged pairs leave the batch.

    watch: called at every step with the numbers of the pairs that take part, their elements before it, their sums of
        weighted squares of the y parallaxes in mm^2, and what is added to the elements.
    """
    result = elements.copy()
    converged = np.zeros(pairs.size, bool)
    steps = np.zeros(pairs.size, np.intp)
    todo, part = np.arange(pairs.size), pairs
    for number in range(ITERATIONS):
        if not len(todo):
            break
        with np.errstate(all="ignore"):
            line = linearised_parallaxes(result[todo], part)
            step, size = gauss_newton_steps(line, part, RIDGE, LARGEST_STEP)
        if watch is not None:
            watch(todo, result[todo], part.sums(part.weight * line.parallax**2), step)
        result[todo] += step
        steps[todo] += 1
        converged[todo[size < CONVERGED]] = True
        going = (size >= CONVERGED) & ((number < HOPELESS[0]) | (size < HOPELESS[1]))
        if not going.all():
            part = part.take(np.flatnonzero(going))
            todo = todo[going]
    return Solved(reduced_angles(result), converged, steps)


def reduced_angles(elements: Floats) -> Floats:
    """Bring angles into -pi to pi."""
    return (elements + np.pi) % (2 * np.pi) - np.pi


def in_front_of_cameras(elements: Floats, pairs: Pairs) -> Flags:
    """Whether each point lies in front of both cameras: its rays meet on their way down, shape (m,)."""
    return rays_meet_in_front(*base_rays(elements, pairs))


def rays_meet_in_front(left: Floats, right: Floats) -> Flags:
    """Whether rays in the base frame, shape (3, m), meet in front of both cameras."""
    to_left, to_right = _distances(left, right)
    return np.asarray((to_left > 0) & (to_right > 0), bool)


def _distances(left: Floats, right: Floats) -> tuple[Floats, Floats]:
    """Distances along both rays to where they meet in the plane of x' and z', in units of the ray and the base."""
    (lx, _, lz), (rx, _, rz) = left, right
    determinant = lx * rz - rx * lz
    with np.errstate(all="ignore"):
        return rz / determinant, lz / determinant


def solve_elements(pairs: Pairs) -> Solved:
    """Elements of all pairs from nothing: start values, iteration, retries from other azimuths.

    A pair is tried again with its start azimuth turned by 15 to 180 degrees when it does not converge, a point comes
    out behind a camera, or the y parallaxes stay large: with tilts beyond 10 degrees, in a narrow field beyond 2, there
    are false minima with all points in front. Of the solutions found, the one with most points in front and then the
    smallest sum of squares is taken.
    """
    start = start_values(pairs)
    best, converged, steps = iterate_elements(start, pairs)
    best, rays = facing(best, pairs)
    share, squares = _score(rays, converged, pairs)
    tolerable = RETRY_RMS**2 * np.square(_base_in_photo(pairs)).sum(axis=0) * pairs.sums(pairs.weight)
    for turn in RETRY_AZIMUTHS:
        todo = np.flatnonzero((share < 1) | (squares > tolerable))
        if not len(todo):
            break
        part = pairs.take(todo)
        turned = start[todo]
        turned[:, [1, 4]] += turn
        elements, success, count = iterate_elements(turned, part)
        elements, rays = facing(elements, part)
        new_share, new_squares = _score(rays, success, part)
        more = new_share > share[todo] + 1e-9
        as_many = new_share > share[todo] - 1e-9
        better = more | (as_many & (new_squares < squares[todo]))
        chosen = todo[better]
        best[chosen], converged[chosen], steps[chosen] = elements[better], success[better], count[better]
        share[chosen], squares[chosen] = new_share[better], new_squares[better]
    return Solved(best, converged, steps)


def facing(elements: Floats, pairs: Pairs) -> tuple[Floats, tuple[Floats, Floats]]:
    """Turn the base of pairs round whose points lie behind both cameras: the same planes, the other side; and rays."""
    rays = base_rays(elements, pairs)
    to_left, to_right = _distances(*rays)
    behind = (to_left < 0) & (to_right < 0) & (pairs.weight > 0)
    away = 2 * pairs.sums(behind.astype(float)) > pairs.sums((pairs.weight > 0).astype(float))
    if not away.any():
        return elements, rays
    result = elements.copy()
    result[away] *= [-1.0, 1.0, -1.0, -1.0, 1.0]
    result[away, 1] += np.pi
    result[away, 4] += np.pi
    result = reduced_angles(result)
    return result, base_rays(result, pairs)


def _score(rays: tuple[Floats, Floats], converged: Flags, pairs: Pairs) -> tuple[Floats, Floats]:
    """Share of the points in front (-1 where not converged) and weighted sum of squares, by pair."""
    used = pairs.weight > 0
    with np.errstate(all="ignore"):
        front = pairs.sums((rays_meet_in_front(*rays) & used).astype(float))
        share = front / np.maximum(pairs.sums(used.astype(float)), 1)
        squares = pairs.sums(pairs.weight * _parallaxes(*rays, pairs.focal) ** 2)
    return np.where(converged, share, -1.0), np.where(np.isfinite(squares), squares, np.inf)


CONDITION_LIMIT = 1e6  # of the column-normalised Jacobian
SMALLEST_PARALLAX = 1e-3  # of the principal distance, mean over a pair: below it there is no base to speak of
LEAST_IN_FRONT = 0.5  # share of the points of a pair
SCREENINGS = ("auto", "parallax+grubbs", "tau", "deletion", "robust", "none")  # searches for gross errors
# whose cofactors are laid out together: those of 87 000 rows are the largest block of a run, and once it is freed, the
# C library keeps all smaller ones for itself, too
ROWS = 32_768
BY_PAIR = ("elements", "sigmas", "sigma0", "condition", "iterations", "cofactors")
BY_ROW = ("parallax", "redundancy")


@dataclass(frozen=True)
class RelativeSettings:
    """How pairs are oriented and their gross errors found."""

    screening: str = "auto"  # of ``SCREENINGS``; ``auto``: robust start where needed, then deletion search
    grubbs_alpha: float = 0.05  # probability of rejecting a point of a pair without gross errors
    # largest y parallax in mm that needs no rejection; None: four times its a-priori standard deviation
    parallax_limit: float | None = None
    # keep, drop: measurements, ``photo/point``, that are used or left out whatever the tests say
    keep: list[str] = field(default_factory=list)
    drop: list[str] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class Orientation:
    """Relative orientation of all pairs of a strip."""

    pairs: Pairs  # measurements with the weights in force; rejected points have weight 0
    # elements, sigmas: (p, 5): elements and their standard deviations in radians; NaN without redundancy
    elements: Floats
    sigmas: Floats
    sigma0: Floats  # (p,): standard deviation of an image coordinate of weight one, in mm; NaN without redundancy
    condition: Floats  # (p,): condition number of the column-normalised Jacobian
    iterations: Numbers  # (p,): steps of the iteration
    parallax: Floats  # (m,): residual y parallaxes in mm, of rejected points too
    redundancy: Floats  # (m,): redundancy numbers; NaN for rejected points
    # (p, 5, 5): cofactors of the elements for a y parallax of weight one, rad^2/mm^2; NaN for a degenerate pair
    cofactors: Floats

    @property
    def point(self) -> Numbers:
        """Point of each row, shape (m,)."""
        return self.pairs.point

    @property
    def rows(self) -> Numbers:
        """Rows of the left and right measurement in the table of image points, shape (m, 2)."""
        return self.pairs.rows

    @property
    def used(self) -> Flags:
        """Rows that took part."""
        return self.pairs.weight > 0

    @property
    def points_used(self) -> Numbers:
        return self.pairs.sums(self.used.astype(float)).astype(np.intp)

    @cached_property
    def relative(self) -> tuple[Floats, Floats]:
        """Base direction (p, 3) and rotation of the right photo (p, 3, 3), both in the left photo's frame."""
        al1, ka1, al2, om2, ka2 = self.elements.T
        left = from_alpha_omega_kappa(al1, 0.0, ka1)
        right = from_alpha_omega_kappa(al2, om2, ka2)
        return left[:, 0, :], left.transpose(0, 2, 1) @ right

    @cached_property
    def rays(self) -> tuple[Floats, Floats]:
        """Image rays of the left and the right photo in the base frame, mm, shape (3, m) each."""
        return base_rays(self.elements, self.pairs)

    def take(self, numbers: Numbers) -> Orientation:
        """Take some of the pairs, given by ascending numbers; they are renumbered from 0."""
        part = take_rows(take_rows(self, numbers, BY_PAIR), self.pairs.rows_of(numbers), BY_ROW)
        return replace(part, pairs=self.pairs.take(numbers))

    def with_pairs(self, numbers: Numbers, part: Orientation) -> Orientation:
        """Put pairs that were taken, and oriented in another way, back in their places."""
        if not len(numbers):
            return replace(self)  # shares the columns, but not the rays that were found
        rows = self.pairs.rows_of(numbers)
        by_pair = {name: _put(getattr(self, name), numbers, getattr(part, name)) for name in BY_PAIR}
        by_row = {name: _put(getattr(self, name), rows, getattr(part, name)) for name in BY_ROW}
        weight = _put(self.pairs.weight, rows, part.pairs.weight)
        return replace(self, pairs=replace(self.pairs, weight=weight), **by_pair, **by_row)


def _put(values: NDArray[Any], rows: Numbers, fresh: NDArray[Any]) -> NDArray[Any]:
    result = values.copy()
    result[rows] = fresh
    return result


def orient_pairs(pairs: Pairs, photos: Sequence[str]) -> Orientation:
    """Relative orientation of all pairs, refusing those that cannot be oriented."""
    result, converged = orient_unchecked(pairs)
    refuse_unusable(result, converged, photos)
    return result


def orient_unchecked(pairs: Pairs) -> tuple[Orientation, Flags]:
    """Relative orientation of all pairs, whatever comes of it, and whether the iteration of each converged."""
    solved = solve_elements(pairs)
    return assess_pairs(solved.elements, pairs, solved.iterations), solved.converged


def orient_again(
    orientation: Orientation, weight: Floats, numbers: Numbers, lost_before: Flags | None = None
) -> Orientation:
    """Orient pairs whose weights changed, given by ascending numbers, again; `weight` (m,) is that of all rows.

    A pair whose iteration does not converge is solved from nothing; one of ``lost_before`` (p,), which marks those,
    keeps its elements instead.
    """
    pairs = replace(orientation.pairs, weight=weight)
    part = pairs.take(numbers)
    elements, converged, steps = iterate_elements(orientation.elements[numbers], part)
    if lost_before is not None:
        kept = ~converged & lost_before[numbers]
        elements[kept], converged[kept] = orientation.elements[numbers[kept]], True
        lost_before[numbers[~converged]] = True
    if not converged.all():
        lost = np.flatnonzero(~converged)
        elements[lost], _, steps[lost] = solve_elements(part.take(lost))
    fresh = assess_pairs(elements, part, orientation.iterations[numbers] + steps)
    return replace(orientation, pairs=pairs).with_pairs(numbers, fresh)


def assess_pairs(elements: Floats, pairs: Pairs, iterations: Numbers) -> Orientation:
    """Everything said about pairs of given elements: standard deviations, redundancy numbers, condition.

    With N = J^T W J, Q = inv(N): sigma_q^2 = q^T W q / (n - 5), r_i = 1 - w_i j_i^T Q j_i.
    """
    with np.errstate(all="ignore"):
        q, jacobian = linearised_parallaxes(elements, pairs)
        normal = normal_matrices(jacobian, pairs)
        condition = condition_numbers(normal)
        regular = condition < CONDITION_LIMIT
        normal[~regular] = np.eye(5)
        cofactors = np.asarray(np.linalg.inv(normal), float)
        cofactors[~regular] = np.nan
        freedom = pairs.sums((pairs.weight > 0).astype(float)) - MINIMUM_POINTS
        variance = pairs.sums(pairs.weight * q**2) / freedom  # of a y parallax: twice that of an image coordinate
        variance[freedom < 1] = np.nan
        spread = np.empty(len(q))
        for rows in pieces(len(q), ROWS):
            by = jacobian[:, rows]
            spread[rows] = np.einsum("im,mij,jm->m", by, cofactors[pairs.pair[rows]], by)
        return Orientation(
            pairs=pairs,
            elements=elements,
            sigmas=np.sqrt(variance[:, None] * cofactors[:, np.arange(5), np.arange(5)]),
            sigma0=np.sqrt(variance / 2),
            condition=condition,
            iterations=iterations,
            parallax=q,
            redundancy=np.where(pairs.weight > 0, 1 - pairs.weight * spread, np.nan),
            cofactors=cofactors,
        )


def condition_numbers(normal: Floats) -> Floats:
    """Condition numbers, shape (p,), of the column-normalised Jacobians behind normal matrices; infinite if singular.

    They are the roots of those of the normal matrices, scaled to unit diagonals.
    """
    diagonal = normal[:, np.arange(5), np.arange(5)]
    with np.errstate(all="ignore"):
        scale = 1 / np.sqrt(diagonal)
        normal = normal * scale[:, :, None] * scale[:, None, :]
    sound = np.isfinite(normal).all(axis=(1, 2))
    normal[~sound] = 0.0
    values = np.linalg.eigvalsh(normal)
    with np.errstate(all="ignore"):
        condition = np.sqrt(values[:, -1] / np.maximum(values[:, 0], 0.0))
    return np.where(sound & (values[:, 0] > 0), condition, np.inf)


def unusable_pairs(result: Orientation, converged: Flags) -> Flags:
    """Pairs that cannot be used as they are: degenerate, not converged, behind their cameras, or without a base."""
    pairs = result.pairs
    front = rays_meet_in_front(*result.rays) & result.used
    share = pairs.sums(front.astype(float)) / np.maximum(result.points_used, 1)
    bad: Flags = ~converged | ~(result.condition <= CONDITION_LIMIT) | (share <= LEAST_IN_FRONT)
    return bad | (_mean_parallaxes(result) < SMALLEST_PARALLAX * pairs.focal)


def _mean_parallaxes(result: Orientation) -> Floats:
    """Mean x parallax of each pair in the base frame, mm; near zero for two photos taken from one place."""
    (lx, _, lz), (rx, _, rz) = result.rays
    with np.errstate(all="ignore"):
        size = np.where(result.used, np.abs(lx / lz - rx / rz), 0.0) * result.pairs.focal
    return np.nan_to_num(result.pairs.sums(size)) / np.maximum(result.points_used, 1)


def refuse_unusable(result: Orientation, converged: Flags, photos: Sequence[str]) -> None:
    """Raise a ``GeometryError`` for the first pair that cannot be used, with the reason a surveyor can act on."""
    for number in np.flatnonzero(unusable_pairs(result, converged)).tolist():
        names = (photos[number], photos[number + 1])
        reason, code = _reason(result.take(np.array([number])), converged=bool(converged[number]))
        msg = f"relative orientation of photos {names[0]} and {names[1]}: {reason}"
        raise GeometryError(msg, photos=names, code=code)


def _reason(pair: Orientation, *, converged: bool) -> tuple[str, str]:
    """Why one pair cannot be used, and the code of that."""
    xy = pair.pairs.left[pair.used]
    spread = np.linalg.svd(xy - xy.mean(axis=0), compute_uv=False)
    if spread[1] < 1e-3 * max(spread[0], 1e-9):
        return (
            "all common points lie on one line of the photo; points in at least the corners of the overlap are needed",
            "points-on-a-line",
        )
    parallax = float(_mean_parallaxes(pair)[0])
    if parallax < SMALLEST_PARALLAX * pair.pairs.focal:
        return (
            f"the x parallax is only {parallax:.3f} mm: the photos have no base; the same photo twice?",
            "no-base",
        )
    if converged and pair.condition[0] > CONDITION_LIMIT:
        text = f"its elements cannot be separated (condition number {pair.condition[0]:.0e}): "
        return (
            text + "the points form a narrow band or lie with both cameras on a critical surface",
            "degenerate-pair",
        )
    if not converged:
        return ("the iteration does not converge; wrong point ids or photos that do not overlap", "not-converged")
    return ("the points come out behind the cameras; are image coordinates negatives or mirrored?", "behind-cameras")


def cofactors(focal: float, width: float, base: float) -> Floats:
    """Cofactors (5, 5) of the elements from six standard points, rad^2/mm^2 for a y parallax of unit variance."""
    f, a, b = focal, width, base
    alpha, omega = f**2 / (2 * a**2 * b**2), 3 * f**2 / (4 * a**4)
    kappa = (8 * a**4 + 12 * a**2 * f**2 + 9 * f**4) / (12 * a**4 * b**2)
    matrix = np.diag([alpha, kappa, alpha, omega, kappa])
    matrix[[1, 4], [4, 1]] = (a**4 / 3 + a**2 * f**2 + 3 * f**4 / 4) / (a**4 * b**2)
    matrix[[1, 4, 3, 3], [3, 3, 1, 4]] = f * (2 * a**2 + 3 * f**2) / (4 * a**4 * b)
    return matrix


def dependent_from_base(base: float) -> Floats:
    """First-order relation T (5, 5) of the dependent pair (left photo fixed) to the base-frame elements.

    (by, bz, dkappa, dalpha, domega) = T (alpha1', kappa1', alpha2', omega2', kappa2'), lengths in mm. The cofactors
    follow as T Q T^T for any points. dalpha = alpha2' + bz/b is the decorrelation that [000] uses.
    """
    matrix = np.zeros((5, 5))
    matrix[0, 1] = matrix[1, 0] = -base
    matrix[2, [1, 4]] = matrix[3, [0, 2]] = -1.0, 1.0
    matrix[4, 3] = 1.0
    return matrix


ZONES = 6
MINIMUM_LEFT = 6  # a pair keeps at least one redundant point


def zones(elements: Floats, pairs: Pairs) -> Numbers:
    """Zone of every point, 1 to 6; points of weight 0 get a zone and do not shape it."""
    left, right = base_rays(elements, pairs)
    x, y = -pairs.focal * left[:2] / left[2]
    parallax = x + pairs.focal * right[0] / right[2]
    used = pairs.weight > 0
    count = np.maximum(pairs.sums(used.astype(float)), 1.0)
    base = pairs.sums(np.where(used, parallax, 0.0)) / count
    spread = np.sqrt(pairs.sums(np.where(used, y**2, 0.0)) / count * 3 / 2)  # rows at -a, 0, a
    half_base, half_spread = base[pairs.pair] / 2, spread[pairs.pair] / 2
    row = np.where(y > half_spread, 2, np.where(y < -half_spread, 4, 0))
    number: Numbers = (1 + row + (x > half_base)).astype(np.intp)
    return number


@dataclass(frozen=True, eq=False)
class Support:
    """What holds the pairs up: their points by zone."""

    zone: Numbers  # (m,): zone of every row, 1 to 6
    counts: Numbers  # (p, 6): points that take part, by pair and zone

    @classmethod
    def of(cls, orientation: Orientation, zone: Numbers | None = None) -> Support:
        """Count the points of oriented pairs, whose zones (m,) may be known already."""
        number = zones(orientation.elements, orientation.pairs) if zone is None else zone
        pairs, used = orientation.pairs, orientation.used
        place = ZONES * pairs.pair[used] + number[used] - 1
        counts = np.bincount(place, minlength=ZONES * pairs.size).reshape(-1, ZONES).astype(np.intp)
        return cls(number, counts)

    @property
    def empty(self) -> Numbers:
        """Zones without a point, by pair, shape (p,)."""
        number: Numbers = (self.counts == 0).sum(axis=1)
        return number

    def spare(self, pair: Numbers) -> Flags:
        """Rows that can go: six points stay, and no zone loses its last point while another one is empty already."""
        enough = self.counts.sum(axis=1) > MINIMUM_LEFT
        last = self.counts[pair, self.zone - 1] <= 1
        flags: Flags = enough[pair] & (~last | (self.empty[pair] == 0))
        return flags
