"""A strip adjusted with its own covariance: from the formed strip and its control to points, photos and tests."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.frozen import dataclass, replace
from photostrip.geometry.rotation import from_vector
from photostrip.points import PhotoPoints
from photostrip.triangulation import absolute_orientation as absolute
from photostrip.triangulation.absolute_orientation import AbsoluteOrientation, Targets
from photostrip.triangulation.covariance_adjustment import conditions as strip_conditions
from photostrip.triangulation.covariance_adjustment import prediction, relinearisation
from photostrip.triangulation.covariance_adjustment import system as strip_system
from photostrip.triangulation.covariance_adjustment.left_out import PointsLeftOut, Without, left_out_errors
from photostrip.triangulation.covariance_adjustment.settings import CovarianceSettings
from photostrip.triangulation.covariance_adjustment.strip_rows import strip_errors
from photostrip.triangulation.covariance_adjustment.strip_rows.derivatives import ErrorRows
from photostrip.triangulation.error_propagation import control_errors
from photostrip.triangulation.error_propagation.image_variance import image_variance
from photostrip.triangulation.relative_orientation.orientation import Orientation
from photostrip.triangulation.strip_formation.strip import FormedStrip

MOST_FORMATIONS = 10
FRESH = 0.05  # radians that a strip may turn before its derivatives are made afresh
# of the variance factor: control that is more than 10 000 times as uncertain as image coordinates without errors leaves
# no digits of the unknowns
LEAST_FACTOR = 1e-8
# of the angle that an image coordinate's standard deviation spans, what squares of turns may leave in the mean of n
# points of a model, which share it: a tenth in a model of 16
ENOUGH = 0.4


@dataclass(frozen=True, eq=False)
class CovarianceFigures:
    """What is told of the adjustment of a strip with its own covariance."""

    control: control_errors.Misclosures  # control coordinates that counted
    tested: prediction.AdjustmentTest  # test of the whole, and of each of these coordinates
    rest: prediction.AdjustmentTest | None  # of the whole without the most doubtful point; None where none is doubtful
    factor: float  # variance factor of the image coordinates
    basis: str  # where it comes from
    sigma: float  # standard deviation of an image coordinate of weight one, mm
    formations: int  # how often the strip was formed
    converged: bool  # whether what squares of the turns leave is small against the image coordinates by then


@dataclass(frozen=True, eq=False)
class CovarianceAdjustment:
    """A strip adjusted with its own covariance, intermediate frame, and the system that says how precise it is."""

    figures: CovarianceFigures
    xyz: Floats  # (q, 3): adjusted points of the strip, metres
    centers: Floats  # (m, 3): perspective centres, metres
    rotations: Floats  # (m, 3, 3): photo to intermediate frame
    control_rows: Numbers  # (c,): points of the strip that the control gives
    system: strip_system.System  # the solved system, with the rows of the strip and the conditions
    # left_out, whole: control of the system that takes no part, when it was left out afterwards; the adjustment with it
    left_out: Without | None = None
    whole: CovarianceAdjustment | None = None

    @property
    def points(self) -> Floats:
        """Covariances (q, 3, 3) of the points, metres^2."""
        if self.left_out is not None:
            return self.of_points(np.arange(len(self.xyz)))
        found = prediction.covariances(self.system, self.system.errors.points)
        found *= self.figures.factor
        return found

    def of_points(self, points: Numbers) -> Floats:
        """Covariances (n, 3, 3) of some of the points, metres^2."""
        rows = self.system.errors.points.take(points)
        if self.left_out is None or self.whole is None:
            return prediction.covariances(self.system, rows) * self.figures.factor
        predicted = self._predicted(points)
        if predicted is not None:
            at = np.arange(len(points))
            return predicted[at, :, at]
        explained = self.left_out.explained(rows)
        return self.whole.of_points(points) + explained @ explained.transpose(0, 2, 1) * self.figures.factor

    def joint_covariance(self, rows: ErrorRows) -> Floats:
        """Covariances (n, n) of rows with d = 1, metres^2."""
        covariance = prediction.joint_covariance(self.system, rows)
        if self.left_out is not None:
            explained = self.left_out.explained(rows)[:, 0]
            covariance += explained @ explained.T
        return covariance * self.figures.factor

    def joint_covariance_at(self, points: Numbers, coordinates: control_errors.Misclosures) -> Floats:
        """Covariances (w, w) of coordinates of some of the points (n,), metres^2."""
        predicted = self._predicted(points)
        if predicted is None:
            rows = self.system.errors.points.take(points[coordinates.point])
            return self.joint_covariance(rows.along(coordinates.direction))
        point, direction = coordinates.point, coordinates.direction
        one = np.einsum("wi,wiqj->wqj", direction, predicted[point])[:, point]
        return np.einsum("wvj,vj->wv", one, direction)

    def _predicted(self, points: Numbers) -> Floats | None:
        """Covariances (n, 3, n, 3) of some of the points; None where not all are control that is left out."""
        if self._points_left_out is None:
            return None
        place = np.full(len(self.xyz), -1)
        place[self.control_rows[self._points_left_out.point]] = np.arange(len(self._points_left_out.point))
        at = place[points]
        return None if (at < 0).any() else self._points_left_out.covariance[at][:, :, at] * self.figures.factor

    @cached_property
    def _points_left_out(self) -> PointsLeftOut | None:
        return None if self.left_out is None else self.left_out.points(self.figures.control, self.figures.factor)

    @cached_property
    def photos(self) -> Floats:
        """Covariances (m, 6, 6) of centre and small rotation of the photos, metres^2 and radians^2."""
        return prediction.covariances(self.system, prediction.photo_rows(self.system)) * self.figures.factor

    def by_control(self, points: Numbers, coordinates: Numbers) -> Floats:
        """Return what errors of control coordinates subtract from points.

        points: (n,), points of the strip.
        coordinates: (c,), rows of ``control``.
        Returns (n, 3, c), derivatives, intermediate frame.
        """
        rows, conditions = self.system.errors.points.take(points), self.system.conditions.of_control(coordinates)
        by_all = prediction.influence(self.system, rows, conditions)
        return by_all if self.left_out is None else by_all - self.left_out.influence(rows, conditions)

    def without(self, coordinates: Numbers) -> CovarianceAdjustment:
        """Leave out control coordinates, given by their rows in ``control``.

        Points, photos and the covariances of points follow; covariances of photos and tests stay those of the whole.

        Raises numpy.linalg.LinAlgError where the others do not determine them.
        """
        left_out = Without.of(self.system, coordinates)
        errors, change = self.system.errors, left_out.change
        images = relinearisation.image_errors(change)
        photos = prediction.photo_errors(change)
        return replace(
            self,
            xyz=self.xyz - prediction.errors(change, errors.points, images),
            centers=self.centers - photos[:, :3],
            rotations=from_vector(-photos[:, 3:]) @ self.rotations,
            left_out=left_out,
            whole=self,
        )


@dataclass(frozen=True, eq=False)
class StripOnControl:
    """A strip as the absolute orientation leaves it: where the adjustment starts."""

    photos: Sequence[str]
    focal: float  # principal distance, mm
    observations: PhotoPoints  # ideal image coordinates of the project
    position: Numbers  # (k,): place in the strip of the photo of every image point; -1 for photos of other strips
    sigma: float  # standard deviation of an image coordinate of weight one, mm
    orientation: Orientation
    formed: FormedStrip
    absolute: AbsoluteOrientation
    targets: Targets  # the control
    control_rows: Numbers  # (n,): its rows in the points of the strip
    errors: strip_errors.StripErrors
    misclosures: control_errors.Misclosures


def adjust(start: StripOnControl, settings: CovarianceSettings) -> CovarianceAdjustment:
    """Distribute the misclosures by prediction, and form the strip anew where that turns it too far.

    Derivatives are those of the strip as it was formed: a correction that turns it by an angle leaves an error of the
    order of its square in the image. While that is more than a part of the scatter of image coordinates, the strip is
    formed of corrected image coordinates, and what is left is distributed.
    """
    found, basis = image_variance(start.orientation, start.sigma)
    factor = max(found, LEAST_FACTOR)
    one, formations = _solved(start, np.broadcast_to(0.0, (len(start.errors.images.row), 2)), settings, factor), 1
    turn = rate = relinearisation.largest_turn(one.system)
    enough = ENOUGH * start.sigma / start.focal / np.sqrt(start.orientation.points_used.mean())
    while formations < MOST_FORMATIONS and turn * rate / 2 > enough:
        fresh = turn > FRESH
        again = _formed_again(one, settings, factor, fresh=fresh)
        if again is None:
            break
        one = again
        turn = relinearisation.largest_turn(one.system)
        formations, rate = formations + 1, turn if fresh else rate
    errors, formed = one.strip.errors, one.strip.formed
    images = relinearisation.image_errors(one.system) - one.images
    photos = prediction.photo_errors(one.system)
    similarity = one.strip.absolute.similarity
    tested = prediction.tested(one.system, settings.level, factor)
    figures = CovarianceFigures(
        control=one.strip.misclosures,
        tested=tested,
        rest=_without_most_doubtful(one, tested, factor),
        factor=factor,
        basis=basis,
        sigma=start.sigma * float(np.sqrt(factor)),
        formations=formations,
        converged=bool(turn * rate / 2 <= enough),
    )
    return CovarianceAdjustment(
        figures=figures,
        xyz=similarity(formed.xyz) - prediction.errors(one.system, errors.points, images),
        centers=similarity(formed.centers) - photos[:, :3],
        rotations=from_vector(-photos[:, 3:]) @ similarity.rotation @ formed.rotations,
        control_rows=start.control_rows,
        system=one.system,
    )


def _without_most_doubtful(
    one: _Linearised, tested: prediction.AdjustmentTest, factor: float
) -> prediction.AdjustmentTest | None:
    """Test the whole without the point to which the most doubtful control coordinate belongs."""
    if not len(tested.doubtful):
        return None
    point = one.strip.misclosures.point
    coordinates = np.flatnonzero(point == point[tested.doubtful[0]])
    (left_out,) = left_out_errors(one.system, [coordinates])
    return replace(
        tested, squares=tested.squares - left_out.squares / factor, redundancy=tested.redundancy - len(coordinates)
    )


@dataclass(frozen=True, eq=False)
class _Linearised:
    """One linear adjustment, at a strip that was formed from image coordinates less the errors known so far."""

    strip: StripOnControl  # as it was formed there, its observations as measured
    images: Floats  # (k, 2): these errors, in units of the stated standard deviations
    system: strip_system.System


def _formed_again(
    before: _Linearised, settings: CovarianceSettings, factor: float, *, fresh: bool
) -> _Linearised | None:
    """Form the strip from corrected image coordinates, and adjust it with the whole errors as unknowns again.

    The derivatives at hand will do, unless the strip has turned too much; then they are made afresh.
    Returns None where rays that have met meet no longer: photos that contradict each other are turned at random.
    """
    strip, targets, rows = before.strip, before.strip.targets, before.strip.control_rows
    images = relinearisation.image_errors(before.system)
    measured = strip.errors.images
    xy = strip.observations.xy.copy()
    xy[measured.row] -= images * measured.sigma
    orientation = relinearisation.oriented_again(strip.orientation, xy)
    observations = replace(strip.observations, xy=xy)
    formed = relinearisation.formed_again(strip.formed, orientation, observations, strip.photos)
    if len(formed.point) < len(strip.formed.point) or np.isnan(formed.xyz).any():
        return None
    # the strip fits its control by now: weights do not matter to where it lies
    oriented = absolute.orient(formed.xyz[rows], targets, targets.control.use.astype(float), formed.xyz)
    kept = replace(formed, model_xyz=np.where(np.isnan(strip.formed.model_xyz), np.nan, formed.model_xyz))
    again = replace(strip, orientation=orientation, formed=kept, absolute=oriented)
    if fresh:
        errors = strip_errors.differentiate_strip(
            orientation, kept, oriented.similarity, strip.position, strip.observations.sigma
        )
        at_control = oriented.similarity(formed.xyz)[rows]
        found = control_errors.misclosures(targets.turned(at_control), rows, oriented.axes)
        return _solved(replace(again, errors=errors, misclosures=found), images, settings, factor)
    found, wanted = strip.misclosures, before.system.conditions
    control = oriented.misclosures[found.point, found.axis]
    value = strip_conditions.misclosures_at(wanted, formed, oriented.similarity, control)
    value += relinearisation.own_displacements(wanted.rows, images)[:, 0]
    known = relinearisation.component_errors(strip.errors, images)
    return _Linearised(again, images, strip_system.solved_for(before.system, value, known))


def _solved(strip: StripOnControl, images: Floats, settings: CovarianceSettings, factor: float) -> _Linearised:
    """Solve the conditions ``w + E v = A y + B u + E v' + g``, v known so far, v' all errors of image coordinates."""
    found = strip.misclosures
    misclosures = strip.absolute.misclosures[found.point, found.axis]
    wanted = strip_conditions.conditions(
        strip.errors, strip.orientation, strip.formed, found, misclosures, distances=settings.distances
    )
    value = wanted.value + relinearisation.own_displacements(wanted.rows, images)[:, 0]
    known = relinearisation.component_errors(strip.errors, images)
    solved = strip_system.system(strip.errors, replace(wanted, value=value), factor, known)
    return _Linearised(strip, images, solved)
