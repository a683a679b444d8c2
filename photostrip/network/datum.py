"""Where shift, rotation and scale come from: control, positions, or inner constraints on the points.

A free network is solved with seven conditions at two photos, which keep the band, and its steps and cofactors are then
carried over to inner constraints: of all solutions of the same shape that with the smallest changes of the points,
and with the smallest trace of their cofactors.
"""

from __future__ import annotations

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS, similarity_derivatives
from photostrip.network.problem import BundleProblem, Parameters, PreparedProblem

DEFECT = SIMILARITY_PARAMETERS
# photos, part: of 250, 500, 1000 and 1e-4, 1e-6, 1e-8 what comes nearest to all photos held by 1e-10, at 10 000 photos
STRETCH, HELD = 500, 1e-8


def is_free(problem: BundleProblem) -> bool:
    """Whether nothing says where the network is: no control coordinate, no camera position, no attitude."""
    sigmas = (problem.control.sigma, problem.positions.sigma, problem.attitudes.sigma)
    return not any(np.isfinite(sigma).any() for sigma in sigmas)


def anchor(blocks: Floats, rank: Numbers, state: Parameters) -> Floats:
    """Conditions that hold seven parameters: all of a model; all of a photo, and its distance from the farthest one.

    Returns what is added to the units' blocks (m, u, u); the conditions are made as strong as the rays, whose blocks
    are ``blocks``; the photo is that in the middle of the order ``rank``.
    """
    middle = int(np.argsort(rank)[len(rank) // 2])
    add = np.zeros_like(blocks)
    add[middle] = np.diag(np.diag(blocks[middle]))
    if len(add[middle]) == DEFECT:
        return add
    base = state.centers - state.centers[middle]
    far = int(np.argmax((base**2).sum(axis=1)))
    direction = state.rotations[far].T @ base[far] / np.linalg.norm(base[far])
    add[far, :3, :3] += np.trace(blocks[far, :3, :3]) / 3.0 * np.outer(direction, direction)
    return add


def anchors(blocks: Floats, rank: Numbers, state: Parameters) -> Floats:
    """Conditions of ``anchor``, and a trifle of its own information that holds one unit in ``STRETCH`` where it is.

    Residuals hardly feel it, but thousands of photos that two of them hold alone bend so far that the cofactors of
    the residuals are lost in rounding.
    """
    add = anchor(blocks, rank, state)
    beside = np.abs(rank - len(rank) // 2)
    held = (beside % STRETCH == 0) & (beside > 0)
    add[held] += HELD * blocks[held] * np.eye(blocks.shape[1])
    return add


def photo_generators(state: Parameters, origin: Floats, unknowns: int) -> Floats:
    """Move photos or models by a small similarity about an origin: (m, u, 7) in their own axes."""
    back = np.swapaxes(state.rotations, 1, 2)
    moves = np.zeros((len(back), unknowns, DEFECT))
    moves[:, :3] = back @ similarity_derivatives(state.centers, origin)
    moves[:, 3:6, 3:6] = back
    moves[:, 6:, 6:] = 1.0
    return moves


def point_generators(prepared: PreparedProblem, state: Parameters) -> tuple[Floats, Floats]:
    """Move points by a small similarity about their mean: the mean, (3,); (q, 3, 7), zero for points without rays."""
    origin = state.points[prepared.measured].mean(axis=0)
    return origin, similarity_derivatives(state.points, origin) * prepared.measured[:, None, None]
