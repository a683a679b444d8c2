"""Where shift, rotation and scale come from: control, positions, or inner constraints on the points.

A free network is solved with seven conditions at two photos, which keep the band, and its steps and cofactors are then
carried over to inner constraints: of all solutions of the same shape that with the smallest changes of the points,
and with the smallest trace of their cofactors.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.geometry.rotation import cross_matrix
from photostrip.triangulation.bundle.observations.linearise import PHOTO, SIGNS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.triangulation.bundle.observations.problem import BundleProblem
    from photostrip.triangulation.bundle.parameters import Parameters, ParameterStep, PreparedProblem

    Floats = NDArray[np.float64]

DEFECT = 7
"""Parameters of a similarity: shift, rotation, scale."""


def is_free(problem: BundleProblem) -> bool:
    """Whether nothing that is given says where the network is.

    Returns
    -------
    bool
        True without any control coordinate, camera position and attitude.
    """
    sigmas = (problem.control.sigma, problem.positions.sigma, problem.attitudes.sigma)
    return not any(np.isfinite(sigma).any() for sigma in sigmas)


def anchor(prepared: PreparedProblem, state: Parameters, own: Floats) -> Floats:
    """Conditions that hold seven parameters: all of a photo, and its distance from the photo farthest away.

    Parameters
    ----------
    own : ndarray, shape (m, 6, 6)
        Blocks of the photos in the order of the band: the conditions are made as strong as the rays.

    Returns
    -------
    ndarray, shape (m, 6, 6)
        What is added to these blocks.
    """
    order = prepared.structure.order
    middle = len(order) // 2
    base = state.centers[order] - state.centers[order[middle]]
    far = int(np.argmax((base**2).sum(axis=1)))
    add = np.zeros_like(own)
    add[middle] = np.diag(np.diag(own[middle]))
    direction = state.rotations[order[far]].T @ base[far] / np.linalg.norm(base[far])
    add[far, :3, :3] += np.trace(own[far, :3, :3]) / 3.0 * np.outer(direction, direction)
    return add


def generators(points: Floats, origin: Floats) -> Floats:
    """Give moves of points by a small similarity: shift, rotation about an origin, scale.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        Points, metres.
    origin : ndarray, shape (3,)
        Origin, metres.

    Returns
    -------
    ndarray, shape (n, 3, 7)
        Derivatives of the points.
    """
    arm = points - origin
    shift = np.broadcast_to(np.eye(3), (len(points), 3, 3))
    return np.concatenate([shift, -cross_matrix(arm), arm[:, :, None]], axis=2)


def photo_generators(prepared: PreparedProblem, state: Parameters, origin: Floats) -> Floats:
    """Give moves of the photos by a small similarity, in their own axes and signs.

    Parameters
    ----------
    origin : ndarray, shape (3,)
        Origin, metres.

    Returns
    -------
    ndarray, shape (m, 6, 7)
        Derivatives of the photos' parameters, in the order of the band.
    """
    order = prepared.structure.order
    back = np.swapaxes(state.rotations[order], 1, 2)
    moves = np.zeros((len(order), PHOTO, DEFECT))
    moves[:, :3] = back @ generators(state.centers[order], origin)
    moves[:, 3:, 3:6] = back
    moves *= SIGNS[:, None]
    return moves


def centred(prepared: PreparedProblem, state: Parameters, move: ParameterStep) -> ParameterStep:
    """Take shift, rotation and scale of the points out of a step.

    Parameters
    ----------
    state : Parameters
        Where the step starts.

    Returns
    -------
    ParameterStep
        The same step under inner constraints.
    """
    origin, inverse = inner(prepared, state)
    right = np.zeros(DEFECT)
    for batch, xyz, shift in zip(prepared.structure.batches, state.xyz, move.points, strict=True):
        moves = generators(xyz[:, batch.real].T, origin)
        right += np.einsum("ncd,nc->d", moves, shift[:, batch.real].T)
    similarity = inverse @ right
    points = tuple(
        shift - np.einsum("scd,d->cs", generators(xyz.T, origin), similarity)
        for xyz, shift in zip(state.xyz, move.points, strict=True)
    )
    return replace(move, photos=move.photos - photo_generators(prepared, state, origin) @ similarity, points=points)


def inner(prepared: PreparedProblem, state: Parameters) -> tuple[Floats, Floats]:
    """Origin and inverse normal matrix of the similarity of the points.

    Returns
    -------
    origin : ndarray, shape (3,)
        Mean of the points, metres.
    inverse : ndarray, shape (7, 7)
        Inverse of G'G with the generators G of all points.
    """
    pairs = list(zip(prepared.structure.batches, state.xyz, strict=True))
    total = sum(xyz[:, batch.real].sum(axis=1) for batch, xyz in pairs)
    origin = total / sum(len(batch.real) for batch, _ in pairs)
    normal = np.zeros((DEFECT, DEFECT))
    for batch, xyz in pairs:
        moves = generators(xyz[:, batch.real].T, origin)
        normal += np.einsum("nca,ncb->ab", moves, moves)
    return origin, np.asarray(np.linalg.inv(normal), float)
