"""What may be wrong with a camera beside what is given: asked before single observations are thrown out.

Lens distortion, stretched film, principal point and principal distance are shared by all photos of a camera.
Each is one hypothesis
of few unknowns: what the sum of squares would fall by with it, linearised at a solution, has a probability, with the
number of hypotheses counted, that is compared with that of the worst single observation. Camera positions that all lie
elsewhere are a rival. Source: derived, see docs/sources.md.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.special import gammaincc, gammaln, log_ndtr

from photostrip.arrays import Numbers
from photostrip.network import datum
from photostrip.network.calibration import values_of
from photostrip.network.common_errors import (
    ALL,
    DISTANCE,
    FILM,
    LEAST_SHARE,
    LENS,
    OF_CAMERAS,
    OFFSET,
    POINT,
    CommonError,
    mirrors,
    taken_up,
)
from photostrip.network.normal_equations import equations_at, factored
from photostrip.network.parameters import prepare
from photostrip.network.problem import BundleProblem, PositionObservations
from photostrip.network.solution import BundleSolution, Cofactors


class Likely(NamedTuple):
    """What is most likely to be wrong with a camera."""

    error: CommonError
    log_p: float  # logarithm of the probability that any of the hypotheses explains so much by chance


def log_probability(squares: float, freedom: int) -> float:
    """Logarithm of the probability of a larger chi-square; asymptotic where the probability is too small a number."""
    p = float(gammaincc(freedom / 2, squares / 2))
    if p > np.finfo(float).tiny:
        return float(np.log(p))
    return float(-squares / 2 + (freedom / 2 - 1) * np.log(squares / 2) - gammaln(freedom / 2))


def log_probability_of_worst(value: float, tests: int) -> float:
    """Logarithm of the probability that the largest of so many standardised residuals is so large by chance."""
    return min(float(np.log(2.0 * max(tests, 1)) + log_ndtr(-value)), 0.0)


def most_likely(problem: BundleProblem, solution: BundleSolution, unit: float) -> Likely | None:
    """Find what is most likely to be wrong with a camera at a solution of the problem; None where nothing can be asked.

    unit: standard deviation of unit weight in force.
    """
    cameras, given = problem.cameras, not datum.is_free(problem)
    may_be_off = _may_be_off(problem.positions)
    asked = [LENS, FILM] if may_be_off else [LENS, FILM, POINT, DISTANCE]  # the others are much like an offset
    known, used = cameras.unknown >= 0, np.unique(cameras.of_photo)
    candidates = [
        CommonError(kind, of="each", number=int(camera))
        for kind in asked
        for camera in used
        if not known[camera, OF_CAMERAS[kind]].any() and (given or kind != DISTANCE)
    ]
    if not candidates:
        return None
    rival = CommonError(OFFSET, ALL)
    freed = taken_up(problem, rival) if may_be_off else problem
    for each in candidates:
        freed = taken_up(freed, each)
    columns = [freed.cameras.unknown[each.number, OF_CAMERAS[each.kind]] for each in candidates]
    if may_be_off:
        candidates.append(rival)
        columns.append(np.arange(len(freed.common_names()))[-int(freed.positions.offset_sigma.astype(bool).sum()) :])
    gains = _gains(problem, solution, freed, columns)
    found = [
        Likely(each, min(log_probability(gain / unit**2, len(own)) + np.log(len(candidates)), 0.0))
        for each, own, gain in zip(candidates, columns, gains, strict=True)
    ]
    likely = min(found, key=lambda each: each.log_p)
    return None if likely.error is rival else likely


def _may_be_off(positions: PositionObservations) -> bool:
    """Whether camera positions may share an offset that nobody asks for: a rival of all errors of cameras."""
    return bool((positions.group >= 0).any() and not (positions.offset_sigma.any() or positions.drift_sigma.any()))


def _gains(
    problem: BundleProblem, solution: BundleSolution, freed: BundleProblem, columns: list[Numbers]
) -> list[float]:
    """By how much the sum of squares would fall with each set of common parameters alone; 0 for undetermined ones."""
    values = values_of(problem.cameras, solution.common)
    prepared = prepare(freed)
    rest = solution.common[int((problem.cameras.unknown >= 0).sum()) :]
    known = values[freed.cameras.unknown >= 0]
    common = np.concatenate([known, rest, np.zeros(len(prepared.prior) - len(known) - len(rest))])
    state = replace(solution.state, common=common)
    equations = equations_at(prepared, state)
    found = factored(equations, datum.anchor(equations.unreduced, prepared.rank, state) if solution.free else None)
    if found is None:
        return [0.0] * len(columns)
    pull = equations.right_common - found.cross.T @ equations.right_photos
    old = np.setdiff1d(np.arange(len(common)), np.concatenate(columns))
    gains = []
    for own in columns:
        left = found.left[np.ix_(own, own)]
        if len(old):
            across = found.left[np.ix_(own, old)]
            left = left - across @ np.linalg.solve(found.left[np.ix_(old, old)], across.T)
        held = np.diag(left) < LEAST_SHARE * np.diag(equations.corner)[own]
        value = np.zeros(len(own)) if held.any() else np.linalg.solve(left, pull[own])
        tried = np.zeros(len(common))
        tried[own] = value
        gains.append(0.0 if mirrors(freed.cameras, tried) else float(pull[own] @ value))
    return gains


def log_probabilities(
    problem: BundleProblem, solution: BundleSolution, cofactors: Cofactors, unit: float, errors: list[CommonError]
) -> list[float]:
    """Logarithm of the probability of such values of the parameters of each error, taken up, if they were zero."""
    place, found = problem.cameras.unknown, []
    for each in errors:
        least = 0.0
        for camera in range(len(place)) if each.number < 0 else [each.number]:
            own = place[camera, OF_CAMERAS[each.kind]]
            value = solution.common[own]
            squares = float(value @ np.linalg.solve(cofactors.common[np.ix_(own, own)], value)) / unit**2
            least = min(least, log_probability(squares, len(own)))
        found.append(least)
    return found
