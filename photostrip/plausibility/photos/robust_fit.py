"""A linear fit that wrong values do not disturb, with as few columns as leave no more than makes sense.

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

MEDIAN_POINTS = 100  # at most, from which a median misclosure is taken
GOOD_SHARE = 0.55  # of the points, at least
NO_GOOD_DRAW = 1e-3  # probability that no draw of as many points as unknowns, for a start, is of good points alone
LEAST_DETERMINANT = 1e-9  # of such a draw, columns of size one
REWEIGHTINGS = 12  # of a robust fit
KEPT_SIGMAS = 5.0  # robust standard deviations within which a point goes with the others
ODD_PROBABILITY = 1e-6  # that a good point is called odd
TINY = 1e-9
SIMPLE_SIGMAS = 2.5  # times what makes sense that a fit may leave before another column is taken
LEAST_REDUNDANCY = 2  # redundancy that must be left then


def _evenly(count: int, most: int) -> Numbers:
    """Numbers below a count, evenly drawn from all where there are too many."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(np.intp))


def _median(size: Floats, unknowns: int) -> Floats:
    """Size that a good half does not exceed, row by row; the points that a fit goes through do not count."""
    count = size.shape[-1]
    place = min((count + unknowns + 1) // 2, count) - 1
    return np.asarray(np.partition(size, place, axis=-1)[..., place])


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


def fit_simplest(
    columns: list[NDArray[Any]],
    least: int,
    values: NDArray[Any],
    in_fit: Flags,
    floor: float,
) -> tuple[NDArray[Any], RobustFit]:
    """Fit as few columns, the simplest first, as leave no more than makes sense, or least; `least` are always taken.

    More columns leave more where too many of the points are wrong for them.

    Returns columns: (n, c), those that were fitted.
    """
    fits: list[tuple[NDArray[Any], RobustFit]] = []
    for number in range(least, len(columns) + 1):
        chosen = np.column_stack(columns[:number])
        fits.append((chosen, fit_robustly(chosen, values, in_fit, floor)))
        spare = int(in_fit.sum()) - number - 1
        if spare < LEAST_REDUNDANCY or fits[-1][1].sigma0 <= SIMPLE_SIGMAS * floor:
            break
    return min(fits, key=lambda each: each[1].sigma0)
