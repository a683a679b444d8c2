"""What users type on the command line for terrestrial computations: cameras, angles, pairs of numbers, tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Floats
from photostrip.errors import Fault, InputError
from photostrip.formats.measured.terrestrial import DIRECTION_POINTS, IMAGE_POINTS, ONE_STATION, SIGHTINGS, read_points
from photostrip.formats.output.terrestrial_directions import Attitude, Theodolite
from photostrip.formats.text.findings import Findings, suggestion
from photostrip.formats.text.numbers import NotANumber, number, shown
from photostrip.formats.text.tables import Column, Table
from photostrip.notes import Note
from photostrip.project.schema.values import Range
from photostrip.project.terrestrial import ranges
from photostrip.project.terrestrial.cameras import preset, read_presets
from photostrip.terrestrial.camera_motion import OneStation
from photostrip.terrestrial.normal_case import Phototheodolite, ground_from_photo, photo_from_directions
from photostrip.terrestrial.orientation import FREE, Sightings
from photostrip.units import ARCSECONDS

STEEPEST = np.radians(89.9999)
KILOMETRE = 1e6  # mm
# Theodolites of Carl Zeiss Jena have in their names the lateral error, in mm at 1 km, of a direction observed once in
# both faces [Pollmer 1976].
THEODOLITES = {"Theo 010": 10.0, "Theo 020": 20.0, "Theo 080": 80.0}
GIMBAL = 1e-6  # cosine of the elevation of the camera below which azimuth and roll are one


def chosen_camera(
    *,
    camera: str | None,
    presets: str | None,
    principal_distance: float | None,
    principal_point: str | None = None,
    photo_format: str | None = None,
) -> Phototheodolite:
    """Return the camera that the options name: one of a list, with what is given instead of the list's numbers."""
    if camera is None and principal_distance is None:
        expected = f"one of {', '.join(read_presets(presets))}, or --principal-distance"
        raise InputError(Fault("nothing says which camera it is", "no-camera", key="--camera", expected=expected))
    chosen = Phototheodolite("camera", 0.0) if camera is None else preset(camera, read_presets(presets), "--camera")
    if principal_distance is not None:
        distance = ranges.within("--principal-distance", principal_distance, ranges.PRINCIPAL_DISTANCE)
        chosen = replace(chosen, principal_distance=distance)
    if principal_point is not None:
        chosen = replace(chosen, principal_point=_pair_within("--principal-point", principal_point, ranges.COORDINATE))
    if photo_format is not None:
        chosen = replace(chosen, format=_pair_within("--photo-format", photo_format, ranges.FORMAT))
    return chosen


def required_format(camera: Phototheodolite) -> tuple[float, float]:
    """Return the format of a camera, or refuse one without."""
    if camera.format is None:
        message = f"the camera {camera.name} has no format"
        raise InputError(Fault(message, "no-format", key="--photo-format", expected="WIDTH,HEIGHT in mm"))
    return camera.format


def image_sigma(sigma_um: float) -> float:
    """Return the standard deviation of an image coordinate in mm."""
    return ranges.within("--sigma-um", sigma_um, ranges.IMAGE_SIGMA_UM) / 1000


def direction_sigma(theodolite: str | None, given: float | None, usual: float | None) -> float:
    """Return that of a direction, arcseconds: as given, of a theodolite by its name, or the usual one."""
    if theodolite is None:
        found = usual if given is None else given
        if found is None:
            message = "nothing says how well directions are measured"
            expected = f"arcseconds, or --theodolite with one of {', '.join(THEODOLITES)}"
            raise InputError(Fault(message, "no-theodolite", key="--sigma-arcsec", expected=expected))
        return found
    if given is not None:
        message = "the theodolite and its standard deviation are both given"
        raise InputError(Fault(message, "two-keys", key="--sigma-arcsec", fix="leave out one of them"))
    name = " ".join(theodolite.split())
    if name not in THEODOLITES:
        expected, fix = f"one of {', '.join(THEODOLITES)}", suggestion(name, THEODOLITES)
        message = f"there is no theodolite `{shown(name)}`"
        raise InputError(Fault(message, "unknown-theodolite", key="--theodolite", expected=expected, fix=fix))
    return THEODOLITES[name] / KILOMETRE * ARCSECONDS


def theodolite_sigmas(horizontal: float, vertical: float | None, rounds: int) -> Theodolite:
    """Return the standard deviations of directions in one round, in arcseconds, and the number of rounds."""
    horizontal = ranges.within("--sigma-arcsec", horizontal, ranges.DIRECTION_SIGMA)
    if vertical is not None:
        ranges.within("--vertical-arcsec", vertical, ranges.DIRECTION_SIGMA)
    return Theodolite(horizontal, horizontal if vertical is None else vertical, rounds)


def pair(option: str, text: str) -> tuple[float, float]:
    """Read two numbers with a comma between them, or refuse what is something else."""
    parts = text.split(",")
    try:
        if len(parts) == 2:
            return number(parts[0]), number(parts[1])
    except NotANumber as why:
        raise InputError(Fault(why.message, "number", key=option, expected="two numbers A,B", fix=why.fix)) from None
    raise InputError(Fault(f"`{shown(text)}` is not a pair", "pair", key=option, expected="two numbers A,B"))


def _pair_within(option: str, text: str, limits: Range) -> tuple[float, float]:
    first, second = (ranges.within(option, each, limits) for each in pair(option, text))
    return first, second


def attitude(alpha: float, omega: float, kappa: float, unit: str) -> Attitude:
    """Return the attitude of a camera by its angles in deg or gon; one that looks straight up or down is refused."""
    for option, value in (("--alpha", alpha), ("--omega", omega), ("--kappa", kappa)):
        ranges.within(option, value, ranges.DEGREES if unit == "deg" else ranges.GON)
    angles = (alpha * ranges.RADIANS[unit], omega * ranges.RADIANS[unit], kappa * ranges.RADIANS[unit])
    if abs(np.cos(angles[1])) < GIMBAL:
        message = f"with {omega:g} {unit} the camera looks straight up or down, which leaves it without an azimuth"
        raise InputError(Fault(message, "range", key="--omega", expected="an elevation below 90 degrees"))
    return Attitude(angles, ground_from_photo(*angles), unit)


class Points(NamedTuple):
    """Points of a table or of the command line, where they are numbered."""

    ids: tuple[str, ...]
    values: Floats  # (n, 2): coordinates x, z in mm, or directions lambda, beta in radians
    notes: tuple[Note, ...]
    table: Table | None


def image_points(file: str | None, at: Sequence[str], unit: str) -> Points:
    """Read image points from a table ``point,x,z``, or from the command line."""
    points = _points(file, at, IMAGE_POINTS, ranges.COORDINATE.scaled(ranges.MILLIMETRES[unit], unit))
    return points._replace(values=points.values * ranges.MILLIMETRES[unit])


def direction_points(file: str | None, at: Sequence[str], camera: Phototheodolite, looking: Attitude) -> Points:
    """Read directions from a table ``point,lambda,beta`` or the command line; refuse what the photo cannot show."""
    points = _points(file, at, DIRECTION_POINTS, ranges.DEGREES.scaled(1.0, looking.unit))
    directions = points.values * ranges.RADIANS[looking.unit]
    steep = np.abs(directions[:, 1]) > STEEPEST
    behind = np.isnan(photo_from_directions(directions, camera.principal_distance, looking.rotation)).any(axis=1)
    faults = []
    for row in np.flatnonzero(steep | behind):
        message = f"the direction to point {points.ids[row]} is 90 degrees or more from the optical axis"
        if steep[row]:
            message = f"the direction to point {points.ids[row]} is not below the zenith"
        faults.append(_outside(points.table, int(row), "beta" if steep[row] else "lambda", message))
    if faults:
        raise InputError(faults)
    return points._replace(values=directions)


def _outside(table: Table | None, row: int, column: str, message: str) -> Fault:
    expected = "an elevation between -90 and 90 degrees" if column == "beta" else "a direction into the photo"
    if table is None:
        return Fault(message, "range", key="--at", expected=expected)
    return table.fault(row, column, message, "range", expected=expected)


def _points(file: str | None, at: Sequence[str], layout: Sequence[Column], limits: Range) -> Points:
    """Read points from one of the two sources, in the unit of the limits."""
    names = [column.name for column in layout if column.number]
    if (file is None) == (not at):
        message = "points are given twice, in a table and with --at" if at else "no points are given"
        raise InputError(Fault(message, "no-points", key="TABLE", expected=f"a table or --at {','.join(names)}"))
    if file is None:
        values = np.array([pair("--at", text) for text in at])
        for each in values.ravel():
            ranges.within("--at", each, limits)
        return Points(ids=tuple(map(str, range(1, len(at) + 1))), values=values, notes=(), table=None)
    read, findings = _read(file, layout)
    ranges.refuse_outside(read, names, limits, findings)
    findings.stop()
    return Points(ids=tuple(read.cells("point")), values=read.columns(*names), notes=tuple(findings.notes), table=read)


def _read(file: str, layout: Sequence[Column]) -> tuple[Table, Findings]:
    """Read a table, or raise why it is none."""
    findings = Findings()
    read = read_points(file, layout, findings)
    if read is None:
        raise InputError(findings.faults)
    return read, findings


class SightingOptions(NamedTuple):
    """What the numbers of a table of sightings mean."""

    unit: str  # unit of image coordinates, ``"mm"`` or ``"um"``
    angles: str  # unit of directions, ``"deg"`` or ``"gon"``
    sigma: float  # standard deviation of image coordinates in mm of rows without one
    theodolite: Theodolite  # standard deviations of directions of rows without one


def read_sightings(file: str, options: SightingOptions) -> tuple[Sightings, tuple[Note, ...]]:
    """Read the points of a photo with their directions ``point,x,z,lambda,beta[,sx,sz][,s_lambda,s_beta][,distance]``.

    Standard deviations are in the unit of the coordinates and in seconds of arc, distances in metres. One of lambda and
    beta may be empty.
    """
    read, findings = _read(file, SIGHTINGS)
    scale, ids = ranges.MILLIMETRES[options.unit], tuple(read.cells("point"))
    ranges.refuse_outside(read, ("x", "z"), ranges.COORDINATE, findings, scale=scale, unit=options.unit)
    ranges.refuse_outside(read, ("sx", "sz"), ranges.IMAGE_SIGMA, findings, scale=scale, unit=options.unit)
    ranges.refuse_outside(read, ("s_lambda", "s_beta"), ranges.DIRECTION_SIGMA, findings)
    ranges.refuse_outside(read, ("distance",), ranges.DISTANCE, findings)
    ranges.refuse_outside(read, ("lambda",), ranges.DEGREES, findings, unit=options.angles)
    directions = read.columns("lambda", "beta")
    for row in np.flatnonzero(np.isnan(directions).all(axis=1)):
        if not findings.number(file):
            message = f"neither direction to point {ids[row]} is given"
            findings.add(read.fault(int(row), "lambda", message, "no-direction", expected="lambda, beta or both"))
    for row in np.flatnonzero(np.abs(np.nan_to_num(directions[:, 1])) * ranges.RADIANS[options.angles] > STEEPEST):
        message = f"{directions[row, 1]:g} {options.angles} is not below the zenith"
        expected = "an elevation between -90 and 90 degrees, not a zenith distance"
        findings.add(read.fault(int(row), "beta", message, "range", expected=expected))
    findings.stop()
    image, angular = read.columns("sx", "sz") * scale, read.columns("s_lambda", "s_beta")
    usual = np.array([options.theodolite.horizontal, options.theodolite.vertical]) / options.theodolite.rounds**0.5
    sightings = Sightings(
        ids=ids,
        xz=read.columns("x", "z") * scale,
        directions=directions * ranges.RADIANS[options.angles],
        sigma_xz=np.where(np.isnan(image), options.sigma, image),
        sigma_directions=np.where(np.isnan(angular), usual, angular) / ARCSECONDS,
        distances=read.columns("distance")[:, 0],
    )
    return sightings, tuple(findings.notes)


def read_one_station(
    file: str, unit: str, sigmas: tuple[float, float, float], stable: Sequence[str], camera: Phototheodolite
) -> tuple[OneStation, tuple[Note, ...]]:
    """Read ``point,x,z,dx,dz,distance[,distance_later][,sigma][,sigma_d][,sigma_distance]``.

    sigmas: standard deviations of coordinates and of pseudo-parallaxes, mm, and of distances, metres, of rows without.
    """
    read, findings = _read(file, ONE_STATION)
    scale, ids = ranges.MILLIMETRES[unit], tuple(read.cells("point"))
    ranges.refuse_outside(read, ("x", "z", "dx", "dz"), ranges.COORDINATE, findings, scale=scale, unit=unit)
    ranges.refuse_outside(read, ("sigma", "sigma_d"), ranges.IMAGE_SIGMA, findings, scale=scale, unit=unit)
    ranges.refuse_outside(read, ("distance", "distance_later"), ranges.DISTANCE, findings)
    unknown = [name for name in stable if name not in ids]
    if unknown:
        message = f"{file} has no point {shown(unknown[0])}"
        findings.add(Fault(message, "unknown-point", key="--stable", fix=suggestion(unknown[0], ids)))
    findings.stop()
    own = read.columns("sigma", "sigma_d", "sigma_distance") * [scale, scale, 1.0]
    own = np.where(np.isnan(own), sigmas, own)
    measured = OneStation(
        points=ids,
        first=read.columns("x", "z") * scale - camera.principal_point,
        change=read.columns("dx", "dz") * scale,
        sigma=own[:, 0],
        sigma_change=own[:, 1],
        distances=read.columns("distance", "distance_later"),
        sigma_distance=own[:, 2],
        stable=np.isin(ids, list(stable)),
    )
    return measured, tuple(findings.notes)


def free_elements(text: str | None) -> tuple[str, ...]:
    """Read what is to be determined besides the angles: keys of ``orientation.FREE``."""
    names = tuple(part.strip() for part in (text or "").split(",") if part.strip())
    unknown = [name for name in names if name not in FREE]
    if unknown:
        message = f"`{shown(unknown[0])}` cannot be determined"
        raise InputError(
            Fault(message, "word", key="--free", expected=f"{', '.join(FREE)}, or several with commas between")
        )
    return names
