"""The result of a bundle adjustment as the pipeline goes on with it: strips, points, precision, notes, check points."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from photostrip.arrays import Numbers
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.network import defects, hypotheses, reliability
from photostrip.network.cofactors import coordinates_of, joint_cofactors
from photostrip.network.problem import CALIBRATION, BundleProblem
from photostrip.notes import Note
from photostrip.pipeline.common_points import in_output
from photostrip.pipeline.given_points import axes_of, compare_with_given
from photostrip.pipeline.inputs import Inputs
from photostrip.pipeline.results import Adjusted, AdjustedStrips, Bundle, Precision, StripResult, Ties
from photostrip.points import ControlPoints, PhotoPoints
from photostrip.rejection import Rejection
from photostrip.strip.fitted_strip import CheckErrors
from photostrip.strip.resection import of_known_photos

OF_THE_STRIP_METHOD = {  # notes on strips that say nothing of a bundle, which tests and holds all rays itself
    "bundle-proposed",
    "contradicting-joint",
    "control-image",
    "control-rejected",
    "degree-reduced",
    "extrapolation",
    "little-control",
    "little-redundancy",
    "long-strip",
    "masked-errors",
    "no-check",
    "not-resected",
    "rays-not-tested",
    "weak-control",
    "weak-joint",
    "weak-pair",
}


def notes(bundle: Bundle) -> tuple[Note, ...]:
    """Collect the notes on the strips that still mean something, and on the adjustment.

    A strip that was found among photos in no order is a start, and no pair of it the user's.
    """
    of_strips = (note for strip in bundle.start.strips if strip.strip.listed for note in strip.notes)
    return (*(note for note in of_strips if note.code not in OF_THE_STRIP_METHOD), *_of_adjustment(bundle))


def _of_adjustment(bundle: Bundle) -> Iterator[Note]:
    """Say what the surveyor should know of the adjustment."""
    solution = bundle.screened.solution
    if solution.free:
        whose = "are those of the first strip" if bundle.start.free else "come from the start values"
        text = (
            f"neither control nor camera positions are given: a free network, its frame and scale {whose}; its "
            "accuracy is relative only"
        )
        yield Note("free-network", text)
    elif loose := defects.weak(solution.prepared, solution.state):
        yield Note("weak-datum", loose)
    test = bundle.sigma0
    if np.isfinite(test.lower) and not test.passed:
        text = (
            f"sigma0 is {test.sigma0:.3f}; with the stated standard deviations it would lie between {test.lower:.3f} "
            f"and {test.upper:.3f}: they are too {'small' if test.sigma0 > 1 else 'large'}"
        )
        yield Note("unit-weight", text, severity="note")
    yield from _given_notes(bundle)
    kinds, problem = list(CALIBRATION.values()), bundle.screened.problem
    places = [hypotheses.place(problem, each) for each in bundle.screened.common if hypotheses.of_images(each)]
    taken_up = {(problem.camera_ids[camera], kinds[k].title) for camera, columns in places for k in columns}
    for parameter in bundle.parameters:
        if not parameter.significant and (parameter.camera, parameter.name) not in taken_up:
            text = (
                f"camera {parameter.camera}: {parameter.name} is {parameter.value:.3g} {parameter.unit} with a "
                f"standard deviation of {parameter.sigma:.3g}: it does not differ significantly from "
                "zero; leave it out of self_calibration"
            )
            yield Note("calibration-insignificant", text)
    common = set(bundle.screened.problem.common_names())
    for correlation in bundle.correlations:
        if not {correlation.first, correlation.second} & common:
            continue  # within a photo: shift and rotation replace each other in every aerial photo
        text = f"{correlation.first} and {correlation.second} are correlated by {correlation.value:+.3f}"
        yield Note("correlated", text, severity="note")


def _given_notes(bundle: Bundle) -> Iterator[Note]:
    """Name control and camera positions that contradict the rest, whether they were taken out or had to stay."""
    problem = bundle.block.problem
    early = "found in its strip" if bundle.start.strips else "found before the adjustment"
    for each in bundle.screened.rejections:
        if not each.readmitted and each.kind != reliability.IMAGE:
            text, photos, points = _contradiction(problem, each, early)
            text += "; not used"
            yield Note("control-rejected" if points else "position-rejected", text, photos=photos, points=points)
    for each in bundle.screened.held:
        text, photos, points = _contradiction(problem, each, early)
        text += "; it was used: without it the adjustment fails, or half of the control would be out"
        yield Note("control-doubtful" if points else "position-doubtful", text, photos=photos, points=points)


def _contradiction(problem: BundleProblem, each: Rejection, early: str) -> tuple[str, tuple[str, ...], tuple[str, ...]]:
    """Say how far a given coordinate is off; of which photo or point it is. ``early``: where no test found it."""
    axis = ("east (X)", "north (Y)", "up (Z)")[each.axes[0]]
    reached = early
    if np.isfinite(each.value):
        reached = f"test value {each.value:.2f}, limit {each.limit:.2f}"
    if each.kind == reliability.CONTROL:
        name = problem.point_name(int(problem.control.point[each.row]))
        size = f"{axis} by about {each.worst:+.2f} m"
        text = f"control point {name} contradicts the {problem.unit}s and the other control: {size}"
        return f"{text} ({reached})", (), (name,)
    part = problem.positions if each.kind == reliability.POSITION else problem.attitudes
    photo = problem.photo_name(int(part.photo[each.row]))
    if each.kind == reliability.POSITION:
        text = f"the given position of photo {photo} does not fit: {axis} by about {each.worst:+.2f} m"
    else:
        turn = f"{np.degrees(each.worst):+.3f} deg"
        text = f"the given angles of photo {photo} do not fit: about image axis {each.axes[0] + 1} by {turn}"
    return f"{text} ({reached})", (photo,), ()


def adjusted_strips(inputs: Inputs, observations: PhotoPoints, output: GroundFrame, bundle: Bundle) -> AdjustedStrips:
    """Put the solution of a bundle adjustment where the pipeline has its results."""
    block, screened, start = bundle.block, bundle.screened, bundle.start
    solution = screened.solution
    used = block.rows[screened.selection.images]
    rays = np.bincount(observations.point[used], minlength=len(observations.point_ids))
    number = np.flatnonzero(rays)
    cartesian = solution.points[number] + block.origin
    points = in_output(number, cartesian, rays[number], observations.point_ids, output)
    calibrated = _calibrated(observations, bundle)
    count = [len(strip.photos) for strip in inputs.strips]
    first = np.cumsum([0, *count])
    places = [(n, int(first[n])) for n, strip in enumerate(inputs.strips) if len(strip.photos) > 1]
    strips = tuple(
        _strip(strip, begin, calibrated, used, points, bundle)
        for strip, (_, begin) in zip(start.strips, places, strict=True)
    )
    sigma = np.median(block.problem.images.sigma) * bundle.unit
    covariances = bundle.screened.precision.points[number] * bundle.unit**2
    photos = tuple(bundle.photo_covariances[begin : begin + count[n]] for n, begin in places)
    basis = "a-priori" if bundle.unit == 1.0 else "a-posteriori"
    precision = Precision(points=covariances, photos=photos, sigma=(sigma,) * len(strips), basis=(basis,) * len(strips))
    return AdjustedStrips(
        strips=strips,
        points=points,
        ties=Ties.none(),  # a point has one position
        observations=calibrated,
        precision=precision,
        notes=notes(bundle),
        bundle=bundle,
    )


def _calibrated(observations: PhotoPoints, bundle: Bundle) -> PhotoPoints:
    """Image coordinates with the calibration that was found."""
    problem = bundle.block.problem
    if not len(bundle.screened.solution.common):
        return observations
    photo = bundle.start.rows_of(observations.photo_ids)[observations.photo]
    shift = reliability.image_shift(problem, bundle.screened.solution.common, observations.xy, photo)
    return replace(observations, xy=observations.xy + shift)


def _strip(
    strip: StripResult, begin: int, observations: PhotoPoints, used: Numbers, points: Adjusted, bundle: Bundle
) -> StripResult:
    """Return a strip the points and orientations of the bundle, in its own intermediate frame."""
    solution, frame = bundle.screened.solution, strip.intermediate
    photos = strip.strip.photos
    numbers = slice(begin, begin + len(photos))
    centers = frame.intermediate_from_cartesian(solution.centers[numbers] + bundle.block.origin)
    rotations = frame.intermediate_rotations(solution.rotations[numbers])
    position = strip.of_photos.strip.positions(observations)
    rows = used[position[used] >= 0]
    rows = rows[np.argsort(position[rows], kind="stable")]
    measured = np.zeros(len(observations.point_ids), bool)
    measured[observations.point[position >= 0]] = True
    inside = measured[points.number]
    number, cartesian = points.number[inside], points.cartesian[inside]
    xyz = frame.intermediate_from_cartesian(cartesian)
    formed = strip.of_photos.formed
    at = np.minimum(np.searchsorted(formed.point, number), len(formed.point) - 1)
    known = formed.point[at] == number
    models = np.where(known, formed.model_count[at], 0)
    shape = np.where(known[:, None], formed.xyz[at], np.nan)
    control_at = np.searchsorted(number, formed.point[strip.control_rows])
    at_rows = np.searchsorted(number, observations.point[rows])
    oriented = strip.of_photos.strip.oriented(centers, rotations)
    resection = of_known_photos(observations.xy, xyz, position[rows], oriented, rows, at_rows)
    stages = replace(
        strip.of_photos,
        formed=replace(formed, point=number, xyz=shape, model_count=models),
        resection=resection,
        rows=rows,
    )
    return replace(
        strip,
        control_rows=np.minimum(control_at, len(number) - 1),
        xyz=xyz,
        cartesian=cartesian,
        rays=points.rays[inside],
        polynomial=None,
        photo_stages=stages,
    )


MOST_TESTED = 40  # check points that are tested together; in a block of 400 photos 60 of them take 11 % of a run


def check_errors(
    bundle: Bundle, adjusted: AdjustedStrips, given: ControlPoints, frames: Sequence[GroundFrame]
) -> CheckErrors | None:
    """Compare a bundle adjustment with its check points; None without any."""
    points = adjusted.points
    places, differences = compare_with_given(given, frames, points, adjusted.observations)
    rows = np.flatnonzero(given.check & np.isfinite(differences).any(axis=1))
    if not len(rows):
        return None
    if len(rows) > MOST_TESTED:
        rows = rows[np.linspace(0, len(rows) - 1, MOST_TESTED).round().astype(int)]
    rows = rows[np.argsort(places[rows], kind="stable")]
    at = places[rows]
    axes = axes_of(given.frame[rows], frames, points.cartesian[at])
    solution = bundle.screened.solution
    joint = (
        joint_cofactors(solution, coordinates_of(solution, points.number[at])).reshape(len(at), 3, len(at), 3)
        * bundle.unit**2
    )
    turned = np.einsum("iap,ipjq,jbq->iajb", axes, joint, axes).reshape(3 * len(at), 3 * len(at))
    difference = differences[rows].ravel()
    known = np.flatnonzero(np.isfinite(difference))
    covariance = turned[np.ix_(known, known)] + np.diag(given.sigma[rows].ravel()[known] ** 2)
    return CheckErrors(
        ids=given.take(rows).ids,
        point=known // 3,
        axis=known % 3,
        difference=difference[known],
        covariance=covariance,
    )
