"""What the image coordinates alone say: units, mirror images, the order of the photos."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from photostrip.camera import Camera
from photostrip.errors import GeometryError, InputError
from photostrip.notes import Finding
from photostrip.pipeline.image_coordinates import PhotoCoordinates
from photostrip.pipeline.inputs import Inputs, Settings, Strip
from photostrip.pipeline.plausibility.base_directions import closer_look
from photostrip.plausibility import accepted
from photostrip.plausibility.photos import flight_order, units
from photostrip.points import PhotoPoints

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
