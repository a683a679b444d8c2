"""A formed strip on its control: intermediate frame, absolute orientation.

Source: [001] eq. 142-149.

A strip of photos on its control: what contradicts it taken out, its photos oriented on the adjusted points.

Source: [001] eq. 142-149.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.errors import GeometryError
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geodesy.local_frame import IntermediateFrame, mean_position, strip_azimuth
from photostrip.geometry.similarity import similarity_derivatives
from photostrip.pipeline.overruling import overruling_notes
from photostrip.pipeline.given_points import rows_of_given
from photostrip.pipeline.inputs import ModelStrip, Settings, Strip
from photostrip.pipeline.results import PhotoStages, StripResult
from photostrip.pipeline.strips import notes
from photostrip.pipeline.strips.photos import FormedPhotos
from photostrip.plausibility.shared_by_control import find_shared
from photostrip.points import ControlPoints
from photostrip.strip import absolute_orientation, control_screening, fitted_strip, strip_errors
from photostrip.strip.control_screening import EITHER, WRONG_IMAGE, ScreenedControl
from photostrip.strip.control_search import ControlRay, StripAtControl
from photostrip.strip.fitted_strip import FitOperator, Misclosures
from photostrip.strip.formed_strip import FormedStrip
from photostrip.strip.polynomial import Polynomial
from photostrip.strip.resection import Resection, depths, resect
from photostrip.strip.strip_errors import StripErrors

if TYPE_CHECKING:
    from photostrip.strip.model_strip import FormedModels


@dataclass(frozen=True, eq=False)
class OrientedStrip:
    """A strip, of photos or of independent models, with the similarity that lays it on its control."""

    strip: Strip | ModelStrip
    formed: FormedStrip | FormedModels
    frames: Sequence[GroundFrame]  # ground frames of the control lists
    control: ControlPoints  # control that the strip holds
    control_rows: Numbers  # (n,): its rows in the strip's points
    intermediate: IntermediateFrame
    absolute: absolute_orientation.AbsoluteOrientation
    precision: absolute_orientation.PointPrecision  # that gave the weights, metres
    settings: absolute_orientation.AbsoluteSettings

    @cached_property
    def targets(self) -> absolute_orientation.Targets:
        """The control in the intermediate frame."""
        return absolute_orientation.Targets(self.control, self.frames, self.intermediate)

    @property
    def xyz(self) -> Floats:
        """Points of the strip after the similarity, intermediate frame, metres, shape (q, 3); worked out anew."""
        return self.absolute.similarity(self.formed.xyz)

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
        """Mean base and half width of the strip, metres; without perspective centres the mean length of a model."""
        xyz, centers = self.xyz, self.absolute.similarity(self.formed.centers)
        bases = np.linalg.norm(np.diff(centers, axis=0), axis=1)
        spacing = np.nanmean(bases) if np.isfinite(bases).any() else np.ptp(xyz[:, 0]) / max(len(bases), 1)
        return float(spacing), max(np.quantile(np.abs(xyz[:, 1]), 0.95), 1e-6)

    @cached_property
    def misclosures(self) -> Misclosures:
        """Control coordinates that count."""
        turned = self.targets.turned(self.at_control)
        return fitted_strip.misclosures(turned, self.control_rows, self.absolute.axes)


def strip_at_control(
    oriented: OrientedStrip, rays: Sequence[ControlRay], covariance: Callable[[Numbers], Floats]
) -> StripAtControl:
    """Put together what wrong control is searched with.

    rays: rays of control points that stand on two photos; models have none.
    covariance: gives that of some misclosures (w,), strip and control together, metres^2, but for a similarity.
    """
    coordinates = oriented.misclosures
    moved = similarity_derivatives(oriented.at_control[coordinates.point], oriented.at_control.mean(axis=0))
    return StripAtControl(
        targets=oriented.targets,
        xyz=oriented.formed.xyz[oriented.control_rows],
        similarity=oriented.absolute.similarity,
        weight=oriented.weights,
        rays=rays,
        coordinates=coordinates,
        design=np.einsum("wi,wij->wj", coordinates.direction, moved),
        covariance=covariance,
        share=1.0,
    )


def control_of(
    formed: FormedStrip | FormedModels, control: ControlPoints, point_ids: tuple[str, ...]
) -> tuple[ControlPoints, Numbers]:
    """Control points that have strip coordinates, and their rows there."""
    rows = rows_of_given(control.ids, formed.point, point_ids)
    inside = rows >= 0
    return control.take(inside), rows[inside]


def to_ground(
    strip: Strip | ModelStrip,
    formed: FormedStrip | FormedModels,
    point_precision: absolute_orientation.PointPrecision,
    control: ControlPoints,
    rows: Numbers,
    frames: Sequence[GroundFrame],
    settings: absolute_orientation.AbsoluteSettings,
) -> OrientedStrip:
    """Intermediate frame with X along the strip, and the similarity into it.

    A provisional similarity in the frame of azimuth 0 gives the direction of the strip and its scale, hence the
    weights; the final one is made in the frame turned along the strip.

    point_precision: of a point of one model, in the unit of the strip.
    control: control that the strip holds.
    rows: (n,), its rows in the points of the strip.
    Raises GeometryError when the control does not determine the similarity; the strip is named.
    """
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
        precision = point_precision.at(provisional.similarity.scale)
        targets = absolute_orientation.Targets(control, frames, intermediate)
        cartesian = provisional_frame.cartesian_from_intermediate(provisional.similarity(formed.xyz[rows]))
        turned = targets.turned(intermediate.intermediate_from_cartesian(cartesian))
        weight = absolute_orientation.weights(turned, precision, settings.control_weights)
        final = absolute_orientation.orient(formed.xyz[rows], targets, weight, formed.xyz)
    except GeometryError as error:
        msg = f"strip {strip.id}: {error}"
        raise GeometryError(msg, photos=strip.photos, points=error.points, code=error.code) from error
    return OrientedStrip(
        strip=strip,
        formed=formed,
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


@dataclass(frozen=True, eq=False)
class OrientedPhotos:
    """A strip of photos with the similarity that lays it on its control."""

    stage: FormedPhotos
    oriented: OrientedStrip

    @cached_property
    def errors(self) -> StripErrors:
        """Derivatives of the strip on the ground by what was measured."""
        stage, similarity = self.stage, self.oriented.absolute.similarity
        return strip_errors.differentiate_strip(stage.orientation, stage.formed, similarity, stage.observations.sigma)

    def fit(self, terms: Sequence[tuple[str, ...]]) -> FitOperator:
        """Operator of the similarity and of polynomials of these terms for X, Y, Z, with the weights in force."""
        on = self.oriented
        return fitted_strip.fit_operator(on.misclosures, on.weights, on.at_control, terms, self.errors.origin)

    def misclosure_covariance(self) -> Callable[[Numbers], Floats]:
        """Covariance of any misclosures at the control, strip and control together, metres^2."""
        stage, misclosures = self.stage, self.oriented.misclosures
        errors, factor = stage.errors(self.oriented.absolute.similarity), stage.excess

        def of(some: Numbers) -> Floats:
            found = misclosures.take(some)
            along = errors.along(found.row, found.direction)
            first, _ = errors.frames(along)  # the test does not depend on what moves the whole section
            return errors.joint_covariance(along, first) * factor + np.diag(found.variance)

        return of

    def control_rays(self) -> list[ControlRay]:
        """Rays of the control points that stand on two photos."""
        stage, control_rows = self.stage, self.oriented.control_rows
        rows = stage.rays_in_use
        point = np.searchsorted(stage.formed.point, stage.observations.point[rows])
        order = np.argsort(point, kind="stable")
        low = np.searchsorted(point[order], control_rows)
        twice = np.flatnonzero(np.bincount(point, minlength=len(stage.formed.point))[control_rows] == 2)
        both = stage.strip.positions(stage.observations)[rows[order[low[twice, None] + np.arange(2)]]]
        ray = stage.formed.xyz[control_rows[twice], None] - stage.formed.centers[both]
        ray /= np.linalg.norm(ray, axis=2)[:, :, None]
        return [
            ControlRay(row, other, along)
            for row, others, directions in zip(twice.tolist(), both[:, ::-1].tolist(), ray, strict=True)
            for other, along in zip(others, directions, strict=True)
        ]


@dataclass(frozen=True, eq=False)
class ScreenedPhotos:
    """A strip of photos on the control that is not contradicted by the strip and the other control."""

    photos: OrientedPhotos
    screened_control: ScreenedControl


def orient_on_control(
    stage: FormedPhotos,
    control: ControlPoints,
    frames: Sequence[GroundFrame],
    settings: absolute_orientation.AbsoluteSettings,
) -> OrientedPhotos:
    """Lay a strip on its control: intermediate frame and absolute orientation.

    Raises GeometryError, InputError when the control does not determine the similarity, or is left-handed; the strip is
        named.
    """
    inside, rows = control_of(stage.formed, control, stage.observations.point_ids)
    oriented = to_ground(stage.strip, stage.formed, stage.point_precision, inside, rows, frames, settings)
    return OrientedPhotos(stage, oriented)


def on_control(
    stage: FormedPhotos,
    control: ControlPoints,
    frames: Sequence[GroundFrame],
    settings: Settings,
    *,
    searched: bool = False,
) -> ScreenedPhotos:
    """Lay a strip on that of its control which nothing contradicts.

    searched: whether the control was searched already; then all of it is kept.
    """
    photos = orient_on_control(stage, control, frames, settings.absolute)
    if searched or settings.relative.screening == "none":
        return ScreenedPhotos(photos, control_screening.not_screened(photos.oriented.control))
    return reject_wrong_control(photos)


def reject_wrong_control(photos: OrientedPhotos) -> ScreenedPhotos:
    """Take out control that the strip and all other control contradict, and lay the strip on what is left.

    A point with a wrong image leaves the strip; what is left is tested again.
    """
    stage, oriented, control = photos.stage, photos.oriented, photos.oriented.control
    place = strip_at_control(oriented, photos.control_rays(), photos.misclosure_covariance())
    if find_shared(place):  # by all control, or a list: single points prove nothing then
        return ScreenedPhotos(photos, control_screening.not_screened(control))
    screened = control_screening.screen_control(place)
    images = {control.ids[each.row]: each for each in screened.rejections if each.cause in {WRONG_IMAGE, EITHER}}
    kept = screened.kept
    if images:
        stage, kept = stage.without_images(images), control
    if screened.rejections:
        photos = orient_on_control(stage, kept, oriented.frames, oriented.settings)
    return reject_wrong_control(photos) if images else ScreenedPhotos(photos, screened)


def adjusted(screened: ScreenedPhotos, correction: Polynomial | None, settings: Settings) -> StripResult:
    """Adjust the points of a strip by a polynomial, or leave them as they are, and orient every photo on them."""
    oriented, stage = screened.photos.oriented, screened.photos.stage
    strip, formed = stage.strip, stage.formed
    xyz = oriented.xyz if correction is None else correction(oriented.xyz)
    rows = stage.rays_in_use
    photo = strip.positions(stage.observations)[rows]
    points = np.searchsorted(formed.point, stage.observations.point[rows])
    resection = _resected(screened.photos, photo, points, xyz)
    return StripResult(
        precision=oriented.precision,
        intermediate=oriented.intermediate,
        control=oriented.control,
        control_rows=oriented.control_rows,
        absolute=oriented.absolute,
        polynomial=correction,
        xyz=xyz,
        cartesian=oriented.intermediate.cartesian_from_intermediate(xyz),
        rays=np.bincount(points, minlength=len(formed.point)),
        depth=float(depths(xyz, points, resection.centers, resection.rotations, photo).mean()),
        notes=(
            *overruling_notes(settings.relative, strip.id, strip.photos),
            *notes.screening_notes(strip, stage.screened, stage.sigma),
            *([] if stage.rays_tested else [notes.rays_not_tested(strip)]),
            *notes.wrong_control_notes(strip, screened.screened_control),
            *notes.wrong_image_notes(strip, stage.observations, stage.wrong_rays),
            *notes.pair_notes(strip, stage.orientation),
            *notes.junction_notes(strip, formed),
            *notes.control_notes(strip, oriented.absolute),
            *notes.polynomial_notes(strip, correction, xyz),
            *([] if correction is None else notes.network_proposal(strip, correction)),
            *notes.photo_notes(strip, resection),
        ),
        screened_control=screened.screened_control,
        photo_stages=PhotoStages(
            strip=strip,
            sigma=stage.sigma,
            screened=stage.screened,
            formed=formed,
            wrong_rays=stage.wrong_rays,
            resection=resection,
            rows=rows,
        ),
    )


def _resected(photos: OrientedPhotos, photo: Numbers, points: Numbers, adjusted: Floats) -> Resection:
    """Orient every photo on its adjusted points, so that orientations and points belong together."""
    stage, similarity = photos.stage, photos.oriented.absolute.similarity
    strip, formed = stage.strip, stage.formed
    # A polynomial can move a long strip by much: a photo starts where its points went, on the average.
    shift = _mean_shifts(adjusted - similarity(formed.xyz), points, photo, len(strip.photos))
    centers = similarity(formed.centers) + shift
    start = strip.oriented(centers, similarity.rotation @ formed.rotations)
    resection = resect(stage.observations.xy[stage.rays_in_use], adjusted[points], photo, start)
    if not resection.solved.any():
        msg = (
            f"strip {strip.id}: no photo can be oriented on its adjusted points: strip and control do not "
            "belong together"
        )
        raise GeometryError(msg, photos=strip.photos, code="no-photo-oriented")
    return resection


def _mean_shifts(moved: Floats, points: Numbers, photo: Numbers, photos: int) -> Floats:
    """Mean shifts (photos, 3) of the points on each photo, 0 where it has none; moved: (q, 3), shifts of points."""
    count = np.maximum(np.bincount(photo, minlength=photos), 1)
    return np.column_stack([np.bincount(photo, moved[points, axis], photos) / count for axis in range(3)])
