"""What users type on the command line for terrestrial computations: cameras, angles, pairs of numbers, tables."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.errors import Fault, InputError
from photostrip.formats.measured.terrestrial import DIRECTION_POINTS, IMAGE_POINTS, SIGHTINGS, PointTable, read_points
from photostrip.formats.text.findings import Findings
from photostrip.formats.text.numbers import NotANumber, number, shown
from photostrip.project.terrestrial.terrestrial_file import MILLIMETRES
from photostrip.project.terrestrial.terrestrial_presets import preset, read_presets
from photostrip.project.terrestrial.terrestrial_ranges import (
    COORDINATE,
    DEGREES,
    DIRECTION_SIGMA,
    FORMAT,
    GON,
    IMAGE_SIGMA,
    PRINCIPAL_DISTANCE,
    Range,
    refuse_outside,
    within,
)
from photostrip.terrestrial.directions import Phototheodolite, photo_from_directions
from photostrip.terrestrial.frame import ARCSECONDS, ground_from_photo
from photostrip.terrestrial.orientation import FREE, Sightings

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from photostrip.formats.text.tables import Column
    from photostrip.notes import Note

    Floats = NDArray[np.float64]

RADIANS = {"deg": np.pi / 180, "gon": np.pi / 200}
STEEPEST = np.radians(89.9999)
GIMBAL = 1e-6  # cosine of the elevation of the camera below which azimuth and roll are one


@dataclass(frozen=True, slots=True)
class CameraOptions:
    """Options that say which camera it is."""

    camera: str | None = None
    presets: str | None = None
    principal_distance: float | None = None  # f in mm, instead of the list's
    # principal_point, photo_format: pairs of numbers in mm, likewise
    principal_point: str | None = None
    photo_format: str | None = None


def chosen_camera(options: CameraOptions, *, with_format: bool = False) -> Phototheodolite:
    """Return the camera that the options name.

    Raises
    ------
    InputError
        With everything that is wrong with the options.
    """
    if options.camera is None and options.principal_distance is None:
        known = ", ".join(read_presets(options.presets))
        message = "nothing says which camera it is"
        raise InputError(
            Fault(message, "no-camera", key="--camera", expected=f"one of {known}, or --principal-distance")
        )
    if options.camera is not None:
        camera = preset(options.camera, read_presets(options.presets), "--camera")
    else:
        camera = Phototheodolite("camera", 0.0)
    if options.principal_distance is not None:
        distance = within("--principal-distance", options.principal_distance, PRINCIPAL_DISTANCE)
        camera = replace(camera, principal_distance=distance)
    if options.principal_point is not None:
        x0, z0 = (
            within("--principal-point", each, COORDINATE) for each in pair("--principal-point", options.principal_point)
        )
        camera = replace(camera, principal_point=(x0, z0))
    if options.photo_format is not None:
        width, height = pair("--photo-format", options.photo_format)
        size = (within("--photo-format", width, FORMAT), within("--photo-format", height, FORMAT))
        camera = replace(camera, format=size)
    if with_format and camera.format is None:
        message = f"the camera {camera.name} has no format"
        raise InputError(Fault(message, "no-format", key="--photo-format", expected="WIDTH,HEIGHT in mm"))
    return camera


def pair(option: str, text: str) -> tuple[float, float]:
    """Read two numbers with a comma between them.

    Raises
    ------
    InputError
        When it is something else.
    """
    parts = text.split(",")
    try:
        if len(parts) == 2:
            return number(parts[0]), number(parts[1])
    except NotANumber as why:
        raise InputError(Fault(why.message, "number", key=option, expected="two numbers A,B", fix=why.fix)) from None
    raise InputError(Fault(f"`{shown(text)}` is not a pair", "pair", key=option, expected="two numbers A,B"))


def looking(alpha: float, omega: float, kappa: float, unit: str) -> tuple[tuple[float, float, float], Floats]:
    """Return the angles of a camera in radians, and its rotation.

    Parameters
    ----------
    unit : str
        ``"deg"`` or ``"gon"``.

    Returns
    -------
    ndarray, shape (3, 3)
        Photo to ground.

    Raises
    ------
    InputError
        When one of them is no number, or the camera looks straight up or down.
    """
    for option, value in (("--alpha", alpha), ("--omega", omega), ("--kappa", kappa)):
        within(option, value, DEGREES if unit == "deg" else GON)
    angles = (alpha * RADIANS[unit], omega * RADIANS[unit], kappa * RADIANS[unit])
    if abs(np.cos(angles[1])) < GIMBAL:
        message = f"with {omega:g} {unit} the camera looks straight up or down, which leaves it without an azimuth"
        raise InputError(Fault(message, "range", key="--omega", expected="an elevation below 90 degrees"))
    return angles, ground_from_photo(*angles)


# -------------------------------------------------------------------------------------------------------- points


def image_points(file: str | None, at: Sequence[str], unit: str) -> tuple[tuple[str, ...], Floats, tuple[Note, ...]]:
    """Read image points from a table, or from the command line.

    Parameters
    ----------
    file : str or None
        Table ``point,x,z``.
    unit : str
        ``"mm"`` or ``"um"``.

    Returns
    -------
    ids : tuple of str
        Points; numbers for those from the command line.
    xz : ndarray, shape (n, 2)
        Coordinates in mm.

    Raises
    ------
    InputError
        With every fault.
    """
    _, ids, values, notes = _given(file, at, IMAGE_POINTS, ("x", "z"), (COORDINATE, MILLIMETRES[unit], unit))
    return ids, values * MILLIMETRES[unit], notes


def direction_points(
    file: str | None, at: Sequence[str], unit: str, camera: Phototheodolite, rotation: Floats
) -> tuple[tuple[str, ...], Floats, tuple[Note, ...]]:
    """Read directions from a table, or from the command line, and refuse what the photo cannot show.

    Parameters
    ----------
    file : str or None
        Table ``point,lambda,beta``.
    unit : str
        ``"deg"`` or ``"gon"``.
    rotation : ndarray, shape (3, 3)
        Photo to ground.

    Returns
    -------
    ids : tuple of str
        Points; numbers for those from the command line.
    directions : ndarray, shape (n, 2)
        Radians.

    Raises
    ------
    InputError
        With every fault.
    """
    table, ids, values, notes = _given(file, at, DIRECTION_POINTS, ("lambda", "beta"), (DEGREES, 1.0, unit))
    directions = values * RADIANS[unit]
    steep = np.abs(directions[:, 1]) > STEEPEST
    behind = np.isnan(photo_from_directions(directions, camera.principal_distance, rotation)).any(axis=1)
    faults = []
    for row in np.flatnonzero(steep | behind):
        message = f"the direction to point {ids[row]} is 90 degrees or more from the optical axis"
        if steep[row]:
            message = f"the direction to point {ids[row]} is not below the zenith"
        faults.append(_at(table, int(row), "beta" if steep[row] else "lambda", message))
    if faults:
        raise InputError(faults)
    return ids, directions, notes


def _at(table: PointTable | None, row: int, column: str, message: str) -> Fault:
    expected = "an elevation between -90 and 90 degrees" if column == "beta" else "a direction into the photo"
    if table is None:
        return Fault(message, "range", key="--at", expected=expected)
    return table.table.fault(row, column, message, "range", expected=expected)


def _given(
    file: str | None,
    at: Sequence[str],
    layout: Sequence[Column],
    names: tuple[str, str],
    limits: tuple[Range, float, str],
) -> tuple[PointTable | None, tuple[str, ...], Floats, tuple[Note, ...]]:
    """Read points from one of the two sources."""
    bounds, scale, unit = limits
    if (file is None) == (not at):
        message = "points are given twice, in a table and with --at" if at else "no points are given"
        raise InputError(Fault(message, "no-points", key="TABLE", expected=f"a table or --at {','.join(names)}"))
    if file is None:
        values = np.array([pair("--at", text) for text in at])
        for each in values.ravel():
            within("--at", each, Range(bounds.least / scale, bounds.most / scale, unit))
        return None, tuple(map(str, range(1, len(at) + 1))), values, ()
    findings = Findings()
    read = read_points(file, layout, findings)
    if read is None:
        raise InputError(findings.faults)
    refuse_outside(read.table, names, bounds, findings, scale=scale, unit=unit)
    findings.stop()
    return read, read.ids, read.columns(*names), tuple(findings.notes)


@dataclass(frozen=True, slots=True)
class SightingOptions:
    """What the numbers of a table of sightings mean."""

    unit: str  # unit of image coordinates, ``"mm"`` or ``"um"``
    angles: str  # unit of directions, ``"deg"`` or ``"gon"``
    sigma: float  # standard deviation of image coordinates in mm of rows without one
    # horizontal, vertical: standard deviations of directions in arcseconds of rows without one
    horizontal: float
    vertical: float


def read_sightings(file: str, options: SightingOptions) -> tuple[Sightings, tuple[Note, ...]]:
    """Read the points of a photo with their directions.

    Parameters
    ----------
    file : str
        Table ``point,x,z,lambda,beta[,sx,sz][,s_lambda,s_beta]``; standard deviations in the unit of the coordinates
        and in seconds of arc. One of lambda and beta may be empty.

    Returns
    -------
    Sightings
        Points; millimetres and radians.

    Raises
    ------
    InputError
        With every fault.
    """
    findings = Findings()
    read = read_points(file, SIGHTINGS, findings)
    if read is None:
        raise InputError(findings.faults)
    scale = MILLIMETRES[options.unit]
    refuse_outside(read.table, ("x", "z"), COORDINATE, findings, scale=scale, unit=options.unit)
    refuse_outside(read.table, ("sx", "sz"), IMAGE_SIGMA, findings, scale=scale, unit=options.unit)
    refuse_outside(read.table, ("s_lambda", "s_beta"), DIRECTION_SIGMA, findings)
    refuse_outside(read.table, ("lambda",), DEGREES, findings, unit=options.angles)
    directions = read.columns("lambda", "beta")
    for row in np.flatnonzero(np.isnan(directions).all(axis=1)):
        if not findings.number(file):
            message = f"neither direction to point {read.ids[row]} is given"
            findings.add(read.table.fault(int(row), "lambda", message, "no-direction", expected="lambda, beta or both"))
    for row in np.flatnonzero(np.abs(np.nan_to_num(directions[:, 1])) * RADIANS[options.angles] > STEEPEST):
        message = f"{directions[row, 1]:g} {options.angles} is not below the zenith"
        expected = "an elevation between -90 and 90 degrees, not a zenith distance"
        findings.add(read.table.fault(int(row), "beta", message, "range", expected=expected))
    findings.stop()
    image, angular = read.columns("sx", "sz") * scale, read.columns("s_lambda", "s_beta")
    usual = np.array([options.horizontal, options.vertical])
    sightings = Sightings(
        read.ids,
        read.columns("x", "z") * scale,
        directions * RADIANS[options.angles],
        np.where(np.isnan(image), options.sigma, image),
        np.where(np.isnan(angular), usual, angular) / ARCSECONDS,
    )
    return sightings, tuple(findings.notes)


def free_elements(text: str | None) -> tuple[str, ...]:
    """Read what is to be determined besides the angles.

    Returns
    -------
    tuple of str
        Keys of ``orientation.FREE``.

    Raises
    ------
    InputError
        When a name is not known.
    """
    names = tuple(part.strip() for part in (text or "").split(",") if part.strip())
    unknown = [name for name in names if name not in FREE]
    if unknown:
        message = f"`{shown(unknown[0])}` cannot be determined"
        raise InputError(
            Fault(message, "word", key="--free", expected=f"{', '.join(FREE)}, or both with a comma between")
        )
    return names
