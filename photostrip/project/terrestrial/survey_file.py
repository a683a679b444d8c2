"""The project file of a terrestrial survey: stations, epochs and measurements of displacements."""

from __future__ import annotations

from typing import Annotated

from photostrip.geodesy.frame_spec import GROUND_AXES
from photostrip.project.schema.sections import (
    After,
    Axes,
    Before,
    FirstSchema,
    Id,
    Number,
    Positive,
    Section,
    Words,
    YAxis,
    bounded,
    key,
    length,
    one_of,
    rule,
    wrong,
)
from photostrip.project.terrestrial.cameras import CameraOrName
from photostrip.project.terrestrial.ranges import (
    BASE,
    DEGREES,
    DIRECTION_SIGMA,
    ECCENTRICITY,
    IMAGE_SIGMA,
    MILLIMETRES,
    POSITION,
    SIGNIFICANCE,
    TIME,
)
from photostrip.terrestrial.monitoring import MOVED_CAMERA, MonitoringSettings

USUAL = MonitoringSettings()
Coordinate = Annotated[Number, After(bounded(POSITION))]
Three = tuple[Coordinate, Coordinate, Coordinate]
Angle = Annotated[Number, After(bounded(DEGREES))]


def _short_epoch(value: object) -> object:
    """Let a single word stand for an epoch without a time."""
    return {"id": value} if isinstance(value, str) else value


def _ground_axes(value: tuple[str, str, str]) -> tuple[str, str, str]:
    if sorted(value) != sorted(GROUND_AXES):
        raise wrong("the axes of the stations are not on the ground", expected="a permutation of [east, north, up]")
    return value


class Station(Section):
    """One of the two stations. Position and angles belong together; without them it is the normal case."""

    camera: Id = key("Camera, a key of `cameras`")
    position: Three | None = key("Perspective centre in the order of `axes`", None, unit="m")
    directions: Words | None = key(
        "Table `point,x,z,lambda,beta[,sx,sz][,s_lambda,s_beta][,distance]` of correction directions that orient the"
        " photo of the first epoch, instead of the angles",
        None,
    )
    sigma_arcsec: Annotated[Positive, After(bounded(DIRECTION_SIGMA))] = key(
        "Standard deviation of these directions in rows without one", 2.0, unit="arcsec"
    )
    eccentricity: Annotated[Number, After(bounded(ECCENTRICITY))] = key(
        "Perspective centre ahead of `position` on the optical axis, where that is the theodolite's", 0.0, unit="m"
    )
    alpha: Angle | None = key("Azimuth of the optical axis, clockwise from north", None, unit="angle_unit")
    omega: Angle | None = key("Elevation of the optical axis, upwards; default: 0", None, unit="angle_unit")
    kappa: Angle | None = key(
        "Roll, the photo's x axis turning counter-clockwise for the photographer; default: 0", None, unit="angle_unit"
    )

    @rule
    def _is_complete(self) -> None:
        turned = [name for name in ("alpha", "omega", "kappa") if getattr(self, name) is not None]
        if self.directions is not None and turned:
            message = f"`directions` gives the orientation of the photo, and `{turned[0]}` another one"
            raise wrong(message, code="two-keys", at=turned[0], fix="remove one of the two")
        if (self.position is None) != (self.alpha is None and self.directions is None):
            given = "alpha" if self.directions is None else "directions"
            missing, other = ("position", given) if self.position is None else ("alpha", "position")
            message = f"`{other}` is given and `{missing}` is not"
            raise wrong(message, code="missing-key", expected="both, or neither in the normal case")
        if self.position is None and turned:
            raise wrong("angles are given without a position", code="missing-key", expected="position and alpha too")

    @property
    def free(self) -> bool:
        """Whether it has a position and angles of its own."""
        return self.position is not None


class Stations(Section):
    """The two stations."""

    left: Station = key("The left station")
    right: Station = key("The right station")


class Epoch(Section):
    """One epoch."""

    id: Id = key("Id of the epoch, as in the table")
    time: Annotated[Number, After(bounded(TIME))] | None = key("Its time, for rates", None, unit="time_unit")


class Measurements(Section):
    """The table of measurements."""

    coordinates: Words | None = key("Table `epoch,photo,point,x,z[,sx,sz]`, .csv or .csv.gz", None)
    pseudo_parallaxes: Words | None = key(
        "Table `point[,epoch],x,z,p[,q],dx,dz,dx_right[,dz_right][,sigma][,sigma_d]`, .csv or .csv.gz", None
    )
    unit: Annotated[Words, After(one_of("mm", "um"))] = key("Unit of the table: `mm` or `um`")
    z_axis: YAxis = key("Direction of z, `up` or `down`; x grows to the right", "up")
    sigma: Positive | None = key("Standard deviation of a coordinate in rows without one", None, unit="unit")
    sigma_d: Positive | None = key(
        "Standard deviation of a pseudo-parallax in rows without one; default: `sigma`", None, unit="unit"
    )

    @rule
    def _one_table(self) -> None:
        if (self.coordinates is None) == (self.pseudo_parallaxes is None):
            what = "two tables are named" if self.coordinates is not None else "no table is named"
            raise wrong(what, code="missing-key", expected="either `coordinates` or `pseudo_parallaxes`")
        if self.coordinates is not None and self.sigma_d is not None:
            message = "coordinates have no pseudo-parallaxes that could have a standard deviation"
            raise wrong(message, at="sigma_d", fix="remove it; use `sigma`")
        for name, value in (("sigma", self.sigma), ("sigma_d", self.sigma_d)):
            if value is not None and not IMAGE_SIGMA.holds(value * MILLIMETRES[self.unit]):
                message = f"{value:g} {self.unit} is out of range"
                raise wrong(message, code="range", at=name, expected=f"{IMAGE_SIGMA}: is the unit right?")


class Processing(Section):
    """How displacements are tested."""

    significance: Annotated[Number, After(bounded(SIGNIFICANCE))] = key(
        "Probability of calling a point moved that did not move", USUAL.significance
    )
    moved_camera: Annotated[Words, After(one_of(*MOVED_CAMERA))] = key(
        "Turn of a camera that the stable points show: taken out `always`, when significant (`auto`), or `never`",
        USUAL.moved_camera,
    )


class TerrestrialFile(Section):
    """Displacements from photos of two stations."""

    photostrip_terrestrial: FirstSchema = key("Number of this schema: 1")
    extends: Words | None = key("Another file whose keys are taken where this one has none", None)
    name: Words = key("Name of the survey", "displacements")
    presets: Words | None = key("A list of cameras of your own", None)
    cameras: Annotated[dict[Id, CameraOrName], length(1)] = key("Cameras by name")
    stations: Stations | None = key("The two stations; default: the normal case, with the only camera at both", None)
    axes: Annotated[Axes, After(_ground_axes)] | None = key(
        "Order of the coordinates of the stations and of the results: a permutation of east, north, up", None
    )
    angle_unit: Annotated[Words, After(one_of("deg", "gon"))] = key("Unit of alpha, omega, kappa", "deg")
    base: Annotated[Number, After(bounded(BASE))] | None = key(
        "Base of the normal case, instead of positions and angles", None, unit="m"
    )
    epochs: list[Annotated[Epoch, Before(_short_epoch)]] | None = key(
        "Epochs, the first being the reference; default: as they stand in the table", None
    )
    time_unit: Words = key("Unit of the times of the epochs, for rates", "year")
    measurements: Measurements = key("The table of measurements")
    stable: list[Id] = key("Points that are taken not to move", [])
    processing: Processing = key("How displacements are tested", Processing())

    @property
    def both(self) -> tuple[Station, Station]:
        """The left and the right station."""
        if self.stations is None:
            station = Station(camera=next(iter(self.cameras)))
            return station, station
        return self.stations.left, self.stations.right

    @rule
    def _one_geometry(self) -> None:
        if self.stations is None and len(self.cameras) > 1:
            raise wrong("nothing says which camera stands where", code="missing-key", expected="`stations`")
        left, right = self.both
        if left.free != right.free:
            side = "right" if left.free else "left"
            raise wrong(
                f"the {side} station has no position", code="missing-key", at="stations", expected="both or none"
            )
        if left.free and self.base is not None:
            raise wrong("the base follows from the positions of the stations", at="base", fix="remove it")
        if not left.free and self.base is None:
            expected = "`base` for the normal case, or position and alpha of both stations"
            raise wrong("nothing says how far apart the stations are", code="missing-key", expected=expected)
        if left.free and self.axes is None:
            expected = "axes: [east, north, up], or [north, east, up] where x points north"
            raise wrong("nothing says which coordinate of a station is east", code="missing-key", expected=expected)
        if not left.free and self.axes is not None:
            raise wrong("the normal case has axes of its own: right, ahead, up", at="axes", fix="remove it")
