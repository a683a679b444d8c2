"""Directions of a phototheodolite, and displacements seen from one station: the keys of their files."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from photostrip.arrays import Floats
from photostrip.formats.measured.terrestrial import DIRECTION_POINTS, IMAGE_POINTS, read_points
from photostrip.formats.text.tables import Table
from photostrip.project.phototheodolites import (
    COORDINATE,
    DEGREES,
    DIRECTION_SIGMA,
    ECCENTRICITY,
    IMAGE_SIGMA_UM,
    MILLIMETRES,
    RADIANS,
    REFRACTION,
    SIGNIFICANCE,
    STEP,
    CameraOrName,
    refuse_outside,
)
from photostrip.project.sections import (
    After,
    FirstSchema,
    Flag,
    Id,
    NotNegative,
    Number,
    Pair,
    Range,
    Section,
    Whole,
    Words,
    bounded,
    key,
    one_of,
    rule,
    wrong,
)
from photostrip.project.terrestrial_tables import STEEPEST
from photostrip.project.yaml.reading import Reading
from photostrip.terrestrial.accuracy import Theodolite
from photostrip.terrestrial.normal_case import (
    GIMBAL,
    Attitude,
    Phototheodolite,
    ground_from_photo,
    photo_from_directions,
)
from photostrip.terrestrial.orientation import FREE, SCREENINGS, OrientationSettings
from photostrip.units import ARCSECONDS

MOST_POINTS = 20_000  # of a table over the photo
KILOMETRE = 1e6  # mm
# Theodolites of Carl Zeiss Jena have in their names the lateral error, in mm at 1 km, of a direction observed once in
# both faces [Pollmer 1976].
THEODOLITES = {"Theo 010": 10.0, "Theo 020": 20.0, "Theo 080": 80.0}
USUAL_DIRECTION = 2.0  # arcseconds
Angle = Annotated[Number, After(bounded(DEGREES))]
Micrometres = Annotated[Number, After(bounded(IMAGE_SIGMA_UM))]
Seconds = Annotated[Number, After(bounded(DIRECTION_SIGMA))]
Level = Annotated[Number, After(bounded(SIGNIFICANCE))]
Unit = Annotated[Words, After(one_of("mm", "um"))]
SIGMA = "Standard deviation of x, z and the principal distance"


class WithCamera(Section):
    """What all of them have: the camera."""

    photostrip_terrestrial: FirstSchema = key("Number of this schema: 1")
    extends: Words | None = key("Another file whose keys are taken where this one has none", None)
    presets: Words | None = key("A list of cameras of your own", None)
    camera: CameraOrName = key("Camera: its name in a list, or preset, principal_distance, principal_point, format")
    angles: Annotated[Words, After(one_of("deg", "gon"))] = key("Unit of angles and directions", "deg")


class Looking(WithCamera):
    """Where the camera looks."""

    alpha: Angle = key("Azimuth of the optical axis, clockwise from north", 0.0, unit="angles")
    omega: Angle = key("Elevation of the optical axis, upwards", 0.0, unit="angles")
    kappa: Angle = key("Roll, counter-clockwise for the photographer", 0.0, unit="angles")

    @property
    def level(self) -> bool:
        """Whether the optical axis and the photo's x axis are horizontal."""
        return self.omega == 0 and self.kappa == 0

    @property
    def attitude(self) -> Attitude:
        unit = RADIANS[self.angles]
        angles = (self.alpha * unit, self.omega * unit, self.kappa * unit)
        return Attitude(angles, ground_from_photo(*angles), self.angles)

    @rule
    def _has_an_azimuth(self) -> None:
        if abs(np.cos(self.omega * RADIANS[self.angles])) < GIMBAL:
            message = f"with {self.omega:g} {self.angles} the camera looks straight up or down, and has no azimuth"
            raise wrong(message, code="range", at="omega", expected="an elevation below 90 degrees")


class Pointed(Looking):
    """Points of a table, or single ones."""

    table: Words | None = key("Table `point,x,z` or `point,lambda,beta`, .csv or .csv.gz", None)
    at: list[Pair] = key("Points instead of a table: [[x, z]] or [[lambda, beta]]", [])

    @rule
    def _one_source(self) -> None:
        if (self.table is None) == (not self.at):
            message = "points are given twice, in `table` and with `at`" if self.at else "no points are given"
            raise wrong(message, code="no-points", expected="`table` or `at`")


class DirectionsFile(Pointed):
    """Image points whose directions are wanted."""

    unit: Unit = key("Unit of image coordinates", "mm")
    sigma_um: Micrometres | None = key(f"{SIGMA}: that of the directions follows", None, unit="um")


class PhotoFile(Pointed):
    """Directions whose image points are wanted."""


class AccuracyFile(Looking):
    """How accurately correction directions must be measured, all over the photo."""

    sigma_um: Micrometres = key(SIGMA, 5.0, unit="um")
    step: Annotated[Number, After(bounded(STEP))] = key("Distance of the points of the table", 20.0, unit="mm")
    as_printed: Flag = key("The formulas as the source prints them; for a level camera", False)  # noqa: FBT003

    @rule
    def _printed_for_a_level_camera(self) -> None:
        if self.as_printed and not self.level:
            message = "the printed formulas hold for a level camera"
            raise wrong(message, code="as-printed", at="as_printed", fix="leave out `omega` and `kappa`")


class Measuring(Section):
    """How well directions are measured."""

    theodolite: Annotated[Words, After(one_of(*THEODOLITES))] | None = key(
        f"Theodolite instead of `sigma_arcsec`: {', '.join(THEODOLITES)} of Jena", None
    )
    sigma_arcsec: Seconds | None = key(
        "Standard deviation of a direction in one round, both faces", None, unit="arcsec"
    )
    vertical_arcsec: Seconds | None = key("The same of a vertical one; default: as horizontal", None, unit="arcsec")
    rounds: Annotated[Whole, After(bounded(Range(1, 10_000, "rounds")))] = key("Rounds measured", 1)

    @rule
    def _one_precision(self) -> None:
        if self.theodolite is not None and self.sigma_arcsec is not None:
            message = "the theodolite and its standard deviation are both given"
            raise wrong(message, code="two-keys", at="sigma_arcsec", fix="leave out one of them")

    @property
    def measured(self) -> Theodolite:
        horizontal = self.sigma_arcsec or USUAL_DIRECTION
        if self.theodolite is not None:
            horizontal = THEODOLITES[self.theodolite] / KILOMETRE * ARCSECONDS
        return Theodolite(horizontal, self.vertical_arcsec or horizontal, self.rounds)


class TheodoliteFile(Looking, Measuring):
    """Which image accuracy a theodolite can vouch for, all over the photo."""

    sigma_um: Micrometres | None = key("Image accuracy wanted: how many rounds it needs", None, unit="um")
    step: Annotated[Number, After(bounded(STEP))] = key("Distance of the points of the table", 20.0, unit="mm")

    @rule
    def _has_a_precision(self) -> None:
        if self.theodolite is None and self.sigma_arcsec is None:
            message = "nothing says how well directions are measured"
            raise wrong(message, code="no-theodolite", expected="`sigma_arcsec` or `theodolite`")


class OrientationFile(WithCamera, Measuring):
    """A photo oriented by measured directions to points in it."""

    table: Words = key("Table `point,x,z,lambda,beta[,sx,sz][,s_lambda,s_beta][,distance]`, .csv or .csv.gz")
    free: list[Annotated[Words, After(one_of(*FREE))]] = key(f"Determined besides the angles: {', '.join(FREE)}", [])
    eccentricity: Annotated[Number, After(bounded(ECCENTRICITY))] = key(
        "Front nodal point ahead of the theodolite's axes; needs the column `distance`", 0.0, unit="m"
    )
    refraction: Annotated[Number, After(bounded(REFRACTION))] = key(
        "Coefficient that computed directions lack; needs the column `distance`", 0.0
    )
    unit: Unit = key("Unit of image coordinates", "mm")
    sigma_um: Micrometres = key("Standard deviation of x and z", 5.0, unit="um")
    screening: Annotated[Words, After(one_of(*SCREENINGS))] = key(
        "Test points against the scatter of the others (`deletion`), the `stated` standard deviations, or not (`none`)",
        "deletion",
    )
    significance: Level = key("Probability of rejecting a point of a clean photo", 0.05)

    @property
    def settings(self) -> OrientationSettings:
        return OrientationSettings(
            tuple(map(str, self.free)),
            eccentricity=self.eccentricity,
            refraction=self.refraction,
            screening=str(self.screening),
            significance=self.significance,
        )


class OneStationFile(Looking):
    """Displacements seen from one station, with known distances of the points."""

    table: Words = key("Table `point,x,z,dx,dz,distance[,distance_later][,sigma][,sigma_d][,sigma_distance]`")
    unit: Unit = key("Unit of image coordinates", "mm")
    sigma_um: Micrometres = key("Standard deviation of x and z", 5.0, unit="um")
    sigma_d_um: Micrometres | None = key("That of dx and dz; default: as of x and z", None, unit="um")
    sigma_distance: NotNegative = key("Standard deviation of a distance", 0.01, unit="m")
    stable: list[Id] = key("Points that did not move", [])
    significance: Level = key("Probability of calling a still point moved", 0.05)


class CamerasFile(Section):
    """Cameras that can be named."""

    photostrip_terrestrial: FirstSchema = key("Number of this schema: 1")
    extends: Words | None = key("Another file whose keys are taken where this one has none", None)
    presets: Words | None = key("A list of cameras of your own", None)


class Points(NamedTuple):
    """Points of a table, or of ``at``, where they are numbered."""

    ids: tuple[str, ...]
    values: Floats  # (n, 2): coordinates x, z in mm, or directions lambda, beta in radians


def image_points(given: DirectionsFile, reading: Reading) -> Points:
    """Read image points, or raise every fault."""
    scale = MILLIMETRES[given.unit]
    points, _ = _points(given, reading, IMAGE_POINTS, COORDINATE.scaled(scale, given.unit))
    return points._replace(values=points.values * scale)


def direction_points(given: PhotoFile, reading: Reading, camera: Phototheodolite) -> Points:
    """Read directions; refuse what the photo cannot show."""
    points, table = _points(given, reading, DIRECTION_POINTS, DEGREES.scaled(1.0, given.angles))
    directions = points.values * RADIANS[given.angles]
    steep = np.abs(directions[:, 1]) > STEEPEST
    seen = photo_from_directions(directions, camera.principal_distance, given.attitude.rotation)
    for row in np.flatnonzero(steep | np.isnan(seen).any(axis=1)).tolist():
        column, expected = "lambda", "a direction into the photo"
        message = f"the direction to point {points.ids[row]} is 90 degrees or more from the optical axis"
        if steep[row]:
            column, expected = "beta", "an elevation between -90 and 90 degrees"
            message = f"the direction to point {points.ids[row]} is not below the zenith"
        if table is None:
            reading.refuse(("at", row), message, "range", expected=expected)
        else:
            reading.findings.add(table.fault(row, column, message, "range", expected=expected))
    reading.findings.stop()
    return points._replace(values=directions)


def _points(given: Pointed, reading: Reading, layout: tuple, limits: Range) -> tuple[Points, Table | None]:  # type: ignore[type-arg]
    """Read points from one of the two sources, in the unit of the limits."""
    names = [column.name for column in layout if column.number]
    table = None
    for path, findings in reading.named(("table",)):
        table = read_points(path, layout, findings)
        if table is not None:
            refuse_outside(table, names, limits, findings)
    for row, pair in enumerate(given.at):
        for column, value in enumerate(pair):
            if not limits.holds(value):
                reading.refuse(("at", row, column), f"{value:g} is out of range", "range", expected=str(limits))
    reading.findings.stop()
    if table is not None:
        return Points(tuple(table.cells("point")), table.columns(*names)), table
    return Points(tuple(map(str, range(1, len(given.at) + 1))), np.array(given.at).reshape(-1, 2)), None
