"""One strip from its image coordinates to adjusted points and oriented photos."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from photostrip.errors import GeometryError
from photostrip.geodesy.local_frame import IntermediateFrame, mean_position, strip_azimuth
from photostrip.geometry.similarity import similarity_derivatives
from photostrip.notes import Note
from photostrip.pipeline import covariance_adjustment as covariance
from photostrip.pipeline import overruling
from photostrip.pipeline.results import PhotoStages, StripResult
from photostrip.triangulation import absolute_orientation
from photostrip.triangulation.error_propagation import control_errors, covariances, strip_errors
from photostrip.triangulation.gross_errors.control import control_screening, control_significance
from photostrip.triangulation.gross_errors.pairs import screening
from photostrip.triangulation.gross_errors.rays import screened_formation, strip_screening
from photostrip.triangulation.polynomial import correction as polynomial
from photostrip.triangulation.relative_orientation.orientation import (
    CONDITION_WARNING,
    Orientation,
    orient_unchecked,
    refuse_unusable,
)
from photostrip.triangulation.relative_orientation.pairs import MINIMUM_POINTS, collect_pairs
from photostrip.triangulation.resection import resection as exterior
from photostrip.triangulation.strip_formation.strip import FormedStrip, form_from_pairs

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from photostrip.geodesy.ground_frame import GroundFrame
    from photostrip.pipeline.inputs import ModelStrip, Settings, Strip
    from photostrip.points import ControlPoints, PhotoPoints
    from photostrip.triangulation.independent_models.formation import FormedModels

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]
    Flags = NDArray[np.bool_]


def adjust_strip(
    strip: Strip, observations: PhotoPoints, control: ControlPoints, frames: Sequence[GroundFrame], settings: Settings
) -> StripResult:
    """Take one strip through the method.

    Parameters
    ----------
    strip : Strip
        Photos in flight order and their camera.
    observations : PhotoPoints
        Ideal image coordinates of the whole project.
    control : ControlPoints
        Measured control of the project, no check points.

    Raises
    ------
    GeometryError, InputError
        When a pair, a joint or the absolute orientation cannot be determined; the strip is named.
    """
    return adjust_formed(form_strip(strip, observations, settings), observations, control, frames, settings)


@dataclass(frozen=True, eq=False)
class Formed:
    """A strip before it meets its control."""

    strip: Strip
    sigma: float  # median standard deviation of its image coordinates, mm
    screened: screening.ScreenedPairs  # the search for gross errors in its pairs
    formed: FormedStrip
    contradictions: strip_screening.RayRejections  # points whose rays contradict each other from model to model


def form_strip(strip: Strip, observations: PhotoPoints, settings: Settings) -> Formed:
    """Orient the pairs of a strip and form it, without any control.

    Parameters
    ----------
    strip : Strip
        Photos in flight order and their camera.
    observations : PhotoPoints
        Ideal image coordinates of the whole project.

    Returns
    -------
    Formed
        The strip in the frame and scale of its first model.

    Raises
    ------
    GeometryError, InputError
        When a pair or a joint cannot be determined; the strip is named.
    """
    sigma = _sigma(strip, observations)
    pairs = collect_pairs(observations, strip.photos, strip.camera.principal_distance)
    pairs = pairs.without(overruling.touched(settings.relative.drop, observations, pairs.rows))
    first, converged = orient_unchecked(pairs)
    screened = screening.screen_pairs(first, settings.relative, sigma, converged)
    kept = overruling.touched(settings.relative.keep, observations, pairs.rows)
    screened = overruling.restored(screened, pairs.weight, kept)
    refuse_unusable(screened.orientation, screened.converged, strip.photos)
    screened, formed, contradictions = _form(strip, observations, screened, settings, pairs.weight)
    return Formed(strip, sigma, screened, formed, contradictions)


def adjust_formed(
    stage: Formed, observations: PhotoPoints, control: ControlPoints, frames: Sequence[GroundFrame], settings: Settings
) -> StripResult:
    """Take a formed strip to the ground.

    Raises
    ------
    GeometryError
        When the absolute orientation cannot be determined; the strip is named.
    """
    strip, sigma, screened = stage.strip, stage.sigma, stage.screened
    oriented, formed, contradictions = screened.orientation, stage.formed, stage.contradictions
    here, rows = control_of(formed, control, observations.point_ids)
    spread_at = partial(_precision, formed, oriented, sigma)
    intermediate, orientation, spread = to_ground(strip, formed, (here, rows), frames, spread_at)
    wrong: tuple[control_screening.ControlRejection, ...] = ()
    judged = None
    if settings.relative.screening != "none":
        extent = _extent(formed, orientation)
        joint = _joint(strip, observations, screened, formed, (here, rows, frames), intermediate, orientation, sigma)
        place = control_screening.StripAtControl(formed.xyz[rows], frames, intermediate, spread, *extent, joint)
        given = here
        here, wrong = control_screening.screen_control(given, place)
        judged = place.judged(given, here)
    if wrong:
        intermediate, orientation, spread = to_ground(strip, formed, (here, rows), frames, spread_at)
    xyz = orientation.similarity(formed.xyz)
    correction = None
    if settings.adjustment == "polynomial":
        targets = absolute_orientation.Targets(here, frames, intermediate)
        weight = absolute_orientation.weights(targets.turned(xyz[rows]), spread)
        problem = polynomial.FitProblem(xyz[rows], targets, weight, *_extent(formed, orientation))
        correction = polynomial.fit(problem, settings.polynomial)
    own = None
    if settings.adjustment == "covariance":
        targets = absolute_orientation.Targets(here, frames, intermediate)
        whole = (oriented, formed, orientation)
        own = covariance.adjust(strip, whole, (targets, rows), observations, sigma, settings.covariance)
    adjusted = own.xyz if own is not None else xyz if correction is None else correction(xyz)
    resection, image_rows = _orient_photos(strip, observations, oriented, formed, adjusted, orientation, own)
    rows_seen = np.searchsorted(formed.point, observations.point[image_rows])
    return StripResult(
        precision=spread,
        intermediate=intermediate,
        control=here,
        control_rows=rows,
        absolute=orientation,
        polynomial=correction,
        xyz=adjusted,
        cartesian=intermediate.cartesian_from_intermediate(adjusted),
        rays=np.bincount(rows_seen, minlength=len(formed.point)),
        depth=_depth(strip, observations, image_rows, formed, adjusted, resection),
        notes=(
            *overruling.notes(settings.relative, strip.id, strip.photos),
            *_screening_notes(strip, screened, sigma),
            *wrong_control_notes(strip, wrong),
            *_notes(strip, oriented, formed, orientation, correction, adjusted, resection),
            *covariance.notes(strip, here, own),
        ),
        wrong_control=wrong,
        judged_control=judged,
        photo_stages=PhotoStages(
            strip=strip,
            sigma=sigma,
            screened=screened,
            formed=formed,
            contradictions=contradictions,
            resection=resection,
            rows=image_rows,
            covariance=own,
        ),
    )


def _joint(
    strip: Strip,
    observations: PhotoPoints,
    screened: screening.ScreenedPairs,
    formed: FormedStrip,
    given: tuple[ControlPoints, Numbers, Sequence[GroundFrame]],
    intermediate: IntermediateFrame,
    orientation: absolute_orientation.AbsoluteOrientation,
    sigma: float,
) -> control_significance.ControlCovariance | None:
    """Covariance of all misclosures at the control; None where there are too many to form it as a whole."""
    control, rows, frames = given
    if control.use.sum() > control_significance.LARGEST or len(strip.photos) > control_significance.LONGEST:
        return None
    place = {photo: number for number, photo in enumerate(strip.photos)}
    position = np.array([place.get(photo, -1) for photo in observations.photo_ids], np.intp)[observations.photo]
    errors = strip_errors.differentiate_strip(
        screened.orientation, formed, orientation.similarity, position, observations.sigma
    )
    xyz = orientation.similarity(formed.xyz[rows])
    targets = absolute_orientation.Targets(control, frames, intermediate)
    found = control_errors.misclosures(errors.points, targets.turned(xyz), rows, targets.axes(xyz))
    # image coordinates are taken as good as stated, or as bad as the pairs have proved
    factor = max(1.0, float(np.median(screened.scatter.by_pair)) ** 2 / (2 * sigma**2))
    covariance = covariances.of_parameters(errors, found, np.eye(len(found.point)), factor).parameters * factor
    moved = similarity_derivatives(xyz[found.point], errors.origin)
    design = np.einsum("wi,wij->wj", found.direction, moved)
    return control_significance.ControlCovariance(found.point, found.axis, design, covariance)


def _extent(formed: FormedStrip, orientation: absolute_orientation.AbsoluteOrientation) -> tuple[float, float]:
    """Mean base and half width of the strip, metres."""
    centers, xyz = orientation.similarity(formed.centers), orientation.similarity(formed.xyz)
    spacing = float(np.linalg.norm(np.diff(centers, axis=0), axis=1).mean())
    return spacing, max(float(np.quantile(np.abs(xyz[:, 1]), 0.95)), 1e-6)


def _form(
    strip: Strip, observations: PhotoPoints, screened: screening.ScreenedPairs, settings: Settings, weight: Floats
) -> tuple[screening.ScreenedPairs, FormedStrip, strip_screening.RayRejections]:
    """Form the strip, and let it decide what its pairs could not."""
    oriented, scatter = screened.orientation, screened.scatter.by_pair
    if settings.relative.screening == "none":
        return (
            screened,
            form_from_pairs(oriented, settings.formation, strip.photos, scatter),
            strip_screening.RayRejections(),
        )
    kept = overruling.rows(settings.relative.keep, observations)
    measured = screened_formation.Measurements(
        observations, strip.photos, weight, scatter, _sigma(strip, observations), kept
    )
    readmit = settings.relative.screening in screening.SEARCHES
    oriented, formed, verdict = screened_formation.form_screened(
        oriented, measured, settings.formation, readmit=readmit
    )
    rejections = screened_formation.taken_back(screened.rejections, oriented.used)
    return replace(screened, orientation=oriented, rejections=rejections), formed, verdict


def _sigma(strip: Strip, observations: PhotoPoints) -> float:
    """Median standard deviation of the strip's image coordinates, mm."""
    members = set(strip.photos)
    inside = np.array([photo in members for photo in observations.photo_ids])
    return float(np.median(observations.sigma[inside[observations.photo]]))


def control_of(
    formed: FormedStrip | FormedModels, control: ControlPoints, point_ids: Sequence[str]
) -> tuple[ControlPoints, Numbers]:
    """Control points that have strip coordinates, and their rows there.

    Parameters
    ----------
    point_ids : sequence of str
        Ids of the points as they are numbered.

    Returns
    -------
    rows : ndarray of int
        Its rows in the points of the strip.
    """
    number = {name: n for n, name in enumerate(point_ids)}
    # a point without a model has no place in the strip's covariance
    row_of = {int(n): row for row, n in enumerate(formed.point) if formed.model_count[row]}
    found = [(row, row_of.get(number[name], -1)) for row, name in enumerate(control.ids)]
    kept = np.array([pair for pair in found if pair[1] >= 0], np.intp).reshape(-1, 2)
    return control.take(kept[:, 0]), kept[:, 1]


def to_ground(
    strip: Strip | ModelStrip,
    formed: FormedStrip | FormedModels,
    given: tuple[ControlPoints, Numbers],
    frames: Sequence[GroundFrame],
    spread_at: Callable[[float], tuple[float, float]],
) -> tuple[IntermediateFrame, absolute_orientation.AbsoluteOrientation, tuple[float, float]]:
    """Intermediate frame with X along the strip, and the similarity into it.

    A provisional similarity in the frame of azimuth 0 gives the direction of the strip and its scale, hence the
    weights; the final one is made in the frame turned along the strip.

    Parameters
    ----------
    strip : Strip or ModelStrip
        The strip, to name it.
    given : tuple of ControlPoints and ndarray of int
        Its control, and the rows of that in its points.
    spread_at : callable
        A-priori standard deviations of a point in plan and height, metres, at a scale of the strip.

    Returns
    -------
    IntermediateFrame, AbsoluteOrientation, tuple of float
        Frame, similarity, and the standard deviations that gave the weights.

    Raises
    ------
    GeometryError
        When the control does not determine the similarity; the strip is named.
    """
    control, rows = given
    if not len(control):
        msg = f"strip {strip.id}: none of its points is a control point"
        raise GeometryError(msg, photos=strip.photos, code="no-control")
    try:
        provisional_frame = middle_frame(control, frames)
        provisional = absolute_orientation.orient(
            formed.xyz[rows],
            absolute_orientation.Targets(control, frames, provisional_frame),
            control.use.astype(float),
            formed.xyz,
        )
        ends = provisional.similarity(formed.ends)
        intermediate = provisional_frame.with_azimuth(strip_azimuth(ends[0], ends[1]))
        spread = spread_at(provisional.similarity.scale)
        targets = absolute_orientation.Targets(control, frames, intermediate)
        cartesian = provisional_frame.cartesian_from_intermediate(provisional.similarity(formed.xyz[rows]))
        turned = targets.turned(intermediate.intermediate_from_cartesian(cartesian))
        final = absolute_orientation.orient(
            formed.xyz[rows], targets, absolute_orientation.weights(turned, spread), formed.xyz
        )
    except GeometryError as error:
        msg = f"strip {strip.id}: {error}"
        raise GeometryError(msg, photos=strip.photos, points=error.points, code=error.code) from error
    return intermediate, final, spread


def middle_frame(control: ControlPoints, frames: Sequence[GroundFrame]) -> IntermediateFrame:
    """Return the frame at the control's centre of gravity, X to the north.

    Parameters
    ----------
    control : ControlPoints
        Control; points without plan position do not count, a missing height is taken from the others.
    frames : sequence of GroundFrame
        Their ground frames.

    Returns
    -------
    IntermediateFrame
        The frame.

    Raises
    ------
    GeometryError
        When no point gives a plan position.
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
        msg = "no control point gives a plan position"
        raise GeometryError(msg, points=control.ids, code="too-little-control")
    if frames[0].kind == "local":
        return IntermediateFrame.at_local_centre(cartesian, 0.0)
    lon, lat, height = frames[0].geodetic(cartesian).T
    lat0, lon0, _ = mean_position(lat, lon, height)
    return IntermediateFrame.at_centre(cartesian, lat0, lon0, 0.0)


def _precision(formed: FormedStrip, oriented: Orientation, sigma: float, scale: float) -> tuple[float, float]:
    """A-priori standard deviation of a point of one model in plan and height, metres.

    Plan: that of an image coordinate at photo scale; height: that of an x parallax times the ratio of depth to base.
    """
    arm = formed.model_xyz - formed.centers[oriented.pairs.pair]
    base = np.diff(formed.centers, axis=0)[oriented.pairs.pair]
    length = np.linalg.norm(base, axis=1)
    depth = np.linalg.norm(np.cross(arm, base), axis=1) / length
    good = np.isfinite(depth)
    depth_mean = float(depth[good].mean())
    plan = sigma * depth_mean / oriented.pairs.focal * scale
    return plan, plan * float(np.sqrt(2.0)) * depth_mean / float(length[good].mean())


def _orient_photos(
    strip: Strip,
    observations: PhotoPoints,
    oriented: Orientation,
    formed: FormedStrip,
    adjusted: Floats,
    orientation: absolute_orientation.AbsoluteOrientation,
    own: covariance.CovarianceAdjustment | None,
) -> tuple[exterior.Resection, Numbers]:
    """Orient every photo on its adjusted points, so that orientations and points belong together.

    The adjustment with the strip's own covariance gives photos and points together.
    """
    in_models = oriented.rows[oriented.used & np.isfinite(formed.model_xyz).all(axis=1)]
    used = np.union1d(in_models, formed.bridging)
    place = {photo: n for n, photo in enumerate(strip.photos)}
    position = np.array([place.get(photo, -1) for photo in observations.photo_ids], np.intp)[observations.photo[used]]
    order = np.argsort(position, kind="stable")
    used, position = used[order], position[order]
    rows = np.searchsorted(formed.point, observations.point[used])
    points = adjusted[rows]
    if own is not None:
        seen = (position, observations.xy[used], points)
        return covariance.resection(own, seen, strip.camera.principal_distance), used
    similarity = orientation.similarity
    # A polynomial can move a long strip by much: a photo starts where its points went, on the average.
    moved = points - similarity(formed.xyz[rows])
    count = np.maximum(np.bincount(position, minlength=len(strip.photos)), 1)
    shift = [np.bincount(position, moved[:, axis], len(strip.photos)) / count for axis in range(3)]
    start = similarity(formed.centers) + np.column_stack(shift), similarity.rotation @ formed.rotations
    focal = np.full(len(strip.photos), strip.camera.principal_distance)
    resection = exterior.resect(observations.xy[used], points, position, focal, start)
    if not resection.solved.any():
        msg = (
            f"strip {strip.id}: no photo can be oriented on its adjusted points: strip and control belong to two worlds"
        )
        raise GeometryError(msg, photos=strip.photos, code="no-photo-oriented")
    return resection, used


def _depth(
    strip: Strip,
    observations: PhotoPoints,
    rows: Numbers,
    formed: FormedStrip,
    adjusted: Floats,
    resection: exterior.Resection,
) -> float:
    place = {photo: n for n, photo in enumerate(strip.photos)}
    position = np.array([place.get(photo, -1) for photo in observations.photo_ids], np.intp)[observations.photo[rows]]
    arm = adjusted[np.searchsorted(formed.point, observations.point[rows])] - resection.centers[position]
    return float(-(arm * resection.rotations[position][:, :, 2]).sum(axis=1).mean())


def _notes(
    strip: Strip,
    oriented: Orientation,
    formed: FormedStrip,
    orientation: absolute_orientation.AbsoluteOrientation,
    correction: polynomial.Polynomial | None,
    adjusted: Floats,
    resection: exterior.Resection,
) -> tuple[Note, ...]:
    """Collect what this strip's numbers say that a surveyor should know."""
    return (
        *_pair_notes(strip, oriented),
        *_joint_notes(strip, formed),
        *control_notes(strip, orientation),
        *polynomial_notes(strip, correction, adjusted),
        *([] if correction is None else covariance.proposal(strip, correction)),
        *_photo_notes(strip, resection),
    )


def _pair_notes(strip: Strip, oriented: Orientation) -> list[Note]:
    notes = []
    for number, count in enumerate(oriented.points_used):
        names = strip.photos[number : number + 2]
        if count == MINIMUM_POINTS:
            text = f"photos {names[0]} and {names[1]} are oriented on 5 points: no check"
            notes.append(Note("no-check", text, strip=strip.id, photos=names))
        if oriented.condition[number] > CONDITION_WARNING:
            text = (
                f"photos {names[0]} and {names[1]}: weak relative orientation (condition number "
                f"{oriented.condition[number]:.0f}); the points stand in a narrow band"
            )
            notes.append(Note("weak-pair", text, strip=strip.id, photos=names))
    return notes


def _screening_notes(strip: Strip, screened: screening.ScreenedPairs, sigma: float) -> list[Note]:
    """Say what the search for gross errors could not settle."""
    notes = []
    scatter = screened.scatter
    if np.isfinite(scatter.found):
        text = (
            f"strip {strip.id}: the y parallaxes scatter as if image coordinates had a standard deviation of "
            f"{scatter.found / np.sqrt(2.0) * 1000:.1f} µm, not the {sigma * 1000:.1f} µm stated; gross errors are "
            "searched for with the larger one"
        )
        notes.append(Note("sigma-contradicted", text, severity="note", strip=strip.id))
    for number in np.flatnonzero(screened.masked):
        names = strip.photos[number : number + 2]
        text = (
            f"photos {names[0]} and {names[1]}: masked errors suspected: the y parallaxes are larger than their "
            "standard deviation allows, and no further point can be rejected; measure the pair again or add points"
        )
        notes.append(Note("masked-errors", text, strip=strip.id, photos=names))
    return notes


def wrong_control_notes(strip: Strip | ModelStrip, wrong: Sequence[control_screening.ControlRejection]) -> list[Note]:
    """Name control that was not used, and what seems to be wrong with it."""
    notes = []
    for each in wrong:
        sizes = dict(zip(control_screening.AXES, each.size, strict=True))
        parts = ", ".join(f"{axis} by about {sizes[axis]:+.2f} m" for axis in each.axes)
        text = (
            f"control point {each.id} contradicts the strip and the other control: {parts} (test value "
            f"{each.value:.1f}, limit {each.limit:.1f}); not used"
        )
        if each.exchanged_with:
            text += f"; it fits when exchanged with {each.exchanged_with}"
        notes.append(Note("control-rejected", text, strip=strip.id, points=(each.id,)))
    return notes


def _joint_notes(strip: Strip, formed: FormedStrip) -> list[Note]:
    junctions = formed.junctions
    count = np.bincount(junctions.junction, junctions.used, len(junctions.factor))
    beyond = np.abs(np.log(junctions.ratio / junctions.factor[junctions.junction])) > junctions.limit
    doubtful = np.unique(junctions.junction[junctions.used & beyond])
    notes = [
        Note(
            "contradicting-joint",
            f"photo {strip.photos[number + 1]}: its pass points contradict each other in the scale of the models, and "
            "which is wrong cannot be told; measure a third pass point",
            strip=strip.id,
            photos=(strip.photos[number + 1],),
        )
        for number in doubtful.tolist()
    ]
    return notes + [
        Note(
            "weak-joint",
            f"photo {strip.photos[number + 1]}: the models on either side are joined by a single pass point: its error "
            "goes into the scale unseen",
            strip=strip.id,
            photos=(strip.photos[number + 1],),
        )
        for number in np.flatnonzero(count == 1)
    ]


def control_notes(strip: Strip | ModelStrip, orientation: absolute_orientation.AbsoluteOrientation) -> list[Note]:
    """Say where the control hardly checks itself, or hardly holds the strip."""
    notes = []
    if orientation.redundancy < 3:
        text = (
            f"strip {strip.id}: the absolute orientation has a redundancy of {orientation.redundancy}: errors of the "
            "control hardly show"
        )
        notes.append(Note("little-control", text, strip=strip.id))
    if orientation.condition > 1 / absolute_orientation.WEAK_LIMIT:
        text = (
            f"strip {strip.id}: the control is nearly on one line: errors of some motion of the strip are "
            f"{orientation.condition:.0f} times those of the others"
        )
        notes.append(Note("weak-control", text, strip=strip.id))
    return notes


def polynomial_notes(
    strip: Strip | ModelStrip, correction: polynomial.Polynomial | None, adjusted: Floats
) -> list[Note]:
    """Say which degree the control did not carry, and where the polynomial is extrapolated."""
    if correction is None:
        return []
    notes = []
    asked = correction.asked
    if asked != "auto" and correction.degree < int(asked):
        text = (
            f"strip {strip.id}: degree {asked} was asked for; the control, {len(correction.axes[0].residuals)} points "
            f"at {correction.stations[0]} stations in plan and {correction.stations[1]} in height, carries degree "
            f"{correction.degree}"
        )
        notes.append(Note("degree-reduced", text, strip=strip.id))
    if correction.degree:
        low, high = correction.reach
        outside = int(((adjusted[:, 0] < low) | (adjusted[:, 0] > high)).sum())
        reach = max(low - float(adjusted[:, 0].min()), float(adjusted[:, 0].max()) - high)
        if outside and reach > 0.1 * (high - low):
            text = (
                f"strip {strip.id}: {outside} points lie up to {reach:.0f} m beyond the control along the strip, where "
                f"the polynomial of degree {correction.degree} is extrapolated"
            )
            notes.append(Note("extrapolation", text, strip=strip.id))
        if min(axis.redundancy for axis in correction.axes) < 3:
            text = f"strip {strip.id}: the polynomial has a redundancy below 3 in an axis: its residuals say little"
            notes.append(Note("little-redundancy", text, strip=strip.id))
    return notes


def _photo_notes(strip: Strip, resection: exterior.Resection) -> list[Note]:
    return [
        Note(
            "not-resected",
            f"photo {strip.photos[number]} could not be oriented on its adjusted points; it keeps its orientation in "
            "the strip",
            strip=strip.id,
            photos=(strip.photos[number],),
        )
        for number in np.flatnonzero(~resection.solved)
    ]
