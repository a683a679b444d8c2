"""What goes into a run: everything a project file and its tables say, without how they say it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from photostrip.triangulation import absolute, formation, interior, polynomial, refinement, relative

if TYPE_CHECKING:
    from photostrip.camera import Camera
    from photostrip.geodesy.frame_spec import FrameSpec
    from photostrip.points import ControlPoints, PhotoPoints

ADJUSTMENTS = ("similarity", "polynomial")


@dataclass(frozen=True)
class Strip:
    """Photos of one flight line.

    Parameters
    ----------
    id : str
        Id of the strip.
    camera : Camera
        The camera of all its photos.
    photos : tuple of str
        Photos in flight order.
    """

    id: str
    camera: Camera
    photos: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Inputs:
    """Everything that is given: what a project file and its tables say, without how they say it.

    Parameters
    ----------
    name : str
        Name of the project.
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
    """

    name: str
    strips: tuple[Strip, ...]
    observations: PhotoPoints
    control: ControlPoints
    frames: tuple[FrameSpec, ...]
    output: FrameSpec | None = None
    fiducials: PhotoPoints | None = None


@dataclass(frozen=True)
class Settings:
    """What is to be done; every part stands beside the operation it steers.

    Parameters
    ----------
    adjustment : str
        ``"similarity"`` or ``"polynomial"``.
    relative, formation, absolute, polynomial, interior, refinement
        Settings of the operations.
    angle_system, angle_unit : str
        System (``geometry.rotation.SYSTEMS``) and unit (``"deg"``, ``"gon"``, ``"rad"``) of exported angles.
    tolerances : dict of str to float
        Largest allowed values of the summary, metres, by name (``check_rms_xy``, ``check_rms_z``, ...).
    """

    adjustment: str = "polynomial"
    relative: relative.Settings = field(default_factory=relative.Settings)
    formation: formation.Settings = field(default_factory=formation.Settings)
    absolute: absolute.Settings = field(default_factory=absolute.Settings)
    polynomial: polynomial.Settings = field(default_factory=polynomial.Settings)
    interior: interior.Settings = field(default_factory=interior.Settings)
    refinement: refinement.Settings = field(default_factory=refinement.Settings)
    angle_system: str = "alpha-omega-kappa"
    angle_unit: str = "deg"
    tolerances: dict[str, float] = field(default_factory=dict)
