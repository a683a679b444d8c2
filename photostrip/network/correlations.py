"""Parameters that the observations hardly tell apart: correlations by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from photostrip.arrays import Floats
from photostrip.network.solution import BundleSolution, Cofactors

LIMIT = 0.95
ELEMENTS = (
    "shift along x",
    "shift along y",
    "shift along z",
    "rotation about x",
    "rotation about y",
    "rotation about z",
    "scale",
)
"""Elements of a photo or model, along and about its own axes, where shift and rotation that replace each other show."""


@dataclass(frozen=True)
class Correlation:
    """Two parameters that depend on each other."""

    # first, second: names: ``camera RC30: c``, ``photo 1003: shift along x``
    first: str
    second: str
    value: float


def correlations(solution: BundleSolution, precision: Cofactors) -> tuple[Correlation, ...]:
    """List correlations above ``LIMIT``: between common parameters, between these and photos, and within photos.

    In this order; each the largest first.
    """
    problem = solution.prepared.problem
    names = problem.common_names()
    turn = np.tile(np.eye(problem.unknowns), (problem.photos, 1, 1))
    turn[:, :3, :3] = turn[:, 3:6, 3:6] = np.swapaxes(solution.rotations, 1, 2)
    photos = turn @ precision.photos @ turn.swapaxes(1, 2)
    cross = turn @ precision.photo_common
    sigma = np.sqrt(np.einsum("nii->ni", photos))

    def element(photo: int, number: int) -> str:
        return f"{problem.unit} {problem.photo_name(photo)}: {ELEMENTS[number]}"

    shared = np.sqrt(np.diag(precision.common))
    found = _named(precision.common[None] / np.outer(shared, shared), lambda _, i, j: (names[i], names[j]))
    found += _named(cross / (sigma[:, :, None] * shared), lambda n, i, j: (element(n, i), names[j]), lower=False)
    found += _named(photos / (sigma[:, :, None] * sigma[:, None]), lambda n, i, j: (element(n, i), element(n, j)))
    return tuple(found)


def _named(ratio: Floats, name: Callable[[int, int, int], tuple[str, str]], *, lower: bool = True) -> list[Correlation]:
    """Name the elements (n, i, j) above the limit, the largest first; of squares only the lower half."""
    chosen = np.abs(ratio) > LIMIT
    if lower:
        chosen &= np.tri(ratio.shape[1], k=-1, dtype=bool)
    places, values = np.argwhere(chosen), ratio[chosen]
    order = np.argsort(-np.abs(values), kind="stable")
    return [Correlation(*name(*places[k].tolist()), float(values[k])) for k in order]
