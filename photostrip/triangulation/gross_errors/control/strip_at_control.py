"""A strip at its control: misclosures, and tests of every coordinate against what the others predict.

The prediction is by the covariance of the strip where it is known (``control_significance``), else by a polynomial of
the highest degree that the control carries.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.statistics import t_quantile
from photostrip.triangulation import absolute_orientation
from photostrip.triangulation.absolute_orientation import Targets
from photostrip.triangulation.gross_errors.control.control_significance import ControlTests, predict_control
from photostrip.triangulation.polynomial import correction
from photostrip.triangulation.polynomial import terms as polynomial_terms

if TYPE_CHECKING:
    from collections.abc import Sequence

    from photostrip.arrays import Floats
    from photostrip.geodesy.ground_frame import GroundFrame
    from photostrip.geodesy.local_frame import IntermediateFrame
    from photostrip.points import ControlPoints
    from photostrip.triangulation.gross_errors.control.control_significance import ControlCovariance


ALPHA = 0.01  # of rejecting anything in a strip without wrong control
LEAST_REDUNDANCY = 3  # of plan and of height, for a test
LEAST_REDUNDANCY_NUMBER = 0.05  # redundancy number below which a coordinate cannot be tested


@dataclass(frozen=True, eq=False)
class StripAtControl:
    """Where a strip stands when its control is tested."""

    xyz: Floats  # (n, 3): strip coordinates of the control points
    frames: Sequence[GroundFrame]
    intermediate: IntermediateFrame
    precision: tuple[float, float]  # a-priori standard deviation of a strip point in plan and height, metres
    # spacing, breadth: as in ``correction.FitProblem``
    spacing: float
    breadth: float
    # covariance of all misclosures; without it polynomials stand for the strip's deformation
    covariance: ControlCovariance | None = None
    # similarities found so far, by the coordinates that count
    found: dict[bytes, absolute_orientation.AbsoluteOrientation] = field(default_factory=dict, repr=False)

    def oriented(self, kept: ControlPoints) -> absolute_orientation.AbsoluteOrientation:
        """Return the similarity on what is kept, all coordinates with the same weight; each choice is fitted once."""
        key = kept.use.tobytes()
        if key not in self.found:
            targets = Targets(kept, self.frames, self.intermediate)
            self.found[key] = absolute_orientation.orient(self.xyz, targets, kept.use.astype(float))
        return self.found[key]

    def problem(self, control: ControlPoints) -> correction.FitProblem:
        """Fit the similarity, and give what is left to a polynomial."""
        targets = Targets(control, self.frames, self.intermediate)
        weight = absolute_orientation.weights(targets.turned(self.placed(control)), self.precision)
        orientation = absolute_orientation.orient(self.xyz, targets, weight)
        return correction.FitProblem(orientation.similarity(self.xyz), targets, weight, self.spacing, self.breadth)

    def placed(self, kept: ControlPoints) -> Floats:
        """Return all control points after a similarity on what is kept, intermediate frame, metres."""
        return self.oriented(kept).similarity(self.xyz)

    def misclosures(self, kept: ControlPoints, control: ControlPoints | None = None) -> Floats:
        """Misclosures of all control after a similarity on what is kept, metres along the ground axes."""
        return Targets(control or kept, self.frames, self.intermediate).misclosures(self.placed(kept))

    def tests_by_covariance(self, control: ControlPoints, kept: ControlPoints) -> ControlTests | None:
        """Test all control against what is kept, by the covariance of the strip; None without one."""
        if self.covariance is None or len(self.covariance.point) != int(control.use.sum()):
            return None
        return predict_control(self.covariance, self.misclosures(kept, control), kept.use, ALPHA)


def richest_polynomial(problem: correction.FitProblem) -> correction.Polynomial | None:
    """Polynomial of the highest degree that leaves redundancy in every axis; None when there is none."""
    for degree in ("3", "2", "1"):
        fit = correction.fit(problem, correction.PolynomialSettings(degree))
        if all(axis.terms and axis.redundancy >= LEAST_REDUNDANCY for axis in fit.axes):
            return fit
    return None


def tests_by_polynomial(problem: correction.FitProblem, fit: correction.Polynomial) -> ControlTests:
    """Test every control coordinate against what the others predict: residual over redundancy number.

    In units of the scatter of the others, by Student's t; value 0 where nothing can be said.
    """
    use = problem.targets.control.use
    rest = np.column_stack([1 - axis.leverage for axis in fit.axes])
    residual = np.column_stack([axis.residuals for axis in fit.axes])
    with np.errstate(divide="ignore", invalid="ignore"):
        predicted = np.where(rest > LEAST_REDUNDANCY_NUMBER, residual / rest, 0.0)
    expected = 1 / np.sqrt(np.where(problem.by_axis > 0, problem.by_axis, np.inf))
    groups = ((0, 1), (0, 1), (2,))
    spread, freedom = np.empty_like(residual), np.empty(3)
    for axis, group in enumerate(groups):
        counted = problem.by_axis[:, group] > 0
        total = sum(fit.axes[k].redundancy for k in group)
        squares = (residual[:, group] ** 2).sum()
        point_squares = (residual[:, group] ** 2 / np.maximum(rest[:, group], LEAST_REDUNDANCY_NUMBER) * counted).sum(
            axis=1
        )
        freedom[axis] = max(total - len(group), 1)
        spread[:, axis] = np.sqrt(np.maximum(squares - point_squares, 0.0) / freedom[axis])
    deviation = np.maximum(spread, expected) / np.sqrt(np.maximum(rest, LEAST_REDUNDANCY_NUMBER))
    axes = problem.targets.axes(problem.xyz)
    size = -np.einsum("nij,nj->ni", axes, predicted)
    with np.errstate(divide="ignore", invalid="ignore"):
        value = np.abs(size) / np.sqrt(np.einsum("nij,nj->ni", axes**2, deviation**2))
    redundancy = np.einsum("nij,nj->ni", axes**2, np.clip(rest, 0.0, 1.0))
    tail = ALPHA / (2 * int(use.sum()))
    limit = np.array([t_quantile(1 - tail, dof) for dof in freedom])
    tested = use & (redundancy > LEAST_REDUNDANCY_NUMBER) & np.isfinite(value)
    return ControlTests(
        value=np.where(tested, value, 0.0),
        limit=np.broadcast_to(limit, value.shape),
        size=size,
        redundancy=redundancy,
        detectable=np.full(value.shape, np.nan),
        sigma0=float("nan"),
    )


def tests_by_kept(control: ControlPoints, kept: ControlPoints, strip: StripAtControl) -> ControlTests:
    """Test all given coordinates, the rejected ones too, against what those that are kept predict."""
    if strip.covariance is not None:
        return predict_control(strip.covariance, strip.misclosures(kept, control), kept.use, ALPHA)
    problem = strip.problem(kept)
    fit = richest_polynomial(problem)
    if fit is None:
        nothing, unknown = np.zeros(control.use.shape), np.full(control.use.shape, np.nan)
        return ControlTests(nothing, nothing + 1, nothing, nothing, unknown, float("nan"))
    tests = tests_by_polynomial(problem, fit)
    given = Targets(control, strip.frames, strip.intermediate)
    corrected = fit(problem.xyz)
    out = control.use & ~kept.use
    gap = -np.einsum("nij,nj->ni", given.axes(corrected), corrected - given.of(corrected))
    expected = 1 / np.sqrt(problem.weight.max(axis=0))
    sigma0 = np.array([max(fit.axes[k].sigma0, float(expected[k])) for k in range(3)])
    columns = [_leverages(problem, axis.terms, problem.by_axis[:, k]) for k, axis in enumerate(fit.axes)]
    spread = sigma0 * np.sqrt(1 + np.column_stack(columns))
    turned = np.sqrt(np.einsum("nij,nj->ni", given.axes(corrected) ** 2, spread**2))
    return replace(
        tests,
        value=np.where(out, np.abs(gap) / turned, tests.value),
        size=np.where(out, gap, tests.size),
        redundancy=np.where(out, 1.0, tests.redundancy),
    )


def _leverages(problem: correction.FitProblem, terms: Sequence[str], weight: Floats) -> Floats:
    """Variance of the fit at every point in units of that of a coordinate of mean weight, shape (n,)."""
    columns = polynomial_terms.columns(problem.xyz[:, :2] / [problem.sizes.reach, problem.breadth], terms)
    used = weight > 0
    design = columns[used] * np.sqrt(weight[used] / weight[used].mean())[:, None]
    cofactors = np.linalg.pinv(design.T @ design, hermitian=True)
    return np.asarray(np.einsum("ni,ij,nj->n", columns, cofactors, columns), float)
