"""What goes into a run: everything a project file and its tables say, without how they say it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from photostrip.triangulation import absolute_orientation as absolute
from photostrip.triangulation.bundle import settings as bundle
from photostrip.triangulation.covariance_adjustment import conditions
from photostrip.triangulation.image_coordinates import corrections as refinement
from photostrip.triangulation.image_coordinates import interior
from photostrip.triangulation.independent_models import link_screening
from photostrip.triangulation.polynomial import correction as polynomial
from photostrip.triangulation.relative_orientation import relative
from photostrip.triangulation.strip_formation import formation

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from photostrip.camera import Camera
    from photostrip.geodesy.frame_spec import FrameSpec
    from photostrip.points import ControlPoints, ModelPoints, PhotoPoints

    Floats = NDArray[np.float64]
    Flags = NDArray[np.bool_]

ADJUSTMENTS = ("similarity", "polynomial", "covariance", "bundle")


@dataclass(frozen=True)
class Strip:
    """Photos of one flight line.

    Parameters
    ----------
    camera : Camera
        The camera of all its photos.
    photos : tuple of str
        Photos in flight order; a single one only in a bundle adjustment.
    calibrate : tuple of str
        Parameters of its camera that a bundle adjustment estimates, of ``bundle.settings.CALIBRATION``.
    """

    id: str
    camera: Camera
    photos: tuple[str, ...]
    calibrate: tuple[str, ...] = ()


@dataclass(frozen=True)
class ModelStrip:
    """Independent models of one flight line.

    Parameters
    ----------
    photos : tuple of str
        Photos in flight order.
    models : tuple of str
        Models in flight order; model i shows photos i and i + 1.
    """

    id: str
    photos: tuple[str, ...]
    models: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class MeasuredModels:
    """Model coordinates in place of image coordinates.

    Parameters
    ----------
    strips : tuple of ModelStrip
        Strips in the project's order.
    points : ModelPoints
        Points and perspective centres as measured, in mm, right-handed.
    """

    strips: tuple[ModelStrip, ...]
    points: ModelPoints


@dataclass(frozen=True, eq=False)
class CameraPositions:
    """Measured positions of cameras (GNSS).

    Parameters
    ----------
    photos : tuple of str
        Photos, unique.
    frame : FrameSpec
        Ground frame of the positions.
    enu : ndarray, shape (n, 3)
        Coordinates in the units of the frame, internal order; NaN where one is not given.
    use : ndarray of bool, shape (n, 3)
        Which coordinates count.
    sigma : ndarray, shape (n, 3)
        Standard deviations in metres.
    time : ndarray, shape (n,)
        Time of exposure; NaN without one.
    lever_arm : tuple of float
        Antenna from the perspective centre along the image axes (x right, y up, z towards the viewer), metres.
    correction : str
        What the positions of one strip share beside the truth: ``"none"``, ``"offset"`` or ``"drift"``.
    """

    photos: tuple[str, ...]
    frame: FrameSpec
    enu: Floats
    use: Flags
    sigma: Floats
    time: Floats
    lever_arm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    correction: str = "none"


@dataclass(frozen=True, eq=False)
class GivenOrientations:
    """Given exterior orientations.

    Parameters
    ----------
    photos : tuple of str
        Photos, unique.
    frame : FrameSpec
        Ground frame of the centres; the rotations refer to its axes at each centre.
    enu : ndarray, shape (n, 3)
        Perspective centres in the units of the frame, internal order.
    angles : ndarray, shape (n, 3)
        Angles of ``system``, radians.
    system : str
        One of ``geometry.rotation.SYSTEMS``.
    sigma : ndarray, shape (n, 3)
        Standard deviations of the centres, metres.
    sigma_angles : ndarray, shape (n, 3)
        Standard deviations of the angles, radians.
    observed : bool
        Whether they are observations; otherwise a start without influence, and the standard deviations are NaN.
    """

    photos: tuple[str, ...]
    frame: FrameSpec
    enu: Floats
    angles: Floats
    system: str
    sigma: Floats
    sigma_angles: Floats
    observed: bool


@dataclass(frozen=True, eq=False)
class Inputs:
    """Everything that is given: what a project file and its tables say, without how they say it.

    Parameters
    ----------
    strips : tuple of Strip
        Strips in the project's order.
    observations : PhotoPoints
        Image points as measured, in mm, x to the right, y up; in the system of the fiducial
        measurements when there are any, otherwise in that of the photo.
    control : ControlPoints
        Control and check points; ``frame`` counts in ``frames``.
    frames : tuple of FrameSpec
        Ground frame of each control list.
    output : FrameSpec or None
        Ground frame of the result; None: that of the first control list.
    fiducials : PhotoPoints or None
        Measured fiducial marks (``point_ids`` are the marks), in mm, y up.
    models : MeasuredModels or None
        Measured model coordinates; there are then no `strips` of photos, and `observations` only name the points.
    """

    name: str
    strips: tuple[Strip, ...]
    observations: PhotoPoints
    control: ControlPoints
    frames: tuple[FrameSpec, ...]
    output: FrameSpec | None = None
    fiducials: PhotoPoints | None = None
    positions: CameraPositions | None = None
    orientations: GivenOrientations | None = None
    models: MeasuredModels | None = None

    @property
    def flights(self) -> tuple[Strip | ModelStrip, ...]:
        """The strips, of photos or of models."""
        return self.strips if self.models is None else self.models.strips


@dataclass(frozen=True)
class Settings:
    """What is to be done; every part stands beside the operation it steers.

    Parameters
    ----------
    adjustment : str
        One of ``ADJUSTMENTS``.
    precision : bool
        Whether standard deviations and covariances of points and photos are computed.
    angle_system, angle_unit : str
        System (``geometry.rotation.SYSTEMS``) and unit (``"deg"``, ``"gon"``, ``"rad"``) of exported angles.
    tolerances : dict of str to float
        Largest allowed values of the summary, metres, by name (``check_rms_xy``, ``check_rms_z``, ...).
    accept : tuple of str
        Findings that the user has looked at and accepted: codes, or ``code/id`` for one photo, point or strip.
    """

    adjustment: str = "polynomial"
    relative: relative.Settings = field(default_factory=relative.Settings)
    formation: formation.Settings = field(default_factory=formation.Settings)
    links: link_screening.Settings = field(default_factory=link_screening.Settings)
    absolute: absolute.Settings = field(default_factory=absolute.Settings)
    polynomial: polynomial.Settings = field(default_factory=polynomial.Settings)
    covariance: conditions.Settings = field(default_factory=conditions.Settings)
    bundle: bundle.Settings = field(default_factory=bundle.Settings)
    interior: interior.Settings = field(default_factory=interior.Settings)
    refinement: refinement.Settings = field(default_factory=refinement.Settings)
    precision: bool = True
    angle_system: str = "alpha-omega-kappa"
    angle_unit: str = "deg"
    tolerances: dict[str, float] = field(default_factory=dict)
    accept: tuple[str, ...] = ()
