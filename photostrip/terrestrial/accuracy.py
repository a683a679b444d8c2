"""How accurately correction directions must be measured for a given image accuracy, and the other way round.

The exact formulas hold for any orientation of the camera. Those of the source, kept for comparison, hold for a level
camera and inherit a misprint of its eq. 3 in the vertical direction. ``xz`` (..., 2) everywhere are image coordinates
in mm, reduced to the principal point; ``rotation`` (3, 3) takes the photo to the ground.

How well displacements will be known, before anything is photographed: by distance, and by place in the photo.

With two stations nothing here has a theory of its own: points are put where both photos show them, measured without
errors in two epochs, and taken through ``monitoring``; what is planned is what a survey reports. With one station the
distances of the points are known, and what is seen is the displacement across the ray.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Floats
from photostrip.statistics import noncentrality
from photostrip.terrestrial.monitoring import MonitoringSettings, Series, monitor
from photostrip.terrestrial.normal_case import SPACE, Phototheodolite, StereoPair, ground_from_photo, partials
from photostrip.units import ARCSECONDS

LEVEL_CAMERA = 1e-12  # difference of a rotation from that of a level camera


class Theodolite(NamedTuple):
    """Standard deviations of directions measured in one round, in arcseconds, and the number of rounds."""

    horizontal: float
    vertical: float
    rounds: int


@dataclass(frozen=True, eq=False)
class RequiredAccuracy:
    """Standard deviations with which correction directions must be known."""

    angle: Floats  # (...): m_lambda', of the angle between a point and the optical axis as the photo gives it, radians
    horizontal: Floats  # (...): m_lambda, of a horizontal direction: an angle is the difference of two of them, radians
    vertical: Floats  # (...): m_beta, of a vertical direction, radians


def required(xz: ArrayLike, principal_distance: float, sigma: float, rotation: ArrayLike) -> RequiredAccuracy:
    """Accuracy of directions that corresponds to the standard deviation `sigma` of x, z and the principal distance, mm.

    For a level camera m_lambda' = m / sqrt(f^2 + x^2) and m_beta = m / sqrt(f^2 + x^2 + z^2).

    Source: [002] eq. 4-6 with all first-order terms and without the misprint of eq. 3.
    """
    by = partials(xz, principal_distance, rotation)
    errors = sigma * np.sqrt((by.by_xz**2).sum(axis=-1) + by.by_f**2)
    return RequiredAccuracy(errors[..., 0], errors[..., 0] / np.sqrt(2.0), errors[..., 1])


@dataclass(frozen=True, eq=False)
class Printed:
    """Standard deviations by the formulas as they are printed, for a level camera."""

    horizontal: Floats  # (...): m_lambda by eq. 5 and 6, which is right, radians
    # (...): m_beta by all terms of eq. 4, by eq. 5, which drops those through g = sec(lambda'), and by its shorter form
    # eq. 6, radians
    vertical_eq4: Floats
    vertical_eq5: Floats
    vertical_eq6: Floats


def as_printed(xz: ArrayLike, principal_distance: float, sigma: float) -> Printed:
    """Accuracy of directions by the formulas of the source, for a standard deviation `sigma` of image coordinates, mm.

    Source: [002] eq. 4 to 6 as printed, see ``photostrip sources``.
    """
    x, z = np.moveaxis(np.asarray(xz, float), -1, 0)
    f = principal_distance
    g = np.sqrt(1.0 + (x / f) ** 2)  # sec(lambda'), which should have been its inverse
    denominator = f**2 + (z * g) ** 2
    by_x, by_z, by_f = z * x / (f * g), f * g, z * g + z * x**2 / (f**2 * g)  # of z g / f, times f^2
    eq4 = sigma * np.sqrt(by_x**2 + by_z**2 + by_f**2) / denominator
    eq5 = sigma * g * np.sqrt(f**2 + z**2) / denominator
    return Printed(sigma / np.sqrt(2.0 * (f**2 + x**2)), eq4, eq5, sigma / np.sqrt(denominator))


def supported(
    xz: ArrayLike, principal_distance: float, horizontal: float, vertical: float, rotation: ArrayLike
) -> Floats:
    """Smallest standard deviations (..., 2) of image coordinates, mm, for which directions are accurate enough.

    Source: derived; ``required`` solved for m.
    """
    unit = required(xz, principal_distance, 1.0, rotation)
    return np.stack([horizontal / unit.horizontal, vertical / unit.vertical], axis=-1)


def rounds_for(sigma: float, wanted: float) -> int:
    """Return the number of rounds, each in both faces with `sigma`, whose mean has the standard deviation wanted."""
    return max(1, ceil((sigma / wanted) ** 2 - 1e-9))  # exactly four times is not more than four times


def grid(photo_format: tuple[float, float], step: float, *, level: bool = True) -> tuple[Floats, Floats]:
    """Coordinates x and z over the photo, mm, at which accuracy is tabulated: multiples of the step, and the edge.

    With a level camera one quarter of the photo stands for the others.
    """
    axes = []
    for size in photo_format:
        half = size / 2
        inside = step * np.arange(int(np.ceil(half / step - LEVEL_CAMERA)))
        upper = np.append(inside, half)
        axes.append(upper if level else np.concatenate([-upper[:0:-1], upper]))
    return axes[0], axes[1]


@dataclass(frozen=True)
class Example:
    """A worked example of the source."""

    camera: str
    # f, x, z, sigma: principal distance, image coordinates and their standard deviation, mm
    f: float
    x: float
    z: float
    sigma: float
    # horizontal, vertical: m_lambda and m_beta as printed, arcseconds
    horizontal: float
    vertical: float
    factor: float


# Source: [002], the two examples at its end.
EXAMPLES = (
    Example(camera="Photheo 19/1318", f=190.0, x=80.0, z=60.0, sigma=0.005, horizontal=3.5, vertical=5.0, factor=1.18),
    Example(camera="UMK 10/1318", f=100.0, x=80.0, z=60.0, sigma=0.005, horizontal=6.0, vertical=8.5, factor=1.18),
)


@dataclass(frozen=True)
class WorkedExample:
    """An example computed again, step by step; standard deviations in arcseconds."""

    example: Example
    horizontal: float  # m_lambda, exact
    printed_factor: float  # m_beta by eq. 6 with the factor that is printed: what the source computed
    # m_beta by eq. 4, by eq. 5 and by eq. 6 with the factor of the camera
    eq4: float
    eq5: float
    eq6: float
    factor: float  # the factor 1 + x^2/f^2 of the camera
    vertical: float  # m_beta, exact


def worked(example: Example) -> WorkedExample:
    """Compute an example of the source again, by the printed and by the exact formulas."""
    f, x, z, m = example.f, example.x, example.z, example.sigma
    exact = required([x, z], f, m, ground_from_photo(0.0))
    printed = as_printed([x, z], f, m)
    factor = 1.0 + (x / f) ** 2
    return WorkedExample(
        example=example,
        horizontal=float(exact.horizontal) * ARCSECONDS,
        printed_factor=float(m * ARCSECONDS / np.sqrt(f**2 + z**2 * example.factor)),
        eq4=float(printed.vertical_eq4) * ARCSECONDS,
        eq5=float(printed.vertical_eq5) * ARCSECONDS,
        eq6=float(printed.vertical_eq6) * ARCSECONDS,
        factor=factor,
        vertical=float(exact.vertical) * ARCSECONDS,
    )


HALVINGS = 60
FARTHEST_ASIDE = 20.0  # of the distance: no photo shows more to the side
PLACES = ("middle", "side", "top")


@dataclass(frozen=True)
class DisplacementSpec:
    camera: Phototheodolite  # with its format
    distances: tuple[float, ...]  # of the object ahead of the base, metres
    sigma: float  # standard deviation of a measured change of an image coordinate, mm
    base: float | None  # length of the base, metres; None: one station, with known distances
    convergence: float = 0.0  # by which each camera is turned towards the other, radians
    significance: float = 0.05  # probability of calling a point moved that did not move
    power: float = 0.8  # probability with which the displacements stated are found


class PlannedDisplacement(NamedTuple):
    """What is expected of a displacement at one place."""

    place: str  # of `PLACES`
    at: Floats  # (3,): to the right of the left station, ahead, up, metres; NaN where the photos do not show it
    sigma: Floats  # (3,): standard deviations, metres; NaN ahead with one station
    found: Floats  # (3,): displacements along each axis that are found with the power asked for, metres
    worst: float  # the largest displacement, in whatever direction, that is not found so often, metres


def plan_displacements(spec: DisplacementSpec) -> list[PlannedDisplacement]:
    """Compute standard deviations of displacements, and what is found, distance by distance and place by place."""
    found = []
    for distance in spec.distances:
        points = np.array([_place(spec, distance, place) for place in PLACES])
        covariance = _of_one(spec, distance) if spec.base is None else _of_two(spec, points)
        for place, at, each in zip(PLACES, points, covariance, strict=True):
            found.append(_planned(spec, place, at, each))
    return found


def _pair(spec: DisplacementSpec) -> StereoPair:
    """Return the stations; with one of them, twice the same."""
    focal = spec.camera.principal_distance
    rotations = np.array([ground_from_photo(side * spec.convergence) for side in (1.0, -1.0)])
    return StereoPair((focal, focal), np.array([[0.0, 0.0, 0.0], [spec.base or 0.0, 0.0, 0.0]]), rotations)


def _image(pair: StereoPair, points: Floats) -> Floats:
    """Image coordinates (n, 4) of points; NaN behind a camera."""
    image = []
    for focal, center, rotation in zip(pair.principal_distances, pair.centers, pair.rotations, strict=True):
        ray = (points - center) @ rotation
        depth = np.where(ray[:, 2] < 0, -ray[:, 2], np.nan)
        image.append(focal * ray[:, :2] / depth[:, None])
    return np.column_stack(image)


def _place(spec: DisplacementSpec, distance: float, place: str) -> Floats:
    """Give the middle of the object, or the outermost point to the right or above it, that both photos show."""
    middle = np.array([(spec.base or 0.0) / 2, distance, 0.0])
    pair, half = _pair(spec), np.array(spec.camera.format or (np.inf, np.inf)) / 2
    axis = {"middle": np.zeros(SPACE), "side": np.eye(SPACE)[0], "top": np.eye(SPACE)[2]}[place]

    def shown(reach: float) -> bool:
        xz = _image(pair, (middle + reach * axis)[None])[0].reshape(2, 2)
        return bool((np.abs(xz) <= half).all())

    if not shown(0.0):
        return np.full(SPACE, np.nan)
    inside, outside = 0.0, FARTHEST_ASIDE * distance
    for _ in range(HALVINGS):
        reach = (inside + outside) / 2
        inside, outside = (reach, outside) if shown(reach) else (inside, reach)
    found: Floats = middle + inside * axis
    return found


def _of_two(spec: DisplacementSpec, points: Floats) -> Floats:
    """Covariances (n, 3, 3) as the displacements of two stations report them."""
    pair = _pair(spec)
    image = _image(pair, points)
    # two epochs with the same errors, so that a change has that of the plan
    series = Series(
        points=PLACES,
        epochs=("first", "second"),
        coordinates=np.stack([image, image]),
        of_epoch=np.full((2, *image.shape), spec.sigma**2 / 2),
        shared=np.zeros(image.shape),
        stable=np.zeros(len(points), bool),
    )
    return monitor(series, pair, MonitoringSettings(spec.significance)).since_first[0].covariance


def _of_one(spec: DisplacementSpec, distance: float) -> Floats:
    """Covariances of displacements seen from one station: across the rays at a known distance.

    dX = (Y/f) dx, dZ = (Y/f) dz for a point that moves in the plane at the distance Y.
    """
    across = (distance / spec.camera.principal_distance * spec.sigma) ** 2
    covariance = np.diag([across, np.nan, across])
    covariance[1, :] = covariance[:, 1] = np.nan
    return np.stack([covariance] * len(PLACES))


def _planned(spec: DisplacementSpec, place: str, at: Floats, covariance: Floats) -> PlannedDisplacement:
    sigma = np.sqrt(np.where(np.isnan(at[0]), np.nan, np.diag(covariance)))
    known = np.flatnonzero(np.isfinite(sigma))
    found = np.full(SPACE, np.nan)
    if not len(known):
        return PlannedDisplacement(place, at=at, sigma=sigma, found=found, worst=float("nan"))
    least = noncentrality(spec.significance, spec.power, len(known))
    part = covariance[np.ix_(known, known)]
    # along a unit vector u a displacement d has d² uᵀ C⁻¹ u
    found[known] = np.sqrt(least / np.diag(np.linalg.inv(part)))
    worst = float(np.sqrt(least * np.linalg.eigvalsh(part)[-1]))
    return PlannedDisplacement(place, at=at, sigma=sigma, found=found, worst=worst)
