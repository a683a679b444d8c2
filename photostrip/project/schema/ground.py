"""The blocks of a project that stand in a ground frame: control, camera positions, orientations, output."""

from typing import Annotated, Any

from photostrip.formats.measured.exterior import POSITIONS, ROTATIONS, orientation_columns
from photostrip.geometry.rotation import SYSTEMS
from photostrip.pipeline.inputs import Settings
from photostrip.project.schema.measurements import COLUMNS, Columns, ControlColumns, TableFile, header_names
from photostrip.project.schema.sections import (
    Axes,
    Flag,
    Height,
    Number,
    Positive,
    Section,
    Sigma3,
    Triple,
    Words,
    YAxis,
    choice,
    key,
    rule,
    wrong,
)

PositionColumns = Annotated[Columns, header_names(POSITIONS)]
OrientationColumns = Annotated[
    Columns, header_names(*(orientation_columns(each, "deg") for each in (*SYSTEMS, *ROTATIONS)))
]
YAW = "yaw-pitch-roll"
USUAL = Settings()
CRS = "An authority code (`EPSG:32633`), a PROJ string, WKT, `geocentric`, or `local` (right-handed, metres)"
SIGMA = "Standard deviations of rows without sx, sy, sz, in the order of `axes`"
UNDULATION: Any = key("Height of the geoid above the ellipsoid, for orthometric heights", None, unit="m")
EPOCH: Any = key("Decimal year of the coordinates, for frames in which the ground moves (ITRF, WGS 84)", None, unit="a")
ELLIPSOID: Any = key("Ellipsoid of geocentric coordinates; default: WGS 84", None)


class Ellipsoid(Section):
    """Ellipsoid of geocentric coordinates."""

    a: Positive = key("Semi-major axis", unit="m")
    b: Positive = key("Semi-minor axis", unit="m")


class GivenList(TableFile):
    """A table of given coordinates and their ground frame."""

    file: Words
    crs: Words = key(CRS)
    axes: Axes | None = key(
        "What the columns x, y, z are: a permutation of east, north, up; required, except for geocentric", None
    )
    height: Height = key("`ellipsoidal` or `orthometric`", "ellipsoidal")
    geoid_undulation: Number | None = UNDULATION
    epoch: Positive | None = EPOCH
    ellipsoid: Ellipsoid | None = ELLIPSOID

    @rule
    def _axes_are_given(self) -> None:
        if self.axes is None and self.crs != "geocentric":
            expected = "axes: [east, north, up], or [north, east, up] where x points north"
            message = "nothing says which of the columns x, y, z is east"
            raise wrong(message, code="missing-key", at="axes", expected=expected)


class Control(GivenList):
    """One list of given ground coordinates."""

    file: Words = key("Table `point,x,y,z[,use][,role][,sx,sy,sz]`, .csv or .csv.gz")
    columns: ControlColumns = key(COLUMNS, {})
    sigma: Sigma3 | None = key(SIGMA, None, unit="m")
    other_zone: Flag | None = key(
        "Plane map coordinates, given as `local`, of another zone than the first list: joined by the points of both",
        None,
    )

    @rule
    def _zones_are_local(self) -> None:
        if self.other_zone and self.crs != "local":
            message = "zones of a known projection are tied by their formulas"
            raise wrong(message, at="other_zone", fix="remove it")


class CameraPositions(GivenList):
    """Measured positions of the cameras, for the bundle adjustment."""

    file: Words = key("Table `photo,x,y,z[,use][,time][,sx,sy,sz]`, .csv or .csv.gz")
    columns: PositionColumns = key(COLUMNS, {})
    sigma: Sigma3 | None = key(SIGMA, None, unit="m")
    lever_arm: Triple = key(
        "Antenna as seen from the perspective centre along the image axes: x right, y up, z towards the viewer",
        (0.0, 0.0, 0.0),
        unit="m",
    )
    correction: Annotated[str, choice(("none", "offset", "drift"))] = key(
        "Unknown error that the positions of one strip share: `none`, `offset` (constant) or `drift` (constant and"
        " linear in `time`; without times in the number of the photo)",
        "none",
    )
    group: Annotated[str, choice(("strip", "block"))] = key(
        "What has one `correction` in common: each `strip`, or the whole `block`", "strip"
    )


class Angles(Section):
    """Angles of the exterior orientations."""

    system: Annotated[str, choice(SYSTEMS)] = key(
        "`alpha-omega-kappa`, `omega-phi-kappa`, `phi-omega-kappa` or `yaw-pitch-roll`", USUAL.angle_system
    )
    unit: Annotated[str, choice(("deg", "gon", "rad"))] = key("`deg`, `gon` or `rad`", USUAL.angle_unit)


class GivenAngles(Section):
    """Angles, quaternions or matrices of given orientations."""

    system: Annotated[str, choice((*SYSTEMS, *ROTATIONS))] = key(
        "`alpha-omega-kappa`, `omega-phi-kappa`, `phi-omega-kappa`, `yaw-pitch-roll`, `quaternion` (columns qw, qx, qy,"
        " qz) or `matrix` (r11, r12, ... r33)",
        USUAL.angle_system,
    )
    unit: Annotated[str, choice(("deg", "gon", "rad"))] = key("`deg`, `gon` or `rad`", USUAL.angle_unit)
    north: Annotated[str, choice(("grid", "true"))] = key(
        "North that they count from: `grid`, or `true`: then the meridian convergence at each photo is applied", "grid"
    )
    looks: Annotated[str, choice(("down", "ahead"))] | None = key(
        "Of yaw-pitch-roll, required: where the camera looks with pitch and roll zero, `down` or `ahead` (a gimbal)",
        None,
    )
    rotates: Annotated[str, choice(("image_to_ground", "ground_to_image"))] | None = key(
        "Of quaternions and matrices, required: `image_to_ground` or `ground_to_image`", None
    )
    y_axis: YAxis | None = key(
        "Of quaternions and matrices, required: y of the image axes, `up` (z towards the viewer) or `down` (z ahead)",
        None,
    )

    @rule
    def _conventions_are_said(self) -> None:
        needed = ("rotates", "y_axis") if self.system in ROTATIONS else ("looks",) if self.system == YAW else ()
        for name in ("looks", "rotates", "y_axis"):
            given = getattr(self, name)
            if name in needed and given is None:
                expected = type(self).model_fields[name].description or "".partition(": ")[2]
                message = f"`{name}` is missing, which nothing else says of {self.system}"
                raise wrong(message, code="missing-key", at=name, expected=expected)
            if name not in needed and given is not None:
                raise wrong(f"`{name}` says nothing of {self.system}", at=name, fix="remove it")


class Orientations(GivenList):
    """Given exterior orientations, for the bundle adjustment."""

    file: Words = key(
        "Table `photo,x,y,z` and the angles by name, as `alpha,omega,kappa`, [,sx,sy,sz][,s_alpha,s_omega,s_kappa]"
    )
    columns: OrientationColumns = key(COLUMNS, {})
    angles: GivenAngles = key("System and unit of the angles", GivenAngles())
    role: Annotated[str, choice(("observed", "approximate"))] = key(
        "`observed`: observations with their standard deviations; `approximate`: a start, without influence", "observed"
    )
    sigma: Sigma3 | None = key(SIGMA, None, unit="m")
    sigma_angles: Sigma3 | None = key(
        "Standard deviations of the angles of rows without them, in the order of their system; of quaternions and"
        " matrices of small turns about the image axes x, y, z",
        None,
        unit="the angles' unit",
    )

    @rule
    def _true_north_is_somewhere(self) -> None:
        if self.angles.north == "true" and self.crs in {"local", "geocentric"}:
            message = f"nothing says where true north is in the frame `{self.crs}`"
            raise wrong(message, at="angles", fix="give the crs of a map, or of longitude and latitude")


class Output(Section):
    """Frame and angles of the results."""

    crs: Words | None = key(f"{CRS}. Default: that of the first control list", None)
    axes: Axes | None = key(
        "Order of x, y, z. Default: that of the first control list; with a crs of its own east, north, up", None
    )
    height: Height | None = key(
        "`ellipsoidal` or `orthometric`; default: that of the first control list, or ellipsoidal", None
    )
    geoid_undulation: Number | None = UNDULATION
    epoch: Positive | None = EPOCH
    ellipsoid: Ellipsoid | None = ELLIPSOID
    angles: Angles = key("Angles of the exterior orientations", Angles())
