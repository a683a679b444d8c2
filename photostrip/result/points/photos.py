"""Photos of a result: perspective centres, rotations, angles, and image residuals on the adjusted points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import GeometryError
from photostrip.geometry.rotation import angles
from photostrip.notes import Document
from photostrip.pipeline.inputs import Strip
from photostrip.pipeline.results import Result, StripResult
from photostrip.result.numbers import PER_RADIAN, order_of, to_decimals
from photostrip.result.points.ground import coordinates
from photostrip.result.points.precision import CORRELATIONS, SIGMAS, centre_columns, photo_columns
from photostrip.result.quantities import MATRIX, angle_decimals
from photostrip.result.table import Table
from photostrip.strip.resection import depths, project

ANGLES = ("angle_1", "angle_2", "angle_3")


@dataclass(frozen=True, eq=False)
class ImageResiduals:
    """Measured minus computed image coordinates of one strip, also of measurements that took no part."""

    strip: Strip
    rows: Numbers  # (m,): rows of the observations, by photo in flight order, then by natural order of the points
    photo: Numbers  # (m,): place of each row's photo in the strip
    residuals: Floats  # (m, 2): in x and y, mm; NaN where the point has no coordinates in the strip
    depth: Floats  # (m,): of the point before the photo, along its viewing direction, metres
    used: Flags  # (m,): whether the measurement took part


def image_residuals(result: Result, rank: Numbers) -> list[ImageResiduals]:
    """Return the residuals of all strips under their final orientations, then those of single photos.

    Photos that are strips of their own are known to a bundle adjustment only. `rank` is the place of each point in
    natural order.
    """
    return [_of_strip(result, strip, rank) for strip in result.photo_strips] + _of_singles(result, rank)


def _of_strip(result: Result, strip: StripResult, rank: Numbers) -> ImageResiduals:
    observations, stages = result.refined.observations, strip.of_photos
    position = stages.strip.positions(observations)
    rows = np.flatnonzero(position >= 0)
    rows = rows[order_of(position[rows], rank[observations.point[rows]])]
    known = np.full((len(observations.point_ids), 3), np.nan)
    known[strip.formed.point] = strip.xyz
    used = np.zeros(len(observations), bool)
    used[stages.rows] = True
    places = known[observations.point[rows]]
    photos = stages.strip.oriented(stages.resection.centers, stages.resection.rotations)
    with np.errstate(invalid="ignore"):
        residuals = observations.xy[rows] - project(places, photos, position[rows])
        depth = depths(known, observations.point[rows], photos.centers, photos.rotations, position[rows])
    return ImageResiduals(
        strip=stages.strip, rows=rows, photo=position[rows], residuals=residuals, depth=depth, used=used[rows]
    )


def _of_singles(result: Result, rank: Numbers) -> list[ImageResiduals]:
    if result.bundle is None or not result.bundle.singles:
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
        photo, point = np.zeros(len(rows), np.intp), observations.point[rows]
        photos = single.strip.oriented(single.center[None], single.rotation[None])
        with np.errstate(invalid="ignore"):
            residuals = observations.xy[rows] - project(known[point], photos, photo)
            depth = depths(known, point, photos.centers, photos.rotations, photo)
        found.append(
            ImageResiduals(
                strip=single.strip, rows=rows, photo=photo, residuals=residuals, depth=depth, used=used[rows]
            )
        )
    return found


def residuals_of(result: Result, images: Sequence[ImageResiduals]) -> Table:
    """Return the table ``residuals``: image residuals and y parallaxes photo by photo, points in natural order."""
    observations, parts = result.refined.observations, []
    parallax, zone = np.full(len(observations), np.nan), np.full(len(observations), np.nan)
    for strip in result.photo_strips:
        oriented = strip.of_photos.orientation
        left = oriented.rows[oriented.used, 0]
        parallax[left] = 1000.0 * oriented.parallax[oriented.used]
        zone[left] = strip.of_photos.screened.zone[oriented.used]
    for image in images:
        columns = {
            "photo": np.array(image.strip.photos, object)[image.photo],
            "point": np.array(observations.point_ids, object)[observations.point[image.rows]],
            "vx_um": 1000.0 * image.residuals[:, 0],
            "vy_um": 1000.0 * image.residuals[:, 1],
            "used": image.used,
            "q_um": parallax[image.rows],
            "zone": zone[image.rows],
        }
        parts.append(Table.of("residuals", columns))
    return Table.joined("residuals", parts)


def ground_sample_distance(images: Sequence[ImageResiduals]) -> Document:
    """Return what a pixel covers in the middle of the depths of each photo that has pixels, over these photos."""
    found = []
    for image in images:
        camera = image.strip.camera
        if camera.pixel_size is None:
            continue
        ends = np.searchsorted(image.photo, np.arange(1, len(image.strip.photos)))
        for depth, used in zip(np.split(image.depth, ends), np.split(image.used, ends), strict=True):
            if used.any():
                found.append(float(np.median(depth[used])) * camera.pixel_size / camera.principal_distance)
    return {"gsd": {"median": float(np.median(found)), "least": min(found), "largest": max(found)}} if found else {}


def point_rms(result: Result, images: Sequence[ImageResiduals]) -> Floats:
    """Root mean square image residual of every point over all its photos, mm; NaN where it took no part.

    Returns (n,), by number of the point in the observations.
    """
    observations = result.refined.observations
    squares, count = np.zeros(len(observations.point_ids)), np.zeros(len(observations.point_ids))
    for image in images:
        point, (x, y) = observations.point[image.rows[image.used]], image.residuals[image.used].T
        np.add.at(squares, point, x**2 + y**2)
        np.add.at(count, point, 2.0)
    with np.errstate(invalid="ignore"):
        return np.sqrt(np.where(count > 0, squares / np.maximum(count, 1), np.nan))


def photos_of(result: Result, images: Sequence[ImageResiduals]) -> Document:
    """Return the tables ``photos``, exterior orientations in the frame of the result, and ``correlations`` of these.

    They stand in flight order. Of photos whose strip is made of independent models the perspective centre alone is
    known.
    """
    if result.model_strips:
        parts = [_centres(result, number, strip) for number, strip in enumerate(result.strips)]
    else:
        of_strips = zip(result.photo_strips, images, strict=False)
        parts = [_photos_of_strip(result, number, strip, image) for number, (strip, image) in enumerate(of_strips)]
        parts += _single_photos(result, images[len(result.photo_strips) :])
    photos = [{key: column for key, column in part.items() if key not in CORRELATIONS} for part in parts]
    found = {"photos": Table.joined("photos", (Table.of("photos", part) for part in photos))}
    if not all("c12" in part for part in parts):
        return found
    known = [{"photo": part["id"], **{key: part[key] for key in CORRELATIONS}} for part in parts]
    return found | {"correlations": Table.joined("correlations", (Table.of("correlations", part) for part in known))}


def _photos_of_strip(result: Result, number: int, strip: StripResult, image: ImageResiduals) -> Document:
    photos, resection = strip.strip.photos, strip.of_photos.resection
    centers = strip.intermediate.cartesian_from_intermediate(resection.centers)
    ground = result.output.ground_from_cartesian(centers, ids=[f"at the center of photo {photo}" for photo in photos])
    axes = result.output.axes_at(centers, ground)
    rotations = axes @ strip.intermediate.cartesian_rotations(resection.rotations)
    known = result.precision
    return {
        "id": photos,
        "strip": strip.strip.id,
        **coordinates(result, ground),
        **_turned(result, rotations),
        **(dict.fromkeys(SIGMAS) if known is None else photo_columns(result, axes, rotations, known.photos[number])),
        "image_rms_um": 1000.0 * resection.rms,
        "points": np.bincount(image.photo[image.used], minlength=len(photos)),
        "resected": resection.solved,
    }


def _single_photos(result: Result, images: Sequence[ImageResiduals]) -> list[Document]:
    if result.bundle is None or not images:
        return []
    singles = result.bundle.singles
    photos = [single.strip.photos[0] for single in singles]
    centers = np.array([single.center for single in singles])
    axes = result.output.axes_at(centers)
    rotations = axes @ np.array([single.rotation for single in singles])
    ground = result.output.ground_from_cartesian(centers, ids=[f"of photo {photo}" for photo in photos])
    rows = [result.bundle.start.photos.index(photo) for photo in photos]
    columns = {
        "id": photos,
        "strip": [single.strip.id for single in singles],
        **coordinates(result, ground),
        **_turned(result, rotations),
        **photo_columns(result, axes, rotations, result.bundle.photo_covariances[rows]),
        "image_rms_um": [
            1000.0 * np.sqrt(np.mean(image.residuals[image.used] ** 2)) if image.used.any() else None
            for image in images
        ],
        "points": [int(image.used.sum()) for image in images],
        "resected": True,
    }
    return [columns]


def _turned(result: Result, rotations: Floats) -> Document:
    system, unit = result.settings.angle_system, result.settings.angle_unit
    values = to_decimals(_angles(rotations, system) * PER_RADIAN[unit], angle_decimals(unit))
    return {**dict(zip(MATRIX, rotations.reshape(-1, 9).T, strict=True)), **dict(zip(ANGLES, values.T, strict=True))}


def _angles(rotations: Floats, system: str) -> Floats:
    """Angles in radians, shape (n, 3); NaN for a photo whose outer two angles cannot be separated."""
    try:
        return angles(rotations, system)
    except GeometryError:
        if len(rotations) == 1:
            return np.full((1, 3), np.nan)
        return np.concatenate([_angles(rotation[None], system) for rotation in rotations])


def _centres(result: Result, number: int, strip: StripResult) -> Document:
    """Return the perspective centres of a strip of independent models, as far as they are known."""
    photos, models = strip.strip.photos, strip.of_models.formed.models
    known = np.flatnonzero(np.isfinite(strip.centers).all(axis=1))
    centers = strip.intermediate.cartesian_from_intermediate(strip.centers[known])
    names = [f"at the center of photo {photos[row]}" for row in known.tolist()]
    places = coordinates(result, result.output.ground_from_cartesian(centers, ids=names))
    covariances = None if result.precision is None else result.precision.photos[number][known]
    of_known = places | centre_columns(result, centers, covariances)
    used = (models.node < models.points) & strip.of_models.formed.used
    count = np.bincount(models.model[used], minlength=models.count)
    return {
        "id": photos,
        "strip": strip.strip.id,
        **{key: _at_rows(column, known, len(photos)) for key, column in of_known.items()},
        **dict.fromkeys((*MATRIX, *ANGLES, "image_rms_um", "resected")),
        "points": np.maximum(np.append(count, 0), np.append(0, count)),
    }


def _at_rows(column: Floats | None, rows: Numbers, size: int) -> Floats:
    found = np.full(size, np.nan)
    if column is not None:
        found[rows] = column
    return found
