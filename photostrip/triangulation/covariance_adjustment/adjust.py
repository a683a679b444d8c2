"""A strip adjusted with its own covariance: from the formed strip and its control to points, photos and tests."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.geometry.rotation import from_vector
from photostrip.triangulation import absolute_orientation as absolute
from photostrip.triangulation.covariance_adjustment import conditions as strip_conditions
from photostrip.triangulation.covariance_adjustment import prediction, relinearisation
from photostrip.triangulation.covariance_adjustment import system as strip_system
from photostrip.triangulation.error_propagation import control_errors, strip_errors
from photostrip.triangulation.error_propagation.covariances import image_variance

if TYPE_CHECKING:
    from collections.abc import Sequence

    from photostrip.arrays import Floats, Numbers
    from photostrip.points import PhotoPoints
    from photostrip.triangulation.absolute_orientation import AbsoluteOrientation, Targets
    from photostrip.triangulation.covariance_adjustment.settings import CovarianceSettings
    from photostrip.triangulation.relative_orientation.orientation import Orientation
    from photostrip.triangulation.strip_formation.strip import FormedStrip


MOST_FORMATIONS = 10
FRESH = 0.05  # radians that a strip may turn before its derivatives are made afresh
ENOUGH = 0.1  # of the angle that an image coordinate's standard deviation spans: what squares of turns may leave


@dataclass(frozen=True, eq=False)
class CovarianceAdjustment:
    """What the adjustment of a strip with its own covariance found, intermediate frame."""

    xyz: Floats  # (q, 3): adjusted points of the strip, metres
    centers: Floats  # (m, 3): perspective centres, metres
    rotations: Floats  # (m, 3, 3): photo to intermediate frame
    points: Floats  # (q, 3, 3): covariances of the points, metres^2
    photos: Floats  # (m, 6, 6): covariances of centre and small rotation of the photos
    control: control_errors.Misclosures  # control coordinates that counted
    tested: prediction.AdjustmentTest  # test of the whole, and of each of these coordinates
    factor: float  # variance factor of the image coordinates
    basis: str  # where it comes from
    sigma: float  # standard deviation of an image coordinate of weight one, mm
    system: strip_system.System  # the solved system, with the rows of the strip and the conditions
    formations: int  # how often the strip was formed

    def by_control(self, points: Numbers, coordinates: Numbers) -> Floats:
        """Return what errors of control coordinates subtract from points.

        points: (n,), points of the strip.
        coordinates: (c,), rows of ``control``.
        Returns (n, 3, c), derivatives, intermediate frame.
        """
        rows = self.system.errors.points.take(points)
        return prediction.influence(self.system, rows, self.system.conditions.of_control(coordinates))


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
    """Adjust a strip with its own covariance."""
    factor, basis = image_variance(start.orientation, start.sigma)
    run = _Adjustment(start, settings, factor)
    one, formations = run.first(), 1
    turn = rate = relinearisation.largest_turn(one.system)
    while formations < MOST_FORMATIONS and turn * rate / 2 > ENOUGH * start.sigma / start.focal:
        one, fresh = run.next(one, fresh=turn > FRESH), turn > FRESH
        turn = relinearisation.largest_turn(one.system)
        formations, rate = formations + 1, turn if fresh else rate
    errors = one.system.errors
    tables = [errors.points, prediction.photo_rows(errors)]
    (points, photos), cofactors = prediction.predict(one.system, tables)
    known = [relinearisation.displacements(errors, rows, one.images) for rows in tables]
    left = photos.error - known[1]
    similarity = one.absolute.similarity
    return CovarianceAdjustment(
        xyz=similarity(one.formed.xyz) - (points.error - known[0]),
        centers=similarity(one.formed.centers) - left[:, :3],
        rotations=from_vector(-left[:, 3:]) @ similarity.rotation @ one.formed.rotations,
        points=points.covariance * factor,
        photos=photos.covariance * factor,
        control=one.control,
        tested=prediction.tested(one.system, cofactors, len(one.control.point)),
        factor=factor,
        basis=basis,
        sigma=start.sigma * float(np.sqrt(factor)),
        system=one.system,
        formations=formations,
    )


@dataclass(frozen=True, eq=False)
class _Linearised:
    """One linear adjustment, at a strip that was formed from image coordinates less the errors known so far.

    ``images`` are these errors, in units of the stated standard deviations.
    """

    orientation: Orientation
    formed: FormedStrip
    absolute: AbsoluteOrientation
    images: Floats
    control: control_errors.Misclosures
    system: strip_system.System


@dataclass(frozen=True, eq=False)
class _Adjustment:
    """What all linearisations have in common."""

    start: StripOnControl
    settings: CovarianceSettings
    factor: float  # variance factor of the image coordinates

    def first(self) -> _Linearised:
        """Linearise where the absolute orientation left the strip."""
        start = self.start
        images = np.zeros((len(start.errors.images.row), 2))
        return self._solved(start.orientation, start.formed, start.absolute, start.errors, start.misclosures, images)

    def next(self, before: _Linearised, *, fresh: bool) -> _Linearised:
        """Form the strip from corrected image coordinates, and adjust it with the whole errors as unknowns again.

        The derivatives at hand will do, unless the strip has turned too much; then they are made afresh.
        """
        start, targets, rows = self.start, self.start.targets, self.start.control_rows
        images = relinearisation.image_errors(before.system)
        measured = before.system.errors.images
        xy = start.observations.xy.copy()
        xy[measured.row] -= images * measured.sigma
        orientation = relinearisation.oriented_again(before.orientation, xy)
        observations = replace(start.observations, xy=xy)
        formed = relinearisation.formed_again(before.formed, orientation, observations, start.photos)
        # the strip fits its control by now: weights do not matter to where it lies
        oriented = absolute.orient(formed.xyz[rows], targets, targets.control.use.astype(float), formed.xyz)
        lost = np.isnan(before.formed.model_xyz)
        if fresh:
            formed = replace(formed, model_xyz=np.where(lost, np.nan, formed.model_xyz))
            errors = strip_errors.differentiate_strip(
                orientation, formed, oriented.similarity, start.position, start.observations.sigma
            )
            at_control = oriented.similarity(formed.xyz)[rows]
            found = control_errors.misclosures(
                errors.points, targets.turned(at_control), rows, targets.axes(at_control)
            )
            return self._solved(orientation, formed, oriented, errors, found, images)
        found, wanted = before.control, before.system.conditions
        control = oriented.misclosures[found.point, found.axis]
        value = strip_conditions.misclosures_at(wanted, formed, oriented.similarity, control)
        value += relinearisation.displacements(before.system.errors, wanted.rows, images)[:, 0]
        return replace(
            before,
            orientation=orientation,
            formed=replace(formed, model_xyz=np.where(lost, np.nan, formed.model_xyz)),
            absolute=oriented,
            images=images,
            system=strip_system.solved_for(before.system, replace(wanted, value=value)),
        )

    def _solved(
        self,
        orientation: Orientation,
        formed: FormedStrip,
        oriented: AbsoluteOrientation,
        errors: strip_errors.StripErrors,
        found: control_errors.Misclosures,
        images: Floats,
    ) -> _Linearised:
        """Solve the conditions ``w + H v = A y + H v' + g``, v known so far, v' all errors of the image coordinates."""
        misclosures = oriented.misclosures[found.point, found.axis]
        wanted = strip_conditions.conditions(
            errors, orientation, formed, found, misclosures, distances=self.settings.distances
        )
        if images.any():
            known = relinearisation.displacements(errors, wanted.rows, images)[:, 0]
            wanted = replace(wanted, value=wanted.value + known)
        return _Linearised(
            orientation=orientation,
            formed=formed,
            absolute=oriented,
            images=images,
            control=found,
            system=strip_system.system(errors, wanted, self.factor),
        )
