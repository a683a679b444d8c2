"""Tables of terrestrial computations: points and directions, correction directions, changes seen from one station."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from photostrip.errors import Fault
from photostrip.formats.measured.terrestrial import ONE_STATION, SIGHTINGS, read_points
from photostrip.formats.text.findings import Findings, suggestion
from photostrip.formats.text.numbers import shown
from photostrip.project.terrestrial import ranges
from photostrip.terrestrial.accuracy import Theodolite
from photostrip.terrestrial.camera_motion import OneStation
from photostrip.terrestrial.normal_case import Phototheodolite
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
    scale, ids = ranges.MILLIMETRES[units.unit], tuple(read.cells("point"))
    ranges.refuse_outside(read, ("x", "z"), ranges.COORDINATE, findings, scale=scale, unit=units.unit)
    ranges.refuse_outside(read, ("sx", "sz"), ranges.IMAGE_SIGMA, findings, scale=scale, unit=units.unit)
    ranges.refuse_outside(read, ("s_lambda", "s_beta"), ranges.DIRECTION_SIGMA, findings)
    ranges.refuse_outside(read, ("distance",), ranges.DISTANCE, findings)
    ranges.refuse_outside(read, ("lambda",), ranges.DEGREES, findings, unit=units.angles)
    directions = read.columns("lambda", "beta")
    for row in np.flatnonzero(np.isnan(directions).all(axis=1)):
        if not findings.number(file):
            message = f"neither direction to point {ids[row]} is given"
            findings.add(read.fault(int(row), "lambda", message, "no-direction", expected="lambda, beta or both"))
    steep = np.abs(np.nan_to_num(directions[:, 1])) * ranges.RADIANS[units.angles] > STEEPEST
    for row in np.flatnonzero(steep):
        message = f"{directions[row, 1]:g} {units.angles} is not below the zenith"
        expected = "an elevation between -90 and 90 degrees, not a zenith distance"
        findings.add(read.fault(int(row), "beta", message, "range", expected=expected))
    image, angular = read.columns("sx", "sz") * scale, read.columns("s_lambda", "s_beta")
    usual = np.array([units.theodolite.horizontal, units.theodolite.vertical]) / units.theodolite.rounds**0.5
    return Sightings(
        ids=ids,
        xz=read.columns("x", "z") * scale,
        directions=directions * ranges.RADIANS[units.angles],
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
    scale, ids = ranges.MILLIMETRES[unit], tuple(read.cells("point"))
    ranges.refuse_outside(read, ("x", "z", "dx", "dz"), ranges.COORDINATE, findings, scale=scale, unit=unit)
    ranges.refuse_outside(read, ("sigma", "sigma_d"), ranges.IMAGE_SIGMA, findings, scale=scale, unit=unit)
    ranges.refuse_outside(read, ("distance", "distance_later"), ranges.DISTANCE, findings)
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
