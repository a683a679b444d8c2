"""What a bundle adjustment finds: the estimate, its residuals and how it got there; and, on request, its precision."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from photostrip.triangulation.bundle.observations.model import Model

    Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Step:
    """One step of the adjustment.

    Parameters
    ----------
    chi_square : float
        Weighted sum of squares of all residuals before the step.
    length : float
        Length of the step in standard deviations: the root of ``dx' N dx`` over all parameters.
    damping : float
        Damping of the step; 0 for a full Gauss-Newton step.
    shift, turn : float
        Largest shift of a perspective centre or point in metres, largest rotation of a photo in radians.
    """

    chi_square: float
    length: float
    damping: float
    shift: float
    turn: float


@dataclass(frozen=True, eq=False)
class Solution:
    """The least-squares estimate.

    Parameters
    ----------
    centers : ndarray, shape (m, 3)
        Perspective centres, metres, in the frame of the problem.
    rotations : ndarray, shape (m, 3, 3)
        Rotations, photo to Cartesian frame.
    points : ndarray, shape (q, 3)
        Points, metres. A point without rays keeps its start.
    common : ndarray, shape (p,)
        Calibration, offset and drift parameters, in the order of ``Problem.common_names()``.
    image_residuals : ndarray, shape (n, 2)
        Measured minus adjusted image coordinates, mm, in the order of ``problem.images``.
    control_residuals : ndarray, shape (c, 3)
        Adjusted minus given coordinates along the axes of each row, metres, also where the sigma is infinite.
    position_residuals : ndarray, shape (g, 3)
        Adjusted minus given camera positions along the axes, metres, offset and drift taken off.
    attitude_residuals : ndarray, shape (a, 3)
        Rotation from the given to the adjusted attitude about the photo axes, radians.
    chi_square : float
        Weighted sum of squares of all residuals, those of weighted parameters included.
    redundancy : int
        Observations (weighted parameters included) minus parameters, plus the datum defect of a free network.
    free : bool
        True when the datum came from inner constraints on the points: no control, no positions.
    steps : tuple of Step
        The way from the start, one entry for each step that was taken or refused.
    model : Model
        The problem as it was laid out; spares the precision that work.
    """

    centers: Floats
    rotations: Floats
    points: Floats
    common: Floats
    image_residuals: Floats
    control_residuals: Floats
    position_residuals: Floats
    attitude_residuals: Floats
    chi_square: float
    redundancy: int
    free: bool
    steps: tuple[Step, ...]
    model: Model

    @property
    def sigma0(self) -> float:
        """Standard deviation of unit weight, 1 when the stated sigmas are right; NaN without redundancy."""
        return float((self.chi_square / self.redundancy) ** 0.5) if self.redundancy > 0 else float("nan")


@dataclass(frozen=True, eq=False)
class Precision:
    """Cofactors: covariances for a sigma0 of 1. Multiply by sigma0 squared where that is wanted.

    Parameters
    ----------
    points : ndarray, shape (q, 3, 3)
        Cofactors of the points, m^2, Cartesian; NaN for a point without rays.
    photos : ndarray, shape (m, 6, 6)
        Cofactors of the photos: shift of the perspective centre (m), then rotation vector (rad), both in the
        Cartesian frame; the rotation is ``from_vector(v) @ R``.
    common : ndarray, shape (p, p)
        Cofactors of the common parameters.
    image_residuals : ndarray, shape (n, 2, 2)
        Cofactors of the residuals of each ray, mm^2: with sigma of a coordinate, its redundancy number is
        ``diagonal / sigma**2``.
    control_residuals : ndarray, shape (c, 3, 3)
        The same for control, along its axes, m^2; of rows and columns that are not given: minus the cofactor
        of the adjusted coordinate.
    position_residuals : ndarray, shape (g, 3, 3)
        The same for camera positions.
    attitude_residuals : ndarray, shape (a, 3, 3)
        The same for attitudes, rad^2.
    common_residuals : ndarray, shape (p,)
        The same for the a-priori values of weighted common parameters; 0 where a parameter is free.
    photo_common : ndarray, shape (m, 6, p)
        Cofactors between photos and common parameters.
    """

    points: Floats
    photos: Floats
    common: Floats
    image_residuals: Floats
    control_residuals: Floats
    position_residuals: Floats
    attitude_residuals: Floats
    common_residuals: Floats
    photo_common: Floats
