"""A strip adjusted with its own covariance: from the formed strip and its control to points, photos and tests."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.geodesy.frame_spec import GROUND_AXES
from photostrip.geometry.rotation import from_vector
from photostrip.notes import Note
from photostrip.triangulation import absolute_orientation as absolute
from photostrip.triangulation.covariance_adjustment import conditions as strip_conditions
from photostrip.triangulation.covariance_adjustment import prediction, relinearisation
from photostrip.triangulation.covariance_adjustment import system as strip_system
from photostrip.triangulation.error_propagation import control_errors, strip_errors
from photostrip.triangulation.error_propagation.covariances import image_variance
from photostrip.triangulation.resection import resection as exterior
from photostrip.triangulation.resection.collinearity import project

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.pipeline.inputs import Strip
    from photostrip.points import ControlPoints, PhotoPoints
    from photostrip.triangulation.absolute_orientation import AbsoluteOrientation, Targets
    from photostrip.triangulation.polynomial.correction import Polynomial
    from photostrip.triangulation.relative_orientation.orientation import Orientation
    from photostrip.triangulation.strip_formation.strip import FormedStrip

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]


LONG_STRIP = 25  # models; beyond it polynomials fall far behind a rigorous adjustment
POLYNOMIAL_MODELS = 15  # models from which on, and
POLYNOMIAL_BANDS = 4  # bands of control below which the adjustment with the covariance is proposed
LEVEL = 0.01  # of the test of the whole
MOST_PASSES = 10
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
    passes: int  # how often the strip was formed

    def by_control(self, points: Numbers, coordinates: Numbers) -> Floats:
        """Return what errors of control coordinates subtract from points.

        Parameters
        ----------
        points : ndarray of int, shape (n,)
            Points of the strip.
        coordinates : ndarray of int, shape (c,)
            Rows of ``control``.

        Returns
        -------
        ndarray, shape (n, 3, c)
            Derivatives, intermediate frame.
        """
        rows = self.system.errors.points.take(points)
        return prediction.influence(self.system, rows, self.system.conditions.of_control(coordinates))


def adjust(
    strip: Strip,
    formed: tuple[Orientation, FormedStrip, AbsoluteOrientation],
    control: tuple[Targets, Numbers],
    observations: PhotoPoints,
    sigma: float,
    settings: strip_conditions.CovarianceSettings,
) -> CovarianceAdjustment:
    """Adjust a strip with its own covariance.

    Parameters
    ----------
    formed : tuple of Orientation, FormedStrip and AbsoluteOrientation
        Oriented pairs, the strip formed from them, and its similarity to the intermediate frame.
    control : tuple of Targets and ndarray of int
        The control, and its rows in the points of the strip.
    observations : PhotoPoints
        Ideal image coordinates of the project.
    sigma : float
        Standard deviation of an image coordinate of weight one, mm.
    settings : strip_conditions.CovarianceSettings
        Which misclosures are distributed.

    Returns
    -------
    CovarianceAdjustment
        Points, photos, covariances and tests.
    """
    given = _Given(strip, control, observations, measured(strip, observations), settings)
    factor, basis = image_variance(formed[0], sigma)
    one, passes = _first(given, formed, factor), 1
    turn = rate = relinearisation.largest_turn(one.system)
    while passes < MOST_PASSES and turn * rate / 2 > ENOUGH * sigma / strip.camera.principal_distance:
        one, fresh = _next(given, one, factor, fresh=turn > FRESH), turn > FRESH
        turn = relinearisation.largest_turn(one.system)
        passes, rate = passes + 1, turn if fresh else rate
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
        sigma=sigma * float(np.sqrt(factor)),
        system=one.system,
        passes=passes,
    )


@dataclass(frozen=True, eq=False)
class _Given:
    """What all linearisations have in common: strip, control, image points, the places of their photos, settings."""

    strip: Strip
    control: tuple[Targets, Numbers]
    observations: PhotoPoints
    position: Numbers
    settings: strip_conditions.CovarianceSettings


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


def _first(given: _Given, formed: tuple[Orientation, FormedStrip, AbsoluteOrientation], factor: float) -> _Linearised:
    errors = strip_errors.differentiate_strip(
        formed[0], formed[1], formed[2].similarity, given.position, given.observations.sigma
    )
    return _solved(given, formed, errors, np.zeros((len(errors.images.row), 2)), factor)


def _next(given: _Given, before: _Linearised, factor: float, *, fresh: bool) -> _Linearised:
    """Form the strip from corrected image coordinates, and adjust it with the whole errors as unknowns again.

    The derivatives at hand will do, unless the strip has turned too much; then they are made afresh.
    """
    images = relinearisation.image_errors(before.system)
    seen = before.system.errors.images
    xy = given.observations.xy.copy()
    xy[seen.row] -= images * seen.sigma
    orientation = relinearisation.oriented_again(before.orientation, xy)
    observations = replace(given.observations, xy=xy)
    formed = relinearisation.formed_again(before.formed, orientation, observations, given.strip.photos)
    targets, rows = given.control
    # the strip fits its control by now: weights do not matter to where it lies
    oriented = absolute.orient(formed.xyz[rows], targets, targets.control.use.astype(float), formed.xyz)
    if fresh:
        position, sigma = given.position, given.observations.sigma
        formed = replace(formed, model_xyz=np.where(np.isnan(before.formed.model_xyz), np.nan, formed.model_xyz))
        errors = strip_errors.differentiate_strip(orientation, formed, oriented.similarity, position, sigma)
        return _solved(given, (orientation, formed, oriented), errors, images, factor)
    found, wanted = before.control, before.system.conditions
    control = oriented.misclosures[found.point, found.axis]
    value = strip_conditions.misclosures_at(wanted, formed, oriented.similarity, control)
    value += relinearisation.displacements(before.system.errors, wanted.rows, images)[:, 0]
    formed = replace(formed, model_xyz=np.where(np.isnan(before.formed.model_xyz), np.nan, formed.model_xyz))
    return replace(
        before,
        orientation=orientation,
        formed=formed,
        absolute=oriented,
        images=images,
        system=strip_system.solved_for(before.system, replace(wanted, value=value)),
    )


def _solved(
    given: _Given,
    formed: tuple[Orientation, FormedStrip, AbsoluteOrientation],
    errors: strip_errors.StripErrors,
    images: Floats,
    factor: float,
) -> _Linearised:
    """Solve the conditions ``w + H v = A y + H v' + g``, v known so far, v' all errors of the image coordinates."""
    (orientation, strip, oriented), (targets, rows) = formed, given.control
    at_control = oriented.similarity(strip.xyz)[rows]
    found = control_errors.misclosures(errors.points, targets.turned(at_control), rows, targets.axes(at_control))
    misclosures = oriented.misclosures[found.point, found.axis]
    wanted = strip_conditions.conditions(
        errors, orientation, strip, found, misclosures, distances=given.settings.distances
    )
    if images.any():
        known = relinearisation.displacements(errors, wanted.rows, images)[:, 0]
        wanted = replace(wanted, value=wanted.value + known)
    solved = strip_system.system(errors, wanted, factor)
    return _Linearised(
        orientation=orientation, formed=strip, absolute=oriented, images=images, control=found, system=solved
    )


def resection(adjusted: CovarianceAdjustment, seen: tuple[Numbers, Floats, Floats], focal: float) -> exterior.Resection:
    """Return the photos of the adjustment with their image residuals.

    Parameters
    ----------
    seen : tuple of ndarray of int, ndarray and ndarray
        Photo of every image point in use, its coordinates (e, 2) in mm and its adjusted point (e, 3).
    focal : float
        Principal distance, mm.

    Returns
    -------
    exterior.Resection
        Orientations; residuals measured minus computed.
    """
    photo, xy, points = seen
    count = len(adjusted.centers)
    computed = project(points, adjusted.centers, adjusted.rotations, photo, np.full(count, focal))
    residuals = xy - computed
    number = np.bincount(photo, minlength=count)
    squares = np.bincount(photo, (residuals**2).sum(axis=1), count)
    rms = np.sqrt(squares / np.maximum(2 * number, 1))
    return exterior.Resection(adjusted.centers, adjusted.rotations, residuals, rms, np.ones(count, bool))


def measured(strip: Strip, observations: PhotoPoints) -> Numbers:
    """Place in a strip of the photo of every image point; -1 for photos of other strips."""
    place = {photo: number for number, photo in enumerate(strip.photos)}
    return np.array([place.get(photo, -1) for photo in observations.photo_ids], np.intp)[observations.photo]


# ---------------------------------------------------------------------------------------------------------- notes


def proposal(strip: Strip, correction: Polynomial) -> list[Note]:
    """Propose this adjustment where a polynomial does badly."""
    models = len(strip.photos) - 1
    if models > LONG_STRIP:
        text = (
            f"strip {strip.id}: {models} models; beyond about {LONG_STRIP} a polynomial falls far behind a rigorous "
            "adjustment (errors 2.5 times larger at 30 models, 12 times at 100); use `processing.adjustment: "
            "covariance`, which does not"
        )
        return [Note("long-strip", text, strip=strip.id)]
    few = min(correction.stations) < POLYNOMIAL_BANDS
    if models > 1 and (models > POLYNOMIAL_MODELS or few):
        bands = f"on {min(correction.stations)} bands of control"
        why = f"over {models} models" if models > POLYNOMIAL_MODELS else bands
        what = "a polynomial" if correction.degree else "the similarity, which no polynomial betters,"
        text = (
            f"strip {strip.id}: {what} {why} leaves more than it must; `processing.adjustment: covariance` "
            "distributes the same misclosures within 5 % of a bundle adjustment"
        )
        return [Note("covariance-proposed", text, severity="note", strip=strip.id)]
    return []


def notes(strip: Strip, control: ControlPoints, adjusted: CovarianceAdjustment | None) -> list[Note]:
    """Say what the tests of the adjustment found.

    Returns
    -------
    list of Note
        Doubtful control, the worst point only: it raises the test values of its neighbours; and a failed test of the
        whole.
    """
    if adjusted is None:
        return []
    tested = adjusted.tested
    found = []
    worst = tested.doubtful[:1]
    for row in worst.tolist():
        name, axis = control.ids[adjusted.control.point[row]], GROUND_AXES[adjusted.control.axis[row]]
        text = (
            f"control point {name} does not go with the strip and the other control: {axis} by about "
            f"{tested.size[row]:+.2f} m (test value {abs(tested.normalised[row]):.1f}, limit {tested.limit:.1f}); "
            "it was used"
        )
        found.append(Note("control-doubtful", text, strip=strip.id, points=(name,)))
    if not len(worst) and tested.probability < LEVEL:
        sigma0 = float(np.sqrt(tested.squares / tested.redundancy))
        text = (
            f"strip {strip.id}: misclosures and distances are {sigma0:.2f} times what the standard deviations of image "
            "coordinates and control let expect, and no single control point explains it: systematic errors of the "
            "images, or standard deviations that are too small"
        )
        found.append(Note("strip-contradicted", text, strip=strip.id))
    return found
