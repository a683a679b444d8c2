"""Where shift, rotation and scale come from: control, positions, or inner constraints on the points.

A free network is solved with seven conditions at two photos, which keep the band, and its steps and cofactors are then
carried over to inner constraints: of all solutions of the same shape that with the smallest changes of the points,
and with the smallest trace of their cofactors.
"""

from __future__ import annotations

import numpy as np

from photostrip.arrays import Floats
from photostrip.frozen import replace
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS, similarity_derivatives
from photostrip.triangulation.bundle.observations.collinearity import PHOTO, SIGNS
from photostrip.triangulation.bundle.observations.problem import BundleProblem
from photostrip.triangulation.bundle.parameters import Parameters, ParameterStep, PreparedProblem

DEFECT = SIMILARITY_PARAMETERS


def is_free(problem: BundleProblem) -> bool:
    """Whether nothing says where the network is: no control coordinate, no camera position, no attitude."""
    sigmas = (problem.control.sigma, problem.positions.sigma, problem.attitudes.sigma)
    return not any(np.isfinite(sigma).any() for sigma in sigmas)


def anchor(prepared: PreparedProblem, state: Parameters, blocks: Floats) -> Floats:
    """Conditions that hold seven parameters: all of a photo, and its distance from the photo farthest away.

    Returns what is added to the photos' blocks (m, 6, 6); the conditions are made as strong as the rays, whose blocks
    in the order of the band are ``blocks``.
    """
    order = prepared.structure.order
    middle = len(order) // 2
    base = state.centers[order] - state.centers[order[middle]]
    far = int(np.argmax((base**2).sum(axis=1)))
    add = np.zeros_like(blocks)
    add[middle] = np.diag(np.diag(blocks[middle]))
    direction = state.rotations[order[far]].T @ base[far] / np.linalg.norm(base[far])
    add[far, :3, :3] += np.trace(blocks[far, :3, :3]) / 3.0 * np.outer(direction, direction)
    return add


def photo_generators(prepared: PreparedProblem, state: Parameters, origin: Floats) -> Floats:
    """Move the photos by a small similarity about an origin: (m, 6, 7) in their own axes and signs, by the band."""
    order = prepared.structure.order
    back = np.swapaxes(state.rotations[order], 1, 2)
    moves = np.zeros((len(order), PHOTO, DEFECT))
    moves[:, :3] = back @ similarity_derivatives(state.centers[order], origin)
    moves[:, 3:, 3:6] = back
    moves *= SIGNS[:, None]
    return moves


def centred(prepared: PreparedProblem, state: Parameters, move: ParameterStep) -> ParameterStep:
    """Take shift, rotation and scale of the points out of a step: dx - G (G'G)^-1 G' dx, G the moves of the points."""
    origin, inverse = inner(prepared, state)
    right = np.zeros(DEFECT)
    for batch, xyz, shift in zip(prepared.structure.batches, state.xyz, move.points, strict=True):
        moves = similarity_derivatives(xyz[:, batch.real].T, origin)
        right += np.einsum("ncd,nc->d", moves, shift[:, batch.real].T)
    similarity = inverse @ right
    points = tuple(
        shift - np.einsum("scd,d->cs", similarity_derivatives(xyz.T, origin), similarity)
        for xyz, shift in zip(state.xyz, move.points, strict=True)
    )
    return replace(move, photos=move.photos - photo_generators(prepared, state, origin) @ similarity, points=points)


def inner(prepared: PreparedProblem, state: Parameters) -> tuple[Floats, Floats]:
    """Mean of the points, metres, and (G'G)^-1, (7, 7), of the similarity of all points about it."""
    pairs = list(zip(prepared.structure.batches, state.xyz, strict=True))
    total = sum((xyz[:, batch.real].sum(axis=1) for batch, xyz in pairs), np.zeros(3))
    origin = total / sum(len(batch.real) for batch, _ in pairs)
    normal = np.zeros((DEFECT, DEFECT))
    for batch, xyz in pairs:
        moves = similarity_derivatives(xyz[:, batch.real].T, origin)
        normal += np.einsum("nca,ncb->ab", moves, moves)
    return origin, np.asarray(np.linalg.inv(normal), float)
