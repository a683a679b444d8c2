"""Directions of bases by relative orientation, where the photos laid side by side leave their order in doubt.

On a photo, a tilt moves the points of its neighbour as a base does: with an end lap of 80 % and a long lens a tilt of
5 degrees is as large as half a base. The layout of the photos is a cheap screen; what it speaks against is looked at
with the pair oriented, which keeps base and tilt apart.

What the image coordinates alone say: units, mirror images, the order of the photos.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from photostrip.camera import Camera
from photostrip.errors import GeometryError, InputError
from photostrip.notes import Finding
from photostrip.pipeline.image_coordinates import PhotoCoordinates
from photostrip.pipeline.inputs import Inputs, Settings, Strip
from photostrip.pipeline.plausibility import evidence
from photostrip.plausibility import accepted, flight_order, units
from photostrip.points import PhotoPoints
from photostrip.strip.relative_orientation.orientation import orient_unchecked, unusable_pairs
from photostrip.strip.relative_orientation.pairs import collect_pairs

LEAST_POINTS = 6  # one more than a pair has unknowns
PAIR_SIGMA0 = 0.01  # of a pair, over the principal distance: beyond it the base is no better known than by the layout


def closer_look(
    strip: Strip, observations: PhotoPoints, cameras: Mapping[str, Camera], settings: Settings
) -> Callable[[str, str], tuple[complex, complex] | None]:
    """Return a function that gives the directions in which two photos of a strip lie from each other.

    Returns of two photos, the direction towards the second on the first and towards the first on the second; None where
        the pair cannot be oriented well enough to say.
    """
    points: list[PhotoPoints] = []

    @cache
    def toward(one: str, other: str) -> tuple[complex, complex] | None:
        if not points:
            points.append(evidence.ideal(observations, cameras, settings))
        focal = strip.camera.principal_distance
        try:
            with np.errstate(all="ignore"):
                pairs = collect_pairs(points[0], [one, other], focal)
                if len(pairs.pair) < LEAST_POINTS:
                    return None
                oriented, converged = orient_unchecked(pairs)
                doubtful = unusable_pairs(oriented, converged)
        except (GeometryError, np.linalg.LinAlgError):
            return None
        if doubtful[0] or not oriented.sigma0[0] < PAIR_SIGMA0 * focal:
            return None
        base, turn = (each[0] for each in oriented.relative)
        back = -base @ turn
        return complex(base[0], base[1]), complex(back[0], back[1])

    return toward


ALL_PHOTOS, ONE_PHOTO = "P101", "P102"  # image coordinates in another unit


@dataclass(frozen=True, eq=False)
class ImageEvidence:
    """What the image coordinates alone say."""

    findings: tuple[Finding, ...]
    observations: PhotoPoints  # image points with what was found put right, for further evidence only; mm, y up
    cameras: dict[str, Camera]  # camera of every photo
    strips: tuple[Strip, ...]  # the strips with their photos as they lie, each place once
    steps: dict[str, complex]  # centre of the next photo, as the photos lie, on each photo; mm, y up
    settings: Settings


def of_units(inputs: Inputs, settings: Settings, photo: PhotoCoordinates | None = None) -> tuple[Finding, ...]:
    """Look at how large image coordinates are, which no fault of other data hides.

    photo: image points in the system of the photo, where a run has them already.
    """
    cameras = {photo: strip.camera for strip in inputs.strips for photo in strip.photos}
    return accepted(_photo_coordinates(inputs, cameras, settings, photo)[1], settings.accept)


def of_images(inputs: Inputs, settings: Settings, photo: PhotoCoordinates | None = None) -> ImageEvidence:
    """Look at image coordinates as far as that goes without adjusting anything.

    photo: image points in the system of the photo, where a run has them already.
    """
    cameras = {photo: strip.camera for strip in inputs.strips for photo in strip.photos}
    observations, findings, of_camera = _photo_coordinates(inputs, cameras, settings, photo)
    factor = {name: of_camera[cameras[name].name] for name in observations.photo_ids}
    in_unit = _put_right(observations, factor, frozenset())
    orders = []
    for strip in inputs.strips:
        closer = closer_look(strip, in_unit, cameras, settings)
        of_order, order = flight_order.find_wrong_order(observations, strip.id, strip.photos, closer)
        findings += of_order
        orders.append(order)
    alone = {name for each in findings if each.code == ONE_PHOTO for name in each.photos}
    findings = [each for each in findings if each.code != ALL_PHOTOS or not alone.issuperset(each.photos)]
    for order in orders:
        factor |= {name: factor[name] / size for name, size in order.size.items()}
    mirrored = frozenset(name for order in orders for name in order.mirrored)
    steps = {
        name: factor.get(name, 1.0) * (step.conjugate() if name in mirrored else step)
        for order in orders
        for name, step in zip(order.photos, order.steps, strict=True)
    }
    return ImageEvidence(
        findings=tuple(findings),
        observations=_put_right(observations, factor, mirrored),
        cameras=cameras,
        strips=tuple(replace(strip, photos=order.photos) for strip, order in zip(inputs.strips, orders, strict=True)),
        steps=steps,
        settings=settings,
    )


def _photo_coordinates(
    inputs: Inputs, cameras: dict[str, Camera], settings: Settings, photo: PhotoCoordinates | None
) -> tuple[PhotoPoints, list[Finding], dict[str, float]]:
    """Image points in the system of the photo, what marks and sizes say, and the factor that a camera's size asks for.

    Nothing is said where the marks give no such system: what is wrong with them stops the run.
    """
    oriented = None if photo is None else photo.interior
    observations = _on_listed_photos(inputs.observations, cameras) if photo is None else photo.observations
    if photo is None and inputs.fiducials is not None:
        from photostrip.strip.image_coordinates import interior  # digital cameras need none of it

        try:
            oriented = interior.orient(_on_listed_photos(inputs.fiducials, cameras), cameras, settings.interior)
            observations = interior.transform(observations, oriented)
        except (GeometryError, InputError):
            return observations, [], {camera.name: 1.0 for camera in cameras.values()}
    findings, factors = units.find_wrong_units(observations, cameras)
    if oriented is not None:
        findings += units.find_wrong_mark_units(oriented.scale_x, oriented.photo_ids)
    return observations, findings, factors


def _on_listed_photos(measured: PhotoPoints, cameras: dict[str, Camera]) -> PhotoPoints:
    """Leave out photos of no strip, whose camera nobody knows."""
    listed = [photo in cameras for photo in measured.photo_ids]
    if all(listed):
        return measured
    number, rows = np.cumsum(listed) - 1, np.flatnonzero(np.array(listed)[measured.photo])
    return replace(
        measured,
        photo_ids=tuple(photo for photo in measured.photo_ids if photo in cameras),
        photo=number[measured.photo[rows]],
        point=measured.point[rows],
        xy=measured.xy[rows],
        sigma=measured.sigma[rows],
    )


def _put_right(observations: PhotoPoints, factor: dict[str, float], mirrored: frozenset[str]) -> PhotoPoints:
    """Image points in millimetres and from the right side, as far as that is known."""
    by_photo = np.array([[factor[name], -factor[name] if name in mirrored else factor[name]] for name in factor])
    if not len(by_photo) or (by_photo == 1.0).all():
        return observations
    return replace(observations, xy=observations.xy * by_photo[observations.photo])
