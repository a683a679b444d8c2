"""Points of all strips together: the mean where strips share a point, and their differences there.

Points that were measured and have no coordinates.

Errors at check points against what the covariances let expect of all of them together.

How precise points and photos of one strip are, and of all strips together.

How precise points and photos of a strip of photos are: covariances from the image coordinates.

Joint covariances of points of a run: what the difference of two of them, or a mean of several, is good for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.errors import Fault, InputError
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.network.reliability import coordinates_of, joint_cofactors
from photostrip.pipeline.given_points import rows_of_given
from photostrip.pipeline.inputs import Inputs, Settings
from photostrip.pipeline.results import Adjusted, AdjustedStrips, Precision, Result, StripResult, Ties
from photostrip.pipeline.strip_method import OrientedStrip, ScreenedStrip
from photostrip.pipeline.strip_notes import precision_of_long_strip
from photostrip.plausibility.ids import TiesOfStrips
from photostrip.points import ControlPoints, PhotoPoints
from photostrip.strip import absolute_orientation, fitted_strip
from photostrip.strip.fitted_strip import (
    CheckErrors,
    FittedStrip,
    Misclosures,
    PhotoErrors,
    differentiate_photos,
    image_variance,
)
from photostrip.strip.strip_errors import StripErrors, differentiate_strip


def join_photos(
    strips: tuple[StripResult, ...],
    screened: Sequence[ScreenedStrip],
    observations: PhotoPoints,
    given: ControlPoints,
    output: GroundFrame,
    settings: Settings,
    *,
    of_checks: bool,
) -> AdjustedStrips:
    """Join strips of photos that were adjusted each by itself, with their precision.

    screened: the same strips before their deformation was corrected.
    given: all given points, check points too.
    of_checks: whether the precision of check points alone is wanted.
    """
    joined = join_strips(strips, observations, output)
    long_strips = [strip for strip in strips if too_long(strip) and not of_checks]
    if long_strips or not settings.precision:
        notes = (precision_of_long_strip(strip.of_photos.strip, MOST_PHOTOS) for strip in long_strips)
        return replace(joined, notes=(*notes, *joined.notes)) if settings.precision else joined
    each = [
        precision_of_photos(strip, before.oriented, observations, given, of_checks=of_checks)
        for strip, before in zip(strips, screened, strict=True)
    ]
    return replace(joined, precision=joined_precision(each, strips, joined.points))


def join_strips(strips: tuple[StripResult, ...], observations: PhotoPoints, output: GroundFrame) -> AdjustedStrips:
    """Join strips that were adjusted each by itself."""
    return AdjustedStrips(
        strips=strips,
        points=_joined(strips, observations.point_ids, output),
        ties=_ties(strips, output),
        observations=observations,
        precision=None,
        notes=tuple(note for strip in strips for note in strip.notes),
    )


class StripMeans(NamedTuple):
    """Points of several strips."""

    number: Numbers  # (n,): as numbered in the observations, ascending
    xyz: Floats  # (n, 3): mean over the strips that hold them, Cartesian frame, metres


def mean_points(strips: Sequence[StripResult], strangers: Mapping[str, AbstractSet[int]] | None = None) -> StripMeans:
    """Mean of every point over the strips that hold it.

    strangers: points by strip that do not count there.
    """
    if len(strips) == 1 and not strangers:  # no copy of the points
        return StripMeans(strips[0].formed.point, strips[0].cartesian)
    none: AbstractSet[int] = frozenset()
    held = [~np.isin(each.formed.point, list((strangers or {}).get(each.strip.id, none))) for each in strips]
    point = np.concatenate([strip.formed.point[rows] for strip, rows in zip(strips, held, strict=True)])
    cartesian = np.concatenate([strip.cartesian[rows] for strip, rows in zip(strips, held, strict=True)])
    number, inverse = np.unique(point, return_inverse=True)
    sums = np.column_stack([np.bincount(inverse, column) for column in cartesian.T])
    return StripMeans(number, np.asarray(sums / np.bincount(inverse)[:, None], float))


def compared_strips(strips: Sequence[StripResult], point_ids: Sequence[str]) -> Iterator[TiesOfStrips]:
    """Compare strips two and two at their common points, before anything joins them."""
    for one, other in combinations(strips, 2):
        number, at_one, at_other = np.intersect1d(one.formed.point, other.formed.point, return_indices=True)
        frame = one.intermediate
        first, second = (
            frame.intermediate_from_cartesian(strip.cartesian[rows])
            for strip, rows in ((one, at_one), (other, at_other))
        )
        yield TiesOfStrips(
            points=number,
            names=tuple(point_ids[each] for each in number.tolist()),
            plan=first[:, :2],
            difference=(second - first)[:, :2],
            rays=np.minimum(one.rays[at_one], other.rays[at_other]),
            sigma=float(np.hypot(one.precision.plan, other.precision.plan)),
            depth=min(one.depth, other.depth),
            strips=(one.strip.id, other.strip.id),
        )


def _joined(strips: Sequence[StripResult], point_ids: Sequence[str], output: GroundFrame) -> Adjusted:
    number, xyz = mean_points(strips)
    rays = np.zeros(len(number), np.intp)
    for strip in strips:
        rays[np.searchsorted(number, strip.formed.point)] += strip.rays
    return in_output(number, xyz, rays, point_ids, output)


def in_output(
    number: Numbers, cartesian: Floats, rays: Numbers, point_ids: Sequence[str], output: GroundFrame
) -> Adjusted:
    """Give adjusted points their coordinates in the output frame; number (n,) counts in ``point_ids``."""
    ground = output.ground_from_cartesian(cartesian, ids=[point_ids[n] for n in number])
    return Adjusted(number=number, cartesian=cartesian, ground=ground, rays=rays)


def _ties(strips: Sequence[StripResult], output: GroundFrame) -> Ties:
    if len(strips) == 1:
        return Ties(np.zeros(0, np.intp), np.zeros((0, 2), np.intp), np.zeros((0, 3)))
    strip = np.concatenate([np.full(len(each.formed.point), number) for number, each in enumerate(strips)])
    point = np.concatenate([each.formed.point for each in strips])
    cartesian = np.concatenate([each.cartesian for each in strips])
    order = np.lexsort((strip, point))
    strip, point, cartesian = strip[order], point[order], cartesian[order]
    second = np.flatnonzero(point[1:] == point[:-1]) + 1
    difference = cartesian[second] - cartesian[second - 1]
    if len(second):
        difference = np.einsum("nij,nj->ni", output.axes_at(cartesian[second]), difference)
    return Ties(point[second], np.column_stack([strip[second - 1], strip[second]]), difference)


def not_determined(adjusted: AdjustedStrips, inputs: Inputs) -> dict[str, str]:
    """Points that were measured and have no coordinates, with the reason."""
    observations = adjusted.observations
    done = np.zeros(len(observations.point_ids), bool)
    done[adjusted.points.number] = True
    if inputs.models is not None:
        why = "coordinates in the models contradict each other, or were left out"
        return {observations.point_ids[number]: why for number in np.flatnonzero(~done).tolist()}
    placed = {photo: (n, k) for n, strip in enumerate(inputs.strips) for k, photo in enumerate(strip.photos)}
    wrong = [each for strip in adjusted.strips for each in strip.of_photos.wrong_rays]
    contradicted = {int(observations.point[each.row]): each.kind == "control" for each in wrong}
    if adjusted.bundle is not None:  # of any two photos
        in_network = np.bincount(observations.point[adjusted.bundle.block.rows])
        contradicted = dict.fromkeys(np.flatnonzero(in_network > 1).tolist(), False) | contradicted
    on_photos: dict[int, list[tuple[int, int]]] = {}
    for row in np.flatnonzero(~done[observations.point]):
        photo = observations.photo_ids[observations.photo[row]]
        if photo in placed:
            on_photos.setdefault(int(observations.point[row]), []).append(placed[photo])
    return {
        observations.point_ids[point]: _reason(places, by_control=contradicted.get(point))
        for point, places in sorted(on_photos.items())
    }


def _reason(places: list[tuple[int, int]], *, by_control: bool | None) -> str:
    """Put it in words; by_control: whether its given coordinates contradict a ray, None where nothing does."""
    if len(places) == 1:
        return "measured on one photo only"
    if by_control is not None:
        return "its given coordinates contradict one of its two rays" if by_control else "rays contradict each other"
    neighbours = any((n, k + 1) in places for n, k in places)
    return "rejected in every pair" if neighbours else "not on two neighbouring photos of one strip"


MOST_TESTED = 100  # check points of a strip that are tested together, spread over it


class CheckPoints(NamedTuple):
    """Check points that a strip holds, along it."""

    control: ControlPoints  # all given points
    chosen: Numbers  # (c,): rows of the check points there
    rows: Numbers  # (c,): their rows in ``strip.formed.point``

    @property
    def points(self) -> ControlPoints:
        return self.control.take(self.chosen)

    def spread(self) -> CheckPoints:
        """Those that are tested together."""
        count = len(self.rows)
        if count <= MOST_TESTED:
            return self
        some = np.linspace(0, count - 1, MOST_TESTED).round().astype(int)
        return self._replace(chosen=self.chosen[some], rows=self.rows[some])


def check_points(strip: StripResult, control: ControlPoints, observations: PhotoPoints) -> CheckPoints:
    """Check points of a strip among all given points; the observations name its points."""
    rows = rows_of_given(control.ids, strip.formed.point, observations.point_ids)
    found = np.flatnonzero(control.check & (rows >= 0) & control.use.any(axis=1))
    found = found[np.argsort(strip.xyz[rows[found], 0], kind="stable")]
    return CheckPoints(control, found, rows[found])


@dataclass(frozen=True, eq=False)
class CheckDifferences:
    """How a strip differs from its check points."""

    checks: CheckPoints
    coordinates: Misclosures
    difference: Floats  # (w,): adjusted minus given, metres


def compare_with_checks(
    strip: StripResult, checks: CheckPoints, frames: Sequence[GroundFrame]
) -> CheckDifferences | None:
    """Compare a strip with its check points, in the ground frames of the given points; None without any."""
    if not len(checks.rows):
        return None
    xyz = strip.xyz[checks.rows]
    targets = absolute_orientation.Targets(checks.points, frames, strip.intermediate)
    axes = targets.axes(xyz)
    found = fitted_strip.misclosures(targets.turned(xyz), checks.rows, axes)
    return CheckDifferences(checks, found, targets.misclosures(xyz, axes)[found.point, found.axis])


def by_fit(found: FittedStrip, compared: CheckDifferences) -> CheckErrors:
    """Return the errors at the check points of a strip that was fitted to the control."""
    at = compared.coordinates
    return errors_at_checks(compared, found.joint_covariance(at.row, at.direction))


def errors_at_checks(compared: CheckDifferences, covariance: Floats) -> CheckErrors:
    """Return all differences; their covariance is that of the adjusted coordinates and of the given ones."""
    return CheckErrors(
        ids=compared.checks.points.ids,
        point=compared.coordinates.point,
        axis=compared.coordinates.axis,
        difference=compared.difference,
        covariance=covariance + np.diag(compared.coordinates.variance),
    )


AT_A_TIME = 100  # control coordinates that two strips share, looked at together


@dataclass(frozen=True, eq=False)
class StripPrecision:
    """Covariances of one strip in the axes of the Cartesian frame."""

    points: Floats  # (q, 3, 3): of the points of the strip, metres^2
    photos: Floats  # (m, 6, 6): of centre and small rotation of its photos; NaN where a photo could not be oriented
    # takes rows of points (n,) and of control coordinates (c,), gives what errors of these coordinates subtract from
    # these points, (n, 3, c), in the same axes
    by_control: Callable[[Numbers, Numbers], Floats]
    # (w, 2): the control coordinates that count: the control point's number among the image points' ids, and its ground
    # axis
    control: Numbers
    variance: Floats  # (w,): their variances, metres^2
    sigma: float  # standard deviation of an image coordinate of weight one, mm
    basis: str  # where that comes from
    check: CheckErrors | None  # errors at the strip's check points, with their covariance


def joined_precision(strips: Sequence[StripPrecision], results: Sequence[StripResult], points: Adjusted) -> Precision:
    """Precision of all strips together."""
    return Precision(
        points=_means(strips, results, points.number),
        photos=tuple(strip.photos for strip in strips),
        sigma=tuple(strip.sigma for strip in strips),
        basis=tuple(strip.basis for strip in strips),
        checks=tuple(strip.check for strip in strips),
    )


def _means(strips: Sequence[StripPrecision], results: Sequence[StripResult], number: Numbers) -> Floats:
    """Covariances (n, 3, 3) of the points of all strips; a point of several strips is their mean.

    Strips have no image coordinate in common; what their points share are the errors of common control.
    """
    if len(strips) == 1:
        return strips[0].points
    rows = [np.searchsorted(number, result.formed.point) for result in results]
    count = np.bincount(np.concatenate(rows), minlength=len(number))
    total = np.zeros((len(number), 3, 3))
    for row, strip in zip(rows, strips, strict=True):
        total[row] += strip.points
    for (row_a, a), (row_b, b) in combinations(zip(rows, strips, strict=True), 2):
        shared, in_a, in_b = np.intersect1d(row_a, row_b, return_indices=True)
        _, of_a, of_b = np.intersect1d(_keys(a), _keys(b), return_indices=True)
        if not len(shared):
            continue
        for start in range(0, len(of_a), AT_A_TIME):
            part = slice(start, start + AT_A_TIME)
            by_a, by_b = a.by_control(in_a, of_a[part]), b.by_control(in_b, of_b[part])
            mixed = (by_a * a.variance[of_a[part]]) @ by_b.transpose(0, 2, 1)
            total[shared] += mixed + mixed.transpose(0, 2, 1)
    total /= (count**2)[:, None, None]
    return total


def _keys(strip: StripPrecision) -> Numbers:
    """One number for each control coordinate."""
    return np.asarray(strip.control[:, 0] * 3 + strip.control[:, 1], np.intp)


MOST_PHOTOS = 400  # of a strip fitted to its control: the work grows by the square of their number, to 1 s


def precision_of_photos(
    strip: StripResult,
    oriented: OrientedStrip,
    observations: PhotoPoints,
    given: ControlPoints,
    *,
    of_checks: bool,
) -> StripPrecision:
    """Covariances of one strip of photos, or ``of_checks`` alone.

    oriented: the same strip before its deformation was corrected.
    observations: ideal image coordinates of the project.
    given: all given points; the check points among them are compared with what is found.
    """
    checks = check_points(strip, given, observations)
    compared = compare_with_checks(strip, checks.spread(), oriented.frames)
    points = np.full((len(strip.xyz), 3, 3), np.nan)
    photos = np.full((len(strip.strip.photos), 6, 6), np.nan)
    stated = strip.of_photos.sigma
    factor, basis = image_variance(strip.of_photos.orientation, stated)
    found = fitted(strip, oriented, observations, factor)
    if of_checks:
        points[checks.rows] = found.covariances_of_points(checks.rows)
    else:
        points = found.covariances_of_points(np.arange(len(points)))
        solved = np.flatnonzero(strip.resection.solved)
        by_photo = photo_errors(strip, found.errors, observations)
        photos[solved] = found.covariances_of_photos(by_photo, solved)
    axes, fit = strip.intermediate.axes, found.fit
    return StripPrecision(
        points=axes @ points @ axes.T,
        photos=_turned(strip, photos),
        by_control=lambda rows, columns: axes @ fit.influence(found.xyz[rows]) @ fit.operator[:, columns],
        control=_control_of(strip, found.control.point, found.control.axis),
        variance=found.control.variance,
        sigma=stated * float(np.sqrt(factor)),
        basis=basis,
        check=None if compared is None else by_fit(found, compared),
    )


def too_long(strip: StripResult) -> bool:
    """Whether a strip was fitted to its control that has too many photos for the covariances of all its points."""
    return not strip.is_of_models and len(strip.strip.photos) > MOST_PHOTOS


def _control_of(strip: StripResult, point: Numbers, axis: Numbers) -> Numbers:
    return np.column_stack([strip.formed.point[strip.control_rows][point], axis])


def _turned(strip: StripResult, photos: Floats) -> Floats:
    """Covariances of photos from the intermediate to the Cartesian frame."""
    turn = np.zeros((6, 6))
    turn[:3, :3] = turn[3:, 3:] = strip.intermediate.axes
    return turn @ photos @ turn.T


def fitted(strip: StripResult, oriented: OrientedStrip, observations: PhotoPoints, factor: float) -> FittedStrip:
    """Carry the errors of a strip over the fit to its control, before which it was ``oriented``."""
    terms = [axis.terms for axis in strip.polynomial.axes] if strip.polynomial else [(), (), ()]
    photos, control = strip.of_photos, oriented.misclosures
    similarity = oriented.absolute.similarity
    errors = differentiate_strip(photos.orientation, photos.formed, similarity, observations.sigma)
    fit = fitted_strip.fit_operator(control, oriented.weights, oriented.at_control, terms, errors.origin)
    return FittedStrip(errors=errors, control=control, fit=fit, xyz=oriented.xyz, factor=factor)


def photo_errors(strip: StripResult, errors: StripErrors, observations: PhotoPoints) -> PhotoErrors:
    """Differentiate the orientation of the photos on their adjusted points."""
    rows = strip.rows
    photo = strip.of_photos.strip.positions(observations)[rows]
    point = np.searchsorted(strip.formed.point, observations.point[rows])
    return differentiate_photos(errors, strip.resection, strip.xyz, photo, point, rows)


def joint_covariance(result: Result, rows: Numbers) -> Floats:
    """Joint covariances (n, 3, n, 3) of points of ``result.points``, metres^2.

    They stand along east, north and up at each point, or along the axes of a geocentric output.
    Raises InputError after any other adjustment than a bundle, and of a free network.
    """
    ascending, back = np.unique(rows, return_inverse=True)
    cartesian = result.points.cartesian[ascending]
    level = result.output.level_axes_at(cartesian)
    axes = np.broadcast_to(np.eye(3), level.shape) if result.output.kind == "geocentric" else level
    return _of_bundle(result, ascending, axes)[back][:, :, back]


def _of_bundle(result: Result, rows: Numbers, axes: Floats) -> Floats:
    if result.bundle is None:
        raise _refused("only a bundle adjustment keeps joint covariances", "set processing.adjustment to bundle")
    if result.bundle.start.free:
        raise _refused("a free network has no covariances on the ground", "tie it to the ground")
    solution = result.bundle.screened.solution
    joint = joint_cofactors(solution, coordinates_of(solution, result.points.number[rows])) * result.bundle.unit**2
    turned: Floats = np.einsum("iap,ipjq,jbq->iajb", axes, joint.reshape(len(rows), 3, len(rows), 3), axes)
    return turned


def _refused(message: str, fix: str) -> InputError:
    return InputError(Fault(message, "no-joint-covariance", fix=fix))
