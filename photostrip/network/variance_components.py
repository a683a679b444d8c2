"""Variance components: how good each kind of observation really is, out of its own residuals.

The stated variances of a group are multiplied with the ratio of the weighted sum of squares of its residuals and its
share of the redundancy, until the ratios are one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from photostrip.arrays import Flags, Floats
from photostrip.network import reliability
from photostrip.network.problem import BundleProblem
from photostrip.network.solution import BundleSolution, Cofactors

LEAST_REDUNDANCY = 3.0  # of a group, below which its residuals say nothing about it
ITERATIONS = 12
CONVERGED = 0.005  # relative change of a standard deviation
LEAST_FACTOR, MOST_FACTOR = 0.05, 20.0  # factors of a stated standard deviation in one step: rounding of a perfect fit


@dataclass(frozen=True)
class Component:
    """The standard deviations of one group."""

    # ``image``, ``control plan``, ``control height``, ``control``, ``positions plan``, ``positions height`` or
    # ``attitudes``
    name: str
    observations: int
    redundancy: float
    factor: float  # what its stated standard deviations are to be multiplied with; 1 when it was not estimated
    sigma: float  # relative standard deviation of the factor
    estimated: bool  # whether its redundancy was enough


def labels(kind: str, rows: int, level: Sequence[bool]) -> list[tuple[str, slice | Flags]]:
    """Split a kind of observations into groups of their own variance: name, and coordinates (rows, 3).

    ``level``: whether the axes of a row are plan and height; others, as of geocentric coordinates, stay one group.
    """
    if kind not in {reliability.CONTROL, reliability.POSITION}:
        return [(kind if kind == reliability.IMAGE else "attitudes", slice(None))]
    name = "control" if kind == reliability.CONTROL else "positions"
    flat = np.array(level, bool).reshape(rows, 1)
    height = np.arange(3) == 2
    return [(f"{name} plan", flat & ~height), (f"{name} height", flat & height), (name, ~flat & np.ones(3, bool))]


def components(
    problem: BundleProblem, solution: BundleSolution, precision: Cofactors, level: Mapping[str, Sequence[bool]]
) -> tuple[Component, ...]:
    """Compare each group's residuals with its standard deviations, once: factor^2 = v^T P v / r of the group.

    ``level`` says for ``control`` and ``position`` whether the axes of each row are plan and height. Groups without
    observations are left out. Source: [Förstner 1979], the simplified form of Helmert's estimation.
    """
    found = []
    for group in reliability.groups_of(problem, solution, precision):
        for name, where in labels(group.kind, len(group.error), level.get(group.kind, ())):
            given = np.isfinite(group.sigma)
            if not isinstance(where, slice):
                given &= where
            if given.any():
                found.append(_component(name, group, given))
    return tuple(found)


def _component(name: str, group: reliability.Group, given: Flags) -> Component:
    squares = float(((group.error[given] / group.sigma[given]) ** 2).sum())
    redundancy = float(group.redundancy[given].sum())
    estimated = redundancy >= LEAST_REDUNDANCY
    factor = float(np.clip(np.sqrt(squares / redundancy), LEAST_FACTOR, MOST_FACTOR)) if estimated else 1.0
    sigma = float(1 / np.sqrt(2 * redundancy)) if estimated else float("nan")
    return Component(
        name=name, observations=int(given.sum()), redundancy=redundancy, factor=factor, sigma=sigma, estimated=estimated
    )


def scaled(problem: BundleProblem, found: Sequence[Component], level: Mapping[str, Sequence[bool]]) -> BundleProblem:
    """Multiply the standard deviations of a problem with the factors of their groups."""
    factor = {each.name: each.factor for each in found}

    def with_factors(kind: str, sigma: Floats) -> Floats:
        result = sigma.copy()
        for name, where in labels(kind, len(sigma), level.get(kind, ())):
            if name in factor:
                result[where] = result[where] * factor[name]
        return result

    return replace(
        problem,
        images=replace(problem.images, sigma=with_factors(reliability.IMAGE, problem.images.sigma)),
        control=replace(problem.control, sigma=with_factors(reliability.CONTROL, problem.control.sigma)),
        positions=replace(problem.positions, sigma=with_factors(reliability.POSITION, problem.positions.sigma)),
        attitudes=replace(problem.attitudes, sigma=with_factors(reliability.ATTITUDE, problem.attitudes.sigma)),
    )


def combined(before: Sequence[Component], step: Sequence[Component]) -> tuple[Component, ...]:
    """Multiply the factors of a step onto those found before; redundancies are those of the last step."""
    known = {each.name: each.factor for each in before}
    return tuple(replace(each, factor=each.factor * known.get(each.name, 1.0)) for each in step)


def converged(step: Sequence[Component]) -> bool:
    """Whether a step changes nothing worth another adjustment."""
    return all(abs(each.factor - 1.0) < CONVERGED for each in step)
