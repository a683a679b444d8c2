"""What the numbers of a strip of photos, or of linked models, say that a surveyor should know.

A formed strip on its control: intermediate frame, absolute orientation.

Source: [001] eq. 142-149.

A strip of photos on its control: what contradicts it taken out, its photos oriented on the adjusted points.

Source: [001] eq. 142-149.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.errors import GeometryError
from photostrip.geodesy.frame_spec import GROUND_AXES
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geodesy.local_frame import IntermediateFrame, mean_position, strip_azimuth
from photostrip.geometry.similarity import similarity_derivatives
from photostrip.notes import Note, counted
from photostrip.pipeline.formed_photos import FormedPhotos
from photostrip.pipeline.given_points import rows_of_given
from photostrip.pipeline.inputs import ModelStrip, Settings, Strip, overruling_notes
from photostrip.pipeline.results import PhotoStages, StripResult
from photostrip.plausibility.given_points import find_shared
from photostrip.points import ControlPoints, ModelPoints, PhotoPoints
from photostrip.rejection import Rejection
from photostrip.strip import absolute_orientation, control_screening, fitted_strip, strip_errors
from photostrip.strip.absolute_orientation import WEAK_LIMIT, AbsoluteOrientation
from photostrip.strip.control_screening import (
    EITHER,
    EXCHANGED,
    WRONG_IMAGE,
    ControlRay,
    ScreenedControl,
    StripAtControl,
)
from photostrip.strip.fitted_strip import FitOperator, Misclosures
from photostrip.strip.formed_strip import FormedStrip
from photostrip.strip.linked_models import LEFT, FormedModels, far_ends
from photostrip.strip.pair_screening import ScreenedPairs
from photostrip.strip.polynomial import Polynomial
from photostrip.strip.relative_orientation import MINIMUM_POINTS, Orientation
from photostrip.strip.resection import Resection, depths, resect
from photostrip.strip.strip_errors import WEAK_PAIR, StripErrors, times_a_good_pair

# of the length that the control spans: how far points may lie beyond it. Of a polynomial they are extrapolated
BEYOND_POLYNOMIAL = 0.1
LONG_STRIP = 25  # models; beyond it polynomials fall far behind a rigorous adjustment
POLYNOMIAL_MODELS = 15  # models from which on, and
POLYNOMIAL_BANDS = 4  # bands of control below which the bundle adjustment is proposed


def pair_notes(strip: Strip, oriented: Orientation) -> Iterator[Note]:
    """Say which pairs check themselves too little."""
    times = times_a_good_pair(oriented)
    for number, count in enumerate(oriented.points_used):
        names = strip.photos[number : number + 2]
        if count == MINIMUM_POINTS:
            text = f"photos {names[0]} and {names[1]} are oriented on 5 points only: there is no check"
            yield Note("no-check", text, strip=strip.id, photos=names)
        if times[number] > WEAK_PAIR:
            text = (
                f"photos {names[0]} and {names[1]}: weak relative orientation: the standard deviations of model points "
                f"are {times[number]:.1f} times those of a good pair of the same base and height; the points lie in a "
                "narrow band, or on one side: measure some towards the corners of the overlap"
            )
            yield Note("weak-pair", text, strip=strip.id, photos=names)


def screening_notes(strip: Strip, screened: ScreenedPairs, sigma: float) -> Iterator[Note]:
    """Say what the search for gross errors could not decide."""
    scatter = screened.scatter
    if np.isfinite(scatter.found):
        text = (
            f"strip {strip.id}: the y parallaxes scatter as if image coordinates had a standard deviation of "
            f"{scatter.found / np.sqrt(2.0) * 1000:.1f} µm, not the {sigma * 1000:.1f} µm stated; the larger one "
            "is used in the search for gross errors"
        )
        yield Note("sigma-contradicted", text, severity="note", strip=strip.id)
    for number in np.flatnonzero(screened.masked):
        names = strip.photos[number : number + 2]
        text = (
            f"photos {names[0]} and {names[1]}: masked errors are suspected: the y parallaxes are larger than their "
            "standard deviation allows, and no further point can be rejected; measure the pair again or add points"
        )
        yield Note("masked-errors", text, strip=strip.id, photos=names)


def rays_not_tested(strip: Strip) -> Note:
    text = (
        f"strip {strip.id}: its rays could not be tested together, as those left do not hold its photos; points were "
        "rejected pair by pair only, where errors along the base do not show"
    )
    return Note("rays-not-tested", text, severity="note", strip=strip.id)


def wrong_control_notes(strip: Strip | ModelStrip, screened: ScreenedControl) -> Iterator[Note]:
    """Name control that was not used, and what seems to be wrong with it."""
    ids = screened.kept.ids
    for each in screened.rejections:
        point = ids[each.row]
        text = f"control point {point} {_contradiction(each)}; not used"
        if each.cause == EXCHANGED:
            text += f"; it fits when exchanged with {ids[each.other]}"
        yield Note("control-rejected", text, strip=strip.id, points=(point,))


def wrong_image_notes(strip: Strip, observations: PhotoPoints, wrong: Sequence[Rejection]) -> Iterator[Note]:
    """Name control points that their own rays place wrongly."""
    for each in wrong:
        if each.kind != "control":
            continue
        point, photo = observations.point_ids[observations.point[each.row]], strip.photos[each.other]
        text = f"control point {point} {_contradiction(each)}; not used"
        if each.cause == EITHER:
            text += f"; this or its image in photo {photo} is wrong, nothing tells which: both agree on its other ray"
        else:
            text += f"; its image in photo {photo} is wrong, not its coordinates: they agree along its other ray"
        yield Note("control-image", text, strip=strip.id, photos=(photo,), points=(point,))


def _contradiction(each: Rejection) -> str:
    parts = ", ".join(f"{GROUND_AXES[axis]} by about {each.size[axis]:+.2f} m" for axis in each.axes)
    return f"contradicts the strip and the other control: {parts} (test value {each.value:.1f}, limit {each.limit:.1f})"


def junction_notes(strip: Strip, formed: FormedStrip) -> Iterator[Note]:
    """Say which models are joined doubtfully or weakly."""
    junctions = formed.junctions
    count = np.bincount(junctions.junction, junctions.used, len(junctions.factor))
    for number in np.flatnonzero(junctions.doubt).tolist():
        photo = strip.photos[number + 1]
        text = (
            f"photo {photo}: its pass points contradict each other in the scale of the models by "
            f"{100 * junctions.doubt[number]:.2f} %, and it cannot be told which is wrong; measure another pass point"
        )
        yield Note("contradicting-joint", text, strip=strip.id, photos=(photo,))
    for number in np.flatnonzero(count == 1).tolist():
        photo = strip.photos[number + 1]
        text = (
            f"photo {photo}: the models on either side are joined by a single pass point: an error in it enters the "
            "scale unnoticed"
        )
        yield Note("weak-joint", text, strip=strip.id, photos=(photo,))


def control_notes(strip: Strip | ModelStrip, orientation: AbsoluteOrientation) -> Iterator[Note]:
    """Say where the control hardly checks itself, or hardly holds the strip."""
    if orientation.redundancy < 3:
        text = (
            f"strip {strip.id}: the absolute orientation has a redundancy of {orientation.redundancy}: errors of the "
            "control hardly show"
        )
        yield Note("little-control", text, strip=strip.id)
    if orientation.condition > 1 / WEAK_LIMIT:
        text = (
            f"strip {strip.id}: the control lies nearly on one line: the errors of one movement of the strip are "
            f"{orientation.condition:.0f} times those of the other movements"
        )
        yield Note("weak-control", text, strip=strip.id)


def polynomial_notes(strip: Strip | ModelStrip, correction: Polynomial | None, adjusted: Floats) -> Iterator[Note]:
    """Say which degree the control did not carry, and where the polynomial is extrapolated."""
    if correction is None:
        return
    asked = correction.asked
    if asked != "auto" and correction.degree < int(asked):
        text = (
            f"strip {strip.id}: degree {asked} was asked for; the control, "
            f"{counted(len(correction.axes[0].residuals), 'point')} at {counted(correction.stations[0], 'station')} in "
            f"plan and {correction.stations[1]} in height, supports degree {correction.degree}"
        )
        yield Note("degree-reduced", text, strip=strip.id)
    if correction.degree:
        low, high = correction.reach
        outside = int(((adjusted[:, 0] < low) | (adjusted[:, 0] > high)).sum())
        reach = max(low - float(adjusted[:, 0].min()), float(adjusted[:, 0].max()) - high)
        if outside and reach > BEYOND_POLYNOMIAL * (high - low):
            text = (
                f"strip {strip.id}: {counted(outside, 'point lies', 'points lie')} up to {reach:.0f} m beyond the "
                f"control along the strip, where the polynomial of degree {correction.degree} is extrapolated"
            )
            yield Note("extrapolation", text, strip=strip.id)
        if min(axis.redundancy for axis in correction.axes) < 3:
            text = f"strip {strip.id}: the polynomial has a redundancy below 3 in one axis: its residuals say little"
            yield Note("little-redundancy", text, strip=strip.id)


def photo_notes(strip: Strip, resection: Resection) -> Iterator[Note]:
    """Name the photos that could not be oriented."""
    for number in np.flatnonzero(~resection.solved):
        photo = strip.photos[number]
        text = f"photo {photo} could not be oriented on its adjusted points; it keeps its orientation in the strip"
        yield Note("not-resected", text, strip=strip.id, photos=(photo,))


def precision_of_long_strip(strip: Strip, most: int) -> Note:
    """Say that a strip that was fitted to its control is too long for standard deviations of all its points."""
    text = (
        f"strip {strip.id} has {len(strip.photos)} photos; standard deviations after a polynomial or a similarity are "
        f"computed up to {most} photos in a strip; `processing.adjustment: bundle` has them at any length"
    )
    return Note("no-precision", text, strip=strip.id)


def network_proposal(strip: Strip, correction: Polynomial) -> Iterator[Note]:
    """Propose the adjustment of all rays together where a polynomial does badly."""
    models = len(strip.photos) - 1
    if models > LONG_STRIP:
        text = (
            f"strip {strip.id}: {models} models; beyond about {LONG_STRIP} models a polynomial falls far behind a "
            "rigorous adjustment (errors 2.5 times larger at 30 models, 12 times at 100); `processing.adjustment: "
            "bundle` is one"
        )
        yield Note("long-strip", text, strip=strip.id)
        return
    few = min(correction.stations) < POLYNOMIAL_BANDS
    if models > 1 and (models > POLYNOMIAL_MODELS or few):
        bands = f"on {counted(min(correction.stations), 'band')} of control"
        why = f"over {models} models" if models > POLYNOMIAL_MODELS else bands
        what = "a polynomial" if correction.degree else "the similarity, which no polynomial improves,"
        text = f"strip {strip.id}: {what} {why} leaves larger errors than `processing.adjustment: bundle`"
        yield Note("bundle-proposed", text, severity="note", strip=strip.id)


ODD_SCALE = 30.0  # ratio of the scale of a model to that of the others
# ratio of residuals to what is stated; below the second there are no errors at all
ANOTHER_UNIT, NO_ERRORS = 100.0, 1e-5
WEAK_LINK = 12.0  # standard deviations of a coordinate by which a link moves the far end of its model


def link_notes(strip: ModelStrip, measured: ModelPoints, formed: FormedModels) -> Iterator[Note]:
    """Say which links are weak, or contradict themselves, and what seems to stand in another unit."""
    links, shared, models = formed.links, formed.links.shared, formed.models
    yield from _unit_notes(strip, formed)
    if links.factor > 1:
        text = (
            f"strip {strip.id}: the common points of the models differ {np.sqrt(links.factor):.1f} times as much as "
            "the standard deviations of the model coordinates allow; larger ones are used in the search for gross "
            "errors"
        )
        yield Note("sigma-contradicted", text, severity="note", strip=strip.id)
    center = np.bincount(
        shared.link[links.used & (models.node[shared.before] >= models.points)], minlength=shared.count
    )
    far = far_ends(formed)
    for link in range(shared.count):
        names = strip.models[link : link + 2]
        photo = strip.photos[link + 1]
        if far[link] > WEAK_LINK:
            why = "" if center[link] else f"; the perspective centre of photo {photo} is missing in one of them"
            text = (
                f"strip {strip.id}: models {names[0]} and {names[1]} are linked weakly: the far end of the second is "
                f"uncertain by {far[link]:.0f} times the standard deviation of a model coordinate{why}"
            )
            yield Note("weak-link", text, strip=strip.id, photos=(photo,))
        elif not center[link]:
            text = (
                f"strip {strip.id}: models {names[0]} and {names[1]} are linked without the perspective centre of "
                f"photo {photo}, which is not measured in both"
            )
            yield Note("link-without-center", text, severity="note", strip=strip.id, photos=(photo,))
    for rows in links.doubtful:
        link = int(shared.link[rows[0]])
        names = strip.models[link : link + 2]
        points = [measured.name(int(models.node[shared.before[row]])) for row in rows]
        what = f"one of {', '.join(points)}" if len(points) > 1 else points[0]
        text = (
            f"strip {strip.id}: the common points of models {names[0]} and {names[1]} contradict each other: {what} is "
            "wrong, but it is still used; measure more common points"
        )
        yield Note("contradicting-link", text, strip=strip.id, points=tuple(points))
    left = np.bincount(shared.link, links.used, shared.count)
    for link in np.unique(shared.link[[each.row for each in links.rejections]]).tolist():
        if left[link] < LEFT:  # two conditions check nine coordinates
            names, out = strip.models[link : link + 2], shared.before[(shared.link == link) & ~links.used]
            points = [measured.name(node) for node in models.node[out].tolist()]
            text = (
                f"strip {strip.id}: models {names[0]} and {names[1]} are linked by {left[link]:.0f} points alone, "
                f"which hardly check each other: {', '.join(points)} contradict them; measure more common points"
            )
            yield Note("contradicting-link", text, strip=strip.id, points=tuple(points))


def _unit_notes(strip: ModelStrip, formed: FormedModels) -> Iterator[Note]:
    """Say where a model, or the standard deviations, seem to stand in another unit than they should."""
    scale = formed.places.scale / np.median(formed.places.scale)
    for number in np.flatnonzero(np.abs(np.log(scale)) > np.log(ODD_SCALE)).tolist():
        times = f"{1 / scale[number]:.3g} times smaller" if scale[number] < 1 else f"{scale[number]:.3g} times larger"
        text = (
            f"strip {strip.id}: the scale number of model {strip.models[number]} is {times} than that of the others: "
            "are its coordinates in another unit?"
        )
        yield Note("odd-scale", text, strip=strip.id, photos=strip.photos[number : number + 2])
    solved = formed.links.solved
    redundancy = int(solved.redundancy.sum())
    ratio = float(np.sqrt(solved.squares.sum() / redundancy)) if redundancy else 1.0
    if ratio > ANOTHER_UNIT or NO_ERRORS < ratio < 1 / ANOTHER_UNIT:
        text = (
            f"strip {strip.id}: the misfits between the models are {ratio:.3g} times their stated standard deviations: "
            "are these in another unit?"
        )
        yield Note("sigma-unit", text, strip=strip.id, key="models.sigma")


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
            *screening_notes(strip, stage.screened, stage.sigma),
            *([] if stage.rays_tested else [rays_not_tested(strip)]),
            *wrong_control_notes(strip, screened.screened_control),
            *wrong_image_notes(strip, stage.observations, stage.wrong_rays),
            *pair_notes(strip, stage.orientation),
            *junction_notes(strip, formed),
            *control_notes(strip, oriented.absolute),
            *polynomial_notes(strip, correction, xyz),
            *([] if correction is None else network_proposal(strip, correction)),
            *photo_notes(strip, resection),
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
