"""What a bundle adjustment finds: the estimate, its residuals and how it got there; and, on request, its precision."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from photostrip.arrays import Floats
from photostrip.errors import GeometryError
from photostrip.network import datum
from photostrip.network.normal_equations import (
    FactoredEquations,
    NormalEquations,
    equations_at,
    factored,
)
from photostrip.network.parameters import PreparedProblem
from photostrip.network.problem import Parameters


@dataclass(frozen=True)
class IterationStep:
    chi_square: float  # weighted sum of squares of all residuals before the step
    length: float  # length of the step in standard deviations: the root of ``dx' N dx`` over all parameters
    damping: float  # damping of the step; 0 for a full Gauss-Newton step
    # shift, turn: largest shift of a perspective centre or point in metres, largest rotation of a photo in radians
    shift: float
    turn: float


@dataclass(frozen=True, eq=False)
class BundleSolution:
    """The least-squares estimate."""

    centers: Floats  # (m, 3): perspective centres, or origins of models, metres, in the frame of the problem
    rotations: Floats  # (m, 3, 3): rotations, photo or model to Cartesian frame
    scales: Floats  # (m,): scales of models, metres per millimetre; 1 for photos
    points: Floats  # (q, 3): points, metres. A point without rays keeps its start
    common: Floats  # (p,): calibration, offset and drift parameters, in the order of ``Problem.common_names()``
    # (n, c): measured minus adjusted image or model coordinates, mm, in the order of ``problem.images``
    image_residuals: Floats
    # (c, 3): adjusted minus given coordinates along the axes of each row, metres, also where the sigma is infinite
    control_residuals: Floats
    # (g, 3): adjusted minus given camera positions along the axes, metres, offset and drift taken off
    position_residuals: Floats
    attitude_residuals: Floats  # (a, 3): rotation from the given to the adjusted attitude about the photo axes, radians
    chi_square: float  # weighted sum of squares of all residuals, those of weighted parameters included
    # observations (weighted parameters included) minus parameters, plus the datum defect of a free network
    redundancy: int
    free: bool  # true when the datum came from inner constraints on the points: no control, no positions
    rough: bool  # good enough for tests of residuals; the datum of a free network is then any
    steps: tuple[IterationStep, ...]  # the way from the start, one entry for each step that was taken or refused
    prepared: PreparedProblem  # the problem as it was laid out; spares the precision that work
    equations: NormalEquations | None  # at the solution, where the last steps of a rough one left them

    @property
    def state(self) -> Parameters:
        return Parameters(
            centers=self.centers, rotations=self.rotations, scales=self.scales, points=self.points, common=self.common
        )

    @cached_property
    def factored(self) -> FactoredEquations:
        """The normal equations at the solution in factors; ``bundle-rank`` where they are singular."""
        equations = self.equations or equations_at(self.prepared, self.state)
        held = datum.anchors if self.rough else datum.anchor
        anchor = held(equations.unreduced, self.prepared.rank, self.state) if self.free else None
        found = factored(equations, anchor)
        if found is None:
            raise GeometryError("the normal matrix is singular at the solution", code="bundle-rank")
        return found

    @property
    def sigma0(self) -> float:
        """Standard deviation of unit weight, 1 when the stated sigmas are right; NaN without redundancy."""
        return float((self.chi_square / self.redundancy) ** 0.5) if self.redundancy > 0 else float("nan")


@dataclass(frozen=True, eq=False)
class Cofactors:
    """Cofactors: covariances for a sigma0 of 1. Multiply by sigma0 squared where that is wanted."""

    points: Floats  # (q, 3, 3): cofactors of the points, m^2, Cartesian; NaN for a point without rays
    # (m, u, u): cofactors of photos or models: shift of the perspective centre (m), then rotation vector (rad), both in
    # the Cartesian frame; the rotation is ``from_vector(v) @ R``; of models the logarithm of the scale
    photos: Floats
    common: Floats  # (p, p): cofactors of the common parameters
    # (n, c, c): cofactors of the residuals of each ray, mm^2: with sigma of a coordinate, its redundancy number is
    # ``diagonal / sigma**2``
    image_residuals: Floats
    # (c, 3, 3): the same for control, along its axes, m^2; of rows and columns that are not given: minus the cofactor
    # of the adjusted coordinate
    control_residuals: Floats
    position_residuals: Floats  # (g, 3, 3): the same for camera positions
    attitude_residuals: Floats  # (a, 3, 3): the same for attitudes, rad^2
    # (p,): the same for the a-priori values of weighted common parameters; 0 where a parameter is free
    common_residuals: Floats
    photo_common: Floats  # (m, u, p): cofactors between photos and common parameters
