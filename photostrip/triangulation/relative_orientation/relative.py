"""Relative orientation of stereopairs in the base frame, all pairs of a strip in one batch.

The five elements are (alpha1', kappa1', alpha2', omega2', kappa2'), angles of the left and the right photo
relative to the base frame: x' along the base, omega1' = 0. All measurements of all pairs stand in flat columns;
sums over a pair are segment sums, so that a thousand pairs cost little more than one.

Source: [001] for the elements; condition, derivatives, start values and retries are derived.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from photostrip.errors import GeometryError
from photostrip.geometry.rotation import from_alpha_omega_kappa

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from photostrip.points import PhotoPoints

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]

ELEMENTS = ("alpha1", "kappa1", "alpha2", "omega2", "kappa2")
MINIMUM_POINTS = 5
CONVERGED = 1e-10  # rad
ITERATIONS = 30
LARGEST_STEP = 0.5  # rad; a longer step is shortened, far starts swing otherwise
CONDITION_WARNING = 100.0  # of the column-normalised Jacobian: a band much narrower than the base
CONDITION_LIMIT = 1e6
RIDGE = 1e-13  # relative; keeps a singular pair from stopping the batch, changes no digit of a regular one
RETRIES = np.radians([15, -15, 30, -30, 60, -60, 90, -90, 180])
RETRY_RMS = 1e-3  # of the principal distance: a larger rms y parallax is a false minimum or a gross error
SMALLEST_PARALLAX = 1e-3  # of the principal distance, mean over a pair: below it there is no base to speak of
UPPER = np.triu_indices(5)
BY_PAIR = ("elements", "sigmas", "sigma0", "condition", "iterations", "cofactors")
BY_ROW = ("parallax", "redundancy")
"""What an orientation says of each pair and of each of its rows."""


@dataclass(frozen=True)
class Settings:
    """How pairs are oriented and their gross errors found."""

    # ``"auto"`` (robust start where needed, then deletion search), ``"parallax+grubbs"``, ``"tau"``, ``"deletion"``,
    # ``"robust"`` or ``"none"``
    screening: str = "auto"
    grubbs_alpha: float = 0.05  # probability of rejecting a point of a pair without gross errors
    # largest y parallax in mm that needs no rejection; None: four times its a-priori standard deviation
    parallax_limit: float | None = None
    # keep, drop: measurements, ``photo/point``, that are used or left out whatever the tests say
    keep: list[str] = field(default_factory=list)
    drop: list[str] = field(default_factory=list)


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

    @property
    def size(self) -> int:
        """Number of pairs."""
        return len(self.starts)

    def take(self, pairs: Numbers) -> tuple[Pairs, Numbers]:
        """Give some of the pairs.

        Parameters
        ----------
        pairs : ndarray of int
            Numbers of the pairs, ascending.

        Returns
        -------
        Pairs
            The measurements of those pairs, renumbered from 0.
        """
        wanted = np.zeros(self.size, bool)
        wanted[pairs] = True
        rows = np.flatnonzero(wanted[self.pair])
        number = np.cumsum(wanted) - 1
        pair = number[self.pair[rows]]
        starts = np.searchsorted(pair, np.arange(len(pairs)))
        part = Pairs(starts, pair, self.left[rows], self.right[rows], self.weight[rows], self.focal)
        return part, rows

    def sums(self, values: Floats) -> Floats:
        """Sum columns over each pair.

        Parameters
        ----------
        values : ndarray, shape (..., m)
            Values by row.

        Returns
        -------
        ndarray, shape (..., p)
            Sums by pair.
        """
        total: Floats = np.add.reduceat(values, self.starts, axis=-1)
        return total


def rays(elements: Floats, pairs: Pairs) -> tuple[Floats, Floats]:
    """Image rays of both photos in the base frame.

    Parameters
    ----------
    elements : ndarray, shape (p, 5)
        Elements of the pairs in radians.

    Returns
    -------
    left, right : ndarray, shape (3, m)
        X, Y, Z of the rays in mm.

    Notes
    -----
    Source: [001] eq. 132-133, 137, relative to the base.
    """
    al1, ka1, al2, om2, ka2 = elements.T
    rotations = (from_alpha_omega_kappa(al1, 0.0, ka1), from_alpha_omega_kappa(al2, om2, ka2))
    turned = []
    for rotation, xy in zip(rotations, (pairs.left, pairs.right), strict=True):
        a = rotation.transpose(1, 2, 0)[:, :, pairs.pair]  # 3 x 3 x m
        turned.append(a[:, 0] * xy[:, 0] + a[:, 1] * xy[:, 1] - a[:, 2] * pairs.focal)
    return turned[0], turned[1]


def parallaxes(elements: Floats, pairs: Pairs) -> Floats:
    """Residual y parallaxes q = y1 - y2 of the photos turned into the base frame.

    Parameters
    ----------
    elements : ndarray, shape (p, 5)
        Elements of the pairs in radians.

    Returns
    -------
    ndarray, shape (m,)
        y parallaxes in mm at photo scale.
    """
    left, right = rays(elements, pairs)
    q: Floats = -pairs.focal * (left[1] / left[2] - right[1] / right[2])
    return q


def linearised(elements: Floats, pairs: Pairs) -> tuple[Floats, Floats]:
    """Return the residual y parallaxes and their exact derivatives by the five elements.

    Parameters
    ----------
    elements : ndarray, shape (p, 5)
        Elements of the pairs in radians.

    Returns
    -------
    q : ndarray, shape (m,)
        y parallaxes in mm.
    jacobian : ndarray, shape (5, m)
        dq/de in mm per radian.
    """
    f = pairs.focal
    (lx, ly, lz), (rx, ry, rz) = rays(elements, pairs)
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
    return -f * (ly / lz - ry / rz), jacobian


def normal_matrices(jacobian: Floats, pairs: Pairs) -> Floats:
    """Form the normal matrices J^T W J of all pairs.

    Parameters
    ----------
    jacobian : ndarray, shape (5, m)
        Derivatives by row.
    pairs : Pairs
        Measurements with their weights.

    Returns
    -------
    ndarray, shape (p, 5, 5)
        Symmetric normal matrices.
    """
    weighted = jacobian * pairs.weight
    sums = pairs.sums(weighted[UPPER[0]] * jacobian[UPPER[1]])
    normal = np.empty((pairs.size, 5, 5))
    normal[:, UPPER[0], UPPER[1]] = sums.T
    normal[:, UPPER[1], UPPER[0]] = sums.T
    return normal


def start_values(pairs: Pairs) -> Floats:
    """Elements to start from: both photos turned so that the mean parallax runs along x.

    Returns
    -------
    ndarray, shape (p, 5)
        (0, kappa0, 0, 0, kappa0) in radians.
    """
    mean = pairs.sums(((pairs.left - pairs.right) * pairs.weight[:, None]).T)
    start = np.zeros((pairs.size, 5))
    start[:, 1] = start[:, 4] = -np.arctan2(mean[1], mean[0])
    return start


def iterate(
    elements: Floats, pairs: Pairs, watch: Callable[[Numbers, Floats, Floats, Floats], None] | None = None
) -> tuple[Floats, NDArray[np.bool_], Numbers]:
    """Gauss-Newton iteration of all pairs from given elements; converged pairs leave the batch.

    Parameters
    ----------
    elements : ndarray, shape (p, 5)
        Start values in radians.
    watch : callable, optional
        Told of every step: the numbers of the pairs that take part, their elements before it, their sums of weighted
        squares of the y parallaxes in mm^2, and what is added to the elements.

    Returns
    -------
    elements : ndarray, shape (p, 5)
        Least-squares elements in radians.
    converged : ndarray of bool, shape (p,)
        Whether the last step was below 1e-10 rad.
    iterations : ndarray of int, shape (p,)
        Steps made.
    """
    result = elements.copy()
    converged = np.zeros(pairs.size, bool)
    steps = np.zeros(pairs.size, np.intp)
    todo, part = np.arange(pairs.size), pairs
    diagonal = np.arange(5)
    for _ in range(ITERATIONS):
        if not len(todo):
            break
        with np.errstate(all="ignore"):
            q, jacobian = linearised(result[todo], part)
            normal = normal_matrices(jacobian, part)
            scale = 1 / np.sqrt(np.maximum(normal[:, diagonal, diagonal], 1e-300))
            normal *= scale[:, :, None] * scale[:, None, :]
            normal[:, diagonal, diagonal] += RIDGE
            right = part.sums(jacobian * (part.weight * q)).T * scale
            sound = np.isfinite(normal).all(axis=(1, 2)) & np.isfinite(right).all(axis=1)
            normal[~sound], right[~sound] = np.eye(5), 0.0
            step = -np.linalg.solve(normal, right[:, :, None])[:, :, 0] * scale
            largest = np.abs(step).max(axis=1)
            step *= np.minimum(1.0, LARGEST_STEP / np.maximum(largest, LARGEST_STEP))[:, None]
        if watch is not None:
            watch(todo, result[todo], part.sums(part.weight * q**2), step)
        result[todo] += step
        steps[todo] += 1
        done = (largest < CONVERGED) & sound
        converged[todo[done]] = True
        going = ~done & sound
        if not going.all():
            part, _ = part.take(np.flatnonzero(going))
            todo = todo[going]
    return (result + np.pi) % (2 * np.pi) - np.pi, converged, steps


def in_front(elements: Floats, pairs: Pairs) -> NDArray[np.bool_]:
    """Whether each point lies in front of both cameras.

    Parameters
    ----------
    elements : ndarray, shape (p, 5)
        Elements of the pairs in radians.

    Returns
    -------
    ndarray of bool, shape (m,)
        True where both rays meet on their way down.
    """
    return ahead(*rays(elements, pairs))


def ahead(left: Floats, right: Floats) -> NDArray[np.bool_]:
    """Whether the rays of points meet on their way down.

    Parameters
    ----------
    left, right : ndarray, shape (3, m)
        Rays of the left and right photo in the base frame, mm.

    Returns
    -------
    ndarray of bool, shape (m,)
        True in front of both cameras.
    """
    (lx, _, lz), (rx, _, rz) = left, right
    determinant = lx * rz - rx * lz
    with np.errstate(divide="ignore", invalid="ignore"):
        front: NDArray[np.bool_] = (rz / determinant > 0) & (lz / determinant > 0)
    return front


def solve(pairs: Pairs) -> tuple[Floats, NDArray[np.bool_], Numbers]:
    """Elements of all pairs from nothing: start values, iteration, retries from other azimuths.

    A pair is tried again with its start azimuth turned by 15 to 180 degrees when it does not converge, a point comes
    out behind a camera, or the y parallaxes stay large: with tilts beyond 10 degrees there are false minima with all
    points in front. Of the solutions found, the one with most points in front and then the smallest sum of squares is
    taken.

    Returns
    -------
    elements, converged, iterations
        As ``iterate``.
    """
    start = start_values(pairs)
    best, converged, steps = iterate(start, pairs)
    best = _facing(best, pairs)
    score = _score(best, converged, pairs)
    tolerable = (RETRY_RMS * pairs.focal) ** 2 * pairs.sums(pairs.weight)
    for turn in RETRIES:
        todo = np.flatnonzero((score[0] < 1) | (score[1] > tolerable))
        if not len(todo):
            break
        part, _ = pairs.take(todo)
        attempt = start[todo]
        attempt[:, [1, 4]] += turn
        elements, success, count = iterate(attempt, part)
        elements = _facing(elements, part)
        tried = _score(elements, success, part)
        share, squares = score[0][todo], score[1][todo]
        better = (tried[0] > share + 1e-9) | ((tried[0] > share - 1e-9) & (tried[1] < squares))
        chosen = todo[better]
        best[chosen], converged[chosen], steps[chosen] = elements[better], success[better], count[better]
        score[0][chosen], score[1][chosen] = tried[0][better], tried[1][better]
    return best, converged, steps


def _facing(elements: Floats, pairs: Pairs) -> Floats:
    """Turn the base of pairs round whose points lie behind both cameras: the same planes, the other side."""
    (lx, _, lz), (rx, _, rz) = rays(elements, pairs)
    determinant = lx * rz - rx * lz
    with np.errstate(all="ignore"):
        behind = (rz / determinant < 0) & (lz / determinant < 0) & (pairs.weight > 0)
    away = 2 * pairs.sums(behind.astype(float)) > pairs.sums((pairs.weight > 0).astype(float))
    result = elements.copy()
    result[away] *= [-1.0, 1.0, -1.0, -1.0, 1.0]
    result[away, 1] += np.pi
    result[away, 4] += np.pi
    return (result + np.pi) % (2 * np.pi) - np.pi


def _score(elements: Floats, converged: NDArray[np.bool_], pairs: Pairs) -> tuple[Floats, Floats]:
    """Share of the points in front (-1 where not converged) and weighted sum of squares, by pair."""
    with np.errstate(all="ignore"):
        used = pairs.weight > 0
        share = pairs.sums((in_front(elements, pairs) & used).astype(float)) / np.maximum(
            pairs.sums(used.astype(float)), 1
        )
        squares = pairs.sums(pairs.weight * parallaxes(elements, pairs) ** 2)
    return np.where(converged, share, -1.0), np.where(np.isfinite(squares), squares, np.inf)


@dataclass(frozen=True, eq=False)
class Orientation:
    """Relative orientation of all pairs of a strip."""

    pairs: Pairs  # measurements with the weights in force; rejected points have weight 0
    point: Numbers  # (m,): point of each row
    rows: Numbers  # (m, 2): rows of the measurements on the left and right photo in the table of image points
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
    def used(self) -> NDArray[np.bool_]:
        """Rows that took part."""
        return self.pairs.weight > 0

    @property
    def points_used(self) -> Numbers:
        """Number of points that took part, by pair."""
        return self.pairs.sums(self.used.astype(float)).astype(np.intp)

    @cached_property
    def relative(self) -> tuple[Floats, Floats]:
        """Base direction (p, 3) and rotation of the right photo (p, 3, 3), both in the left photo's frame."""
        al1, ka1, al2, om2, ka2 = self.elements.T
        left = from_alpha_omega_kappa(al1, 0.0, ka1)
        right = from_alpha_omega_kappa(al2, om2, ka2)
        return left[:, 0, :], left.transpose(0, 2, 1) @ right


def collect_pairs(
    observations: PhotoPoints, photos: Sequence[str], focal: float
) -> tuple[Pairs, NDArray[np.intp], NDArray[np.intp]]:
    """Points measured on neighbouring photos of a strip, as pairs.

    Parameters
    ----------
    observations : PhotoPoints
        Image points, reduced to the principal point.
    focal : float
        Principal distance in mm.

    Returns
    -------
    pairs : Pairs
        Measurements; weights are 1 where both sigmas are the strip's median.
    point : ndarray of int, shape (m,)
        Point of each row.
    rows : ndarray of int, shape (m, 2)
        Rows in ``observations`` of the left and right measurement.

    Raises
    ------
    GeometryError
        When a pair has no common point.
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
    variance = (observations.sigma**2).mean(axis=1)
    sums = variance[rows].sum(axis=1)
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    pairs = Pairs(
        starts,
        pair,
        observations.xy[rows[:, 0]],
        observations.xy[rows[:, 1]],
        2 * np.median(variance[inside]) / sums,
        focal,
    )
    return pairs, observations.point[rows[:, 0]], rows


def _require_points(counts: Numbers, photos: Sequence[str]) -> None:
    for number in np.flatnonzero(counts < MINIMUM_POINTS).tolist():
        names = photos[number : number + 2]
        msg = (
            f"relative orientation of photos {names[0]} and {names[1]}: {counts[number]} common points, "
            f"at least {MINIMUM_POINTS} are necessary (12 are recommended); measure more points or correct the order "
            "of the photos"
        )
        raise GeometryError(msg, photos=names, code="too-few-common-points")


def condition_numbers(normal: Floats) -> Floats:
    """Condition numbers of the column-normalised Jacobians.

    Parameters
    ----------
    normal : ndarray, shape (p, 5, 5)
        Normal matrices of the pairs.

    Returns
    -------
    ndarray, shape (p,)
        Largest over smallest singular value; infinite when singular.
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


def assess(elements: Floats, pairs: Pairs, point: Numbers, rows: Numbers, iterations: Numbers) -> Orientation:
    """Everything said about oriented pairs: standard deviations, redundancy, condition.

    Parameters
    ----------
    elements : ndarray, shape (p, 5)
        Elements in radians.
    pairs : Pairs
        Measurements with the weights in force.
    point, rows, iterations : ndarray
        As in ``Orientation``.
    """
    with np.errstate(all="ignore"):
        q, jacobian = linearised(elements, pairs)
        normal = normal_matrices(jacobian, pairs)
        condition = condition_numbers(normal)
        regular = condition < CONDITION_LIMIT
        normal[~regular] = np.eye(5)
        cofactors = np.asarray(np.linalg.inv(normal), float)
        cofactors[~regular] = np.nan
        freedom = pairs.sums((pairs.weight > 0).astype(float)) - MINIMUM_POINTS
        variance = pairs.sums(pairs.weight * q**2) / freedom  # of a y parallax: twice that of an image coordinate
        variance[freedom < 1] = np.nan
        spread = np.einsum("im,mij,jm->m", jacobian, cofactors[pairs.pair], jacobian)
        redundancy = np.where(pairs.weight > 0, 1 - pairs.weight * spread, np.nan)
        sigmas = np.sqrt(variance[:, None] * cofactors[:, np.arange(5), np.arange(5)])
    return Orientation(
        pairs, point, rows, elements, sigmas, np.sqrt(variance / 2), condition, iterations, q, redundancy, cofactors
    )


def attempt(pairs: Pairs, point: Numbers, rows: Numbers) -> tuple[Orientation, NDArray[np.bool_]]:
    """Relative orientation of all pairs, whatever comes of it; gross errors may still be in it.

    Parameters
    ----------
    point, rows : ndarray
        As ``collect_pairs`` gives them.

    Returns
    -------
    converged : ndarray of bool, shape (p,)
        Whether the iteration of each pair converged.
    """
    elements, converged, steps = solve(pairs)
    return assess(elements, pairs, point, rows, steps), converged


def doubtful(
    result: Orientation, converged: NDArray[np.bool_], known: tuple[Floats, Floats] | None = None
) -> NDArray[np.bool_]:
    """Pairs that cannot be used as they are: degenerate, not converged or behind their cameras.

    Parameters
    ----------
    converged : ndarray of bool, shape (p,)
        Whether the iteration of each pair converged.
    known : tuple of ndarray, shape (3, m), optional
        The rays of its points, when they are known already.

    Returns
    -------
    ndarray of bool, shape (p,)
        True for those that ``require`` refuses.
    """
    pairs = result.pairs
    left, right = rays(result.elements, pairs) if known is None else known
    with np.errstate(all="ignore"):
        front = ahead(left, right) & result.used
    share = pairs.sums(front.astype(float)) / np.maximum(result.points_used, 1)
    bad: NDArray[np.bool_] = ~converged | ~(result.condition <= CONDITION_LIMIT) | (share <= 0.5)  # noqa: PLR2004  half of the points
    return bad | (_mean_parallax(result, left, right) < SMALLEST_PARALLAX * pairs.focal)


def mean_parallax(result: Orientation) -> Floats:
    """Mean x parallax of the points of each pair, turned into the base frame, mm.

    Returns
    -------
    ndarray, shape (p,)
        Near zero when both photos were taken from the same place.
    """
    return _mean_parallax(result, *rays(result.elements, result.pairs))


def _mean_parallax(result: Orientation, left: Floats, right: Floats) -> Floats:
    """Mean x parallax of each pair out of its rays."""
    (lx, _, lz), (rx, _, rz) = left, right
    with np.errstate(all="ignore"):
        size = np.where(result.used, np.abs(lx / lz - rx / rz), 0.0) * result.pairs.focal
    mean: Floats = np.nan_to_num(result.pairs.sums(size)) / np.maximum(result.points_used, 1)
    return mean


def require(result: Orientation, converged: NDArray[np.bool_], photos: Sequence[str]) -> None:
    """Refuse pairs that cannot be oriented.

    Parameters
    ----------
    converged : ndarray of bool, shape (p,)
        Whether the iteration of each pair converged.
    photos : sequence of str
        Photos of the strip, to name a pair that is refused.

    Raises
    ------
    GeometryError
        For the first pair that is degenerate, does not converge, or lies behind its cameras.
    """
    for number in np.flatnonzero(doubtful(result, converged)):
        _refuse(result, int(number), photos, converged=bool(converged[number]))


def orient(pairs: Pairs, point: Numbers, rows: Numbers, photos: Sequence[str]) -> Orientation:
    """Relative orientation of all pairs, refusing those that cannot be oriented.

    Parameters
    ----------
    point, rows : ndarray
        As ``collect_pairs`` gives them.
    photos : sequence of str
        Photos of the strip, to name a pair that is refused.

    Raises
    ------
    GeometryError
        For the first pair that is degenerate, does not converge, or lies behind its cameras.
    """
    result, converged = attempt(pairs, point, rows)
    require(result, converged, photos)
    return result


def refine(orientation: Orientation, weight: Floats, todo: Numbers) -> Orientation:
    """Orient some pairs again with other weights, from their present elements.

    Parameters
    ----------
    weight : ndarray, shape (m,)
        New weights of all rows.
    todo : ndarray of int
        Pairs whose weights changed, ascending.

    Returns
    -------
    Orientation
        All pairs; those not named keep their numbers.
    """
    pairs = replace(orientation.pairs, weight=weight)
    part, rows = pairs.take(todo)
    solved, converged, steps = iterate(orientation.elements[todo], part)
    if not converged.all():
        lost = np.flatnonzero(~converged)
        again, _ = part.take(lost)
        solved[lost], _, steps[lost] = solve(again)
    fresh = assess(solved, part, orientation.point[rows], orientation.rows[rows], orientation.iterations[todo] + steps)
    return put_back(replace(orientation, pairs=pairs), todo, rows, fresh)


def taken(orientation: Orientation, todo: Numbers) -> tuple[Orientation, Numbers]:
    """Give some of the pairs alone.

    Parameters
    ----------
    todo : ndarray of int
        Pairs to take, ascending.

    Returns
    -------
    Orientation
        Those pairs, numbered from 0.
    ndarray of int
        Their rows in the table of all.
    """
    pairs, rows = orientation.pairs.take(todo)
    by_pair = {name: getattr(orientation, name)[todo] for name in BY_PAIR}
    by_row = {name: getattr(orientation, name)[rows] for name in ("point", "rows", *BY_ROW)}
    return replace(orientation, pairs=pairs, **by_pair, **by_row), rows


def put_back(orientation: Orientation, todo: Numbers, rows: Numbers, part: Orientation) -> Orientation:
    """Put pairs back that were taken.

    Parameters
    ----------
    todo, rows : ndarray of int
        The pairs that were taken, ascending, and their rows.

    Returns
    -------
    Orientation
        All pairs; those not named keep their numbers.
    """
    by_pair = {name: _put(getattr(orientation, name), todo, getattr(part, name)) for name in BY_PAIR}
    by_row = {name: _put(getattr(orientation, name), rows, getattr(part, name)) for name in BY_ROW}
    weight = _put(orientation.pairs.weight, rows, part.pairs.weight)
    return replace(orientation, pairs=replace(orientation.pairs, weight=weight), **by_pair, **by_row)


def restored(orientation: Orientation, earlier: Orientation, todo: Numbers) -> Orientation:
    """Give some pairs back their earlier orientation.

    Parameters
    ----------
    orientation, earlier : Orientation
        The same pairs now and before.
    todo : ndarray of int
        Pairs to restore, ascending.
    """
    if not len(todo):
        return orientation
    part, rows = taken(earlier, todo)
    return put_back(orientation, todo, rows, part)


def _put(values: NDArray[Any], rows: Numbers, fresh: NDArray[Any]) -> NDArray[Any]:
    result = values.copy()
    result[rows] = fresh
    return result


def _refuse(result: Orientation, number: int, photos: Sequence[str], *, converged: bool) -> None:
    """Raise for one pair, with the reason a surveyor can act on."""
    names = (photos[number], photos[number + 1])
    of_pair = (result.pairs.pair == number) & result.used
    reason, code = _reason(result, number, of_pair, converged=converged)
    msg = f"relative orientation of photos {names[0]} and {names[1]}: {reason}"
    raise GeometryError(msg, photos=names, code=code)


def _reason(result: Orientation, number: int, of_pair: NDArray[np.bool_], *, converged: bool) -> tuple[str, str]:
    xy = result.pairs.left[of_pair]
    spread = np.linalg.svd(xy - xy.mean(axis=0), compute_uv=False)
    if spread[1] < 1e-3 * max(spread[0], 1e-9):
        return (
            "all common points lie on one line of the photo; points in at least the corners of the overlap are needed",
            "points-on-a-line",
        )
    parallax = float(mean_parallax(result)[number])
    if parallax < SMALLEST_PARALLAX * result.pairs.focal:
        return (
            f"the x parallax is only {parallax:.3f} mm: the photos have no base; the same photo twice?",
            "no-base",
        )
    if converged and result.condition[number] > CONDITION_LIMIT:
        condition = result.condition[number]
        text = f"its elements cannot be separated (condition number {condition:.0e}): "
        return (
            text + "the points form a narrow band or lie with both cameras on a critical surface",
            "degenerate-pair",
        )
    if not converged:
        return ("the iteration does not converge; wrong point ids or photos that do not overlap", "not-converged")
    return ("the points come out behind the cameras; are image coordinates negatives or mirrored?", "behind-cameras")
