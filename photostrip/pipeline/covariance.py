"""A strip adjusted with its own covariance: from the formed strip and its control to points, photos and tests."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.geodesy.frame_spec import GROUND_AXES
from photostrip.geometry.rotation import from_vector
from photostrip.notes import Note
from photostrip.triangulation import (
    control_errors,
    exterior,
    strip_conditions,
    strip_covariance,
    strip_errors,
    strip_system,
)
from photostrip.triangulation.error_rows import ELEMENTS, PARAMETERS, UNITS, Rows, similarity_rows
from photostrip.triangulation.precision import image_variance
from photostrip.triangulation.strip_conditions import centers_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.pipeline.inputs import Strip
    from photostrip.points import ControlPoints, PhotoPoints
    from photostrip.triangulation.absolute import AbsoluteOrientation, Targets
    from photostrip.triangulation.formation import FormedStrip
    from photostrip.triangulation.polynomial import Polynomial
    from photostrip.triangulation.relative import Orientation

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]


LONG_STRIP = 25  # models; beyond it polynomials fall far behind a rigorous adjustment
POLYNOMIAL_MODELS = 15  # models from which on, and
POLYNOMIAL_BANDS = 4  # bands of control below which the adjustment with the covariance is proposed
LEVEL = 0.01  # of the test of the whole


@dataclass(frozen=True, eq=False)
class CovarianceAdjustment:
    """What the adjustment of a strip with its own covariance found, intermediate frame.

    Parameters
    ----------
    xyz : ndarray, shape (q, 3)
        Adjusted points of the strip, metres.
    centers : ndarray, shape (m, 3)
        Perspective centres, metres.
    rotations : ndarray, shape (m, 3, 3)
        Photo to intermediate frame.
    points : ndarray, shape (q, 3, 3)
        Covariances of the points, metres^2.
    photos : ndarray, shape (m, 6, 6)
        Covariances of centre and small rotation of the photos.
    control : control_errors.Misclosures
        Control coordinates that counted.
    tested : strip_covariance.Tested
        Test of the whole, and of each of these coordinates.
    factor : float
        Variance factor of the image coordinates.
    basis : str
        Where it comes from.
    sigma : float
        Standard deviation of an image coordinate of weight one, mm.
    errors, conditions, local, system
        Rows of the strip, conditions, unknowns and the solved system.
    """

    xyz: Floats
    centers: Floats
    rotations: Floats
    points: Floats
    photos: Floats
    control: control_errors.Misclosures
    tested: strip_covariance.Tested
    factor: float
    basis: str
    sigma: float
    errors: strip_errors.StripErrors
    conditions: strip_conditions.Conditions
    local: strip_conditions.Local
    system: strip_system.System


def adjust(
    formed: tuple[Orientation, FormedStrip],
    absolute: AbsoluteOrientation,
    control: tuple[Targets, Numbers],
    images: tuple[Numbers, Floats, float],
    *,
    distances: bool = True,
) -> CovarianceAdjustment:
    """Adjust a strip with its own covariance.

    Parameters
    ----------
    formed : tuple of Orientation and FormedStrip
        Oriented pairs and the strip formed from them.
    absolute : AbsoluteOrientation
        Similarity from the strip to the intermediate frame.
    control : tuple of Targets and ndarray of int
        The control, and its rows in the points of the strip.
    images : tuple of ndarray of int, ndarray and float
        Place of every image point's photo in the strip, standard deviations of the image points in mm, and that of one
        of weight one.
    distances : bool
        Whether distances of pass points from the common centres count.

    Returns
    -------
    CovarianceAdjustment
        Points, photos, covariances and tests.
    """
    orientation, strip = formed
    targets, control_rows = control
    position, sigma, stated = images
    similarity = absolute.similarity
    errors = strip_errors.strip_errors(orientation, strip, similarity, position, sigma)
    factor, basis = image_variance(orientation, stated)
    xyz = similarity(strip.xyz)
    at_control = xyz[control_rows]
    turned, axes = targets.turned(at_control), targets.axes(at_control)
    found = control_errors.misclosures(errors.points, turned, control_rows, axes)
    given = absolute.misclosures[found.point, found.axis]
    length = float(np.linalg.norm(errors.pairs.reach, axis=1).mean())
    local = strip_conditions.Local.about(centers_of(errors)[:-1], length)
    wanted = strip_conditions.conditions(errors, formed, (found, given), local, distances=distances)
    solved = strip_system.system(errors, wanted, factor)
    things = [errors.points, photo_rows(errors)]
    (points, photos), cofactors = strip_covariance.predict(errors, wanted, local, solved, things)
    tested = strip_covariance.tested(wanted, solved, cofactors, len(found.point))
    return CovarianceAdjustment(
        xyz - points.error,
        similarity(strip.centers) - photos.error[:, :3],
        from_vector(-photos.error[:, 3:]) @ similarity.rotation @ strip.rotations,
        points.covariance * factor,
        photos.covariance * factor,
        found,
        tested,
        factor,
        basis,
        stated * float(np.sqrt(factor)),
        errors,
        wanted,
        local,
        solved,
    )


def photo_rows(errors: strip_errors.StripErrors) -> Rows:
    """Rows of derivatives of the photos in the chain: each moves with the model on its right, the last with its own.

    Parameters
    ----------
    errors : StripErrors
        The formed strip.

    Returns
    -------
    Rows
        Centre and small rotation of each photo, d = 6.
    """
    models = errors.models
    centers = centers_of(errors)
    frame = np.zeros((models + 1, 6, PARAMETERS))
    frame[:, :3] = similarity_rows(centers, np.zeros(3))
    frame[:, 3:, 3:6] = np.eye(3)
    core = np.zeros((models + 1, 1, 6, UNITS))
    core[-1, 0, :3, ELEMENTS] = errors.pairs.base[-1]
    core[-1, 0, 3:, ELEMENTS] = errors.pairs.turn[-1]
    first = np.append(np.arange(models), models - 1)
    none = np.zeros(0, np.intp)
    return Rows(first, frame, core, none, none, np.zeros((0, 6, 2)))


def resection(adjusted: CovarianceAdjustment, seen: tuple[Numbers, Floats, Floats], focal: float) -> exterior.Resection:
    """Give the photos of the adjustment with their image residuals.

    Parameters
    ----------
    adjusted : CovarianceAdjustment
        The adjusted strip.
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
    computed = exterior.project(points, adjusted.centers, adjusted.rotations, photo, np.full(count, focal))
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
    """Propose this adjustment where a polynomial does badly.

    Parameters
    ----------
    strip : Strip
        The strip.
    correction : Polynomial
        Its polynomial.

    Returns
    -------
    list of Note
        At most one.
    """
    models = len(strip.photos) - 1
    if models > LONG_STRIP:
        text = (
            f"strip {strip.id}: {models} models; beyond about {LONG_STRIP} a polynomial falls far behind a rigorous "
            "adjustment (errors 2.5 times larger at 30 models, 12 times at 100); use `processing.adjustment: "
            "covariance`, which does not"
        )
        return [Note("long-strip", text, strip=strip.id)]
    few = min(correction.stations) < POLYNOMIAL_BANDS
    if correction.degree and (models > POLYNOMIAL_MODELS or few):
        bands = f"on {min(correction.stations)} bands of control"
        why = f"over {models} models" if models > POLYNOMIAL_MODELS else bands
        text = (
            f"strip {strip.id}: a polynomial {why} leaves more than it must; `processing.adjustment: covariance` "
            "distributes the same misclosures within 5 % of a bundle adjustment"
        )
        return [Note("covariance-proposed", text, severity="note", strip=strip.id)]
    return []


def notes(strip: Strip, control: ControlPoints, adjusted: CovarianceAdjustment | None) -> list[Note]:
    """Say what the tests of the adjustment found.

    Parameters
    ----------
    strip : Strip
        The strip.
    control : ControlPoints
        Its control.
    adjusted : CovarianceAdjustment or None
        The adjustment.

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
