"""Tables of terrestrial computations: correction directions, changes seen from one station, series of epochs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats
from photostrip.errors import Fault
from photostrip.formats.measured import terrestrial
from photostrip.formats.measured.terrestrial import ONE_STATION, SIGHTINGS, read_points
from photostrip.formats.text.findings import Findings, suggestion
from photostrip.formats.text.numbers import shown
from photostrip.notes import Note, counted, listed
from photostrip.points import locate
from photostrip.project.phototheodolites import (
    COORDINATE,
    DEGREES,
    DIRECTION_SIGMA,
    DISTANCE,
    IMAGE_SIGMA,
    MILLIMETRES,
    RADIANS,
    refuse_outside,
)
from photostrip.terrestrial.accuracy import Theodolite
from photostrip.terrestrial.camera_motion import OneStation
from photostrip.terrestrial.monitoring import Series
from photostrip.terrestrial.normal_case import SIDES, Phototheodolite
from photostrip.terrestrial.orientation import Sightings
from photostrip.units import ARCSECONDS

STEEPEST = np.radians(89.9999)


class SightingUnits(NamedTuple):
    """What the numbers of a table of sightings mean."""

    unit: str  # unit of image coordinates, ``"mm"`` or ``"um"``
    angles: str  # unit of directions, ``"deg"`` or ``"gon"``
    sigma: float  # standard deviation of image coordinates in mm of rows without one
    theodolite: Theodolite  # standard deviations of directions of rows without one


def read_sightings(file: str, units: SightingUnits, findings: Findings) -> Sightings | None:
    """Read the points of a photo with their directions ``point,x,z,lambda,beta[,sx,sz][,s_lambda,s_beta][,distance]``.

    Standard deviations are in the unit of the coordinates and in seconds of arc, distances in metres. One of lambda and
    beta may be empty. None where there are faults.
    """
    read = read_points(file, SIGHTINGS, findings)
    if read is None:
        return None
    scale, ids = MILLIMETRES[units.unit], tuple(read.cells("point"))
    refuse_outside(read, ("x", "z"), COORDINATE, findings, scale=scale, unit=units.unit)
    refuse_outside(read, ("sx", "sz"), IMAGE_SIGMA, findings, scale=scale, unit=units.unit)
    refuse_outside(read, ("s_lambda", "s_beta"), DIRECTION_SIGMA, findings)
    refuse_outside(read, ("distance",), DISTANCE, findings)
    refuse_outside(read, ("lambda",), DEGREES, findings, unit=units.angles)
    directions = read.columns("lambda", "beta")
    for row in np.flatnonzero(np.isnan(directions).all(axis=1)):
        if not findings.number(file):
            message = f"neither direction to point {ids[row]} is given"
            findings.add(read.fault(int(row), "lambda", message, "no-direction", expected="lambda, beta or both"))
    steep = np.abs(np.nan_to_num(directions[:, 1])) * RADIANS[units.angles] > STEEPEST
    for row in np.flatnonzero(steep):
        message = f"{directions[row, 1]:g} {units.angles} is not below the zenith"
        expected = "an elevation between -90 and 90 degrees, not a zenith distance"
        findings.add(read.fault(int(row), "beta", message, "range", expected=expected))
    image, angular = read.columns("sx", "sz") * scale, read.columns("s_lambda", "s_beta")
    usual = np.array([units.theodolite.horizontal, units.theodolite.vertical]) / units.theodolite.rounds**0.5
    return Sightings(
        ids=ids,
        xz=read.columns("x", "z") * scale,
        directions=directions * RADIANS[units.angles],
        sigma_xz=np.where(np.isnan(image), units.sigma, image),
        sigma_directions=np.where(np.isnan(angular), usual, angular) / ARCSECONDS,
        distances=read.columns("distance")[:, 0],
    )


def read_one_station(
    file: str,
    unit: str,
    sigmas: tuple[float, float, float],
    stable: Sequence[str],
    camera: Phototheodolite,
    findings: Findings,
) -> OneStation | None:
    """Read ``point,x,z,dx,dz,distance[,distance_later][,sigma][,sigma_d][,sigma_distance]``; None with faults.

    sigmas: standard deviations of coordinates and of pseudo-parallaxes, mm, and of distances, metres, of rows without.
    """
    read = read_points(file, ONE_STATION, findings)
    if read is None:
        return None
    scale, ids = MILLIMETRES[unit], tuple(read.cells("point"))
    refuse_outside(read, ("x", "z", "dx", "dz"), COORDINATE, findings, scale=scale, unit=unit)
    refuse_outside(read, ("sigma", "sigma_d"), IMAGE_SIGMA, findings, scale=scale, unit=unit)
    refuse_outside(read, ("distance", "distance_later"), DISTANCE, findings)
    for number, name in enumerate(stable):
        if name not in ids:
            message, fix = f"{file} has no point {shown(name)}", suggestion(name, ids)
            findings.add(Fault(message, "unknown-point", key=f"stable[{number}]", fix=fix))
    own = read.columns("sigma", "sigma_d", "sigma_distance") * [scale, scale, 1.0]
    own = np.where(np.isnan(own), sigmas, own)
    return OneStation(
        points=ids,
        first=read.columns("x", "z") * scale - camera.principal_point,
        change=read.columns("dx", "dz") * scale,
        sigma=own[:, 0],
        sigma_change=own[:, 1],
        distances=read.columns("distance", "distance_later"),
        sigma_distance=own[:, 2],
        stable=np.isin(ids, list(stable)),
    )


LAYOUTS = {"coordinates": terrestrial.COORDINATES, "pseudo_parallaxes": terrestrial.PSEUDO_PARALLAXES}
REFERENCE, SECOND = "first", "second"  # names of epochs that have none
FEWEST_EPOCHS = 2


@dataclass(frozen=True)
class Table:
    """What the numbers of a table mean."""

    kind: str  # ``"coordinates"`` or ``"pseudo_parallaxes"``
    unit: str  # ``"mm"`` or ``"um"``
    z_axis: str  # ``"up"`` or ``"down"``
    # sigma, sigma_d: standard deviations of coordinates and of pseudo-parallaxes, in the unit, of rows without one
    sigma: float | None
    sigma_d: float | None


@dataclass(frozen=True)
class Wanted:
    """What the project says of epochs and points."""

    epochs: tuple[str, ...] = ()  # epochs in order, the first being the reference; empty: as they stand in the table
    times: tuple[float, ...] | None = None
    stable: tuple[str, ...] = ()


def read_series(file: str, table: Table, centre: Floats, wanted: Wanted, findings: Findings) -> Series | None:
    """Read a table of measurements, in mm, reduced to the principal points, z up; None when there are faults.

    centre: (2, 2), principal points of the left and right camera in mm, z up.
    """
    reader = terrestrial.read_coordinates if table.kind == "coordinates" else terrestrial.read_pseudo_parallaxes
    read = reader(file, findings)
    if read is None or findings.number(file):
        return None
    scale = MILLIMETRES[table.unit]
    coordinates = [each.name for each in LAYOUTS[table.kind] if each.number and not each.positive]
    deviations = [each.name for each in LAYOUTS[table.kind] if each.number and each.positive]
    refuse_outside(read.table, coordinates, COORDINATE, findings, scale=scale, unit=table.unit)
    refuse_outside(read.table, deviations, IMAGE_SIGMA, findings, scale=scale, unit=table.unit)
    epochs = _epochs(read, table.kind, wanted, findings)
    stable = _stable(read, wanted.stable, findings)
    build = _from_coordinates if table.kind == "coordinates" else _from_pseudo_parallaxes
    built = build(read, table, centre, epochs, findings)
    if findings.number(file) or findings.number("") or built is None:
        return None
    times = None if wanted.times is None or len(wanted.times) != len(epochs) else np.array(wanted.times)
    return Series(
        points=read.points,
        epochs=epochs,
        coordinates=built.coordinates,
        of_epoch=built.of_epoch,
        shared=built.shared,
        stable=stable,
        times=times,
    )


def _epochs(read: terrestrial.EpochTable, kind: str, wanted: Wanted, findings: Findings) -> tuple[str, ...]:
    """Return the epochs in order and refuse those that are not measured."""
    known = read.epochs
    if kind != "coordinates":  # the reference epoch has no rows of its own
        later = read.epochs or (wanted.epochs[1:] if len(wanted.epochs) == FEWEST_EPOCHS else (SECOND,))
        known = (*(wanted.epochs[:1] or (REFERENCE,)), *later)
    epochs = wanted.epochs or tuple(dict.fromkeys(known))
    for name, times in Counter(epochs).items():
        if times > 1:
            findings.add(Fault(f"epoch {name} is named {times} times", "duplicate", key="epochs", fix="remove one"))
    if len(epochs) < FEWEST_EPOCHS:
        message = f"has only one epoch, {epochs[0]}" if epochs else "has no epoch"
        file, key = ("", "epochs") if wanted.epochs else (read.table.file, "epoch")
        message = f"the list {message}" if wanted.epochs else message
        findings.add(Fault(message, "one-epoch", file, key=key, expected="two or more"))
    missing = [(number, name) for number, name in enumerate(epochs) if name not in known]
    for number, name in missing:
        near = suggestion(name, [each for each in known if each not in epochs])
        message = f"{read.table.file} has no measurement of epoch {name}"
        fix = near or f"its epochs are {listed(read.epochs)}"
        findings.add(Fault(message, "not-measured", key=f"epochs[{number}]", fix=fix))
    if kind != "coordinates" and epochs and epochs[0] in read.epochs:
        row = int(np.flatnonzero(read.epoch == read.epochs.index(epochs[0]))[0])
        message = f"epoch {epochs[0]} is the reference, against which pseudo-parallaxes are measured"
        fix = "name the reference epoch first in `epochs`, and only later epochs in the table"
        findings.add(read.table.fault(row, "epoch", message, "reference-epoch", fix=fix))
    others = [name for name in read.epochs if name not in epochs]
    if others and not missing:
        rows = int(np.isin(read.epoch, [read.epochs.index(name) for name in others]).sum())
        message = (
            f"{read.table.file}: {counted(rows, 'row')} of epochs that the project does not name: {listed(others)}"
        )
        findings.notes.append(Note("epoch-not-used", message))
    return epochs


def _stable(read: terrestrial.EpochTable, stable: tuple[str, ...], findings: Findings) -> Flags:
    """Mark the points that are taken not to move, and refuse those that are not measured."""
    for number, name in enumerate(stable):
        if name not in read.points:
            message = f"{read.table.file} has no point {name}"
            fix = suggestion(name, read.points) or "correct the id, or remove it"
            findings.add(Fault(message, "not-measured", key=f"stable[{number}]", fix=fix))
    return np.array([name in set(stable) for name in read.points], bool)


class _Measured(NamedTuple):
    """Coordinates and variances of a ``Series``."""

    coordinates: Floats
    of_epoch: Floats
    shared: Floats


def _from_coordinates(
    read: terrestrial.EpochTable, table: Table, centre: Floats, epochs: tuple[str, ...], findings: Findings
) -> _Measured | None:
    """Coordinates of each epoch have errors of their own and share none."""
    sigma = _filled(read, ("sx", "sz"), table.sigma, "sigma", findings)
    if sigma is None:
        return None
    number = locate(read.epochs, epochs)[read.epoch]
    rows = np.flatnonzero(number >= 0)
    shape = (len(epochs), len(read.points), len(SIDES), 2)
    coordinates, of_epoch = np.full(shape, np.nan), np.ones(shape)
    where = (number[rows], read.point[rows], read.side[rows])
    flip = np.array([1.0, -1.0 if table.z_axis == "down" else 1.0])
    scale = MILLIMETRES[table.unit]
    coordinates[where] = read.table.columns("x", "z")[rows] * scale * flip - centre[read.side[rows]]
    of_epoch[where] = (sigma[rows] * scale) ** 2
    flat = (*shape[:2], 4)
    return _Measured(coordinates.reshape(flat), of_epoch.reshape(flat), np.zeros(flat[1:]))


def _from_pseudo_parallaxes(
    read: terrestrial.EpochTable, table: Table, centre: Floats, epochs: tuple[str, ...], findings: Findings
) -> _Measured | None:
    """Pseudo-parallaxes have errors of their own; those of the reference photos all epochs share."""
    sigma = _filled(read, ("sigma",), table.sigma, "sigma", findings)
    usual = table.sigma if table.sigma_d is None else table.sigma_d
    sigma_d = _filled(read, ("sigma_d",), usual, "sigma_d", findings)
    reference = terrestrial.reference_values(read, findings)
    if sigma is None or sigma_d is None or findings.number(read.table.file):
        return None
    scale = MILLIMETRES[table.unit] * np.array([1.0, -1.0 if table.z_axis == "down" else 1.0] * 2)
    x, z, p, q = reference.T
    first = np.column_stack([x, z, x - p, z - q]) * scale - centre.ravel()
    names = read.epochs or epochs[1:2] or (SECOND,)
    number = locate(names, epochs)[read.epoch]
    rows = np.flatnonzero(number >= 0)
    shape = (len(epochs), len(read.points), 4)
    coordinates, of_epoch = np.full(shape, np.nan), np.zeros(shape)
    coordinates[0] = first
    change = read.table.columns("dx", "dz", "dx_right", "dz_right")[rows] * scale
    coordinates[number[rows], read.point[rows]] = first[read.point[rows]] + change
    of_epoch[1:] = 1.0
    of_epoch[number[rows], read.point[rows]] = (sigma_d[rows] * MILLIMETRES[table.unit]) ** 2
    shared = np.zeros((len(read.points), 4))
    shared[read.point[::-1]] = (sigma[::-1] * MILLIMETRES[table.unit]) ** 2  # the first row of a point counts
    return _Measured(coordinates, of_epoch, shared)


def _filled(
    read: terrestrial.EpochTable, columns: tuple[str, ...], usual: float | None, key: str, findings: Findings
) -> Floats | None:
    """Give standard deviations row by row, in the unit of the table."""
    sigma = read.table.columns(*columns)
    missing = np.flatnonzero(np.isnan(sigma).any(axis=1))
    if usual is not None:
        return np.where(np.isnan(sigma), usual, sigma)
    if len(missing):
        number = counted(len(missing), "row has no standard deviation", "rows have no standard deviation")
        names = ", ".join(columns)
        message = f"{number} ({names}), and none is given for all"
        fix = f"set `measurements.{key}` in the project, or fill the column {names}"
        findings.add(read.table.fault(int(missing[0]), columns[0], message, "no-sigma", fix=fix))
        return None
    return sigma
