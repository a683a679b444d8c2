"""Joint covariances of points of a run: what the difference of two of them, or a mean of several, is good for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.errors import Fault, InputError

if TYPE_CHECKING:
    from photostrip.pipeline.results import Result, StripResult

BUNDLE = "set processing.adjustment to bundle"


def joint_covariance(result: Result, rows: Numbers) -> Floats:
    """Joint covariances (n, 3, n, 3) of points of ``result.points``, metres^2.

    They stand along east, north and up at each point, or along the axes of a geocentric output.
    Raises InputError where the adjustment does not keep what they need: after a polynomial, of independent models, and
        of points of several strips that are adjusted one by one; or where the run was to keep nothing for them.
    """
    ascending, back = np.unique(rows, return_inverse=True)
    cartesian = result.points.cartesian[ascending]
    level = result.output.level_axes_at(cartesian)
    axes = np.broadcast_to(np.eye(3), level.shape) if result.output.kind == "geocentric" else level
    found = _of_bundle(result, ascending, axes) if result.bundle is not None else _of_strip(result, ascending, axes)
    return found[back][:, :, back]


def _of_bundle(result: Result, rows: Numbers, axes: Floats) -> Floats:
    from photostrip.triangulation.bundle.quality.cofactors import coordinates_of, joint_cofactors

    if result.bundle is None or result.bundle.start.free:
        raise _refused("a free network has no covariances on the ground", "tie it to the ground")
    solution = result.bundle.screened.solution
    joint = joint_cofactors(solution, coordinates_of(solution, result.points.number[rows])) * result.bundle.unit**2
    turned: Floats = np.einsum("iap,ipjq,jbq->iajb", axes, joint.reshape(len(rows), 3, len(rows), 3), axes)
    return turned


def _of_strip(result: Result, rows: Numbers, axes: Floats) -> Floats:
    strip, places = _strip_of(result, result.points.number[rows])
    stages = strip.photo_stages
    if stages is not None and stages.covariance is not None and stages.solved is None:
        raise _refused("the run did not keep what joint covariances are made of", "run the project with joint=True")
    if stages is None or stages.solved is None:
        raise _refused("only covariance and bundle adjustments keep joint covariances", BUNDLE)
    adjusted = stages.solved
    directions = (axes @ strip.intermediate.axes).reshape(-1, 3)
    wanted = adjusted.system.errors.points.take(np.repeat(places, 3)).along(directions)
    joint = adjusted.joint_covariance(wanted)
    return joint.reshape(len(rows), 3, len(rows), 3)


def _strip_of(result: Result, numbers: Numbers) -> tuple[StripResult, Numbers]:
    """Return the strip that alone holds some points, and their places in it."""
    holding = [strip for strip in result.strips if np.isin(numbers, strip.formed.point).any()]
    if len(holding) != 1:
        raise _refused("the points lie in several strips, which are adjusted one by one", BUNDLE)
    return holding[0], np.searchsorted(holding[0].formed.point, numbers)


def _refused(message: str, fix: str) -> InputError:
    return InputError(Fault(message, "no-joint-covariance", fix=fix))
