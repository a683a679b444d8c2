"""A formed strip on its control: intermediate frame, absolute orientation, wrong control taken out.

Source: [001] eq. 142-149.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.errors import GeometryError, InputError
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geodesy.local_frame import IntermediateFrame, mean_position, strip_azimuth
from photostrip.geometry.similarity import Similarity, similarity_derivatives
from photostrip.pipeline.given_points import rows_of_given
from photostrip.pipeline.inputs import ModelStrip, Settings, Strip
from photostrip.pipeline.results import StripResult
from photostrip.plausibility.control.shared_by_control import ShiftedList, StretchedHeights, find_shared
from photostrip.points import ControlPoints
from photostrip.rejection import Rejection
from photostrip.strip import absolute_orientation
from photostrip.strip.error_propagation import control_errors
from photostrip.strip.error_propagation.control_errors import FitOperator, Misclosures
from photostrip.strip.error_propagation.strip_at_control import ControlRay, StripAtControl
from photostrip.strip.gross_errors.control import control_screening
from photostrip.strip.gross_errors.control.control_rejections import EITHER, WRONG_IMAGE
from photostrip.strip.gross_errors.control.control_screening import ScreenedControl
from photostrip.strip.polynomial.correction import Polynomial
from photostrip.strip.strip_formation.strip import FormedStrip

if TYPE_CHECKING:
    from photostrip.strip.independent_models.formation import FormedModels


class OfStrip(Protocol):
    """Derivatives of a strip on the ground by what was measured."""

    @property
    def origin(self) -> Floats:
        """Origin (3,) of its similarities, in the intermediate frame."""


Errors = TypeVar("Errors", bound=OfStrip)


class StripStage(Protocol[Errors]):
    """A strip before it meets its control, of photos or of independent models."""

    @property
    def strip(self) -> Strip | ModelStrip:
        """What was flown."""

    @property
    def formed(self) -> FormedStrip | FormedModels:
        """Points and perspective centres, in the scale of the first model."""

    @property
    def point_ids(self) -> tuple[str, ...]:
        """Ids of the points as they are numbered."""

    def point_precision(self, scale: float) -> tuple[float, float]:
        """A-priori standard deviation of a point of one model in plan and height, metres, at a scale of the strip."""

    def extent(self, similarity: Similarity) -> tuple[float, float]:
        """Mean base and half width of the strip on the ground, metres."""

    def differentiate(self, similarity: Similarity) -> Errors:
        """Differentiate the strip on the ground by what was measured."""

    def misclosure_covariance(self, oriented: OrientedStrip[Errors]) -> Callable[[Numbers], Floats]:
        """Covariance of any misclosures at the control, strip and control together, metres^2."""

    def control_rays(self, oriented: OrientedStrip[Errors]) -> Sequence[ControlRay]:
        """Rays of the control points that stand on two photos."""

    def without_images(self, wrong: Mapping[str, Rejection]) -> StripStage[Errors]:
        """Leave out control points, by id, one of whose two images is wrong."""

    def screens_control(self, settings: Settings) -> bool:
        """Whether wrong control is looked for."""

    def turned_over(self, refusal: InputError) -> StripStage[Errors]:
        """Return the strip upside down where nothing has told which way is up; else raise the refusal."""

    def refuse_other_hand(self, oriented: OrientedStrip[Errors]) -> None:
        """Refuse a strip that its control fits only as a mirror image."""

    def adjusted(
        self, screened: ScreenedStrip[Errors], correction: Polynomial | None, settings: Settings
    ) -> StripResult:
        """Adjust the points and photos by a polynomial, or leave them as the similarity has them."""


@dataclass(frozen=True, eq=False)
class OrientedStrip(Generic[Errors]):
    """A strip with the similarity that lays it on its control."""

    stage: StripStage[Errors]
    frames: Sequence[GroundFrame]  # ground frames of the control lists
    control: ControlPoints  # control that the strip holds
    control_rows: Numbers  # (n,): its rows in the strip's points
    intermediate: IntermediateFrame
    absolute: absolute_orientation.AbsoluteOrientation
    precision: tuple[float, float]  # a-priori standard deviations in plan and height that gave the weights, metres
    settings: absolute_orientation.AbsoluteSettings

    @cached_property
    def targets(self) -> absolute_orientation.Targets:
        """The control in the intermediate frame."""
        return absolute_orientation.Targets(self.control, self.frames, self.intermediate)

    @property
    def xyz(self) -> Floats:
        """Points of the strip after the similarity, intermediate frame, metres, shape (q, 3); worked out anew."""
        return self.absolute.similarity(self.stage.formed.xyz)

    @cached_property
    def at_control(self) -> Floats:
        """Those that are control, shape (n, 3)."""
        xyz: Floats = self.xyz[self.control_rows]
        return xyz

    @cached_property
    def weights(self) -> Floats:
        """Weights of the control coordinates, shape (n, 3)."""
        turned = self.targets.turned(self.at_control)
        return absolute_orientation.weights(turned, self.precision, self.settings.control_weights)

    @cached_property
    def extent(self) -> tuple[float, float]:
        """Mean base and half width of the strip, metres."""
        return self.stage.extent(self.absolute.similarity)

    @cached_property
    def errors(self) -> Errors:
        """Derivatives of the strip by what was measured."""
        return self.stage.differentiate(self.absolute.similarity)

    @cached_property
    def misclosures(self) -> Misclosures:
        """Control coordinates that count."""
        turned = self.targets.turned(self.at_control)
        return control_errors.misclosures(turned, self.control_rows, self.absolute.axes)

    def fit(self, terms: Sequence[tuple[str, ...]]) -> FitOperator:
        """Operator of the similarity and of polynomials of these terms for X, Y, Z, with the weights in force."""
        return control_errors.fit_operator(self.misclosures, self.weights, self.at_control, terms, self.errors.origin)


@dataclass(frozen=True, eq=False)
class ScreenedStrip(Generic[Errors]):
    """A strip on the control that is not contradicted by the strip and the other control."""

    oriented: OrientedStrip[Errors]
    screened_control: ScreenedControl
    shared: StretchedHeights | ShiftedList | None = None  # by all control, found before points were tested one by one


def orient_on_control(
    stage: StripStage[Errors],
    control: ControlPoints,
    frames: Sequence[GroundFrame],
    settings: absolute_orientation.AbsoluteSettings,
) -> OrientedStrip[Errors]:
    """Lay a strip on its control: intermediate frame and absolute orientation.

    Raises GeometryError, InputError when the control does not determine the similarity, or strip and control are of
        different hands; the strip is named.
    """
    inside, rows = control_of(stage.formed, control, stage.point_ids)
    try:
        oriented = to_ground(stage, inside, rows, frames, settings)
    except InputError as refusal:
        oriented = to_ground(stage.turned_over(refusal), inside, rows, frames, settings)
    oriented.stage.refuse_other_hand(oriented)
    return oriented


def on_control(
    stage: StripStage[Errors],
    control: ControlPoints,
    frames: Sequence[GroundFrame],
    settings: Settings,
    *,
    searched: bool = False,
) -> ScreenedStrip[Errors]:
    """Lay a strip on that of its control which nothing contradicts.

    searched: whether the control was searched already; then all of it is kept.
    """
    oriented = orient_on_control(stage, control, frames, settings.absolute)
    if searched:
        return ScreenedStrip(oriented, control_screening.not_screened(oriented.control))
    return reject_wrong_control(oriented, settings)


def reject_wrong_control(oriented: OrientedStrip[Errors], settings: Settings) -> ScreenedStrip[Errors]:
    """Take out control that the strip and all other control contradict, and lay the strip on what is left.

    A point with a wrong image leaves the strip; what is left is tested again.
    """
    stage, control = oriented.stage, oriented.control
    if not stage.screens_control(settings):
        return ScreenedStrip(oriented, control_screening.not_screened(control))
    found = oriented.misclosures
    moved = similarity_derivatives(oriented.at_control[found.point], oriented.at_control.mean(axis=0))
    place = StripAtControl(
        targets=oriented.targets,
        xyz=stage.formed.xyz[oriented.control_rows],
        similarity=oriented.absolute.similarity,
        weight=oriented.weights,
        rays=stage.control_rays(oriented),
        coordinates=found,
        design=np.einsum("wi,wij->wj", found.direction, moved),
        covariance=stage.misclosure_covariance(oriented),
        share=1.0,
    )
    shared = find_shared(place) if isinstance(stage.strip, Strip) else None
    if shared is not None:  # single points prove nothing then
        return ScreenedStrip(oriented, control_screening.not_screened(control), shared)
    screened = control_screening.screen_control(place)
    images = {control.ids[each.row]: each for each in screened.rejections if each.cause in {WRONG_IMAGE, EITHER}}
    kept = screened.kept
    if images:
        stage, kept = stage.without_images(images), control
    if screened.rejections:
        inside = control_of(stage.formed, kept, stage.point_ids)
        oriented = to_ground(stage, *inside, oriented.frames, oriented.settings)
    return reject_wrong_control(oriented, settings) if images else ScreenedStrip(oriented, screened)


def control_of(
    formed: FormedStrip | FormedModels, control: ControlPoints, point_ids: tuple[str, ...]
) -> tuple[ControlPoints, Numbers]:
    """Control points that have strip coordinates, and their rows there."""
    rows = rows_of_given(control.ids, formed.point, point_ids)
    inside = rows >= 0
    return control.take(inside), rows[inside]


def to_ground(
    stage: StripStage[Errors],
    control: ControlPoints,
    rows: Numbers,
    frames: Sequence[GroundFrame],
    settings: absolute_orientation.AbsoluteSettings,
) -> OrientedStrip[Errors]:
    """Intermediate frame with X along the strip, and the similarity into it.

    A provisional similarity in the frame of azimuth 0 gives the direction of the strip and its scale, hence the
    weights; the final one is made in the frame turned along the strip.

    control: control that the strip holds.
    rows: (n,), its rows in the points of the strip.
    Raises GeometryError when the control does not determine the similarity; the strip is named.
    """
    strip, formed = stage.strip, stage.formed
    if not len(control):
        msg = f"strip {strip.id}: none of its points is a control point"
        raise GeometryError(msg, photos=strip.photos, code="no-control")
    try:
        provisional_frame = middle_frame(control, frames)
        provisional = absolute_orientation.lay(
            formed.xyz[rows],
            absolute_orientation.Targets(control, frames, provisional_frame),
            control.use.astype(float),
            formed.xyz,
        )
        ends = provisional.similarity(formed.ends)
        intermediate = provisional_frame.with_azimuth(strip_azimuth(ends[0], ends[1]))
        precision = stage.point_precision(provisional.similarity.scale)
        targets = absolute_orientation.Targets(control, frames, intermediate)
        cartesian = provisional_frame.cartesian_from_intermediate(provisional.similarity(formed.xyz[rows]))
        turned = targets.turned(intermediate.intermediate_from_cartesian(cartesian))
        weight = absolute_orientation.weights(turned, precision, settings.control_weights)
        final = absolute_orientation.orient(formed.xyz[rows], targets, weight, formed.xyz)
    except GeometryError as error:
        msg = f"strip {strip.id}: {error}"
        raise GeometryError(msg, photos=strip.photos, points=error.points, code=error.code) from error
    return OrientedStrip(
        stage=stage,
        frames=frames,
        control=control,
        control_rows=rows,
        intermediate=intermediate,
        absolute=final,
        precision=precision,
        settings=settings,
    )


def middle_frame(control: ControlPoints, frames: Sequence[GroundFrame]) -> IntermediateFrame:
    """Return the frame at the control's centre of gravity, X to the north.

    control: control; points without plan position do not count, a missing height is taken from the others.
    Raises GeometryError when no point gives a plan position.
    """
    known = ~np.isnan(control.enu[:, :2]).any(axis=1) & control.use[:, 0]
    chosen = control.take(known)
    heights = np.where(control.use[:, 2], control.enu[:, 2], np.nan)
    mean = float(np.nanmean(heights)) if np.isfinite(heights).any() else 0.0
    cartesian = np.empty((len(chosen), 3))
    for number, frame in enumerate(frames):
        rows = chosen.frame == number
        if rows.any():
            enu = chosen.enu[rows].copy()
            enu[~chosen.use[rows, 2], 2] = mean
            cartesian[rows] = frame.cartesian_from_ground(enu, ids=[chosen.ids[i] for i in np.flatnonzero(rows)])
    if not len(chosen):
        msg = "nothing that is given has a plan position"
        raise GeometryError(msg, points=control.ids, code="too-little-control")
    if frames[0].kind == "local":
        return IntermediateFrame.at_local_centre(cartesian, 0.0)
    lon, lat, height = frames[0].geodetic(cartesian).T
    lat0, lon0, _ = mean_position(lat, lon, height)
    return IntermediateFrame.at_centre(cartesian, lat0, lon0, 0.0)
