"""How precise a planned strip becomes with a layout of control, by each method of adjustment.

The covariances are those that a run reports for a measured strip: nothing is propagated anew.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.errors import GeometryError
from photostrip.geodesy.frame_spec import FrameSpec
from photostrip.geodesy.local_frame import IntermediateFrame
from photostrip.geodesy.tying import tie_frames
from photostrip.network import problem as bundle
from photostrip.network.cofactors import cofactors_of as bundle_precision
from photostrip.network.solve import solve
from photostrip.notes import counted
from photostrip.planning.strip.ideal_strip import USES, ControlLayout, IdealStrip, Spot, Triple, numbers_of
from photostrip.points import ControlPoints
from photostrip.strip import absolute_orientation
from photostrip.strip.error_propagation import control_errors
from photostrip.strip.error_propagation.fitted_strip import FittedStrip
from photostrip.strip.gross_errors.pairs.screening import DETECTABLE
from photostrip.strip.polynomial import correction
from photostrip.strip.polynomial import terms as polynomial_terms

SIMILARITY, BUNDLE = "similarity", "bundle"
DEGREES = {"degree 1": "1", "degree 2": "2", "degree 3": "3"}
METHODS = (SIMILARITY, *DEGREES, BUNDLE)
NO_REDUNDANCY = 1e-9  # redundancy number of a control coordinate that nothing checks


@dataclass(frozen=True, eq=False)
class Accuracy:
    """Expected precision of a strip."""

    method: str
    used: str  # what the control carries of it: ``degree 2`` where degree 3 was asked for and three bands are given
    covariance: Floats  # (q, 3, 3): of the points of the strip, along, across and up, metres^2
    control: Numbers  # (c,): points that are control
    # (c, 3): smallest error of each given coordinate that a test at 0.1 % finds in 80 % of cases, metres; infinite
    # where nothing checks it, NaN where it is not given
    detectable: Floats

    @property
    def sigmas(self) -> Floats:
        """Standard deviations along, across and up, shape (q, 3)."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))

    @property
    def plan_and_height(self) -> Floats:
        """Standard deviations in plan (both coordinates together) and in height, shape (q, 2)."""
        variance = np.diagonal(self.covariance, axis1=1, axis2=2)
        return np.sqrt(np.column_stack([variance[:, 0] + variance[:, 1], variance[:, 2]]))

    @property
    def new(self) -> Numbers:
        """Points that are not control."""
        return np.delete(np.arange(len(self.covariance)), self.control)


def control_of(strip: IdealStrip, spots: tuple[Spot, ...], sigma: Triple) -> ControlPoints:
    """Return the control points of a layout along X, Y, Z of the strip, in the order of the spots."""
    numbers = numbers_of(strip, spots)
    ids = tuple(f"{spot.photo}/{spot.row}" for spot in spots)
    use = np.array([USES[spot.use] for spot in spots], bool).reshape(-1, 3)
    given = np.broadcast_to(np.array(sigma, float), use.shape)
    return ControlPoints(
        ids=ids, enu=np.where(use, strip.xyz[numbers], np.nan), use=use, check=np.zeros(len(ids), bool), sigma=given
    )


def accuracy(strip: IdealStrip, layout: ControlLayout, spots: tuple[Spot, ...], method: str) -> Accuracy:
    """Compute the expected precision of a strip with one layout of control, by one method.

    The layout gives the precision of the control and of measured perspective centres, which only the bundle uses.

    Raises GeometryError when the control does not determine the strip.
    """
    control = control_of(strip, spots, layout.sigma)
    if method == BUNDLE:
        return _bundle(strip, layout, spots, control)
    plan, height = int(control.use[:, 0].sum()), int(control.use[:, 2].sum())
    if plan < 2 or height < 3:
        message = f"{counted(plan, 'control point')} in plan and {height} in height cannot orient a strip"
        raise GeometryError(message, code="plan-control")
    return _fitted(strip, np.array(numbers_of(strip, spots), np.intp), control, method)


def _fitted(strip: IdealStrip, numbers: Numbers, control: ControlPoints, method: str) -> Accuracy:
    """Similarity, and polynomials of a fixed degree as far as the control carries them, as a run would fit them.

    The absolute orientation refuses control that leaves the strip a motion.
    """
    frames, _ = tie_frames([FrameSpec("local", ("east", "north", "up"))])
    intermediate = IntermediateFrame.at_local_centre(strip.xyz[numbers[control.use[:, 0]]], np.pi / 2)
    targets = absolute_orientation.Targets(control, frames, intermediate)
    weight = absolute_orientation.weights(control, _precision(strip))
    absolute_orientation.lay(strip.formed.xyz[numbers], targets, weight, strip.formed.xyz)
    xyz = intermediate.intermediate_from_cartesian(strip.xyz)
    terms: list[tuple[str, ...]] = [(), (), ()]
    if method in DEGREES:
        breadth = max(np.quantile(np.abs(xyz[:, 1]), 0.95), 1e-6)
        problem = correction.FitProblem(
            xyz=xyz[numbers], targets=targets, weight=weight, spacing=strip.geometry.base, breadth=breadth
        )
        terms = [axis.terms for axis in correction.fit(problem, correction.PolynomialSettings(DEGREES[method])).axes]
    found = control_errors.misclosures(control, numbers, targets.axes(xyz[numbers]))
    shift = intermediate.intermediate_from_cartesian(strip.errors.origin[None])[0]
    fit = control_errors.fit_operator(found, weight, xyz[numbers], terms, shift)
    fitted = FittedStrip(errors=strip.errors, control=found, fit=fit, xyz=xyz, factor=1.0)
    covariance = fitted.covariances_of_points(np.arange(len(xyz)))
    share = np.einsum("wi,wit,tw->w", found.direction, fit.influence(xyz[found.row]), fit.operator)
    variance = np.diagonal(covariance, axis1=1, axis2=2)[numbers[found.point], found.axis]
    residual = variance + found.variance * (1 - 2 * share)
    detectable = np.full((len(numbers), 3), np.nan)
    free = 1 - share
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.where(free > NO_REDUNDANCY, DETECTABLE * np.sqrt(np.maximum(residual, 0.0)) / free, np.inf)
    detectable[found.point, found.axis] = size
    return Accuracy(
        method=method,
        used=_used(terms) if method in DEGREES else method,
        covariance=covariance,
        control=numbers,
        detectable=detectable,
    )


def _used(terms: list[tuple[str, ...]]) -> str:
    """Say which degree the control carries; plan and height apart where they differ."""
    powers = [polynomial_terms.degree_of(each) for each in (terms[0], terms[2])]
    names = ["similarity" if power == 0 else f"degree {power}" for power in powers]
    return names[0] if names[0] == names[1] else f"{names[0]} in plan, {names[1]} in height"


def _precision(strip: IdealStrip) -> absolute_orientation.PointPrecision:
    """A-priori standard deviation of a point of one model in plan and height, metres, as a run takes it."""
    geometry = strip.geometry
    plan = geometry.image_sigma * geometry.scale / 1000.0
    depth = float(strip.centers[:, 2].mean())
    height = plan * float(np.sqrt(2.0)) * depth / geometry.base
    return absolute_orientation.PointPrecision(plan, height)


def _bundle(strip: IdealStrip, layout: ControlLayout, spots: tuple[Spot, ...], control: ControlPoints) -> Accuracy:
    """All rays with control and perspective centres in one solution."""
    numbers = np.array(numbers_of(strip, spots), np.intp)
    problem = bundle_problem(strip, layout, numbers, control)
    found = bundle_precision(solve(problem))
    given = np.where(control.use, control.sigma, np.nan)
    redundant = np.diagonal(found.control_residuals, axis1=1, axis2=2) / given**2
    with np.errstate(divide="ignore", invalid="ignore"):
        detectable = np.where(redundant > NO_REDUNDANCY, DETECTABLE * given / np.sqrt(redundant), np.inf)
    return Accuracy(
        method=BUNDLE,
        used=BUNDLE,
        covariance=found.points,
        control=numbers,
        detectable=np.where(control.use, detectable, np.nan),
    )


def bundle_problem(
    strip: IdealStrip, layout: ControlLayout, numbers: Numbers, control: ControlPoints
) -> bundle.BundleProblem:
    """Return the strip and its control (point `numbers`) as a bundle adjustment that starts at the truth."""
    observed = strip.observations
    point = np.full(len(observed.point_ids), -1)
    point[strip.formed.point] = np.arange(len(strip.formed.point))
    rows = np.flatnonzero(point[observed.point] >= 0)
    place = {name: number for number, name in enumerate(strip.photos)}
    photo = np.array([place[name] for name in observed.photo_ids], np.intp)[observed.photo[rows]]
    axes = np.broadcast_to(np.eye(3), (len(numbers), 3, 3))
    count = len(strip.centers)
    return bundle.BundleProblem(
        images=bundle.ImageObservations(
            photo=photo, point=point[observed.point[rows]], xy=observed.xy[rows], sigma=observed.sigma[rows]
        ),
        cameras=bundle.BundleCameras(np.zeros(count, np.intp), np.array([strip.geometry.camera.principal_distance])),
        start=bundle.StartValues(strip.centers, strip.rotations, strip.xyz),
        control=bundle.ControlObservations(
            point=numbers, xyz=strip.xyz[numbers], axes=axes, sigma=np.where(control.use, control.sigma, np.inf)
        ),
        positions=_positions(strip, layout),
    )


def _positions(strip: IdealStrip, layout: ControlLayout) -> bundle.PositionObservations:
    """Return all perspective centres, with a constant offset that is free or absent; none where none are measured."""
    if layout.gnss is None:
        return bundle.PositionObservations()
    count = len(strip.centers)
    return bundle.PositionObservations(
        photo=np.arange(count),
        xyz=strip.centers,
        axes=np.broadcast_to(np.eye(3), (count, 3, 3)),
        sigma=np.broadcast_to(np.array(layout.gnss, float), (count, 3)),
        lever=np.zeros((count, 3)),
        group=np.zeros(count, np.intp),
        time=np.linspace(-1.0, 1.0, count),
        offset_sigma=np.full((1, 3), np.inf if layout.gnss_offset else 0.0),
        drift_sigma=np.zeros((1, 3)),
    )
