"""The strip method: strips formed without any control, laid on it, and corrected for what the similarity leaves.

Laid on control: intermediate frame, absolute orientation, what contradicts it taken out. Corrected by polynomials; then
photos are oriented on the adjusted points, and perspective centres of models moved with the ground below them.

Source: [001] eq. 142-152.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import chain
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.errors import Fault, GeometryError, InputError
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geodesy.local_frame import IntermediateFrame, mean_position, strip_azimuth
from photostrip.geometry.similarity import Similarity, similarity_derivatives
from photostrip.pipeline import strip_notes as notes
from photostrip.pipeline.formed_models import LinkedModels, link_strip
from photostrip.pipeline.formed_photos import FormedPhotos, form_strip
from photostrip.pipeline.given_points import rows_of_given
from photostrip.pipeline.inputs import (
    AUTO,
    SIMILARITY,
    Inputs,
    ModelStrip,
    Settings,
    Strip,
    overruling_notes,
    require_measured,
    require_named,
)
from photostrip.pipeline.results import PlacedModels, StripResult
from photostrip.plausibility.given_points import find_curvature, find_shared
from photostrip.points import ControlPoints, PhotoPoints
from photostrip.strip import absolute_orientation, fitted_strip, linked_models, polynomial
from photostrip.strip.control_screening import (
    EITHER,
    WRONG_IMAGE,
    ControlRay,
    ScreenedControl,
    StripAtControl,
    not_screened,
    screen_control,
)
from photostrip.strip.fitted_strip import Misclosures
from photostrip.strip.formed_strip import FormedStrip
from photostrip.strip.linked_models import FormedModels
from photostrip.strip.polynomial import Polynomial
from photostrip.strip.resection import Resection, depths, resect
from photostrip.units import MILLIMETRES

LEAST_SOLID = 4  # points that can tell a body from its mirror image


@dataclass(frozen=True, eq=False)
class OrientedStrip:
    """A strip, of photos or of independent models, with the similarity that lays it on its control."""

    stage: FormedPhotos | LinkedModels  # as it was laid
    frames: Sequence[GroundFrame]  # ground frames of the control lists
    control: ControlPoints  # control that the strip holds
    control_rows: Numbers  # (n,): its rows in the strip's points
    intermediate: IntermediateFrame
    absolute: absolute_orientation.AbsoluteOrientation
    precision: absolute_orientation.PointPrecision  # that gave the weights, metres
    settings: absolute_orientation.AbsoluteSettings

    @property
    def strip(self) -> Strip | ModelStrip:
        return self.stage.strip

    @property
    def formed(self) -> FormedStrip | FormedModels:
        return self.stage.formed

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

    def misclosure_covariance(self) -> Callable[[Numbers], Floats]:
        """Covariance of any misclosures at the control, strip and control together, metres^2, but for a similarity."""
        of_strip, misclosures = self.stage.covariance(self.absolute.similarity), self.misclosures

        def of(some: Numbers) -> Floats:
            chosen = misclosures.take(some)
            return np.asarray(of_strip(chosen.row, chosen.direction) + np.diag(chosen.variance), float)

        return of


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


def control_rays(stage: FormedPhotos, control_rows: Numbers) -> list[ControlRay]:
    """Rays of the control points (n,), rows of the strip's points, that stand on two photos."""
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


class ScreenedStrip(NamedTuple):
    """A strip on the control that is not contradicted by the strip and the other control."""

    oriented: OrientedStrip
    screened_control: ScreenedControl


def orient_on_control(
    stage: FormedPhotos | LinkedModels,
    control: ControlPoints,
    frames: Sequence[GroundFrame],
    settings: absolute_orientation.AbsoluteSettings,
) -> OrientedStrip:
    """Lay a strip on its control; models upside down where without perspective centres nothing told which way is up.

    Raises GeometryError, InputError when the control does not determine the similarity, is left-handed, or strip and
        control are of different hands; the strip is named.
    """
    rows = rows_of_given(control.ids, stage.formed.point, stage.point_ids)
    held = control.take(rows >= 0), rows[rows >= 0]
    if isinstance(stage, FormedPhotos):
        return to_ground(stage, *held, frames, settings)
    try:
        oriented = to_ground(stage, *held, frames, settings)
    except InputError as refusal:
        if not any(fault.code == "left-handed-control" for fault in refusal.faults):
            raise
        if stage.formed.upright:
            raise _left_handed(stage.strip) from refusal
        oriented = to_ground(stage.overturned(), *held, frames, settings)
    except GeometryError:  # of a narrow strip that lies upside down, the control seems to lie on a line
        if stage.formed.upright:
            raise
        oriented = to_ground(stage.overturned(), *held, frames, settings)
    _refuse_other_hand(oriented)
    return oriented


def on_control(
    stage: FormedPhotos | LinkedModels,
    control: ControlPoints,
    frames: Sequence[GroundFrame],
    settings: Settings,
    *,
    searched: bool = False,
) -> ScreenedStrip:
    """Lay a strip on that of its control which nothing contradicts.

    searched: whether the control was searched already; then all of it is kept.
    """
    oriented = orient_on_control(stage, control, frames, settings.absolute)
    of_stage = settings.relative if isinstance(stage, FormedPhotos) else settings.links
    if searched or of_stage.screening == "none":
        return ScreenedStrip(oriented, not_screened(oriented.control))
    return reject_wrong_control(oriented)


def reject_wrong_control(oriented: OrientedStrip) -> ScreenedStrip:
    """Take out control that the strip and all other control contradict, and lay the strip on what is left.

    A point with a wrong image leaves the strip; what is left is tested again.
    """
    stage, control = oriented.stage, oriented.control
    rays = control_rays(stage, oriented.control_rows) if isinstance(stage, FormedPhotos) else ()
    place = strip_at_control(oriented, rays, oriented.misclosure_covariance())
    if isinstance(stage, FormedPhotos) and find_shared(place):  # by all control, or a list: single points prove nothing
        return ScreenedStrip(oriented, not_screened(control))
    screened = screen_control(place)
    images = {control.ids[each.row]: each for each in screened.rejections if each.cause in {WRONG_IMAGE, EITHER}}
    kept = screened.kept
    if images and isinstance(stage, FormedPhotos):
        stage, kept = stage.without_images(images), control
    if screened.rejections:
        oriented = orient_on_control(stage, kept, oriented.frames, oriented.settings)
    return reject_wrong_control(oriented) if images else ScreenedStrip(oriented, screened)


def to_ground(
    stage: FormedPhotos | LinkedModels,
    control: ControlPoints,
    rows: Numbers,
    frames: Sequence[GroundFrame],
    settings: absolute_orientation.AbsoluteSettings,
) -> OrientedStrip:
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
        precision = stage.point_precision.at(provisional.similarity.scale)
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


def _refuse_other_hand(oriented: OrientedStrip) -> None:
    """Refuse a strip that a mirror image of it would fit far better; flat ground does not tell."""
    control, spread = oriented.control, oriented.precision
    full = control.use.all(axis=1)
    if full.sum() < LEAST_SOLID:
        return
    xyz = oriented.formed.xyz[oriented.control_rows]
    targets = oriented.targets.of(xyz)[full]
    as_it_is, mirrored = linked_models.either_hand(xyz[full], targets)
    expected = ((control.sigma[full] ** 2).sum(axis=1) + 2 * spread.plan**2 + spread.height**2).sum()
    conspicuous = as_it_is > linked_models.CONSPICUOUS * expected
    if conspicuous and mirrored < linked_models.REFLECTED * as_it_is:
        raise _left_handed(oriented.strip)


def _left_handed(strip: Strip | ModelStrip) -> InputError:
    """Say that models and control are of different hands."""
    return InputError(
        Fault(
            f"strip {strip.id} fits its control only as a mirror image: the model coordinates or the control are "
            "left-handed",
            code="left-handed-models",
            key="models.axes",
            expected="right-handed, or left-handed when the axes of the plotter are",
            fix="set `models.axes: left-handed`, or put the axes of the control in the order of its columns",
        )
    )


def adjust_formed(
    stage: FormedPhotos | LinkedModels, control: ControlPoints, frames: Sequence[GroundFrame], settings: Settings
) -> StripResult:
    """Lay a formed strip on its control and correct its deformation."""
    return adjusted(on_control(stage, control, frames, settings), settings)


def adjusted(screened: ScreenedStrip, settings: Settings) -> StripResult:
    """Correct the deformation of a strip on its control, and orient its photos or models on the corrected points."""
    oriented = screened.oriented
    stage, strip, frame = oriented.stage, oriented.strip, oriented.intermediate
    correction = _correction(oriented, settings)
    xyz = oriented.xyz if correction is None else correction(oriented.xyz)
    wrong = notes.wrong_control_notes(strip, screened.screened_control)
    held = *notes.control_notes(strip, oriented.absolute), *notes.polynomial_notes(strip, correction, xyz)
    if settings.absolute.earth_curvature == AUTO and oriented.frames[0].kind == "local":
        bent = find_curvature(strip_at_control(oriented, (), oriented.misclosure_covariance()))
        held = *held, *([] if bent is None else [notes.curvature_note(strip, bent, oriented.at_control)])
    result = partial(
        StripResult,
        stage=stage,
        precision=oriented.precision,
        intermediate=frame,
        control=oriented.control,
        control_rows=oriented.control_rows,
        absolute=oriented.absolute,
        polynomial=correction,
        xyz=xyz,
        cartesian=frame.cartesian_from_intermediate(xyz),
        screened_control=screened.screened_control,
    )
    if isinstance(stage, LinkedModels):
        similarity, formed = oriented.absolute.similarity, stage.formed
        centers = _centers(formed, similarity, correction)
        return result(
            rays=formed.photo_count,
            depth=depth_of(centers, xyz),
            notes=(*notes.link_notes(stage.strip, stage.measured, formed), *wrong, *held),
            placed=PlacedModels(
                centers=centers,
                rotations=similarity.rotation @ formed.places.rotation,
                scales=similarity.scale * formed.places.scale * MILLIMETRES,
            ),
            rows=np.zeros(0, np.intp),
        )
    rows = stage.rays_in_use
    photo = stage.strip.positions(stage.observations)[rows]
    points = np.searchsorted(stage.formed.point, stage.observations.point[rows])
    resection = _resected(stage, oriented.absolute.similarity, photo, points, xyz)
    return result(
        rays=np.bincount(points, minlength=len(xyz)),
        depth=float(depths(xyz, points, resection.centers, resection.rotations, photo).mean()),
        notes=(
            *overruling_notes(settings.relative, strip.id, strip.photos),
            *notes.screening_notes(stage.strip, stage.screened, stage.sigma),
            *([] if stage.rays_tested else [notes.rays_not_tested(stage.strip)]),
            *wrong,
            *notes.wrong_image_notes(stage.strip, stage.observations, stage.wrong_rays),
            *notes.pair_notes(stage.strip, stage.orientation),
            *notes.junction_notes(stage.strip, stage.formed),
            *held,
            *([] if correction is None else notes.network_proposal(stage.strip, correction)),
            *notes.photo_notes(stage.strip, resection),
        ),
        placed=resection,
        rows=rows,
    )


def _correction(oriented: OrientedStrip, settings: Settings) -> polynomial.Polynomial | None:
    if settings.adjustment == SIMILARITY:
        return None
    spacing, breadth = oriented.extent
    problem = polynomial.FitProblem(
        xyz=oriented.at_control, targets=oriented.targets, weight=oriented.weights, spacing=spacing, breadth=breadth
    )
    return polynomial.fit(problem, settings.polynomial)


def _resected(
    stage: FormedPhotos, similarity: Similarity, photo: Numbers, points: Numbers, adjusted: Floats
) -> Resection:
    """Orient every photo on its adjusted points, so that orientations and points belong together."""
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


def _centers(formed: FormedModels, similarity: Similarity, correction: Polynomial | None) -> Floats:
    """Perspective centres, moved with the ground below them."""
    placed = similarity(formed.centers)
    known = np.isfinite(placed).all(axis=1)
    if correction is None or not known.any():
        return placed
    found, axes = placed[known], correction.axes
    above = linked_models.heights_above(found, similarity(formed.xyz))
    rows = linked_models.displacement_rows(found, above, [axis.terms for axis in axes])
    placed[known] = found + sum(row @ axis.coefficients for row, axis in zip(rows, axes, strict=True))
    return placed


def depth_of(centers: Floats, xyz: Floats) -> float:
    """Mean height of perspective centres above the points, metres; NaN without any."""
    known = np.isfinite(centers).any()
    return float(np.nanmean(centers[:, 2]) - xyz[:, 2].mean()) if known else float("nan")


def form_strips(
    inputs: Inputs, observations: PhotoPoints, settings: Settings
) -> list[FormedPhotos] | list[LinkedModels]:
    """Form the strips of a project, of photos or of independent models, each by itself."""
    models = inputs.models
    if models is None:
        return form_photos(inputs, observations, settings)
    require_named(settings.links, models.points)
    return [link_strip(strip, models.points, settings) for strip in models.strips]


def form_photos(inputs: Inputs, observations: PhotoPoints, settings: Settings) -> list[FormedPhotos]:
    """Form the strips of photos; a single photo, which only a bundle adjustment can orient, forms nothing."""
    require_measured(settings.relative, observations)
    whole = [strip for strip in inputs.strips if len(strip.photos) > 1]
    if len(whole) < len(inputs.strips) and not settings.together:
        alone = next(strip.photos for strip in inputs.strips if len(strip.photos) == 1)
        msg = f"photo {alone[0]} is no strip: only a bundle adjustment can orient it"
        raise GeometryError(msg, photos=alone, code="one-photo")
    return [form_strip(strip, observations, settings) for strip in whole]


def as_single_photos(inputs: Inputs, settings: Settings, refused: GeometryError) -> Inputs | None:
    """Cut the strip that a refusal is about into single photos, to start from given orientations or on others' points.

    A bundle that diverges names none: then all strips are cut.

    None where orientations are not given for all photos and no strip is left beside them, the bundle rejects nothing,
    or positions of a strip share an error.
    """
    positions, named = inputs.positions, set(refused.photos)
    known = set() if inputs.orientations is None else set(inputs.orientations.photos)
    several = [strip for strip in inputs.strips if len(strip.photos) > 1 and named <= set(strip.photos)]
    if not several or not (named or refused.code == "bundle-diverged"):
        return None
    left = any(len(strip.photos) > 1 and strip not in several for strip in inputs.strips)
    if not left and not all(known.issuperset(strip.photos) for strip in several):
        return None
    if not settings.together or "none" in {settings.bundle.screening, settings.relative.screening}:
        return None
    if positions is not None and positions.correction != "none" and positions.group == "strip":
        return None

    def cut(strip: Strip) -> list[Strip]:
        names = [f"{strip.id}/{photo}" if strip.listed else photo for photo in strip.photos]
        singles = [replace(strip, id=name, photos=(photo,)) for name, photo in zip(names, strip.photos, strict=True)]
        return singles if strip in several else [strip]

    return replace(inputs, strips=tuple(chain(*map(cut, inputs.strips))))
