"""What comes out of a run: every stage of every strip, nothing thrown away."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from photostrip.geodesy.crs import GroundFrame
    from photostrip.geodesy.local_frame import IntermediateFrame
    from photostrip.notes import Finding, Note
    from photostrip.pipeline.covariance import CovarianceAdjustment
    from photostrip.pipeline.inputs import Inputs, Settings, Strip
    from photostrip.points import ControlPoints
    from photostrip.triangulation import (
        absolute,
        control_screening,
        exterior,
        formation,
        interior,
        polynomial,
        refinement,
        relative,
        screening,
        strip_screening,
    )

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]

NEW, CONTROL, CHECK = "new", "control", "check"


@dataclass(frozen=True, eq=False)
class StripResult:
    """Every stage of one strip, in order.

    Parameters
    ----------
    strip : Strip
        The strip.
    orientation : relative.Orientation
        Relative orientation of its pairs, after screening.
    rejections : tuple of screening.Rejection
        Points taken out of pairs.
    formed : formation.FormedStrip
        The formed strip.
    precision : tuple of float
        A-priori standard deviation of a point in plan and height from one model, metres.
    intermediate : IntermediateFrame
        Frame of the adjustment.
    control : ControlPoints
        Control that took part.
    control_rows : ndarray of int, shape (n,)
        Its rows in the strip's points.
    absolute : absolute.AbsoluteOrientation
        Similarity to the control.
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
    """

    points: Floats
    photos: tuple[Floats, ...]
    sigma: tuple[float, ...]
    basis: tuple[str, ...]


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
    interior : interior.InteriorOrientation or None
        Interior orientation of the photos.
    refined : refinement.Refined
        Ideal image coordinates and the size of each correction.
    strips : tuple of StripResult
        The strips.
    points : Adjusted
        All points.
    control_rows : ndarray of int, shape (c,)
        Row in ``points`` of every point of ``inputs.control``; -1 where it has no coordinates.
    control_differences : ndarray, shape (c, 3)
        Adjusted minus given in metres along east, north, up of the point's own ground frame; NaN where it is not
        given, does not count or has no result.
    ties : Ties
        Points common to strips.
    not_determined : dict of str to str
        Points without coordinates and why.
    notes : tuple of Note
        What the surveyor should know.
    precision : Precision or None
        How precise points and photos are; None when it was not computed.
    findings : tuple of Finding
        What the data say against themselves.
    """

    inputs: Inputs
    settings: Settings
    frames: tuple[GroundFrame, ...]
    output: GroundFrame
    interior: interior.InteriorOrientation | None
    refined: refinement.Refined
    strips: tuple[StripResult, ...]
    points: Adjusted
    control_rows: Numbers
    control_differences: Floats
    ties: Ties
    not_determined: dict[str, str]
    notes: tuple[Note, ...]
    precision: Precision | None = None
    findings: tuple[Finding, ...] = ()

    @property
    def roles(self) -> tuple[str, ...]:
        """Role of each point of ``points``: new, control or check."""
        roles = [NEW] * len(self.points.number)
        for row, check in zip(self.control_rows, self.inputs.control.check, strict=True):
            if row >= 0:
                roles[row] = CHECK if check else CONTROL
        return tuple(roles)
