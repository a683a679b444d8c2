"""What comes out of a run: every stage of every strip, nothing thrown away."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.geodesy.crs import GroundFrame
    from photostrip.geodesy.local_frame import IntermediateFrame
    from photostrip.notes import Finding, Note
    from photostrip.pipeline.covariance_adjustment import CovarianceAdjustment
    from photostrip.pipeline.inputs import Inputs, Settings, Strip
    from photostrip.pipeline.models.model_results import LinkedStrip
    from photostrip.points import ControlPoints
    from photostrip.triangulation import absolute_orientation as absolute
    from photostrip.triangulation.bundle.observations.problem import Problem
    from photostrip.triangulation.bundle.quality import reliability, self_calibration, variance_components
    from photostrip.triangulation.bundle.quality.correlations import Correlation
    from photostrip.triangulation.bundle.selection import Selection
    from photostrip.triangulation.bundle.snooping import Screened
    from photostrip.triangulation.error_propagation.covariances import CheckTest
    from photostrip.triangulation.gross_errors.control import control_screening, control_significance
    from photostrip.triangulation.gross_errors.pairs import screening
    from photostrip.triangulation.gross_errors.rays import strip_screening
    from photostrip.triangulation.image_coordinates import corrections, interior
    from photostrip.triangulation.polynomial import correction as polynomial
    from photostrip.triangulation.relative_orientation import relative
    from photostrip.triangulation.resection import resection as exterior
    from photostrip.triangulation.strip_formation import formation

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]
    Flags = NDArray[np.bool_]

NEW, CONTROL, CHECK = "new", "control", "check"


@dataclass(frozen=True, eq=False)
class StripResult:
    """Every stage of one strip, in order.

    Parameters
    ----------
    orientation : relative.Orientation
        Relative orientation of its pairs, after screening.
    precision : tuple of float
        A-priori standard deviation of a point in plan and height from one model, metres.
    control : ControlPoints
        Control that took part.
    control_rows : ndarray of int, shape (n,)
        Its rows in the strip's points.
    polynomial : polynomial.Polynomial or None
        Correction of the strip deformation; None with ``adjustment: similarity``.
    xyz : ndarray, shape (q, 3)
        Adjusted points, intermediate frame, metres; points of ``formed.point``.
    cartesian : ndarray, shape (q, 3)
        The same in the project's Cartesian frame.
    resection : exterior.Resection
        Photos oriented on the adjusted points, intermediate frame.
    rows : ndarray of int, shape (m,)
        Image points that took part in the resections, rows of the observations.
    depth : float
        Mean distance of the points from the cameras along the viewing direction, metres.
    notes : tuple of Note
        What this strip's numbers say beside themselves.
    screened : screening.Screened
        The search for gross errors: log, zones, detectable errors; it holds ``orientation`` and ``rejections`` too.
    contradictions : strip_screening.Verdict
        Measurements that the strip as a whole does not confirm.
    wrong_control : tuple of control_screening.ControlRejection
        Control coordinates that were not used; ``control`` says so in its ``use``.
    covariance : CovarianceAdjustment or None
        The adjustment with the strip's own covariance; None with other adjustments.
    judged_control : control_significance.Judged or None
        What the covariance of the strip says of each coordinate of ``control``; None without.
    """

    strip: Strip
    orientation: relative.Orientation
    rejections: tuple[screening.Rejection, ...]
    formed: formation.FormedStrip
    precision: tuple[float, float]
    intermediate: IntermediateFrame
    control: ControlPoints
    control_rows: Numbers
    absolute: absolute.AbsoluteOrientation
    polynomial: polynomial.Polynomial | None
    xyz: Floats
    cartesian: Floats
    resection: exterior.Resection
    rows: Numbers
    depth: float
    notes: tuple[Note, ...]
    screened: screening.Screened
    contradictions: strip_screening.Verdict
    wrong_control: tuple[control_screening.ControlRejection, ...]
    covariance: CovarianceAdjustment | None = None
    judged_control: control_significance.Judged | None = None

    @property
    def centers(self) -> Floats:
        """Perspective centres in flight order, intermediate frame, metres."""
        return self.resection.centers

    @property
    def scale_number(self) -> float:
        """Denominator of the photo scale."""
        return self.depth / (self.strip.camera.principal_distance / 1000)


@dataclass(frozen=True, eq=False)
class Adjusted:
    """Points of all strips together.

    Parameters
    ----------
    number : ndarray of int, shape (n,)
        Points, as numbered in the observations, ascending.
    cartesian : ndarray, shape (n, 3)
        Coordinates in the project's Cartesian frame, metres; mean over the strips.
    ground : ndarray, shape (n, 3)
        Coordinates in the output frame, internal order east, north, up.
    rays : ndarray of int, shape (n,)
        Photos on which the point was measured and used.
    """

    number: Numbers
    cartesian: Floats
    ground: Floats
    rays: Numbers


@dataclass(frozen=True, eq=False)
class Ties:
    """Points common to two strips.

    Parameters
    ----------
    number : ndarray of int, shape (t,)
        Points, as numbered in the observations.
    strips : ndarray of int, shape (t, 2)
        The two strips.
    difference : ndarray, shape (t, 3)
        Second minus first strip along east, north and up of the output frame, metres.
    """

    number: Numbers
    strips: Numbers
    difference: Floats

    @classmethod
    def none(cls) -> Ties:
        """Return the ties of an adjustment in which a point has one position."""
        return cls(np.zeros(0, np.intp), np.zeros((0, 2), np.intp), np.zeros((0, 3)))


@dataclass(frozen=True, eq=False)
class Precision:
    """How precise points and photos are: covariances carried from the image coordinates and the control.

    Every way of adjusting fills the same columns. All covariances refer to the axes of the project's Cartesian frame,
    as ``Adjusted.cartesian`` does; they are turned into the axes of the output where they are written.

    Parameters
    ----------
    points : ndarray, shape (n, 3, 3)
        Covariances of the points of ``Adjusted.number``, metres^2; NaN where one is not known.
    photos : tuple of ndarray, shape (m, 6, 6)
        One array for each strip, photos in flight order: perspective centre in metres, then the small rotation in
        radians that turns the photo about the axes of the frame, ``R_true = exp([theta]) R``; NaN where not known.
    sigma : tuple of float
        Standard deviation of an image coordinate of weight one behind the covariances, mm, for each strip.
    basis : tuple of str
        For each strip: ``"a-priori"`` when that is the stated one, ``"a-posteriori"`` when it was found by the
        adjustment.
    checks : tuple of CheckTest or None
        For each strip the test of its check points together; None without any, empty when no strip was tested.
    """

    points: Floats
    photos: tuple[Floats, ...]
    sigma: tuple[float, ...]
    basis: tuple[str, ...]
    checks: tuple[CheckTest | None, ...] = ()


@dataclass(frozen=True, eq=False)
class BlockStart:
    """Start values of the bundle adjustment.

    Parameters
    ----------
    strips : tuple of StripResult
        Strips of two photos or more, every stage of the strip method.
    photos : tuple of str
        All photos, strip by strip.
    centers, rotations : ndarray, shapes (m, 3), (m, 3, 3)
        Their orientations, Cartesian frame.
    points : ndarray, shape (q, 3)
        All points of the observations; NaN where one has no coordinates.
    free : bool
        Whether nothing ties the block to the ground: its frame and scale are those of the first strip.
    """

    strips: tuple[StripResult, ...]
    photos: tuple[str, ...]
    centers: Floats
    rotations: Floats
    points: Floats
    free: bool


@dataclass(frozen=True, eq=False)
class BlockProblem:
    """A bundle adjustment with what its rows stand for.

    Parameters
    ----------
    problem : Problem
        The arrays; points as numbered in the observations, photos strip by strip.
    origin : ndarray, shape (3,)
        Origin of its frame in the project's Cartesian frame, metres.
    kept : ndarray of bool, shape (n,)
        Rays that the user keeps.
    rows : ndarray of int, shape (n,)
        Row in the observations of each ray.
    control : ndarray of int, shape (c,)
        Row in the measured control of each row of ``problem.control``.
    level : dict of str to tuple of bool
        For ``control`` and ``position``: whether the axes of each row are plan and height.
    """

    problem: Problem
    origin: Floats
    begin: Selection
    kept: Flags
    rows: Numbers
    control: Numbers
    level: dict[str, tuple[bool, ...]]


@dataclass(frozen=True, eq=False)
class SinglePhoto:
    """A photo that is a strip of its own.

    Parameters
    ----------
    center, rotation : ndarray, shapes (3,), (3, 3)
        Its orientation in the project's Cartesian frame.
    """

    strip: Strip
    center: Floats
    rotation: Floats


@dataclass(frozen=True, eq=False)
class Bundle:
    """What the bundle adjustment found beside points and orientations.

    Parameters
    ----------
    start : BlockStart
        Where it started: the strips as the strip method leaves them.
    block : BlockProblem
        All observations, with the standard deviations of the last adjustment.
    screened : Screened
        The solution and how it was cleaned.
    groups : tuple of reliability.Group
        Observations that took part with their redundancy numbers.
    sigma0 : reliability.Sigma0Test
        Test of sigma0, with the stated standard deviations.
    components : tuple of variance_components.Component
        Variance components; empty when none were asked for.
    correlations : tuple of correlations.Correlation
        Correlations above 0.95: of parameters that photos share with each other and with the photo where it is largest,
        and the largest within photos.
    singles : tuple of SinglePhoto
        Photos that are strips of their own.
    photo_covariances : ndarray, shape (m, 6, 6)
        Covariances of all photos, strip by strip, as in ``results.Precision``.
    unit : float
        Standard deviation of unit weight behind the covariances: sigma0, or 1 with Baarda's test.
    """

    start: BlockStart
    block: BlockProblem
    screened: Screened
    groups: tuple[reliability.Group, ...]
    sigma0: reliability.Sigma0Test
    components: tuple[variance_components.Component, ...]
    parameters: tuple[self_calibration.Parameter, ...]
    correlations: tuple[Correlation, ...]
    singles: tuple[SinglePhoto, ...]
    photo_covariances: Floats
    unit: float


@dataclass(frozen=True, eq=False)
class Result:
    """What a run found, stage by stage; everything written and printed is rendered from it.

    Parameters
    ----------
    inputs, settings
        What was given and asked for.
    frames : tuple of GroundFrame
        Ground frames of the control lists.
    output : GroundFrame
        Ground frame of the result.
    refined : corrections.Refined
        Ideal image coordinates and the size of each correction.
    control_rows : ndarray of int, shape (c,)
        Row in ``points`` of every point of ``inputs.control``; -1 where it has no coordinates.
    control_differences : ndarray, shape (c, 3)
        Adjusted minus given in metres along east, north, up of the point's own ground frame; NaN where it is not
        given, does not count or has no result.
    precision : Precision or None
        How precise points and photos are; None when it was not computed.
    bundle : Bundle or None
        The bundle adjustment; ``strips`` then carry its orientations and points.
    findings : tuple of Finding
        What the data say against themselves.
    linked : tuple of LinkedStrip
        Strips of independent models; there are then no `strips`.
    """

    inputs: Inputs
    settings: Settings
    frames: tuple[GroundFrame, ...]
    output: GroundFrame
    interior: interior.InteriorOrientation | None
    refined: corrections.Refined
    strips: tuple[StripResult, ...]
    points: Adjusted
    control_rows: Numbers
    control_differences: Floats
    ties: Ties
    not_determined: dict[str, str]
    notes: tuple[Note, ...]
    precision: Precision | None = None
    bundle: Bundle | None = None
    findings: tuple[Finding, ...] = ()
    linked: tuple[LinkedStrip, ...] = ()

    @property
    def flights(self) -> tuple[StripResult | LinkedStrip, ...]:
        """The strips, of photos or of models: what they have in common has the same name."""
        return self.linked or self.strips

    @property
    def roles(self) -> tuple[str, ...]:
        """Role of each point of ``points``: new, control or check."""
        roles = [NEW] * len(self.points.number)
        for row, check in zip(self.control_rows, self.inputs.control.check, strict=True):
            if row >= 0:
                roles[row] = CHECK if check else CONTROL
        return tuple(roles)
