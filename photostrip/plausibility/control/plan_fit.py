"""A strip, or the mosaic of its photos, laid on given points in plan and height, whatever else is wrong with them.

The strip is set upright by its cameras, which look down; so it cannot come out upside down, and a mirror image shows as
a mirror image. In plan, the similarity through two given points whose middle misclosure is the smallest of all pairs
is taken, once as it is and once with the strip mirrored. Up to nearly half of the points may be wrong.

Source: least median of squares (Rousseeuw 1984); derived, see docs/sources.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from random import Random
from typing import Any

import numpy as np
from numpy.typing import NDArray

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.statistics import SIGMA_FROM_MEDIAN, t_quantile

Complex = NDArray[np.complex128]

LEAST_POINTS = 3  # in plan; two always fit
PLAN_UNKNOWNS = 2  # complex ones: turn and shift
MOST_PAIRS = 1500  # tried
MEDIAN_POINTS = 100  # at most, from which a median misclosure is taken
LEAST_PAIR_DISTANCE = 0.25  # of the largest distance: two points that give a similarity
GOOD_SHARE = 0.55  # of the points, at least
NO_GOOD_DRAW = 1e-3  # probability that no draw of as many points as unknowns, for a start, is of good points alone
LEAST_DETERMINANT = 1e-9  # of such a draw, columns of size one
REWEIGHTINGS = 12  # of a robust fit
KEPT_SIGMAS = 5.0  # robust standard deviations within which a point goes with the others
ODD_PROBABILITY = 1e-6  # that a good point is called odd
TINY = 1e-9


@dataclass(frozen=True, eq=False)
class PlanSimilarity:
    """Plan from strip: E + iN = turn w + shift, with conj(w) where the strip is mirrored."""

    turn: complex
    shift: complex
    mirrored: bool
    median: float  # misclosure that a good half of the points does not exceed, metres

    @property
    def matrix(self) -> Floats:
        """The same turn of plan and height together, shape (3, 3)."""
        sense = -1.0 if self.mirrored else 1.0
        a, b = self.turn.real, self.turn.imag
        return np.array([[a, -sense * b, 0.0], [b, sense * a, 0.0], [0.0, 0.0, abs(self.turn)]])

    def __call__(self, w: Complex) -> Complex:
        """Bring places of the upright strip to the plan."""
        return np.asarray(self.turn * (np.conj(w) if self.mirrored else w) + self.shift)


def upright(axes: Floats) -> Floats:
    """Rotation (3, 3) that takes the mean of the photos' third axes (n, 3), from the ground to the cameras, to up."""
    up = axes.mean(axis=0)
    up /= max(float(np.linalg.norm(up)), TINY)
    helper = np.eye(3)[int(np.abs(up).argmin())]
    first = np.cross(helper, up)
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(up, first), up])


def fit_similarity(w: Complex, plan: Complex, *, mirrored: bool = False) -> PlanSimilarity | None:
    """Lay a strip on given points in plan, by least median of squares, then least squares on the better half.

    w: (n,), places of the points in the upright strip.
    plan: (n,), given places E + iN, metres.
    Returns none for fewer than three points, or when all lie at the same place.
    """
    if len(w) < LEAST_POINTS:
        return None
    z = np.conj(w) if mirrored else w
    i, j = _pairs(z, plan)
    if not len(i):
        return None
    turn = (plan[j] - plan[i]) / (z[j] - z[i])
    shift = plan[i] - turn * z[i]
    some = _evenly(len(z), MEDIAN_POINTS)
    size = np.abs(turn[:, None] * z[some] + shift[:, None] - plan[some])
    best = int(_median(size, PLAN_UNKNOWNS).argmin())
    return _refined(z, plan, complex(turn[best]), complex(shift[best]), mirrored=mirrored)


def _evenly(count: int, most: int) -> Numbers:
    """Numbers below a count, evenly drawn from all where there are too many."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(np.intp))


def _median(size: Floats, unknowns: int) -> Floats:
    """Size that a good half does not exceed, row by row; the points that a fit goes through do not count."""
    count = size.shape[-1]
    place = min((count + unknowns + 1) // 2, count) - 1
    return np.asarray(np.partition(size, place, axis=-1)[..., place])


def _pairs(z: Complex, plan: Complex) -> tuple[Numbers, Numbers]:
    """Pairs of points far enough from each other on both sides, evenly drawn from all."""
    n = len(z)
    if n * (n - 1) // 2 > 20 * MOST_PAIRS:
        draw = np.random.default_rng(n)  # the same for the same number of points
        i, j = draw.integers(0, n, (2, 20 * MOST_PAIRS))
    else:
        i, j = _each_two(n)
    far = np.abs(z[j] - z[i])
    enough = far > LEAST_PAIR_DISTANCE * far.max(initial=0.0)
    keep = np.flatnonzero(enough & (far > 0) & (np.abs(plan[j] - plan[i]) > TINY))
    if len(keep) > MOST_PAIRS:
        keep = keep[_evenly(len(keep), MOST_PAIRS)]
    return i[keep].astype(np.intp), j[keep].astype(np.intp)


@lru_cache(maxsize=8)
def _each_two(n: int) -> tuple[Numbers, Numbers]:
    return np.triu_indices(n, 1)


def _refined(z: Complex, plan: Complex, turn: complex, shift: complex, *, mirrored: bool) -> PlanSimilarity:
    """Fit the better half of the points by least squares."""
    size = np.abs(turn * z + shift - plan)
    good = size <= max(2.5 * SIGMA_FROM_MEDIAN * float(_median(size, PLAN_UNKNOWNS)), TINY)
    d, t = z[good] - z[good].mean(), plan[good] - plan[good].mean()
    squares = float((np.abs(d) ** 2).sum())
    if squares >= TINY:
        turn = complex((np.conj(d) * t).sum() / squares)
        shift = complex(plan[good].mean() - turn * z[good].mean())
    size = np.abs(turn * z + shift - plan)
    return PlanSimilarity(turn=turn, shift=shift, mirrored=mirrored, median=float(_median(size, PLAN_UNKNOWNS)))


def _least_median(columns: NDArray[Any], values: NDArray[Any], rows: Numbers) -> Floats | None:
    """Sizes of the residuals of the fit through as many points as unknowns whose middle residual is smallest."""
    unknowns = columns.shape[1]
    if len(rows) <= unknowns:
        return None
    chosen = rows[_draws(len(rows), unknowns)]
    with np.errstate(all="ignore"):
        design = columns[chosen]
        sound = np.abs(np.linalg.det(design)) > LEAST_DETERMINANT
        if not sound.any():
            return None
        coefficient = np.linalg.solve(design[sound], values[chosen[sound]][:, :, None])[:, :, 0]
    some = rows[_evenly(len(rows), MEDIAN_POINTS)]
    best = int(_median(np.abs(values[some] - coefficient @ columns[some].T), unknowns).argmin())
    return np.asarray(np.abs(values - columns @ coefficient[best]))


@lru_cache(maxsize=64)
def _draws(count: int, unknowns: int) -> list[list[int]]:
    """Draw so often that one draw is good; the same for the same number."""
    draws = int(np.ceil(np.log(NO_GOOD_DRAW) / np.log(1.0 - GOOD_SHARE**unknowns)))
    draw = Random(count)  # noqa: S311 (importing numpy.random takes 12 ms)
    return [draw.sample(range(count), unknowns) for _ in range(draws)]


def _robust(size: Floats, unknowns: int) -> float:
    """Robust standard deviation of residuals of a fit; some of them are zero only because it is one."""
    if not len(size):
        return 0.0
    return SIGMA_FROM_MEDIAN * float(_median(size, unknowns)) * (1.0 + 2.0 / max(len(size) - unknowns, 1))


@dataclass(frozen=True, eq=False)
class RobustFit:
    """A fit that wrong points do not disturb, for example of the bending of a strip."""

    residual: NDArray[Any]  # (n,): given minus predicted, metres; of every point, whether it took part or not
    # (n,): standard deviation of a residual of a point that did not take part, in each direction; metres
    spread: Floats
    used: Flags  # (n,): points that took part and go with the others
    # coefficient, sigma: (c,): coefficients of the columns and their standard deviations
    coefficient: NDArray[Any]
    sigma: Floats
    freedom: int
    # standard deviation of a given coordinate, metres; not below what makes sense, infinite without redundancy
    sigma0: float

    @property
    def limit(self) -> Floats:
        """Residuals beyond which a point contradicts the others, shape (n,), metres."""
        if self.freedom < 1:
            return np.full(len(self.spread), np.inf)
        return self.spread * t_quantile(1 - ODD_PROBABILITY, self.freedom)

    @property
    def odd(self) -> Flags:
        """Points that contradict the others."""
        return np.asarray(np.abs(self.residual) > self.limit)


def fit_robustly(columns: NDArray[Any], values: NDArray[Any], in_fit: Flags, floor: float) -> RobustFit:
    """Fit columns to values, with less and less weight for what does not go with the others.

    It starts from the fit through as many points as unknowns whose median residual is smallest, takes weights that fall
    with what that leaves, and ends with the points that go with each other, all of one weight.

    columns, values: (n, c), (n,), metres; in_fit: (n,), points that may take part.
    floor: smallest standard deviation that makes sense, metres.
    """
    size = np.maximum(np.abs(columns[in_fit]).max(axis=0, initial=TINY), TINY)
    scaled = columns / size
    coefficient, used = _reweighted(scaled, values, np.array(in_fit, bool), floor)
    residual = values - scaled @ coefficient
    parts = 2 if np.iscomplexobj(values) else 1
    freedom = parts * (int(used.sum()) - columns.shape[1])
    squares = float((np.abs(residual[used]) ** 2).sum())
    sigma0 = max(float(np.sqrt(squares / freedom)), floor) if freedom > 0 else np.inf
    inverse = np.linalg.pinv(scaled[used].conj().T @ scaled[used], rcond=1e-12)
    lever = np.einsum("ni,ij,nj->n", scaled, inverse, scaled.conj()).real
    sigma = np.sqrt(np.maximum(np.diag(inverse).real, 0.0)) * (sigma0 if freedom > 0 else np.inf)
    return RobustFit(
        residual=residual,
        spread=np.sqrt(1.0 + np.maximum(lever, 0.0)) * (sigma0 if freedom > 0 else np.inf),
        used=used,
        coefficient=coefficient / size,
        sigma=sigma / size,
        freedom=freedom,
        sigma0=sigma0,
    )


def _weighted(columns: NDArray[Any], values: NDArray[Any], weight: Floats) -> tuple[NDArray[Any], NDArray[Any]]:
    """Fit by weighted least squares; coefficients, and residuals of all."""
    root = np.sqrt(weight)
    coefficient = np.linalg.lstsq(columns * root[:, None], values * root, rcond=1e-9)[0]
    return coefficient, values - columns @ coefficient


def _reweighted(columns: NDArray[Any], values: NDArray[Any], in_fit: Flags, floor: float) -> tuple[NDArray[Any], Flags]:
    """Fit with the weights of a first fit, then without what is far away; coefficients, and what is kept."""
    first = _least_median(columns, values, np.flatnonzero(in_fit))
    weight = in_fit.astype(float)
    if first is not None:
        weight = in_fit / np.maximum(first / max(_robust(first[in_fit], columns.shape[1]), floor), 0.5) ** 2
    coefficient = np.zeros(columns.shape[1], values.dtype)
    for _ in range(REWEIGHTINGS):
        coefficient, residual = _weighted(columns, values, weight)
        middle = max(_robust(np.abs(residual[in_fit]), columns.shape[1]), floor)
        before, weight = weight, (in_fit & (np.abs(residual) < KEPT_SIGMAS * middle)).astype(float)
        if (before == weight).all():
            break
    return coefficient, weight > 0
