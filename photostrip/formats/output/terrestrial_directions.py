"""Documents of direction computations: what goes out as JSON and CSV, and what reports are made from."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Floats
from photostrip.formats.output.csv_text import to_csv
from photostrip.notes import Document
from photostrip.result.numbers import EXACT, rounded, significant
from photostrip.terrestrial import accuracy
from photostrip.terrestrial.normal_case import Phototheodolite, directions_from_photo, photo_from_directions
from photostrip.terrestrial.orientation import ANGLES, REFRACTION, OrientationSettings, PhotoOrientation, Sightings
from photostrip.units import ARCSECONDS, MICROMETRES

Grid = tuple[Floats, Floats]  # x and z of a table over the photo in mm, from the principal point

SCHEMA = 1
ANGLE, ARCSEC, MILLIMETRE, IMAGE_UM, RATIO = 8, 5, 6, 4, 5  # decimals: finer than any report prints
PER_RADIAN = {"deg": 180 / np.pi, "gon": 200 / np.pi}
FULL_CIRCLE = 2 * np.pi
ANGLE_ROUNDING = 1e-12  # rad


class Attitude(NamedTuple):
    """How a camera looks."""

    angles: tuple[float, float, float]  # alpha, omega, kappa
    rotation: Floats  # (3, 3): photo to ground
    unit: str  # in which angles and directions are reported: ``"deg"`` or ``"gon"``


class Theodolite(NamedTuple):
    """Standard deviations of directions measured in one round, in arcseconds, and the number of rounds."""

    horizontal: float
    vertical: float
    rounds: int


def head(kind: str, camera: Phototheodolite | None = None) -> Document:
    """Begin a document: what it is and of which camera."""
    document: Document = {"photostrip_terrestrial_result": SCHEMA, "kind": kind}
    if camera is not None:
        document["camera"] = {
            "name": camera.name,
            "principal_distance_mm": rounded(camera.principal_distance, MILLIMETRE),
            "principal_point_mm": rounded(camera.principal_point, MILLIMETRE),
            "format_mm": None if camera.format is None else rounded(camera.format, MILLIMETRE),
        }
    return document


def _oriented_head(kind: str, camera: Phototheodolite, attitude: Attitude) -> Document:
    """Begin a document of an oriented camera, azimuth from 0 to a full circle."""
    alpha, omega, kappa = attitude.angles
    angles = rounded(np.array([positive(alpha), omega, kappa]) * PER_RADIAN[attitude.unit], ANGLE)
    return head(kind, camera) | {"orientation": {"unit": attitude.unit, **dict(zip(ANGLES, angles, strict=True))}}


def positive(angle: float) -> float:
    """Bring an azimuth between 0 and a full circle; what rounds to the full circle is 0."""
    turned = float(np.mod(angle, FULL_CIRCLE))
    return 0.0 if FULL_CIRCLE - turned < ANGLE_ROUNDING else turned


def directions_document(
    camera: Phototheodolite, attitude: Attitude, ids: Sequence[str], xz: Floats, sigma: float | None
) -> Document:
    """Return the directions of image points.

    xz: (n, 2), image coordinates in mm as measured.
    sigma: standard deviation of an image coordinate in mm, for those of the directions.
    """
    reduced = xz - np.array(camera.principal_point)
    directions = directions_from_photo(reduced, camera.principal_distance, attitude.rotation)
    document = _points_and_directions("directions", camera, attitude, ids, reduced, directions)
    if sigma is not None:
        document["image_sigma_um"] = rounded(sigma * MICROMETRES, IMAGE_UM)
        errors = accuracy.required(reduced, camera.principal_distance, sigma, attitude.rotation)
        for row, angle, vertical in zip(document["points"], errors.angle, errors.vertical, strict=True):
            row["sigma_lambda_arcsec"] = rounded(angle * ARCSECONDS, ARCSEC)
            row["sigma_beta_arcsec"] = rounded(vertical * ARCSECONDS, ARCSEC)
    return document


def photo_document(camera: Phototheodolite, attitude: Attitude, ids: Sequence[str], directions: Floats) -> Document:
    reduced = photo_from_directions(directions, camera.principal_distance, attitude.rotation)
    return _points_and_directions("photo-coordinates", camera, attitude, ids, reduced, directions)


def _points_and_directions(
    kind: str, camera: Phototheodolite, attitude: Attitude, ids: Sequence[str], reduced: Floats, directions: Floats
) -> Document:
    """Return photo coordinates, given from the principal point, with their directions."""
    document, unit = _oriented_head(kind, camera, attitude), attitude.unit
    document["units"] = {"x": "mm", "z": "mm", "lambda": unit, "beta": unit, "_arcsec": "seconds of arc"}
    xz = rounded(reduced + np.array(camera.principal_point), MILLIMETRE)
    turned = np.array([[positive(each[0]), each[1]] for each in directions]).reshape(-1, 2)
    rows = zip(ids, xz, rounded(turned * PER_RADIAN[unit], ANGLE), strict=True)
    document["points"] = [
        {"id": name, "x": x, "z": z, "lambda": horizontal, "beta": vertical}
        for name, (x, z), (horizontal, vertical) in rows
    ]
    return document


def required_accuracy(
    camera: Phototheodolite, attitude: Attitude, sigma: float, grid: Grid, *, as_printed: bool = False
) -> Document:
    """Return the accuracy over the photo with which directions must be measured.

    sigma: standard deviation of image coordinates and principal distance in mm.
    """
    xz = _grid_points(grid)
    exact = accuracy.required(xz, camera.principal_distance, sigma, attitude.rotation)
    document = _oriented_head("direction-accuracy", camera, attitude)
    document["image_sigma_um"] = rounded(sigma * MICROMETRES, IMAGE_UM)
    document["formulas"] = "as printed" if as_printed else "exact"
    document["units"] = {"x": "mm from the principal point", "z": "mm from the principal point"}
    columns = {"angle_arcsec": exact.angle, "horizontal_arcsec": exact.horizontal, "vertical_arcsec": exact.vertical}
    if as_printed:
        printed = accuracy.as_printed(xz, camera.principal_distance, sigma)
        columns = {
            "angle_arcsec": printed.horizontal * np.sqrt(2.0),
            "horizontal_arcsec": printed.horizontal,
            "vertical_arcsec": printed.vertical_eq6,
            "vertical_eq5_arcsec": printed.vertical_eq5,
            "vertical_exact_arcsec": exact.vertical,
        }
    document["points"] = _table(xz, {name: column * ARCSECONDS for name, column in columns.items()}, ARCSEC)
    return document


def _grid_points(grid: Grid) -> Floats:
    return np.column_stack([axis.ravel() for axis in np.meshgrid(*grid)])


def _table(xz: Floats, columns: dict[str, Floats], decimals: int) -> list[Document]:
    names = ("x", "z", *columns)
    values = np.column_stack([rounded(xz, MILLIMETRE), *(rounded(each, decimals) for each in columns.values())])
    return [dict(zip(names, row, strict=True)) for row in values.tolist()]


def theodolite_accuracy(
    camera: Phototheodolite, attitude: Attitude, theodolite: Theodolite, sigma: float | None, grid: Grid
) -> Document:
    """Return the image accuracy over the photo that a theodolite can vouch for.

    sigma: image accuracy wanted, mm: the rounds it needs are computed.
    """
    xz = _grid_points(grid)
    horizontal, vertical, rounds = theodolite
    means = [each / sqrt(rounds) for each in (horizontal, vertical)]
    by = (means[0] / ARCSECONDS, means[1] / ARCSECONDS)
    image = accuracy.supported(xz, camera.principal_distance, *by, attitude.rotation) * MICROMETRES
    document = _oriented_head("theodolite-accuracy", camera, attitude)
    document["theodolite"] = {
        "horizontal_arcsec": rounded(horizontal, ARCSEC),
        "vertical_arcsec": rounded(vertical, ARCSEC),
        "rounds": rounds,
        "mean_horizontal_arcsec": rounded(means[0], ARCSEC),
        "mean_vertical_arcsec": rounded(means[1], ARCSEC),
    }
    document["supported_um"] = {
        "by_horizontal": rounded(image[:, 0].max(), IMAGE_UM),
        "by_vertical": rounded(image[:, 1].max(), IMAGE_UM),
        "by_both": rounded(image.max(), IMAGE_UM),
    }
    if sigma is not None:
        needed = accuracy.required(xz, camera.principal_distance, sigma, attitude.rotation)
        document["wanted"] = {
            "image_sigma_um": rounded(sigma * MICROMETRES, IMAGE_UM),
            "rounds_horizontal": accuracy.rounds_for(horizontal, float(needed.horizontal.min()) * ARCSECONDS),
            "rounds_vertical": accuracy.rounds_for(vertical, float(needed.vertical.min()) * ARCSECONDS),
        }
    columns = {"by_horizontal_um": image[:, 0], "by_vertical_um": image[:, 1], "supported_um": image.max(axis=1)}
    document["points"] = _table(xz, columns, IMAGE_UM)
    return document


def worked_examples() -> Document:
    """Return the worked examples of the source: as printed, by the printed formulas, and exact."""
    document = head("worked-examples")
    document["examples"] = []
    for example in accuracy.EXAMPLES:
        found = accuracy.worked(example)
        document["examples"].append(
            {
                "camera": example.camera,
                "f_mm": example.f,
                "x_mm": example.x,
                "z_mm": example.z,
                "image_sigma_um": rounded(example.sigma * MICROMETRES, IMAGE_UM),
                "horizontal_printed_arcsec": example.horizontal,
                "horizontal_exact_arcsec": rounded(found.horizontal, ARCSEC),
                "vertical_printed_arcsec": example.vertical,
                "factor_printed": example.factor,
                "vertical_with_printed_factor_arcsec": rounded(found.printed_factor, ARCSEC),
                "factor_of_camera": rounded(found.factor, 4),
                "vertical_eq6_arcsec": rounded(found.eq6, ARCSEC),
                "vertical_eq5_arcsec": rounded(found.eq5, ARCSEC),
                "vertical_exact_arcsec": rounded(found.vertical, ARCSEC),
                "z_returned_by_printed_eq3_mm": rounded(found.returned_z, ARCSEC),
            }
        )
    return document


def oriented(
    camera: Phototheodolite, sightings: Sightings, found: PhotoOrientation, settings: OrientationSettings, unit: str
) -> Document:
    document = head("photo-orientation", camera)
    if settings.eccentricity:
        document["eccentricity_m"] = rounded(settings.eccentricity, EXACT)
    if found.refraction and REFRACTION not in found.names:
        document["refraction"] = rounded(found.refraction, EXACT)
    lower, upper = found.sigma0_range(settings.significance)
    document["summary"] = {
        "points": len(sightings.ids),
        "points_used": int(found.used.sum()),
        "directions_used": int(sightings.measured[found.used].sum()),
        "redundancy": found.dof,
        "sigma0": rounded(found.sigma0, RATIO),
        "sigma0_range": rounded([lower, upper], RATIO),
        "screening": settings.screening,
        "significance": settings.significance,
        "condition": significant(found.condition),
    }
    document["elements"] = [
        _element(name, value, sigma, unit)
        for name, value, sigma in zip(found.names, found.values, found.sigma, strict=True)
    ]
    document["correlations"] = rounded(found.cofactors / np.outer(found.sigma, found.sigma), RATIO)
    document["rotation"] = rounded(found.rotation.ravel(), 12)
    document["points"] = _sighted(sightings, found)
    document["rejected"] = [
        {
            "point": sightings.ids[each.row],
            "test": each.test,
            "value": significant(each.value),
            "limit": significant(each.limit),
            "lambda_arcsec": rounded(each.size[0] * ARCSECONDS, ARCSEC),
            "beta_arcsec": rounded(each.size[1] * ARCSECONDS, ARCSEC),
        }
        for each in found.rejected
    ]
    return document


def _element(name: str, value: float, sigma: float, unit: str) -> Document:
    """Return one unknown: angles in the user's unit with seconds, the others in mm with micrometres."""
    if name in ANGLES:
        angle = positive(value) if name == "alpha" else value
        found = {"value": rounded(angle * PER_RADIAN[unit], ANGLE), "unit": unit}
        return {"name": name, **found, "sigma": rounded(sigma * ARCSECONDS, ARCSEC), "sigma_unit": "arcsec"}
    if name == REFRACTION:
        return {
            "name": name,
            "value": rounded(value, RATIO),
            "unit": "",
            "sigma": rounded(sigma, RATIO),
            "sigma_unit": "",
        }
    found = {"value": rounded(value, MILLIMETRE), "unit": "mm"}
    return {"name": name, **found, "sigma": rounded(sigma * MICROMETRES, IMAGE_UM), "sigma_unit": "um"}


def _sighted(sightings: Sightings, found: PhotoOrientation) -> list[Document]:
    residuals = rounded(found.residuals * ARCSECONDS, ARCSEC)
    shares = rounded(found.redundancy, RATIO)
    return [
        {
            "id": name,
            "used": bool(used),
            "v_lambda_arcsec": v[0],
            "v_beta_arcsec": v[1],
            "redundancy_lambda": r[0],
            "redundancy_beta": r[1],
        }
        for name, used, v, r in zip(sightings.ids, found.used, residuals, shares, strict=True)
    ]


def camera_list(cameras: dict[str, Phototheodolite]) -> Document:
    document = head("cameras")
    document["cameras"] = []
    for name, each in cameras.items():
        size = each.format or (np.nan, np.nan)
        keys = ("principal_distance_mm", "x0_mm", "z0_mm", "width_mm", "height_mm")
        values = rounded([each.principal_distance, *each.principal_point, *size], MILLIMETRE)
        document["cameras"].append({"id": name, **dict(zip(keys, values, strict=True))})
    return document


def points_csv(document: Document) -> str:
    """Return the points, the worked examples or the cameras of a document as CSV."""
    rows = next(document[key] for key in ("examples", "cameras", "points") if key in document)
    names = list(rows[0]) if rows else ["id"]
    return to_csv(["point" if name == "id" else name for name in names], (row.values() for row in rows))
