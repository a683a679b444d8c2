"""How well displacements will be known, before anything is photographed: by distance, and by place in the photo.

With two stations nothing here has a theory of its own: points are put where both photos show them, measured without
errors in two epochs, and taken through ``monitoring``; what is planned is what a survey reports. With one station the
distances of the points are known, and what is seen is the displacement across the ray.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Floats
from photostrip.statistics import noncentrality
from photostrip.terrestrial.frame import Phototheodolite, ground_from_photo
from photostrip.terrestrial.monitoring import MonitoringSettings, Series, monitor
from photostrip.terrestrial.normal_case import SPACE, StereoPair

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
