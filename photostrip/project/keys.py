"""The project file: every key, its type, unit, default and meaning; each description ends with the unit.

Defaults of `processing` are those of the settings beside the mathematics; none is repeated.
"""

from collections.abc import Iterable, Sequence
from importlib.util import find_spec
from itertools import pairwise
from pathlib import PurePosixPath
from typing import Annotated, Any

from pydantic import Discriminator, Tag

from photostrip import camera
from photostrip.errors import Fault, InputError
from photostrip.formats.faults import shown, suggestion
from photostrip.formats.measured import (
    CONTROL,
    FIDUCIALS,
    LAYOUTS,
    OBSERVATIONS,
    POLICIES,
    POSITIONS,
    ROTATIONS,
    orientation_columns,
)
from photostrip.formats.models import MODEL_CENTERS, MODEL_POINTS
from photostrip.formats.tables import MOST_LINES, WORDS, Column
from photostrip.geometry.rotation import SYSTEMS
from photostrip.network.problem import ASKED, SCREENINGS, TESTS
from photostrip.pipeline.inputs import ADJUSTMENTS, Settings
from photostrip.plausibility import KINDS
from photostrip.project.sections import (
    After,
    Axes,
    Before,
    Flag,
    Fraction,
    Height,
    Id,
    Number,
    NumberOrAuto,
    OneOrMany,
    Pair,
    Positive,
    PositiveOrAuto,
    Range,
    Read,
    Refusals,
    SchemaNumber,
    Section,
    Sigma3,
    Text,
    Triple,
    Words,
    YAxis,
    choice,
    if_empty,
    key,
    known_word,
    length,
    quoted,
    read_positive,
    single,
    text,
    whole,
    wrong,
)
from photostrip.strip import pixel_cameras
from photostrip.strip.fiducial_marks import PLACES
from photostrip.strip.formed_strip import INTERSECTIONS, SCALE_TRANSFERS
from photostrip.strip.linked_models import METHODS as LINK_METHODS
from photostrip.strip.pixel_cameras import CONVENTIONS, PIXEL_SIZE
from photostrip.strip.polynomial import DEGREES
from photostrip.strip.relative_orientation import SCREENINGS as RELATIVE_SCREENINGS


def header_names(*layouts: Iterable[Column]) -> After:
    """Check of the names that a table has for the columns of some layouts."""
    known = tuple(dict.fromkeys(column.name for layout in layouts for column in layout))
    return After(lambda value: require_columns(value, known))


def require_columns(value: dict[str, str], known: Sequence[str]) -> dict[str, str]:
    """Return names of columns that a table knows: all those of a header, or all numbers of fields."""
    for name in value:
        if name not in known:
            message = f"`{shown(name)}` is no column of this table"
            fix = suggestion(name, known)
            raise wrong(message, code="word", at=name, expected=f"one of {', '.join(known)}", fix=fix)
    numbers = [name for name, given in value.items() if given.strip().isdecimal()]
    for name, given in value.items():
        if numbers and (name not in numbers or int(given) < 1):
            message = f"`{shown(given)}` is no number of a field, as that of `{numbers[0]}` is"
            fix = "give all columns by number, from 1 on, where the table has no header"
            raise wrong(message, code="word", at=name, expected="names for all, or numbers for all", fix=fix)
    return value


def _lines_skipped(value: object) -> int:
    found = whole(value)
    if not 0 <= found <= MOST_LINES:
        raise wrong(f"{found} is no number of lines", code="range", expected="a whole number from 0 on")
    return found


def _files(value: object) -> str | list[str]:
    if not isinstance(value, list):
        return text(value)
    names: list[str] = [text(each) for each in value]
    if not names:
        raise wrong("no file is named", code="no-value", expected="the path of a table, or a list of paths")
    for name in names:
        if names.count(name) > 1:
            raise wrong(f"{shown(name)} is named twice", fix="remove one of the two")
    return names


Files = Annotated[
    str | list[str],
    Read(_files, {"anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}, "minItems": 1}]}),
]


class TableFile(Section):
    """How a table is written."""

    file: Files
    separator: Annotated[str, choice(*WORDS.values())] = key(
        "What stands between the fields: `comma`, `semicolon`, `tab` or `blank` (any number of blanks and tabs)",
        "comma",
    )
    decimal: Annotated[str, choice("point", "comma")] = key("What stands before decimals: `point` or `comma`", "point")
    skip: Annotated[int, Read(_lines_skipped, {"type": "integer", "minimum": 0})] = key(
        "Lines above the table that are passed over", 0
    )

    def rules(self) -> Refusals:
        if self.decimal == self.separator:
            message = "commas cannot stand between the fields and before decimals"
            yield wrong(message, at="decimal", fix="say the `separator`: semicolon, tab or blank")


Unit = Annotated[str, choice("mm", "um", "0.1um", "px")]
Repeated = Annotated[str, choice(*POLICIES)]
Columns = Annotated[dict[str, Words], Before(if_empty)]
PointColumns = Annotated[Columns, header_names(OBSERVATIONS, *LAYOUTS)]
MarkColumns = Annotated[Columns, header_names(FIDUCIALS)]
ControlColumns = Annotated[Columns, header_names(CONTROL)]
ModelColumns = Annotated[Columns, header_names(MODEL_POINTS)]
CenterColumns = Annotated[Columns, header_names(MODEL_CENTERS)]
COLUMNS = (
    "Names in the header of columns that are called otherwise, `{point: Punkt, x: xs}`; of a table without header the"
    " numbers of the fields, `{point: 1, x: 3, y: 4}`"
)


class Observations(TableFile):
    """Points measured on photos."""

    file: Files = key(
        "Table `photo,point,x,y[,sx,sy]`, or of pairs, `pair,point,x,y,p,q`, .csv or .csv.gz; or a list of such tables"
    )
    unit: Unit = key("Unit of the table: `mm`, `um`, `0.1um` or `px`")
    y_axis: YAxis | None = key(
        "Direction of y, `up` or `down`; x grows to the right. Default: `up`; required for px", None
    )
    origin: Annotated[str, choice("center", "top-left", "first-pixel")] | None = key(
        "Where x = y = 0: `center` of the photo, `top-left` corner of the first pixel, `first-pixel`: its centre."
        " Default: `center`; for px `top-left`. Meaningless with measured fiducial marks",
        None,
    )
    repeated: Repeated | None = key(
        "A point measured again on the same photo: `refuse` or `average`. Default: `refuse`; for pairs `average`", None
    )
    columns: PointColumns = key(COLUMNS, {})
    sigma: Positive | None = key("Standard deviation of rows without sx, sy", None, unit="the table's unit")


class ModelCenters(TableFile):
    """Perspective centres in the systems of the models."""

    file: Words = key("Table `model,photo,x,y,z[,sx,sy,sz]`, .csv or .csv.gz")
    columns: CenterColumns = key(COLUMNS, {})


class Models(TableFile):
    """Independent models measured on a plotter, in place of image coordinates."""

    file: Words = key(
        "Table `model,point,x,y,z[,sx,sy,sz]`, .csv or .csv.gz; a point with the id of a photo is its centre"
    )
    unit: Annotated[str, choice("mm", "um", "m")] = key("Unit of the tables: `mm`, `um` or `m`, at model scale")
    axes: Annotated[str, choice("right-handed", "left-handed")] = key(
        "Whether x, y, z of the plotter are `right-handed` or `left-handed`", "right-handed"
    )
    centers: ModelCenters | None = key("Perspective centres, when they stand in a table of their own", None)
    columns: ModelColumns = key(COLUMNS, {})
    sigma: Sigma3 | None = key("Standard deviations of rows without sx, sy, sz", None, unit="the tables' unit")
    center_sigma: Sigma3 | None = key(
        "Standard deviations of perspective centres without their own; default: `sigma`", None, unit="the tables' unit"
    )


class FiducialMeasurements(TableFile):
    """Fiducial marks measured on photos."""

    file: Files = key("Table `photo,mark,x,y[,sx,sy]`, .csv or .csv.gz; or a list of such tables")
    unit: Unit | None = key("Unit of the table; default: that of `observations`", None)
    y_axis: YAxis | None = key("Direction of y; default: that of `observations`", None)
    repeated: Repeated = key("A mark measured again on the same photo: `refuse` or `average`", "refuse")
    columns: MarkColumns = key(COLUMNS, {})
    sigma: Positive | None = key(
        "Standard deviation of rows without sx, sy; default: that of `observations`", None, unit="the table's unit"
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

    def rules(self) -> Refusals:
        if self.axes is None and self.crs != "geocentric":
            expected = "axes: [east, north, up], or [north, east, up] where x points north"
            message = "nothing says which of the columns x, y, z is east"
            yield wrong(message, code="missing-key", at="axes", expected=expected)


class Control(GivenList):
    """One list of given ground coordinates."""

    file: Words = key("Table `point,x,y,z[,use][,role][,sx,sy,sz]`, .csv or .csv.gz")
    columns: ControlColumns = key(COLUMNS, {})
    sigma: Sigma3 | None = key(SIGMA, None, unit="m")
    other_zone: Flag | None = key(
        "Plane map coordinates, given as `local`, of another zone than the first list: joined by the points of both",
        None,
    )

    def rules(self) -> Refusals:
        if self.other_zone and self.crs != "local":
            message = "zones of a known projection are tied by their formulas"
            yield wrong(message, at="other_zone", fix="remove it")


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
    correction: Annotated[str, choice("none", "offset", "drift")] = key(
        "Unknown error that the positions of one strip share: `none`, `offset` (constant) or `drift` (constant and"
        " linear in `time`; without times in the number of the photo)",
        "none",
    )
    group: Annotated[str, choice("strip", "block")] = key(
        "What has one `correction` in common: each `strip`, or the whole `block`", "strip"
    )


class Angles(Section):
    """Angles of the exterior orientations."""

    system: Annotated[str, choice(*SYSTEMS)] = key(
        "`alpha-omega-kappa`, `omega-phi-kappa`, `phi-omega-kappa` or `yaw-pitch-roll`", USUAL.angle_system
    )
    unit: Annotated[str, choice("deg", "gon", "rad")] = key("`deg`, `gon` or `rad`", USUAL.angle_unit)


class GivenAngles(Section):
    """Angles, quaternions or matrices of given orientations."""

    system: Annotated[str, choice(*SYSTEMS, *ROTATIONS)] = key(
        "`alpha-omega-kappa`, `omega-phi-kappa`, `phi-omega-kappa`, `yaw-pitch-roll`, `quaternion` (columns qw, qx, qy,"
        " qz) or `matrix` (r11, r12, ... r33)",
        USUAL.angle_system,
    )
    unit: Annotated[str, choice("deg", "gon", "rad")] = key("`deg`, `gon` or `rad`", USUAL.angle_unit)
    north: Annotated[str, choice("grid", "true")] = key(
        "North that they count from: `grid`, or `true`: then the meridian convergence at each photo is applied", "grid"
    )
    looks: Annotated[str, choice("down", "ahead")] | None = key(
        "Of yaw-pitch-roll, required: where the camera looks with pitch and roll zero, `down` or `ahead` (a gimbal)",
        None,
    )
    rotates: Annotated[str, choice("image_to_ground", "ground_to_image")] | None = key(
        "Of quaternions and matrices, required: `image_to_ground` or `ground_to_image`", None
    )
    y_axis: YAxis | None = key(
        "Of quaternions and matrices, required: y of the image axes, `up` (z towards the viewer) or `down` (z ahead)",
        None,
    )

    def rules(self) -> Refusals:
        needed = ("rotates", "y_axis") if self.system in ROTATIONS else ("looks",) if self.system == YAW else ()
        for name in ("looks", "rotates", "y_axis"):
            given = getattr(self, name)
            if name in needed and given is None:
                expected = type(self).model_fields[name].description or "".partition(": ")[2]
                message = f"`{name}` is missing, which nothing else says of {self.system}"
                yield wrong(message, code="missing-key", at=name, expected=expected)
            if name not in needed and given is not None:
                yield wrong(f"`{name}` says nothing of {self.system}", at=name, fix="remove it")


class Orientations(GivenList):
    """Given exterior orientations, for the bundle adjustment."""

    file: Words = key(
        "Table `photo,x,y,z` and the angles by name, as `alpha,omega,kappa`, [,sx,sy,sz][,s_alpha,s_omega,s_kappa]"
    )
    columns: OrientationColumns = key(COLUMNS, {})
    angles: GivenAngles = key("System and unit of the angles", GivenAngles())
    role: Annotated[str, choice("observed", "approximate")] = key(
        "`observed`: observations with their standard deviations; `approximate`: a start, without influence", "observed"
    )
    sigma: Sigma3 | None = key(SIGMA, None, unit="m")
    sigma_angles: Sigma3 | None = key(
        "Standard deviations of the angles of rows without them, in the order of their system; of quaternions and"
        " matrices of small turns about the image axes x, y, z",
        None,
        unit="the angles' unit",
    )

    def rules(self) -> Refusals:
        if self.angles.north == "true" and self.crs in {"local", "geocentric"}:
            message = f"nothing says where true north is in the frame `{self.crs}`"
            yield wrong(message, at="angles", fix="give the crs of a map, or of longitude and latitude")


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


Place = Annotated[str, choice(*PLACES)]
Parameter = Annotated[str, choice(*ASKED)]
AUTO, NEVER = "auto", "never"
MILLIMETRES, PIXELS = "mm", "px"


def _self_calibration(value: object) -> str | list[str]:
    if isinstance(value, list):
        return [known_word(single(each, f"one of {', '.join(ASKED)}"), ASKED) for each in value]
    return known_word(single(value, f"{AUTO}, {NEVER} or a list of parameters"), (AUTO, NEVER))


SelfCalibration = Annotated[
    str | list[str],
    Read(
        _self_calibration,
        {"anyOf": [{"enum": [AUTO, NEVER]}, {"type": "array", "items": {"enum": list(ASKED)}}]},
    ),
]


class Distortion(Section):
    """Lens distortion of a camera."""

    model: Annotated[str, choice("brown", "radial-table")] = key("`brown` or `radial-table`")
    direction: Annotated[str, choice("image_to_ideal", "ideal_to_image")] = key(
        "`image_to_ideal`: ideal = image + D(image); `ideal_to_image`: image = ideal + D(ideal)"
    )
    k: tuple[Number, Number, Number] = key(
        "Radial coefficients k1, k2, k3", (0.0, 0.0, 0.0), unit="mm^-2, mm^-4, mm^-6"
    )
    p: Pair = key("Decentring coefficients p1, p2", (0.0, 0.0), unit="mm^-1")
    b: Pair = key("Affinity b1 and shear b2: D_x gets b1 X + b2 Y", (0.0, 0.0))
    radius: list[Number] = key("Radial table: ascending distances from the principal point", [], unit="mm")
    distortion: list[Number] = key("Radial table: distortion at these distances, outwards positive", [], unit="mm")

    def rules(self) -> Refusals:
        table = self.model == "radial-table"
        for name in ("k", "p", "b") if table else ("radius", "distortion"):
            if name in self.model_fields_set:
                yield wrong(f"`{name}` does not belong to model {self.model}", at=name, fix="remove it or change model")
        if table and (len(self.radius) < 2 or len(self.radius) != len(self.distortion)):
            message = f"{len(self.radius)} radii and {len(self.distortion)} values of distortion are given"
            yield wrong(message, at="distortion", expected="as many values as radii, at least two")
        elif table and (self.radius[0] < 0 or any(after <= before for before, after in pairwise(self.radius))):
            yield wrong("the radii do not ascend", at="radius", expected="distances from 0 upwards")


class CertifiedDistortion(Distortion):
    """Lens distortion of a camera as its certificate has it."""

    k0: Number = key("`brown`: the radial coefficient k0 of USGS, D = X k0: part of the principal distance", 0.0)

    def rules(self) -> Refusals:
        if self.k0 and self.model != "brown":
            yield wrong(f"`k0` does not belong to model {self.model}", at="k0", fix="remove it or change model")
        if not abs(self.k0) < 1.0:
            message = f"{self.k0:g} is out of range"
            yield wrong(message, code="range", at="k0", expected="a number near 0, as 1.2e-4, without unit")


Focal = Annotated[
    tuple[float, ...],
    Read(
        lambda value: tuple(map(read_positive, value if isinstance(value, list) and len(value) in {1, 2} else [value])),
        {"anyOf": [{"type": "number"}, {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}]},
    ),
]


class PixelCamera(Section):
    """One camera as a program that counts in pixels gives it."""

    unit: Annotated[str, choice("px")] = key("`px`: all of it is in pixels, as its convention counts")
    convention: Annotated[str, choice(*CONVENTIONS)] = key(
        f"Whose signs, names and origins these are: {quoted(tuple(CONVENTIONS))}"
    )
    image_size: tuple[Positive, Positive] = key("Width and height of the photo", unit="px")
    focal_length: Focal = key("Focal length, or [fx, fy]", unit="px")
    principal_point: Pair = key("Principal point where the convention counts from, y down", unit="px")
    distortion: Annotated[dict[str, Number], Before(if_empty)] = key(
        "Coefficients by the names of the convention, as `{k1: -0.1}`", {}
    )
    pixel_size: Positive = key(
        "Size of a pixel; by default a micrometre, so that micrometres in reports are pixels", PIXEL_SIZE, unit="mm"
    )
    self_calibration: list[Parameter] | None = key(
        "Parameters of this camera that the bundle adjustment estimates. Default: `processing.self_calibration`",
        None,
    )

    def rules(self) -> Refusals:
        try:
            self.in_millimetres("")
        except InputError as error:
            fault = error.faults[0]
            yield wrong(fault.message, code=fault.code, at="distortion", fix=fault.fix)

    def in_millimetres(self, name: str) -> camera.Camera:
        """Return the camera as the program computes with it."""
        given = pixel_cameras.PixelCamera(
            convention=self.convention,
            image_size=self.image_size,
            focal_length=(self.focal_length[0], self.focal_length[-1]),
            principal_point=self.principal_point,
            distortion=self.distortion,
        )
        return pixel_cameras.in_millimetres(name, given, self.pixel_size)


class Camera(Section):
    """One camera, in millimetres."""

    unit: Annotated[str, choice("mm")] | None = key("`mm`; `px` for a camera that is given in pixels", None)
    principal_distance: Positive = key("Principal distance", unit="mm")
    principal_point: Pair = key("Principal point in the system of the image coordinates", (0.0, 0.0), unit="mm")
    format: tuple[Positive, Positive] | None = key("Width and height of the photo; needed for pixels", None, unit="mm")
    pixel_size: Positive | None = key("Size of a pixel; needed for pixels without fiducial marks", None, unit="mm")
    fiducials: Annotated[dict[str, Pair], Before(if_empty)] = key(
        "Coordinates of the fiducial marks, by mark: calibrated, or nominal beside `fiducial_distances`", {}, unit="mm"
    )
    fiducial_places: Annotated[dict[str, Place], Before(if_empty)] = key(
        f"Where on the photo each mark is, for `fiducial_distances` without coordinates: {quoted(tuple(PLACES))}", {}
    )
    fiducial_distances: list[tuple[Id, Id, Positive]] = key(
        "Calibrated distances between marks, `[[F1, F2, 211.98], ...]`, where nothing else is calibrated", [], unit="mm"
    )
    distortion: CertifiedDistortion | None = key("Lens distortion", None)
    self_calibration: list[Parameter] | None = key(
        "Parameters of this camera that the bundle adjustment estimates. Default: `processing.self_calibration`",
        None,
    )

    def rules(self) -> Refusals:
        if self.fiducial_places and (self.fiducials or not self.fiducial_distances):
            message = "places of fiducial marks are for distances between them without coordinates"
            yield wrong(message, at="fiducial_places", fix="remove them, or give fiducial_distances and no fiducials")
        if self.fiducial_distances and not (self.fiducials or self.fiducial_places):
            message = "distances alone do not say which mark is where"
            fix = "give fiducial_places: {F1: bottom-right, ...}, or nominal coordinates in fiducials"
            yield wrong(message, at="fiducial_distances", fix=fix)


def _unit(value: object) -> str:
    return PIXELS if isinstance(value, dict) and value.get("unit") == PIXELS else MILLIMETRES


AnyCamera = Annotated[Annotated[Camera, Tag(MILLIMETRES)] | Annotated[PixelCamera, Tag(PIXELS)], Discriminator(_unit)]


class FirstPhoto(Angles):
    """Orientation of the first photo of a strip, and the length of its first base: its frame and its scale."""

    angles: Triple = key("Angles of the first photo in the strip, in the order of their system", (0.0, 0.0, 0.0))
    base: Positive = key("Length of the first base in the strip", 1.0, unit="any")


class Strip(Section):
    """Photos of one flight line."""

    id: Id = key("Id of the strip")
    camera: Id | None = key("Camera of all its photos, a key of `cameras`; not with model coordinates", None)
    photos: Annotated[list[Id], length(1)] = key("Photos in flight order: two at least, or one in a bundle adjustment")
    models: Annotated[list[Id], length(1)] | None = key(
        "Independent models in flight order, one for every two neighbouring photos. Default: by their perspective"
        " centres",
        None,
    )
    first_photo: FirstPhoto | None = key(
        "Angles of the first photo and length of the first base, for strip coordinates as in a textbook", None
    )


class Photos(Section):
    """Photos of one camera in any order, among which a run finds the strips."""

    camera: Id = key("Camera of all these photos, a key of `cameras`")
    photos: Annotated[list[Id], length(1)] | None = key(
        "Their ids, in any order. Default: all measured photos that are listed nowhere else", None
    )


class Relative(Section):
    """Relative orientation and its search for gross errors."""

    screening: Annotated[str, choice(*RELATIVE_SCREENINGS)] = key(
        f"How gross errors are searched for: {quoted(RELATIVE_SCREENINGS)}", USUAL.relative.screening
    )
    grubbs_alpha: Fraction = key(
        "Probability of rejecting a good point of a pair without gross errors", USUAL.relative.grubbs_alpha
    )
    parallax_limit: PositiveOrAuto = key(
        "y parallax that needs no rejection; `auto`: four times its standard deviation",
        USUAL.relative.parallax_limit,
        unit="mm",
    )
    keep: list[Id] = key("Measurements, `photo/point`, that are used whatever the tests say", [])
    drop: list[Id] = key("Measurements, `photo/point`, that are left out", [])


class Links(Section):
    """Links of independent models and their search for gross errors."""

    screening: Annotated[str, choice(*LINK_METHODS)] = key(
        "How gross errors are searched for: `auto` (points of each link one after the other) or `none`",
        USUAL.links.screening,
    )
    alpha: Fraction = key(
        "Probability of rejecting anything in the links of a strip without gross errors", USUAL.links.alpha
    )
    keep: list[Id] = key("Coordinates, `model/point` or `model/photo`, that are used whatever the test says", [])
    drop: list[Id] = key("Coordinates, `model/point` or `model/photo`, that are left out", [])


class Polynomial(Section):
    """Polynomial adjustment of a strip."""

    degree: Annotated[str, choice(*DEGREES)] = key(
        "`auto` (decided by evidence, which is printed), `1`, `2` or `3`", USUAL.polynomial.degree
    )


class Interior(Section):
    """Interior orientation by fiducial marks."""

    transform: Annotated[str, choice("auto", "conformal", "affine", "bilinear", "projective")] = key(
        "`auto` (affine from four marks on, else conformal), `conformal`, `affine`, `bilinear` or `projective`",
        USUAL.interior.transform,
    )
    residuals: Annotated[str, choice("ignore", "interpolate")] = key(
        "What the residuals of the marks do: `ignore`, or `interpolate` them to the points",
        USUAL.interior.residuals,
    )


class Bundle(Section):
    """Bundle adjustment of all strips together."""

    screening: Annotated[str, choice(*SCREENINGS)] = key(
        "How gross errors are searched for: `snooping`, by the largest test values, or `none`",
        USUAL.bundle.screening,
    )
    test: Annotated[str, choice(*TESTS)] = key(
        "`tau`: residuals against the sigma0 found; `baarda`: against the stated standard deviations",
        USUAL.bundle.test,
    )
    level: Fraction = key(
        "Probability of rejecting anything in an adjustment without gross errors; of many rejections the part that is "
        "false",
        USUAL.bundle.level,
    )
    alpha: Fraction | None = key(
        "Probability of rejecting one good observation; by default `level` is shared out among all tests", None
    )
    power: Fraction = key("Probability with which the minimal detectable errors are found", USUAL.bundle.power)
    variance_components: Flag = key(
        "Estimate the standard deviations of image coordinates, control and camera positions",
        USUAL.bundle.variance_components,
    )
    gone = {"self_calibration": "write `processing.self_calibration`"}  # noqa: RUF012 (a class variable of Section)
    calibration_sigma: Annotated[dict[str, Positive], Before(if_empty)] = key(
        "A-priori standard deviations of these parameters, by name; free without one",
        {},
        unit="mm, mm^-2 for k1 and so on; 1 for affinity and shear",
    )

    def rules(self) -> Refusals:
        for name in self.calibration_sigma:
            if name not in ASKED:
                message = f"`{shown(name)}` is no parameter of a camera"
                expected, fix = f"one of {', '.join(ASKED)}", suggestion(name, ASKED)
                yield wrong(message, code="word", at="calibration_sigma", expected=expected, fix=fix)


Latitude = Annotated[Number, Range(-90.0, 90.0, "deg")]


class Processing(Section):
    """What is computed and how."""

    gone = {"covariance": "remove it: `adjustment: bundle` took its place, and needs none of it"}  # noqa: RUF012 (as above)

    adjustment: Annotated[str, choice(*ADJUSTMENTS)] = key(
        "`auto` (`bundle` wherever it is determined, the polynomials printed beside it; otherwise `polynomial`), "
        "`polynomial` (the strip method), `similarity` (without a polynomial) or `bundle` (all photos rigorously)",
        USUAL.adjustment,
    )
    polynomial: Polynomial = key("Polynomial adjustment", Polynomial())
    self_calibration: SelfCalibration = key(
        "`auto`: lens distortion, principal point and principal distance of a camera are estimated where the "
        "measurements contradict what is given; `never`; or a list of parameters that are estimated: "
        f"{quoted(ASKED)}",
        AUTO,
    )
    bundle: Bundle = key("Bundle adjustment", Bundle())
    relative: Relative = key("Relative orientation", Relative())
    links: Links = key("Links of independent models", Links())
    scale_transfer: Annotated[str, choice(*SCALE_TRANSFERS)] = key(
        "`least_squares`: all common points with their precision; `distances`: the textbook's mean of ratios",
        USUAL.formation.scale_transfer,
    )
    intersection: Annotated[str, choice(*INTERSECTIONS)] = key(
        "`mean`: Y of a model point is the mean of both rays; `left`: the point lies on the left ray, as printed",
        USUAL.formation.intersection,
    )
    control_weights: Annotated[str, choice("stated", "equal")] = key(
        "`stated`: control weighs by its standard deviations and those of the strip's points; `equal`: each coordinate"
        " alike, as printed",
        USUAL.absolute.control_weights,
    )
    earth_curvature: Annotated[str, choice("auto", "model", "image", "none")] = key(
        "`auto` or `none`: the frames carry it, `local` is truly Cartesian; `model`: D^2/2R, for plane map"
        " coordinates of an unknown projection given as `local`; `image`: the same, photo by photo in the image",
        USUAL.absolute.earth_curvature,
    )
    earth_radius: Positive = key(
        "Radius of the Earth for `earth_curvature: model` and `image`", USUAL.absolute.earth_radius, unit="m"
    )
    earth_latitude: Latitude | None = key(
        "Latitude of the strip: the radius of the ellipsoid there takes the place of `earth_radius`", None, unit="deg"
    )
    earth_azimuth: Number | None = key(
        "Azimuth of the strip: the radius in this direction; without it the mean radius at the latitude",
        None,
        unit="deg",
    )
    precision: Flag = key("Compute standard deviations and covariances of points and photos", USUAL.precision)
    cross_validation: Flag = key(
        "Adjust again without each point of the control, or each of ten groups of it, and compare there",
        USUAL.cross_validation,
    )
    principal_point: Flag = key(
        "Reduce image coordinates to the principal point of the camera", USUAL.refinement.principal_point
    )
    distortion: Flag = key("Take out the lens distortion of the camera", USUAL.refinement.distortion)
    refraction: Flag = key("Correct for atmospheric refraction", USUAL.refinement.refraction)
    flying_height: NumberOrAuto = key(
        "Mean height of the cameras above sea level, for refraction and curvature; `auto`: derived",
        USUAL.refinement.flying_height,
        unit="m",
    )
    ground_height: NumberOrAuto = key(
        "Mean height of the ground above sea level, for refraction and curvature; `auto`: derived",
        USUAL.refinement.ground_height,
        unit="m",
    )
    interior: Interior = key("Interior orientation", Interior())

    def rules(self) -> Refusals:
        if self.earth_azimuth is not None and self.earth_latitude is None:
            message = "a direction has a radius of curvature at a latitude only"
            yield wrong(message, code="missing-key", at="earth_azimuth", fix="give `earth_latitude` as well")


GEOPACKAGE = "geopackage"
ENDINGS = {
    GEOPACKAGE: ".gpkg",
    "historix": "extrinsics.csv",
    "orthority": ".csv",
    "orthority-geojson": ".geojson",
    "omega-phi-kappa": ".txt",
    "colmap": "/",
    "opensfm": "reconstruction.json",
}
ENDINGS |= {f"cameras-{each}": f".{each}.yaml" for each in CONVENTIONS} | {"cameras": ".yaml"}
"""What a result is written as, and the ending that asks for it; that of a folder is ``/``."""
TABLES = ("points", "photos", "residuals", "rejected", "refined", "reliability", "links")  # of a run


def form_of(target: str, asked: str = "") -> str:
    """Return the name of a form, as asked for or else by the ending; raises InputError for one that is unknown."""
    expected = "one of " + ", ".join(f"{name} ({ending})" for name, ending in ENDINGS.items())
    if asked:
        if asked not in ENDINGS:
            message = f"a result is not written as `{shown(asked)}`"
            raise InputError(Fault(message, "export", key="--to", expected=expected))
        return _installed(asked)
    found = next((name for name, ending in ENDINGS.items() if target.lower().endswith(ending)), "")
    if not found:
        raise InputError(Fault(f"`{shown(target)}` does not say by its ending what it is", "export", expected=expected))
    return _installed(found)


def _installed(form: str) -> str:
    """Refuse a form whose libraries are not there, before anything is computed."""
    try:
        missing = form == "historix" and not all(map(find_spec, ("laspy", "lazrs")))
    except ValueError:  # put out of action: sys.modules["laspy"] is None
        missing = True
    if missing:
        message = "a point cloud (LAZ) needs laspy with lazrs, which are not installed"
        raise InputError(Fault(message, "extra", fix="pip install photostrip[laz]"))
    return form


def export(value: object) -> Text:
    """Read the name of a file in the folder of a run."""
    name = text(value)
    try:
        form = form_of(name)
    except InputError as error:
        fault = error.faults[0]
        raise wrong(fault.message, code=fault.code, expected=fault.expected, fix=fault.fix) from None
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts or name == "/":
        raise wrong(f"`{shown(name)}` does not lie in the folder of the run", code="export", expected="a name")
    if name == "project.resolved.yaml" or (form == "orthority" and str(path) in {f"{table}.csv" for table in TABLES}):
        message = f"{name} is a file of the result itself"
        raise wrong(message, code="export", fix=f"write other-{name}")
    return name


def _finding(value: object) -> str:
    """Read the code of a finding, alone or with the one id that it is accepted for."""
    expected = "a code such as P201, or P201/1003 for one photo, point or strip"
    word = single(value, expected)
    code, _, _ = word.partition("/")
    if code not in KINDS:
        message = f"there is no finding `{shown(code)}`"
        raise wrong(message, code="no-such-finding", expected=expected, fix=suggestion(code, KINDS))
    return text(word)


Accepted = Annotated[str, Read(_finding, {"type": "string", "pattern": "^P[0-9]{3}(/.+)?$"})]


Exported = Annotated[str, Read(export, {"type": "string"})]


class Tolerances(Section):
    """Largest allowed values; where one is exceeded the exit code is 1."""

    check_rms_xy: Positive | None = key("Largest rms of the check points in plan", None, unit="m")
    check_rms_z: Positive | None = key("Largest rms of the check points in height", None, unit="m")
    check_max_xy: Positive | None = key("Largest difference at a check point in plan", None, unit="m")
    check_max_z: Positive | None = key("Largest difference at a check point in height", None, unit="m")
    control_rms_xy: Positive | None = key("Largest rms of the control points in plan", None, unit="m")
    control_rms_z: Positive | None = key("Largest rms of the control points in height", None, unit="m")
    sigma0_um: Positive | None = key("Largest sigma0 of the image coordinates", None, unit="um")


class ProjectFile(Section):
    """A project of photostrip: what was measured, what is given, and what is to be done.

    All paths are relative to the file itself. All ids are text, quoted or not.
    """

    photostrip: SchemaNumber = key("Number of this schema")
    name: Words | None = key("Name of the project; default: the file's name without its ending", None)
    extends: Words | None = key("Another file whose keys are taken where this one has none", None)
    cameras: Annotated[dict[str, AnyCamera], length(1), Before(if_empty)] = key(
        "Cameras by name; needed with `observations`", {}
    )
    strips: Annotated[list[Strip], length(1)] = key(
        "Strips: photos in flight order; beside or in place of `photos`", []
    )
    photos: Annotated[list[Photos], length(1), OneOrMany()] = key(
        "Photos in no given order, for the bundle adjustment: `{camera: name}`, or a list of `{camera, photos}`", []
    )
    observations: Observations | None = key("Points measured on photos; or `models`", None)
    models: Models | None = key("Independent models measured on a plotter, in place of `observations`", None)
    fiducial_measurements: FiducialMeasurements | None = key("Fiducial marks measured on photos", None)
    control: list[Control] = key(
        "Lists of given ground coordinates, each in its own frame; a bundle adjustment may do without", []
    )
    camera_positions: CameraPositions | None = key("Measured positions of the cameras, for the bundle adjustment", None)
    orientations: Orientations | None = key("Given exterior orientations, for the bundle adjustment", None)
    output: Output = key("Frame and angles of the results", Output())
    processing: Processing = key("What is computed and how", Processing())
    tolerances: Tolerances = key("Largest allowed values; where one is exceeded the exit code is 1", Tolerances())
    accept: list[Accepted] = key(
        "Findings that were looked at and are accepted: codes, or `code/id` for one photo, point or strip",
        [],
    )
    export: list[Exported] = key(
        "Files for other programs that each run with -o writes beside its result, by their ending: "
        + ", ".join(f"`{ending}` {name}" for name, ending in ENDINGS.items()),
        [],
    )

    def rules(self) -> Refusals:
        for name in self.export:
            if self.models is not None and form_of(name) != GEOPACKAGE:
                message = f"independent models give no orientation of photos, which {name} is made of"
                yield wrong(message, code="export", at="export", fix="remove it; a GeoPackage (.gpkg) can be written")

    @property
    def camera_of(self) -> dict[str, str | None]:
        """Camera of every photo that is listed: of the strips, then of `photos`."""
        return {str(photo): group.camera for group in self.groups for photo in group.photos or []}

    @property
    def groups(self) -> list[Strip | Photos]:
        """Photos with a camera in common: of the strips, then of `photos`."""
        return [*self.strips, *self.photos]
