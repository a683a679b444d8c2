"""Points and photos of a result: frame, coordinates, orientations, rays, image coordinates; how they are checked."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import GeometryError
from photostrip.geometry.rotation import angles
from photostrip.network import reliability
from photostrip.notes import Document, Note, counted
from photostrip.pipeline.given_points import rejected_control
from photostrip.pipeline.inputs import Strip
from photostrip.pipeline.results import ROLES, Bundle, Result, StripResult
from photostrip.points import PhotoPoints, locate
from photostrip.rejection import UNCONTROLLED
from photostrip.result.given import size_columns
from photostrip.result.numbers import (
    EXACT,
    GROUND,
    MATRIX,
    PER_RADIAN,
    angle_decimals,
    attributes,
    coordinate_decimals,
    natural_rank,
    order_of,
    significant,
    to_decimals,
)
from photostrip.result.precision import CORRELATIONS, SIGMAS, centre_columns, photo_columns, point_columns
from photostrip.result.table import Table
from photostrip.strip.resection import KnownPhotos, depths, project
from photostrip.units import MICROMETRES

CHECKED = NONE, ACROSS, ALONG = "none", "across", "along"


def checked_of(result: Result, models: Numbers) -> Numbers:
    """Return the place in ``CHECKED`` of every point, in the order of ``result.points``.

    models: of every point, how many gave it.
    """
    return _of_strips(result, models) if result.bundle is None else _of_bundle(result, result.bundle)


def _of_bundle(result: Result, bundle: Bundle) -> Numbers:
    """In how many directions of the image, of the model, every error of a ray shows in its own residuals.

    The redundancy numbers of a ray are the eigenvalues of its block of cofactors over its variances: one for each
    direction. The ray that is checked least says it of its point.
    """
    problem, precision = bundle.screened.problem, bundle.screened.precision
    (group,) = (each for each in bundle.groups if each.kind == reliability.IMAGE)
    shares = precision.image_residuals / group.sigma[:, :, None] / group.sigma[:, None, :]
    directions = (np.linalg.eigvalsh(shares) >= UNCONTROLLED).sum(axis=1)
    every = group.sigma.shape[1]
    of_ray = np.where(directions == every, 2, np.minimum(directions, 1))
    ids = result.refined.observations.point_ids
    numbers, place = np.unique(problem.images.point, return_inverse=True)
    rows = np.searchsorted(result.points.number, locate(map(problem.point_name, numbers.tolist()), ids))
    found = np.zeros(len(result.points.number), np.intp)
    least = np.full(len(numbers), len(CHECKED) - 1)
    np.minimum.at(least, place, of_ray)
    found[rows] = least
    return found


def _of_strips(result: Result, models: Numbers) -> Numbers:
    """By a second model, or by control, along the base; else across, where the pair has redundancy there."""
    control, numbers = result.inputs.control, result.points.number
    across: Flags = np.zeros(len(result.refined.observations.point_ids), bool)
    for strip in result.photo_strips:
        oriented = strip.of_photos.orientation
        across[oriented.point[oriented.used & (oriented.redundancy >= UNCONTROLLED)]] = True
    given = ~control.check & (control.use & ~rejected_control(result)).all(axis=1) & (result.control_rows >= 0)
    along = models > 1
    along[result.control_rows[given]] = True
    return np.where(along, 2, across[numbers].astype(np.intp))


def counts_of(points: Table) -> Document:
    """Count the points by how they are checked, best first."""
    number = Counter(points.values("checked"))
    return {"points_checked": {name: number[name] for name in reversed(CHECKED)}}


def unchecked_notes(points: Table, rejected: Table) -> Iterator[Note]:
    """Say what may be left in points that nothing checks along the base, where as many rays were found wrong.

    rejected: the table ``rejected`` of the document.
    """
    gone = [each["point"] for each in rejected if each["photo"] is not None and not each["readmitted"]]
    wrong, tested = set(gone), int(points["rays"].sum()) + len(gone)
    share, number = len(wrong) / max(tested, 1), counts_of(points)["points_checked"]
    if share * points["rays"][points["checked"] != ALONG].sum() < 1.0:
        return
    text = (
        f"rays of {counted(len(wrong), 'point')} were found wrong, {100 * share:.1f} % of all rays; "
        f"{counted(number[ACROSS], 'point is', 'points are')} checked only across the base, {number[NONE]} not at all: "
        f"about as many of their rays may be wrong along it, which no residual shows and no standard deviation contains"
    )
    yield Note("unchecked-points", text, severity="note")


KEPT = 1e-3  # of a pixel on the ground that the coordinates of a free network show


def coordinates(result: Result, enu: Floats) -> Document:
    """Return the columns x, y, z of coordinates in the internal order, with the decimals of their frame."""
    columns = zip("xyz", result.output.order, coordinate_decimals(frame_of(result)), strict=True)
    return {axis: to_decimals(enu[:, k], count) for axis, k, count in columns}


def ground_decimals(result: Result) -> int:
    """Return the decimals of lengths: of a free network, in which a metre may be anything, those that pixels need."""
    bundle = result.bundle
    if bundle is None or not bundle.screened.solution.free:
        return GROUND
    of_strips = [(strip.of_photos.strip.camera, strip.scale_number) for strip in result.photo_strips]
    scales = of_strips + [(single.strip.camera, single.scale_number) for single in bundle.singles]
    pixels = [scale * camera.pixel_size / 1000 for camera, scale in scales if camera.pixel_size is not None]
    return max([GROUND, *(math.ceil(-math.log10(KEPT * pixel)) for pixel in pixels)])


def frame_of(result: Result) -> Document:
    """Return the block ``frame``: what the coordinates of the result refer to."""
    frame = result.output
    spec = frame.spec
    corrected = spec.curvature_radius is not None and frame.origin is not None
    return {
        "crs": spec.crs,
        "axes": list(frame.axes),
        "kind": frame.kind,
        "plan_unit": frame.plan_unit,
        "height_unit": frame.height_unit,
        "plan_factor": frame.plan_factor,
        "height_factor": frame.height_factor,
        "ellipsoid": None if frame.ellipsoid is None else list(frame.ellipsoid),
        "heights": spec.height,
        **({} if spec.geoid_undulation is None else {"geoid_undulation": spec.geoid_undulation}),
        **({"curvature": {"radius": spec.curvature_radius, "origin": list(frame.origin or ())}} if corrected else {}),
        **({} if (decimals := ground_decimals(result)) == GROUND else {"decimals": decimals}),
        "description": frame.describe(),
    }


def points_of(result: Result, image_rms: Floats, rank: Numbers) -> Table:
    """Return the list ``points``, in natural order of their ids.

    image_rms: (n,), root mean square image residual of each point as numbered in the observations, mm.
    rank: (n,), place of each of them in natural order.
    """
    points, ids = result.points, result.refined.observations.point_ids
    models = np.zeros(len(ids), np.intp)
    for strip in result.strips:
        models[strip.formed.point] += strip.formed.model_count
    columns = {
        "id": np.array(ids, object)[points.number],
        "role": np.array(ROLES, object)[result.roles],
        **coordinates(result, points.ground),
        **point_columns(result),
        "rays": points.rays,
        "models": models[points.number],
        "checked": np.array(CHECKED, object)[checked_of(result, models[points.number])],
        "image_rms_um": image_rms[points.number] * 1000.0,
    }
    return Table.of("points", columns)[np.argsort(rank[points.number])]


def ties_of(result: Result, rank: Numbers) -> Table:
    """Return the list ``ties``: points of two strips with their differences, second minus first."""
    ties, ids = result.ties, result.refined.observations.point_ids
    names = [strip.strip.id for strip in result.strips]
    scale = np.array([strip.scale_number for strip in result.strips])[ties.strips].mean(axis=1)
    level, axes = _level_ties(result), result.output.user_from_internal(ties.difference)
    columns = {
        "id": [ids[number] for number in ties.number],
        "strips": [[names[first], names[second]] for first, second in ties.strips],
        **size_columns(axes, np.hypot(level[:, 0], level[:, 1]), level[:, 2], scale),
    }
    return Table.of("ties", columns)[np.lexsort((ties.strips[:, 1], ties.strips[:, 0], rank[ties.number]))]


def _level_ties(result: Result) -> Floats:
    """Differences of ties to the east, to the north and up."""
    if result.output.kind != "geocentric":
        return result.ties.difference
    place = result.points.cartesian[np.searchsorted(result.points.number, result.ties.number)]
    level: Floats = np.einsum("nij,nj->ni", result.output.level_axes_at(place), result.ties.difference)
    return level


def not_determined_of(result: Result) -> Table:
    """Return the list ``not_determined``: measured points without coordinates, and why."""
    names = tuple(result.not_determined)
    order = [names[row] for row in np.argsort(natural_rank(names))]
    return Table.of("not_determined", {"id": order, "reason": [result.not_determined[name] for name in order]})


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
    observations, found = result.refined.observations, []
    for strip in result.photo_strips:
        photos = strip.of_photos.strip.oriented(strip.resection.centers, strip.resection.rotations)
        known = _known(observations, strip.formed.point, strip.xyz, strip.rows, strip.resection.residuals)
        found.append(_residuals(observations, strip.of_photos.strip, photos, known, rank))
    if result.bundle is None or not result.bundle.singles:
        return found
    bundle = result.bundle
    rows, own = bundle.block.rows[bundle.screened.selection.images], bundle.screened.solution.image_residuals
    known = _known(observations, result.points.number, result.points.cartesian, rows, own)
    for each in bundle.singles:
        photos = each.strip.oriented(each.center[None], each.rotation[None])
        found.append(_residuals(observations, each.strip, photos, known, rank))
    return found


def _known(
    observations: PhotoPoints, number: Numbers, xyz: Floats, rows: Numbers, own: Floats
) -> tuple[Floats, Flags, Floats]:
    """Return the places of all points, which measurements took part, and the residuals of these: those in some rows."""
    places, used = np.full((len(observations.point_ids), 3), np.nan), np.zeros(len(observations), bool)
    residuals = np.full((len(observations), 2), np.nan)
    places[number], used[rows], residuals[rows] = xyz, True, own
    return places, used, residuals


def _residuals(
    observations: PhotoPoints, strip: Strip, photos: KnownPhotos, known: tuple[Floats, Flags, Floats], rank: Numbers
) -> ImageResiduals:
    """Return residuals: of what took part those of the adjustment, of all else how its points would be seen."""
    position, (places, used, own) = strip.positions(observations), known
    rows = np.flatnonzero(position >= 0)
    rows = rows[order_of(position[rows], rank[observations.point[rows]])]
    photo, point = position[rows], observations.point[rows]
    with np.errstate(invalid="ignore"):
        seen = observations.xy[rows] - project(places[point], photos, photo)
        residuals = np.where(used[rows, None], own[rows], seen)
        depth = depths(places, point, photos.centers, photos.rotations, photo)
    return ImageResiduals(strip=strip, rows=rows, photo=photo, residuals=residuals, depth=depth, used=used[rows])


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
    photos, resection = strip.strip.photos, strip.resection
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
    known = np.flatnonzero(np.isfinite(strip.placed.centers).all(axis=1))
    centers = strip.intermediate.cartesian_from_intermediate(strip.placed.centers[known])
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


def fiducials_of(result: Result) -> Document:
    """Return the interior orientation of each photo, and the residuals of its marks; nothing without marks."""
    found = result.interior
    if found is None or not found.photo_ids:
        return {}
    photos = {
        "photo": list(found.photo_ids),
        "transform": list(found.transforms),
        "coefficients": significant(found.photo_from_measured.coefficients, EXACT),
        "sigma0_um": found.sigma0 * MICROMETRES,
        **attributes(found, "redundancy scale_x scale_y mirrored"),
        "rotation_deg": np.degrees(found.rotation),
        "shear_deg": np.degrees(found.shear),
        "marks": list(map(len, found.marks)),
    }
    residuals = np.concatenate(found.residuals) * MICROMETRES
    marks = {
        "photo": np.repeat(np.array(found.photo_ids, object), photos["marks"]),
        "mark": [mark for marks in found.marks for mark in marks],
        "vx_um": residuals[:, 0],
        "vy_um": residuals[:, 1],
    }
    return {"fiducials": Table.of("fiducials", photos), "fiducial_marks": Table.of("fiducial_marks", marks)}


def refined_table(result: Result) -> Table:
    """Return the table of refined.csv, photos in flight order and points in natural order; of models there are none.

    The coordinates are those that the adjustment takes, corrected by a
    calibration where a bundle has found one.
    """
    found = result.refined.observations
    place = {photo: number for number, photo in enumerate(p for strip in result.inputs.strips for p in strip.photos)}
    order = np.array([place.get(photo, len(place)) for photo in found.photo_ids], np.intp)
    rows = order_of(order[found.photo], natural_rank(found.point_ids)[found.point])
    sigma: Floats = found.sigma[rows] * MICROMETRES
    columns = {
        "photo": np.array(found.photo_ids, object)[found.photo[rows]],
        "point": np.array(found.point_ids, object)[found.point[rows]],
        "x_mm": found.xy[rows, 0],
        "y_mm": found.xy[rows, 1],
        "sigma_x_um": sigma[:, 0],
        "sigma_y_um": sigma[:, 1],
    }
    return Table.of("refined", columns)
