"""What comes out of a run: every stage of every strip, nothing thrown away."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers, pieces
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geodesy.local_frame import IntermediateFrame
from photostrip.network import reliability
from photostrip.network.adjustment import Selection
from photostrip.network.problem import BundleProblem
from photostrip.network.reliability import Correlation
from photostrip.network.snooping import ScreenedBundle
from photostrip.notes import Finding, Note
from photostrip.pipeline.formed_models import LinkedModels
from photostrip.pipeline.formed_photos import FormedPhotos
from photostrip.pipeline.inputs import Inputs, ModelStrip, Settings, Strip
from photostrip.points import ControlPoints, PhotoPoints
from photostrip.rejection import Rejection
from photostrip.strip import absolute_orientation as absolute
from photostrip.strip import corrections
from photostrip.strip.control_screening import ScreenedControl
from photostrip.strip.fitted_strip import CheckErrors
from photostrip.strip.formed_strip import FormedStrip
from photostrip.strip.linked_models import FormedModels
from photostrip.strip.polynomial import Polynomial
from photostrip.strip.resection import Resection

if TYPE_CHECKING:
    from photostrip.strip.interior import InteriorOrientation

ROLES = NEW, CONTROL, CHECK = "new", "control", "check"


@dataclass(frozen=True, eq=False)
class PlacedModels:
    """Independent models of a strip in its intermediate frame."""

    # (f, 3): adjusted perspective centres in flight order, metres; NaN where none was measured
    centers: Floats
    rotations: Floats  # (k, 3, 3): rotation of each model, model to intermediate frame
    scales: Floats  # (k,): denominator of the scale of each model


@dataclass(frozen=True, eq=False)
class StripResult:
    """Every stage of one strip of photos or of independent models, in order."""

    stage: FormedPhotos | LinkedModels  # as it was formed; after a bundle with its points
    precision: absolute.PointPrecision  # a-priori standard deviations of a point from one model, metres
    intermediate: IntermediateFrame
    control: ControlPoints  # control that took part
    control_rows: Numbers  # (n,): its rows in the strip's points
    absolute: absolute.AbsoluteOrientation
    polynomial: Polynomial | None  # correction of the strip deformation; None of a similarity and after a bundle
    xyz: Floats  # (q, 3): adjusted points, intermediate frame, metres; points of ``formed.point``
    cartesian: Floats  # (q, 3): the same in the project's Cartesian frame
    rays: Numbers  # (q,): photos on which each point was measured and used
    depth: float  # mean distance of the points from the cameras along the viewing direction, metres; NaN if unknown
    notes: tuple[Note, ...]  # what this strip's numbers say beside themselves
    # control coordinates that were not used; ``control`` says so in its ``use``
    screened_control: ScreenedControl
    placed: Resection | PlacedModels  # photos oriented on the adjusted points, or models, intermediate frame
    rows: Numbers  # (m,): image points that took part in the resections, rows of the observations; of models none

    @property
    def wrong_control(self) -> tuple[Rejection, ...]:
        """Control coordinates that were rejected."""
        return self.screened_control.rejections

    @property
    def strip(self) -> Strip | ModelStrip:
        """What was flown: id and photos, and cameras or models."""
        return self.stage.strip

    @property
    def formed(self) -> FormedStrip | FormedModels:
        """The strip in the frame and scale of its first model."""
        return self.stage.formed

    @property
    def scale_number(self) -> float:
        """Denominator of the photo scale, or of the mean scale of the models."""
        if isinstance(self.placed, PlacedModels):
            return float(np.exp(np.log(self.placed.scales).mean()))
        return self.depth / (self.of_photos.strip.camera.principal_distance / 1000)

    @property
    def is_of_models(self) -> bool:
        return isinstance(self.stage, LinkedModels)

    @property
    def of_photos(self) -> FormedPhotos:
        """The stage of a strip of photos; to be asked of such a strip alone."""
        if isinstance(self.stage, LinkedModels):
            msg = "a strip of independent models"
            raise TypeError(msg)
        return self.stage

    @property
    def of_models(self) -> LinkedModels:
        """The stage of a strip of independent models; to be asked of such a strip alone."""
        if isinstance(self.stage, LinkedModels):
            return self.stage
        msg = "a strip of photos"
        raise TypeError(msg)

    @property
    def resection(self) -> Resection:
        """Photos oriented on the adjusted points; to be asked of a strip of photos alone."""
        if isinstance(self.placed, Resection):
            return self.placed
        msg = "a strip of independent models"
        raise TypeError(msg)

    @property
    def models(self) -> PlacedModels:
        """Models on the ground; to be asked of a strip of independent models alone."""
        if isinstance(self.placed, PlacedModels):
            return self.placed
        msg = "a strip of photos"
        raise TypeError(msg)


@dataclass(frozen=True, eq=False)
class Adjusted:
    """Points of all strips together."""

    number: Numbers  # (n,): points, as numbered in the observations, ascending
    cartesian: Floats  # (n, 3): coordinates in the project's Cartesian frame, metres; mean over the strips
    ground: Floats  # (n, 3): coordinates in the output frame, internal order east, north, up
    rays: Numbers  # (n,): photos on which the point was measured and used


@dataclass(frozen=True, eq=False)
class Ties:
    """Points common to two strips."""

    number: Numbers  # (t,): points, as numbered in the observations
    strips: Numbers  # (t, 2): the two strips
    difference: Floats  # (t, 3): second minus first strip along east, north and up of the output frame, metres

    @classmethod
    def none(cls) -> Ties:
        """Return the ties of an adjustment in which a point has one position."""
        return cls(np.zeros(0, np.intp), np.zeros((0, 2), np.intp), np.zeros((0, 3)))


@dataclass(frozen=True, eq=False)
class Precision:
    """How precise points and photos are: covariances carried from the image coordinates and the control.

    Every way of adjusting fills the same columns. All covariances refer to the axes of the project's Cartesian frame,
    as ``Adjusted.cartesian`` does; they are turned into the axes of the output where they are written.
    """

    points: Floats  # (n, 3, 3): covariances of the points of ``Adjusted.number``, metres^2; NaN where one is not known
    # (m, 6, 6): one array for each strip, photos in flight order: perspective centre in metres, then the small rotation
    # in radians that turns the photo about the axes of the frame, ``R_true = exp([theta]) R``; NaN where not known
    photos: tuple[Floats, ...]
    # standard deviation of an image coordinate of weight one behind the covariances, mm, for each strip
    sigma: tuple[float, ...]
    # for each strip: ``"a-priori"`` when that is the stated one, ``"a-posteriori"`` when it was found by the adjustment
    basis: tuple[str, ...]
    # for each strip the errors at its check points, of a bundle those of all strips together; None without any
    checks: tuple[CheckErrors | None, ...] = ()


@dataclass(frozen=True, eq=False)
class BlockStart:
    """Start values of the bundle adjustment."""

    strips: tuple[StripResult, ...]  # strips of two photos or more, every stage of the strip method
    photos: tuple[str, ...]  # all photos, or all independent models, strip by strip
    # centers, rotations: (m, 3), (m, 3, 3): their orientations, Cartesian frame
    centers: Floats
    rotations: Floats
    points: Floats  # (q, 3): all points of the observations; NaN where one has no coordinates
    strangers: Mapping[str, AbstractSet[int]]  # points by strip whose ids stand for other points in a strip before
    rough: Flags  # (m,): photos that stand as they were given, with too few known points to orient them
    scales: Floats | None  # (m,): of models: metres per millimetre; None: photos
    free: bool  # whether nothing ties the block to the ground: its frame and scale are those of the first strip

    def rows_of(self, photos: Sequence[str]) -> Numbers:
        row = {photo: number for number, photo in enumerate(self.photos)}
        return np.array([row[photo] for photo in photos], np.intp)


@dataclass(frozen=True, eq=False)
class BlockProblem:
    """A bundle adjustment with what its rows stand for."""

    problem: BundleProblem  # the arrays; points as numbered in the observations, photos strip by strip
    origin: Floats  # (3,): origin of its frame in the project's Cartesian frame, metres
    begin: Selection
    kept: Flags  # (n,): rays that the user keeps
    rows: Numbers  # (n,): row in the observations, or in the model coordinates, of each ray
    control: Numbers  # (c,): row in the measured control of each row of ``problem.control``
    # for ``control`` and ``position``: whether the axes of each row are plan and height
    level: dict[str, tuple[bool, ...]]


@dataclass(frozen=True, eq=False)
class SinglePhoto:
    """A photo that is a strip of its own."""

    strip: Strip
    # center, rotation: (3,), (3, 3): its orientation in the project's Cartesian frame
    center: Floats
    rotation: Floats
    depth: float  # mean distance of its points along the viewing direction, metres

    @property
    def scale_number(self) -> float:
        return self.depth / (self.strip.camera.principal_distance / 1000)


@dataclass(frozen=True, eq=False)
class Bundle:
    """What the bundle adjustment found beside points and orientations."""

    start: BlockStart  # where it started: the strips as the strip method leaves them
    block: BlockProblem  # all observations, with the standard deviations of the last adjustment
    screened: ScreenedBundle  # the solution and how it was cleaned
    groups: tuple[reliability.Group, ...]  # observations that took part with their redundancy numbers
    sigma0: reliability.Sigma0Test  # test of sigma0, with the stated standard deviations
    components: tuple[reliability.Component, ...]  # variance components; empty when none were asked for
    parameters: tuple[reliability.Parameter, ...]
    # correlations above 0.95: of parameters that photos share with each other and with the photo where it is largest,
    # and the largest within photos
    correlations: tuple[Correlation, ...]
    singles: tuple[SinglePhoto, ...]  # photos that are strips of their own
    photo_covariances: Floats  # (m, 6, 6): covariances of all photos, strip by strip, as in ``results.Precision``
    unit: float  # standard deviation of unit weight behind the covariances: sigma0, or 1 with Baarda's test


@dataclass(frozen=True, eq=False)
class AdjustedStrips:
    """All strips adjusted, each by itself or in one bundle adjustment."""

    strips: tuple[StripResult, ...]
    points: Adjusted
    ties: Ties
    observations: PhotoPoints  # ideal image coordinates, a calibration found by a bundle taken into account
    precision: Precision | None  # None when it was not computed
    notes: tuple[Note, ...]
    bundle: Bundle | None = None


@dataclass(frozen=True, eq=False)
class Result:
    """What a run found, stage by stage; everything written and printed is rendered from it."""

    # inputs, settings: what was given and asked for
    inputs: Inputs
    settings: Settings
    frames: tuple[GroundFrame, ...]  # ground frames of the control lists
    output: GroundFrame  # ground frame of the result
    measured: PhotoPoints  # image points in the system of the photo, before any correction
    interior: InteriorOrientation | None
    refined: corrections.Refined  # ideal image coordinates and the size of each correction
    strips: tuple[StripResult, ...]  # of photos or of independent models, never both
    points: Adjusted
    # (c,): row in ``points`` of every point of ``inputs.control``; -1 where it has no coordinates
    control_rows: Numbers
    # (c, 3): adjusted minus given in metres along east, north, up of the point's own ground frame; NaN where it is not
    # given, does not count or has no result
    control_differences: Floats
    ties: Ties
    not_determined: dict[str, str]
    notes: tuple[Note, ...]
    precision: Precision | None = None  # how precise points and photos are; None when it was not computed
    bundle: Bundle | None = None  # the bundle adjustment; ``strips`` then carry its orientations and points
    findings: tuple[Finding, ...] = ()  # what the data say against themselves
    folds: tuple[Fold, ...] = ()  # the cross-validation, when it was asked for

    @property
    def photo_strips(self) -> tuple[StripResult, ...]:
        """The strips where they are of photos, otherwise none."""
        return self.strips if self.inputs.models is None else ()

    @property
    def model_strips(self) -> tuple[StripResult, ...]:
        """The strips where they are of independent models, otherwise none."""
        return () if self.inputs.models is None else self.strips

    @cached_property
    def level_covariances(self) -> Floats | None:
        """Covariances (n, 3, 3) of the points along east, north and up, metres^2; None when they are not known."""
        if self.precision is None:
            return None
        points, given = self.points, self.precision.points
        found = np.empty(given.shape)
        for some in pieces(len(found)):  # axes and products of all at once take twice as much again
            level = self.output.level_axes_at(points.cartesian[some], points.ground[some])
            found[some] = level @ given[some] @ level.transpose(0, 2, 1)
        return found

    @property
    def roles(self) -> Numbers:
        """Role of each point of ``points``, a place in ``ROLES``."""
        roles, known = np.zeros(len(self.points.number), np.intp), self.control_rows >= 0
        of_given = np.where(self.inputs.control.check, ROLES.index(CHECK), ROLES.index(CONTROL))
        roles[self.control_rows[known]] = of_given[known]
        return roles


@dataclass(frozen=True, eq=False)
class Fold:
    """One adjustment of a cross-validation."""

    left_out: tuple[str, ...]  # control points that were check points in it; no others were
    result: Result | None  # None where it could not be made
    reason: str = ""  # why not
