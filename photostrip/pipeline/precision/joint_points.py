"""Joint covariances of points of a run: what the difference of two of them, or a mean of several, is good for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.errors import Fault, InputError

if TYPE_CHECKING:
    from photostrip.pipeline.results import Result


def joint_covariance(result: Result, rows: Numbers) -> Floats:
    """Joint covariances (n, 3, n, 3) of points of ``result.points``, metres^2.

    They stand along east, north and up at each point, or along the axes of a geocentric output.
    Raises InputError after any other adjustment than a bundle, and of a free network.
    """
    ascending, back = np.unique(rows, return_inverse=True)
    cartesian = result.points.cartesian[ascending]
    level = result.output.level_axes_at(cartesian)
    axes = np.broadcast_to(np.eye(3), level.shape) if result.output.kind == "geocentric" else level
    return _of_bundle(result, ascending, axes)[back][:, :, back]


def _of_bundle(result: Result, rows: Numbers, axes: Floats) -> Floats:
    from photostrip.network.cofactors import coordinates_of, joint_cofactors

    if result.bundle is None:
        raise _refused("only a bundle adjustment keeps joint covariances", "set processing.adjustment to bundle")
    if result.bundle.start.free:
        raise _refused("a free network has no covariances on the ground", "tie it to the ground")
    solution = result.bundle.screened.solution
    joint = joint_cofactors(solution, coordinates_of(solution, result.points.number[rows])) * result.bundle.unit**2
    turned: Floats = np.einsum("iap,ipjq,jbq->iajb", axes, joint.reshape(len(rows), 3, len(rows), 3), axes)
    return turned


def _refused(message: str, fix: str) -> InputError:
    return InputError(Fault(message, "no-joint-covariance", fix=fix))
