"""Directions of a phototheodolite: of image points and back, their accuracy, a photo oriented by them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from math import sqrt
from typing import Any

import numpy as np

from photostrip.arrays import Floats
from photostrip.notes import counted
from photostrip.report.page.parts import DASH, Part, Words
from photostrip.report.page.tables import Cell, Field, fields, written
from photostrip.sheets.sheet import Fact, Rows, Sheet, by_columns, filled, hidden, plain, table, taken
from photostrip.terrestrial import accuracy
from photostrip.terrestrial.accuracy import Theodolite
from photostrip.terrestrial.normal_case import (
    Attitude,
    Phototheodolite,
    directions_from_photo,
    partials,
    photo_from_directions,
)
from photostrip.terrestrial.orientation import ANGLES, REFRACTION, OrientationSettings, PhotoOrientation, Sightings
from photostrip.units import ARCSECONDS, MICROMETRES

Grid = tuple[Floats, Floats]  # x and z of a table over the photo in mm, from the principal point

ANGLE = 5  # decimals in deg and gon: 0.04 and 0.03 seconds of arc
PER_RADIAN = {"deg": 180 / np.pi, "gon": 200 / np.pi}
FULL_CIRCLE = 2 * np.pi
ANGLE_ROUNDING = 1e-12  # rad
OF_THE_PHOTO = "µm in the photo, of x, z and the principal distance"


def camera_facts(camera: Phototheodolite, attitude: Attitude | None = None) -> list[Fact]:
    """Say which camera it is and how it looks."""
    x0, z0 = camera.principal_point
    text = f"{camera.name}, f {camera.principal_distance:.9g} mm"
    text += f", principal point {x0:.9g}, {z0:.9g} mm" if (x0, z0) != (0.0, 0.0) else ""
    value = {
        "name": camera.name,
        "principal_distance_mm": plain(camera.principal_distance, "mm 4"),
        "principal_point_mm": plain(camera.principal_point, "mm 4"),
        "format_mm": camera.format,
    }
    facts = [Fact("camera", value, text=text)]
    if attitude is not None:
        alpha, omega, kappa = attitude.angles
        turned = [each * PER_RADIAN[attitude.unit] for each in (positive(alpha), omega, kappa)]
        angles = dict(zip(ANGLES, turned, strict=True))
        shown = ", ".join(f"{name} {value:z.{ANGLE}f}" for name, value in angles.items())
        stated = {"unit": attitude.unit, **{name: plain(value, f"deg {ANGLE + 1}") for name, value in angles.items()}}
        facts.append(Fact("orientation", stated, text=f"{shown} {attitude.unit}"))
    return facts


def positive(angle: float) -> float:
    """Bring an azimuth between 0 and a full circle; what rounds to the full circle is 0."""
    turned = float(np.mod(angle, FULL_CIRCLE))
    return 0.0 if FULL_CIRCLE - turned < ANGLE_ROUNDING else turned


def directions_sheet(
    camera: Phototheodolite, attitude: Attitude, ids: Sequence[str], xz: Floats, sigma: float | None
) -> Sheet:
    """Return the directions of image points.

    xz: (n, 2), image coordinates in mm as measured.
    sigma: standard deviation of an image coordinate in mm, for those of the directions.
    """
    reduced = xz - np.array(camera.principal_point)
    directions = directions_from_photo(reduced, camera.principal_distance, attitude.rotation)
    facts = camera_facts(camera, attitude)
    more: tuple[Field, ...] = ()
    errors = np.zeros((len(xz), 0))
    if sigma is not None:
        facts.append(_sigma(sigma))
        found = accuracy.required(reduced, camera.principal_distance, sigma, attitude.rotation)
        errors = np.column_stack([found.angle, found.vertical]) * ARCSECONDS
        more = tuple(Field(f"sigma_{name}_arcsec", "arcsec 2", f"m_{name}") for name in ("lambda", "beta"))
    points = _points(attitude, ids, xz, directions, more, errors)
    by = partials(reduced, camera.principal_distance, attitude.rotation)
    rates = np.concatenate([by.by_xz, by.by_f[..., None]], axis=-1).reshape(len(xz), -1) * ARCSECONDS / MICROMETRES
    slopes = Rows(
        "derivatives",
        "Derivatives, seconds of arc for each µm, eq. 4",
        (
            Field("point"),
            *(
                Field(f"{direction}_by_{name}_arcsec_um", "ratio +4", f"{direction} / {name}")
                for direction, name in product(("lambda", "beta"), ("x", "z", "f"))
            ),
        ),
        by_columns(ids, rates),
    )
    return Sheet("directions", "Directions of image points", facts, [points, slopes], main="points")


def photo_sheet(camera: Phototheodolite, attitude: Attitude, ids: Sequence[str], directions: Floats) -> Sheet:
    """Return where directions meet the photo."""
    reduced = photo_from_directions(directions, camera.principal_distance, attitude.rotation)
    points = _points(attitude, ids, reduced + np.array(camera.principal_point), directions)
    return Sheet("photo-coordinates", "Image coordinates of directions", camera_facts(camera, attitude), [points])


def _points(
    attitude: Attitude,
    ids: Sequence[str],
    xz: Floats,
    directions: Floats,
    more: tuple[Field, ...] = (),
    values: Floats | None = None,
) -> Rows:
    turned = np.array([[positive(each[0]), each[1]] for each in directions]).reshape(-1, 2)
    rows = by_columns(ids, xz, turned * PER_RADIAN[attitude.unit], *([] if values is None else [values]))
    angles = fields("lambda beta", f"{attitude.unit} {ANGLE}")
    return Rows("points", "", (Field("point"), *fields("x z", "mm 4"), *angles, *more), rows)


def _sigma(sigma: float) -> Fact:
    return Fact(
        "image_sigma_um", sigma * MICROMETRES, "um 3", f"{sigma * MICROMETRES:.4g} {OF_THE_PHOTO}", "standard deviation"
    )


def accuracy_sheet(
    camera: Phototheodolite,
    ends: Sequence[Attitude],
    sigma: float,
    grid: Grid,
    theodolites: Mapping[str, tuple[float, float]],
    *,
    as_printed: bool = False,
) -> Sheet:
    """Return the accuracy over the photo with which directions must be measured, and the rounds that give it.

    ends: of the base; of two the stricter counts everywhere.
    sigma: standard deviation of image coordinates and principal distance in mm.
    theodolites: standard deviations of a horizontal and of a vertical direction in one round, arcseconds.
    """
    xz = _grid_points(grid)
    of_ends = [accuracy.required(xz, camera.principal_distance, sigma, each.rotation) for each in ends]
    angle, horizontal, vertical = (
        np.minimum.reduce([getattr(each, name) for each in of_ends]) for name in ("angle", "horizontal", "vertical")
    )
    columns = {
        "horizontal_arcsec": ("Horizontal directions, m_lambda in ″", horizontal),
        "vertical_arcsec": ("Vertical directions, m_beta in ″", vertical),
    }
    note = "" if len(ends) == 1 else "of both ends of the base the stricter one"
    if as_printed:
        printed = accuracy.as_printed(xz, camera.principal_distance, sigma)
        angle = printed.horizontal * np.sqrt(2.0)
        columns = {
            "horizontal_arcsec": ("Horizontal directions, m_lambda in ″", printed.horizontal),
            "vertical_arcsec": ("Vertical directions as printed (eq. 6), m_beta in ″", printed.vertical_eq6),
            "vertical_eq5_arcsec": ("Vertical directions as printed (eq. 5), m_beta in ″", printed.vertical_eq5),
            "vertical_exact_arcsec": ("Vertical directions, exact, m_beta in ″", vertical),
        }
        note = (
            "The vertical directions inherit sec(lambda') from eq. 3, where cos(lambda') is right; without `as_printed`"
        )
        note += " the exact values are given."
    needed = [float((columns[f"{name}_arcsec"][1] * ARCSECONDS).min()) for name in ("horizontal", "vertical")]
    formulas = "as printed" if as_printed else "exact"
    right = [replace(each, key="right", label="right end") for each in camera_facts(camera, ends[-1])[1:]]
    facts = [
        *camera_facts(camera, ends[0]),
        *(right if len(ends) > 1 else []),
        _sigma(sigma),
        Fact("formulas", formulas, text=formulas),
        Fact(
            "needed_arcsec",
            plain(needed, "arcsec 2"),
            text=f"horizontal {needed[0]:.2f}″, vertical {needed[1]:.2f}″",
            label="needed everywhere",
        ),
    ]
    angles = Field("angle_arcsec", "arcsec 2", shown=False)
    columns_over = tuple(Field(key, "arcsec 2", title) for key, (title, _) in columns.items())
    values = np.column_stack([angle, *(column for _, column in columns.values())]) * ARCSECONDS
    tables = [_over_photo(xz, (angles, *columns_over), values)]
    if note:
        tables.append(Rows("", "", (), (), below=[note]))
    turns = {
        name: [accuracy.rounds_for(each, limit) for each, limit in zip(sizes, needed, strict=True)]
        for name, sizes in theodolites.items()
    }
    rounds = Rows(
        "rounds",
        "Rounds, both faces, that give it",
        (
            Field("theodolite"),
            *fields("sigma_horizontal_arcsec sigma_vertical_arcsec", "arcsec 2", "horizontal vertical", "one round, ″"),
            *fields("horizontal vertical", "count", below="rounds"),
            Field("rounds", "count"),
        ),
        [(name, *theodolites[name], *counts, max(counts)) for name, counts in turns.items()],
    )
    tables.append(rounds)
    return Sheet("direction-accuracy", "Required accuracy of correction directions", facts, tables)


def _grid_points(grid: Grid) -> Floats:
    return np.column_stack([axis.ravel() for axis in np.meshgrid(*grid)])


def _over_photo(xz: Floats, columns: Sequence[Field], values: Floats) -> Rows:
    axes = (Field("x", "mm g9"), Field("z", "mm g9", "z \\ x"))
    shown = tuple(each.key for each in columns if each.shown)
    return Rows(
        "points", "", (*axes, *columns), by_columns(xz[:, 0].tolist(), xz[:, 1], values), across="x", tables=shown
    )


def theodolite_sheet(
    camera: Phototheodolite, attitude: Attitude, theodolite: Theodolite, sigma: float | None, grid: Grid
) -> Sheet:
    """Return the image accuracy over the photo that a theodolite can vouch for.

    sigma: image accuracy wanted, mm: the rounds it needs are computed.
    """
    xz = _grid_points(grid)
    horizontal, vertical, rounds = theodolite
    means = [each / sqrt(rounds) for each in (horizontal, vertical)]
    by = (means[0] / ARCSECONDS, means[1] / ARCSECONDS)
    image = accuracy.supported(xz, camera.principal_distance, *by, attitude.rotation) * MICROMETRES
    largest = [float(each) for each in (image[:, 0].max(), image[:, 1].max(), image.max())]
    given = {"horizontal_arcsec": plain(horizontal, "arcsec 3"), "vertical_arcsec": plain(vertical, "arcsec 3")}
    mean = {
        f"mean_{name}_arcsec": plain(each, "arcsec 2")
        for name, each in zip(("horizontal", "vertical"), means, strict=True)
    }
    of_one, of_means = (
        f"horizontal {horizontal:.4g}″, vertical {vertical:.4g}″",
        f"horizontal {means[0]:.2f}″, vertical {means[1]:.2f}″",
    )
    supported = dict(zip(("by_horizontal", "by_vertical", "by_both"), plain(largest, "um 2"), strict=True))
    facts = [
        *camera_facts(camera, attitude),
        Fact("theodolite", {**given, "rounds": rounds, **mean}, text=of_one, label="theodolite, one round"),
        Fact("mean", plain(means, "arcsec 2"), text=of_means, label=f"mean of {counted(rounds, 'round')}"),
        Fact(
            "supported_um",
            supported,
            text=f"{largest[2]:.2f} µm everywhere (horizontal {largest[0]:.2f}, vertical {largest[1]:.2f})",
            label="supports in the photo",
        ),
    ]
    if sigma is not None:
        needed = accuracy.required(xz, camera.principal_distance, sigma, attitude.rotation)
        pairs = ((horizontal, needed.horizontal), (vertical, needed.vertical))
        turns = [accuracy.rounds_for(each, float(limit.min()) * ARCSECONDS) for each, limit in pairs]
        wanted = {"image_sigma_um": plain(sigma * MICROMETRES, "um 2")}
        wanted |= {"rounds_horizontal": turns[0], "rounds_vertical": turns[1]}
        text = f"{counted(max(turns), 'round')} (horizontal {turns[0]}, vertical {turns[1]})"
        facts.append(Fact("wanted", wanted, text=text, label=f"for {sigma * MICROMETRES:.4g} µm"))
    columns = (
        *hidden("by_horizontal_um", "by_vertical_um", form="um 2"),
        Field("supported_um", "um 2", "Standard deviation of image coordinates that it supports, µm"),
    )
    values = np.column_stack([image, image.max(axis=1)])
    title = "Image accuracy that a theodolite supports"
    return Sheet("theodolite-accuracy", title, facts, [_over_photo(xz, columns, values)])


def orientation_sheet(
    camera: Phototheodolite, sightings: Sightings, found: PhotoOrientation, settings: OrientationSettings, unit: str
) -> Sheet:
    """Return a photo oriented by directions: elements, residuals, what was rejected."""
    facts = camera_facts(camera)
    if settings.eccentricity:
        text = f"{settings.eccentricity:.4g} m ahead of the theodolite's axes"
        facts.append(Fact("eccentricity_m", settings.eccentricity, text=text, label="front node"))
    if found.refraction and REFRACTION not in found.names:
        facts.append(Fact("refraction", found.refraction, text=f"k {found.refraction:.4g} of the photo's rays"))
    lower, upper = found.sigma0_range(settings.significance)
    used, directions = int(found.used.sum()), int(sightings.measured[found.used].sum())
    checked = np.isfinite(found.sigma0)
    expected = f"between {lower:.2f} and {upper:.2f} is as expected"
    facts += [
        Fact("points_used", used, text=f"{used} of {len(sightings.ids)} used, {directions} directions", label="points"),
        Fact("directions_used", directions),
        Fact("redundancy", found.dof, text=str(found.dof) if found.dof else "0: no check"),
        Fact(
            "sigma0",
            found.sigma0,
            "ratio 3",
            f"{found.sigma0:.2f} times the stated standard deviations; {expected}" if checked else DASH,
        ),
        Fact("sigma0_range", plain([lower, upper], "ratio 3")),
        Fact("screening", settings.screening),
        Fact("significance", settings.significance),
        Fact("condition", found.condition, "ratio g3", label="condition number"),
        Fact("correlations", plain(found.cofactors / np.outer(found.sigma, found.sigma), "ratio 3")),
        Fact("rotation", plain(found.rotation.ravel(), "ratio 10")),
    ]
    outside: list[Part] = []
    if checked and not lower <= found.sigma0 <= upper:
        outside = [Words("The scatter of the directions does not agree with the stated standard deviations.", "look")]
    elements = Rows(
        "elements",
        "Elements",
        (
            Field("name", head="element"),
            Field("value", " 4"),
            Field("unit", head=""),
            Field("sigma", " 1"),
            Field("sigma_unit", head=""),
        ),
        [_element(*each, unit) for each in zip(found.names, found.values, found.sigma, strict=True)],
    )
    columns = [
        (Field("point"), list(sightings.ids)),
        *filled(fields("v_lambda_arcsec v_beta_arcsec", "arcsec 1", "v_lambda v_beta"), found.residuals * ARCSECONDS),
        (Field("redundancy_lambda", "ratio 2", "redundancy", "lambda"), found.redundancy[:, 0]),
        (Field("redundancy_beta", "ratio 2", "redundancy", "beta"), found.redundancy[:, 1]),
        (Field("used", head=""), [Cell("" if kept else "rejected", bool(kept)) for kept in found.used]),
    ]
    residuals = table("points", "Residuals", columns)
    tests = {"deletion": "p value {0:.2g}, limit {1:.2g}", "stated": "chi-square {0:.3g}, limit {1:.3g}"}
    rejected: list[tuple[Any, ...]] = [
        (sightings.ids[each.row], each.test, each.value, each.limit, *(float(size) * ARCSECONDS for size in each.size))
        for each in found.rejected
    ]
    left_out = Rows(
        "rejected",
        "Rejected",
        (
            *hidden("point", "test"),
            *hidden("value", "limit", form="ratio g4"),
            *hidden("lambda_arcsec", "beta_arcsec", form="arcsec 1"),
        ),
        rejected,
        below=[
            Words(
                f"{point}: lambda {by[0]:.1f}″, beta {by[1]:.1f}″ off the orientation without it"
                f" ({tests.get(test, tests['stated']).format(value, limit)})",
                mark="-",
            )
            for point, test, value, limit, *by in rejected
        ],
    )
    first = Rows("", "", (), (), below=outside)
    order = [first, elements, residuals, left_out]
    return Sheet("photo-orientation", "Orientation of a photo by directions", facts, order, main="points")


def _element(name: str, value: float, sigma: float, unit: str) -> tuple[object, ...]:
    """Return one unknown: angles in the user's unit with seconds, the others in mm with micrometres."""
    if name in ANGLES:
        angle = (positive(value) if name == "alpha" else value) * PER_RADIAN[unit]
        return name, _formed(angle, f" {ANGLE}"), unit, sigma * ARCSECONDS, Cell("″", "arcsec")
    if name == REFRACTION:
        return name, _formed(value, " 3"), "", _formed(sigma, " 3"), ""
    return name, value, "mm", sigma * MICROMETRES, Cell("µm", "um")


def _formed(value: float, form: str) -> Cell:
    return Cell(written(value, form), plain(value, form))


def cameras_sheet(cameras: dict[str, Phototheodolite]) -> Sheet:
    """Return the cameras that can be named."""
    columns = (
        Field("camera", of="name"),
        Field("principal_distance_mm", "mm g9", "f", of="principal_distance"),
        Field("x0_mm", "mm g9", "x0", of=lambda camera: camera.principal_point[0]),
        Field("z0_mm", "mm g9", "z0", of=lambda camera: camera.principal_point[1]),
        Field("format_mm", "mm g4", "format", of=_format),
    )
    named = [replace(camera, name=name) for name, camera in cameras.items()]
    return Sheet("cameras", "Cameras", (), [table("cameras", "", taken(columns, named))])


def _format(camera: Phototheodolite) -> Cell:
    size = camera.format
    return Cell(DASH if size is None else " × ".join(f"{each:.4g}" for each in size), size)
