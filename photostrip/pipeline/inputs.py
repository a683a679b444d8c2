"""What goes into a run: everything a project file and its tables say, without how they say it.

What a run refuses before anything is computed: settings and inputs that contradict each other.

What the user knows better: measurements that are kept or dropped whatever the tests say.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.camera import Camera
from photostrip.errors import Fault, InputError
from photostrip.geodesy.frame_spec import FrameSpec
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.network.problem import BundleSettings
from photostrip.notes import Note
from photostrip.points import ControlPoints, ModelPoints, PhotoPoints
from photostrip.strip.absolute_orientation import AbsoluteSettings
from photostrip.strip.corrections import ImageCorrectionSettings, InteriorSettings
from photostrip.strip.formed_strip import NOTHING_GIVEN, FirstPhoto, StripFormationSettings
from photostrip.strip.linked_models import LinkSettings
from photostrip.strip.polynomial import PolynomialSettings
from photostrip.strip.relative_orientation import RelativeSettings
from photostrip.strip.resection import KnownPhotos

METHODS = SIMILARITY, POLYNOMIAL, BUNDLE = "similarity", "polynomial", "bundle"
AUTO = "auto"  # bundle where it is determined, otherwise polynomial
ADJUSTMENTS = (AUTO, *METHODS)


@dataclass(frozen=True)
class Strip:
    """Photos of one flight line."""

    id: str
    camera: Camera  # the camera of all its photos
    photos: tuple[str, ...]  # photos in flight order; a single one only in a bundle adjustment
    first: FirstPhoto = NOTHING_GIVEN  # frame and scale of the strip as long as it has no control
    # parameters of its camera that a bundle adjustment estimates, of ``bundle.settings.ASKED``
    calibrate: tuple[str, ...] = ()
    listed: bool = True  # as one strip in the project; otherwise found among photos in no given order, or one of them

    def positions(self, observations: PhotoPoints) -> Numbers:
        """Place in the strip of the photo of every image point; -1 for photos of other strips."""
        return observations.places(self.photos)

    def oriented(self, centers: Floats, rotations: Floats) -> KnownPhotos:
        return KnownPhotos(centers, rotations, np.full(len(centers), self.camera.principal_distance))

    def median_sigma(self, observations: PhotoPoints) -> float:
        """Median standard deviation of the image coordinates of its photos, mm."""
        return np.median(observations.sigma[self.positions(observations) >= 0])


@dataclass(frozen=True)
class ModelStrip:
    """Independent models of one flight line."""

    id: str
    photos: tuple[str, ...]  # photos in flight order
    models: tuple[str, ...]  # models in flight order; model i shows photos i and i + 1
    listed = True  # as a strip in the project


@dataclass(frozen=True, eq=False)
class MeasuredModels:
    """Model coordinates in place of image coordinates."""

    strips: tuple[ModelStrip, ...]  # strips in the project's order
    points: ModelPoints  # points and perspective centres as measured, in mm, right-handed


@dataclass(frozen=True, eq=False)
class CameraPositions:
    """Measured positions of cameras (GNSS)."""

    photos: tuple[str, ...]  # photos, unique
    frame: FrameSpec  # ground frame of the positions
    enu: Floats  # (n, 3): coordinates in the units of the frame, internal order; NaN where one is not given
    use: Flags  # (n, 3): which coordinates count
    sigma: Floats  # (n, 3): standard deviations in metres
    time: Floats  # (n,): time of exposure; NaN without one
    # antenna from the perspective centre along the image axes (x right, y up, z towards the viewer), metres
    lever_arm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    # what the positions of one group share beside the truth: ``"none"``, ``"offset"`` or ``"drift"``
    correction: str = "none"
    group: str = "strip"  # or ``"block"``


@dataclass(frozen=True, eq=False)
class GivenOrientations:
    photos: tuple[str, ...]  # photos, unique
    frame: FrameSpec  # ground frame of the centres; the rotations refer to its axes at each centre
    enu: Floats  # (n, 3): perspective centres in the units of the frame, internal order
    angles: Floats  # (n, 3): angles of ``system``, radians
    system: str  # one of ``geometry.rotation.SYSTEMS``
    sigma: Floats  # (n, 3): standard deviations of the centres, metres
    sigma_turns: Floats  # (n, 3): standard deviations of small turns about the axes of the photo, radians
    # whether they are observations; otherwise a start without influence, and the standard deviations are NaN
    observed: bool
    # whether angles and system are those that the user has; otherwise they were made of matrices, say
    stated: bool = True

    @property
    def has_own_frame(self) -> bool:
        """Whether place, direction and scale of their frame may be any: they are laid on what is known."""
        return not self.observed and self.frame.crs == "local"


@dataclass(frozen=True, eq=False)
class Inputs:
    """Everything that is given: what a project file and its tables say, without how they say it."""

    name: str
    strips: tuple[Strip, ...]  # strips in the project's order
    # image points as measured, in mm, x to the right, y up; in the system of the fiducial measurements when there are
    # any, otherwise in that of the photo
    observations: PhotoPoints
    control: ControlPoints  # control and check points; ``frame`` counts in ``frames``
    frames: tuple[FrameSpec, ...]  # ground frame of each control list
    output: FrameSpec | None = None  # ground frame of the result; None: that of the first control list
    fiducials: PhotoPoints | None = None  # measured fiducial marks (``point_ids`` are the marks), in mm, y up
    positions: CameraPositions | None = None
    orientations: GivenOrientations | None = None
    # measured model coordinates; there are then no `strips` of photos, and `observations` only name the points
    models: MeasuredModels | None = None
    # what a project file says where image or model coordinates are of the other hand than they are read; empty for
    # pixels counted from a corner, which lie on one side of it
    other_hand: str = "`observations.y_axis: down`"

    @cached_property
    def cameras(self) -> dict[str, Camera]:
        """Camera of every photo."""
        return {photo: strip.camera for strip in self.strips for photo in strip.photos}

    @cached_property
    def camera_named(self) -> dict[str, Camera]:
        """Cameras by their names, in the order of the strips."""
        return {strip.camera.name: strip.camera for strip in self.strips}

    @property
    def flights(self) -> tuple[Strip | ModelStrip, ...]:
        return self.strips if self.models is None else self.models.strips

    @property
    def lines(self) -> tuple[Strip | ModelStrip, ...]:
        """The flights without single photos that are listed in no order."""
        return tuple(flight for flight in self.flights if flight.listed or len(flight.photos) > 1)


@dataclass(frozen=True)
class Settings:
    """What is to be done; every part stands beside the operation it steers."""

    adjustment: str = "auto"  # one of ``ADJUSTMENTS``
    relative: RelativeSettings = field(default_factory=RelativeSettings)
    formation: StripFormationSettings = field(default_factory=StripFormationSettings)
    links: LinkSettings = field(default_factory=LinkSettings)
    absolute: AbsoluteSettings = field(default_factory=AbsoluteSettings)
    polynomial: PolynomialSettings = field(default_factory=PolynomialSettings)
    bundle: BundleSettings = field(default_factory=BundleSettings)
    interior: InteriorSettings = field(default_factory=InteriorSettings)
    refinement: ImageCorrectionSettings = field(default_factory=ImageCorrectionSettings)
    precision: bool = True  # whether standard deviations and covariances of points and photos are computed
    cross_validation: bool = False  # whether control is left out in turn
    # angle_system, angle_unit: system (``geometry.rotation.SYSTEMS``) and unit (``"deg"``, ``"gon"``, ``"rad"``) of
    # exported angles
    angle_system: str = "alpha-omega-kappa"
    angle_unit: str = "deg"
    # largest allowed values of the summary, metres, by name (``check_rms_xy``, ``check_rms_z``, ...)
    tolerances: dict[str, float] = field(default_factory=dict)
    # findings that the user has looked at and accepted: codes, or ``code/id`` for one photo, point or strip
    accept: tuple[str, ...] = ()

    @property
    def together(self) -> bool:
        """Whether photos are adjusted in one bundle."""
        return self.adjustment in {AUTO, BUNDLE}


def require_runnable(inputs: Inputs, settings: Settings) -> None:
    """Refuse an adjustment that does not exist, and photos in tables that no strip has."""
    if settings.adjustment not in ADJUSTMENTS:
        message = f"adjustment {settings.adjustment!r} is not available"
        known = " or ".join(ADJUSTMENTS)
        raise InputError(Fault(message, "not-available", key="processing.adjustment", expected=known))
    positions, orientations = inputs.positions, inputs.orientations
    tables = {
        "is measured": inputs.observations.photo_ids,
        "has a given position": () if positions is None else positions.photos,
        "has a given orientation": () if orientations is None else orientations.photos,
    }
    flown = {photo for flight in inputs.flights for photo in flight.photos}
    for what, photos in tables.items():
        if stray := [photo for photo in photos if photo not in flown]:
            message = f"photo {stray[0]} {what} but belongs to no strip ({len(stray)} such photos)"
            raise InputError(Fault(message, code="photo-without-strip", key="strips"))


def require_whole(inputs: Inputs, frames: Sequence[GroundFrame]) -> None:
    """Refuse points of which half a plan position counts, or some of X, Y and Z, which are neither plan nor height."""
    control = inputs.control
    if not frames:
        return
    geocentric = np.array([frame.kind == "geocentric" for frame in frames])[control.frame]
    part = control.use.any(axis=1) & ~control.use.all(axis=1)
    half = control.use[:, 0] != control.use[:, 1]
    faults = [
        Fault(
            f"point {control.ids[row]} is geocentric, and only some of its coordinates count",
            code="geocentric-use",
            key=f"control[{control.frame[row]}]",
            expected="`use: xyz` or `off`: X, Y and Z are neither plan nor height",
        )
        for row in np.flatnonzero(part & geocentric).tolist()
    ]
    faults += [
        Fault(
            f"of point {control.ids[row]} one plan coordinate counts without the other",
            code="half-plan-use",
            key=f"control[{control.frame[row]}]",
            expected="both, `use: xyz` or `xy`, or neither, `z` or `off`",
        )
        for row in np.flatnonzero(half & ~geocentric).tolist()
    ]
    if faults:
        raise InputError(faults)


def refuse_curvature_twice(inputs: Inputs, settings: Settings) -> None:
    """Refuse curvature in image space where the ground frames carry it."""
    curved = [spec.name for spec in (*inputs.frames, *filter(None, [inputs.output])) if spec.crs != "local"]
    if settings.refinement.earth_radius is not None and curved:
        fault = Fault(
            f"Earth curvature would be counted twice: in the images and in {curved[0]}, which carries it",
            code="curvature-twice",
            key="processing.earth_curvature",
            expected="auto",
            fix="drop `earth_curvature: image`, or give plane coordinates of an unknown projection as `crs: local`",
        )
        raise InputError(fault)


CENTER = "center of photo "  # before the name of a perspective centre in model coordinates


def require_measured(settings: RelativeSettings, observations: PhotoPoints) -> None:
    """Refuse entries of `keep` and `drop` that name no measurement, and those in both, with a fault for each."""
    found = rows_of((*settings.keep, *settings.drop), observations)
    known = {entry for entry, row in found.items() if row >= 0}
    _require_known(settings, known, "relative", "photo/point, as in the table of observations")


def require_named(settings: LinkSettings, measured: ModelPoints) -> None:
    """Refuse the same in lists of model coordinates."""
    if not (settings.keep or settings.drop):
        return
    nodes = [measured.name(node).removeprefix(CENTER) for node in measured.node.tolist()]
    known = {f"{measured.model_ids[k]}/{name}" for k, name in zip(measured.model.tolist(), nodes, strict=True)}
    _require_known(settings, known, "links", "model/point or model/photo, as in the table of models")


def rows_of_models(entries: Sequence[str], measured: ModelPoints) -> Flags:
    """Mark the model coordinates that a list of the user names, ``model/point`` or ``model/photo``."""
    if not entries:
        return np.zeros(len(measured), bool)
    wanted, names = set(entries), [measured.name(node).removeprefix(CENTER) for node in measured.node.tolist()]
    models = [measured.model_ids[number] for number in measured.model.tolist()]
    return np.array([f"{model}/{name}" in wanted for model, name in zip(models, names, strict=True)], bool)


def _require_known(settings: RelativeSettings | LinkSettings, known: set[str], block: str, expected: str) -> None:
    faults = [
        Fault(
            f"`{entry}` names no measurement",
            code="no-such-measurement",
            key=f"processing.{block}.{key}",
            expected=expected,
        )
        for key, entries in (("keep", settings.keep), ("drop", settings.drop))
        for entry in dict.fromkeys(entries)
        if entry not in known
    ]
    faults += [
        Fault(f"`{entry}` is both kept and dropped", code="kept-and-dropped", key=f"processing.{block}.drop")
        for entry in settings.drop
        if entry in settings.keep
    ]
    if faults:
        raise InputError(faults)


def rows_of(entries: Sequence[str], observations: PhotoPoints) -> dict[str, int]:
    """Row of each measurement of a list, photo/point; -1 for none."""
    if not entries:
        return {}
    wanted = dict.fromkeys(entries, -1)
    photos, points = observations.photo_ids, observations.point_ids
    for row, (photo, point) in enumerate(zip(observations.photo, observations.point, strict=True)):
        name = f"{photos[photo]}/{points[point]}"
        if name in wanted:
            wanted[name] = row
    return wanted


def kept_rows(entries: Sequence[str], observations: PhotoPoints) -> Numbers:
    """Rows of the measurements of a list, ascending."""
    return np.array(sorted(rows_of(entries, observations).values()), np.intp)


def overruling_notes(settings: RelativeSettings, strip: str, photos: Sequence[str]) -> Iterator[Note]:
    """Say what the user has decided, one note for each list that touches the strip."""
    kept, dropped = (
        ", ".join(entry for entry in entries if any(entry.startswith(f"{photo}/") for photo in photos))
        for entries in (settings.keep, settings.drop)
    )
    if kept:
        text = f"strip {strip}: kept at the user's request, whatever the tests say: {kept}"
        yield Note("user-keep", text, severity="note", strip=strip)
    if dropped:
        text = f"strip {strip}: left out at the user's request: {dropped}"
        yield Note("user-drop", text, severity="note", strip=strip)
