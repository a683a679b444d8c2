"""Photos of a result: perspective centres, rotations, angles, and image residuals on the adjusted points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.errors import GeometryError
from photostrip.geometry.rotation import angles
from photostrip.result.numbers import DEGREES, RADIANS, ROTATION, Document, Plain, micrometres, rounded
from photostrip.result.points.ground import coordinates
from photostrip.result.points.precision import columns_of_photos, photo_columns
from photostrip.triangulation.resection.resection import project

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.pipeline import Result, StripResult

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]
    Flags = NDArray[np.bool_]

PER_RADIAN = {"deg": (180 / np.pi, DEGREES), "gon": (200 / np.pi, DEGREES), "rad": (1.0, RADIANS)}


@dataclass(frozen=True, eq=False)
class ImageResiduals:
    """Measured minus computed image coordinates of one strip, also of measurements that took no part."""

    rows: Numbers  # (m,): rows of the observations, by photo in flight order, then by natural order of the points
    photo: Numbers  # (m,): place of each row's photo in the strip
    residuals: Floats  # (m, 2): in x and y, mm; NaN where the point has no coordinates in the strip
    used: Flags  # (m,): whether the measurement took part

    @classmethod
    def of(cls, result: Result, strip: StripResult, rank: Numbers) -> ImageResiduals:
        """Compute the residuals of a strip under its final orientations."""
        observations, photos = result.refined.observations, strip.strip.photos
        place = {photo: number for number, photo in enumerate(photos)}
        position = np.array([place.get(photo, -1) for photo in observations.photo_ids], np.intp)[observations.photo]
        rows = np.flatnonzero(position >= 0)
        rows = rows[np.lexsort((rank[observations.point[rows]], position[rows]))]
        position = position[rows]
        known = np.full((len(observations.point_ids), 3), np.nan)
        known[strip.formed.point] = strip.xyz
        resection = strip.of_photos.resection
        focal = np.full(len(photos), strip.of_photos.strip.camera.principal_distance)
        with np.errstate(invalid="ignore"):
            computed = project(known[observations.point[rows]], resection.centers, resection.rotations, position, focal)
        used = np.zeros(len(observations), bool)
        used[strip.of_photos.rows] = True
        return cls(rows, position, observations.xy[rows] - computed, used[rows])


def photos_of(result: Result, residuals: list[ImageResiduals]) -> list[Document]:
    """Return the list ``photos``: exterior orientations in the frame of the result, in flight order."""
    return [
        photo
        for number, (strip, image) in enumerate(zip(result.photo_strips, residuals, strict=True))
        for photo in _photos(result, number, strip, image)
    ]


def _photos(result: Result, number: int, strip: StripResult, image: ImageResiduals) -> list[Document]:
    photos, resection = strip.strip.photos, strip.of_photos.resection
    cartesian = strip.intermediate.cartesian_from_intermediate(resection.centers)
    ground = result.output.ground_from_cartesian(cartesian, ids=[f"at the center of photo {p}" for p in photos])
    turned = strip.intermediate.cartesian_rotations(resection.rotations)
    rotations = result.output.axes_at(cartesian) @ turned
    system, unit = result.settings.angle_system, result.settings.angle_unit
    rows = zip(
        photos,
        coordinates(result.output, ground),
        rounded(rotations.reshape(-1, 9), ROTATION),
        _angles(rotations, system, unit),
        micrometres(resection.rms),
        np.bincount(image.photo[image.used], minlength=len(photos)).tolist(),
        resection.solved.tolist(),
        photo_columns(result, number, cartesian, rotations),
        strict=True,
    )
    return [
        {
            "id": photo, "strip": strip.strip.id, "x": x, "y": y, "z": z, "rotation": rotation,
            "angles": {"system": system, "unit": unit, "values": values}, **sigmas,
            "image_rms_um": rms, "points": points, "resected": solved,
        }
        for photo, (x, y, z), rotation, values, rms, points, solved, sigmas in rows
    ]  # fmt: skip


def _angles(rotations: Floats, system: str, unit: str) -> Plain:
    """Angles in the unit of the output; None for a photo whose outer two angles cannot be separated."""
    factor, decimals = PER_RADIAN[unit]
    try:
        return rounded(angles(rotations, system) * factor, decimals)
    except GeometryError:
        return [_angles_of_one(rotation, system, unit) for rotation in rotations]


def _angles_of_one(rotation: Floats, system: str, unit: str) -> Plain:
    factor, decimals = PER_RADIAN[unit]
    try:
        return rounded(angles(rotation, system) * factor, decimals)
    except GeometryError:
        return None


def residuals_of(result: Result, residuals: list[ImageResiduals]) -> list[Document]:
    """Return the list ``residuals``: image residuals photo by photo, points in natural order."""
    observations = result.refined.observations
    ids = observations.point_ids
    found = []
    for strip, image in zip(result.photo_strips, residuals, strict=True):
        names = [ids[number] for number in observations.point[image.rows].tolist()]
        vx, vy = (micrometres(image.residuals[:, axis]) for axis in (0, 1))
        used = image.used.tolist()
        ends = np.searchsorted(image.photo, np.arange(len(strip.strip.photos) + 1)).tolist()
        found += [
            {
                "strip": strip.strip.id,
                "photo": photo,
                "points": names[ends[n] : ends[n + 1]],
                "vx_um": vx[ends[n] : ends[n + 1]],
                "vy_um": vy[ends[n] : ends[n + 1]],
                "used": used[ends[n] : ends[n + 1]],
            }
            for n, photo in enumerate(strip.strip.photos)
        ]
    return found


def point_rms(result: Result, residuals: list[ImageResiduals]) -> Floats:
    """Root mean square image residual of every point over all its photos, mm; NaN where it took no part.

    Returns
    -------
    ndarray, shape (n,)
        By number of the point in the observations.
    """
    observations = result.refined.observations
    squares, count = np.zeros(len(observations.point_ids)), np.zeros(len(observations.point_ids))
    for image in residuals:
        point = observations.point[image.rows[image.used]]
        np.add.at(squares, point, (image.residuals[image.used] ** 2).sum(axis=1))
        np.add.at(count, point, 2)
    with np.errstate(invalid="ignore"):
        return np.sqrt(np.where(count > 0, squares / np.maximum(count, 1), np.nan))


# ------------------------------------------------------------------------------------------------ single photos


def singles_of(result: Result, rank: Numbers) -> list[ImageResiduals]:
    """Return the residuals of the photos that are strips of their own, which only a bundle adjustment has."""
    if result.bundle is None:
        return []
    observations = result.refined.observations
    known = np.full((len(observations.point_ids), 3), np.nan)
    known[result.points.number] = result.points.cartesian
    used = np.zeros(len(observations), bool)
    used[result.bundle.block.rows[result.bundle.screened.selection.images]] = True
    found = []
    for single in result.bundle.singles:
        rows = np.flatnonzero(observations.photo == observations.photo_ids.index(single.strip.photos[0]))
        rows = rows[np.argsort(rank[observations.point[rows]], kind="stable")]
        photo = np.zeros(len(rows), np.intp)
        focal = np.array([single.strip.camera.principal_distance])
        with np.errstate(invalid="ignore"):
            at = known[observations.point[rows]]
            computed = project(at, single.center[None], single.rotation[None], photo, focal)
        found.append(ImageResiduals(rows, photo, observations.xy[rows] - computed, used[rows]))
    return found


def single_photos_of(result: Result, residuals: list[ImageResiduals]) -> list[Document]:
    """Return the entries of ``photos`` for photos that are strips of their own."""
    if result.bundle is None:
        return []
    system, unit = result.settings.angle_system, result.settings.angle_unit
    rows = []
    place = {photo: number for number, photo in enumerate(result.bundle.start.photos)}
    for single, image in zip(result.bundle.singles, residuals, strict=True):
        photo = single.strip.photos[0]
        center = single.center[None]
        (ground,) = coordinates(result.output, result.output.ground_from_cartesian(center, ids=[f"of photo {photo}"]))
        rotation = result.output.axes_at(center) @ single.rotation[None]
        covariance = result.bundle.photo_covariances[place[photo]][None]
        (columns,) = columns_of_photos(result, center, rotation, covariance)
        values = _angles(rotation, system, unit)[0]
        fit = micrometres(np.sqrt(np.mean(image.residuals[image.used] ** 2))) if image.used.any() else None
        rows.append(
            {
                "id": photo, "strip": single.strip.id, "x": ground[0], "y": ground[1], "z": ground[2],
                "rotation": rounded(rotation.reshape(9), ROTATION),
                "angles": {"system": system, "unit": unit, "values": values}, **columns,
                "image_rms_um": fit, "points": int(image.used.sum()), "resected": True,
            }
        )  # fmt: skip
    return rows


def single_residuals_of(result: Result, residuals: list[ImageResiduals]) -> list[Document]:
    """Return the entries of ``residuals`` for photos that are strips of their own."""
    if result.bundle is None:
        return []
    observations = result.refined.observations
    return [
        {
            "strip": single.strip.id,
            "photo": single.strip.photos[0],
            "points": [observations.point_ids[number] for number in observations.point[image.rows].tolist()],
            "vx_um": micrometres(image.residuals[:, 0]),
            "vy_um": micrometres(image.residuals[:, 1]),
            "used": image.used.tolist(),
        }
        for single, image in zip(result.bundle.singles, residuals, strict=True)
    ]
