"""The project file as a schema: every key, its unit, its default, and what its text must be.

Values arrive as texts (see ``document``) and get their type here. Defaults of processing are
those of the settings beside the mathematics; none is repeated. Each description ends with the unit.
"""

from __future__ import annotations

import warnings
from copy import deepcopy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Self

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, PlainValidator, model_validator
from pydantic_core import PydanticCustomError

from photostrip.formats.measured.control import CONTROL
from photostrip.formats.measured.models import MODEL_CENTERS, MODEL_POINTS
from photostrip.formats.measured.observations import FIDUCIALS, OBSERVATIONS
from photostrip.formats.measured.pairs import LAYOUTS
from photostrip.formats.measured.repeated import POLICIES as REPEATED
from photostrip.formats.text.findings import suggestion
from photostrip.formats.text.numbers import SMALLEST, NotANumber, shown
from photostrip.formats.text.numbers import number as read_number
from photostrip.formats.text.tables import CONTROL_CHARACTER
from photostrip.geodesy.frame_spec import CARTESIAN_AXES, GROUND_AXES
from photostrip.geometry.rotation import SYSTEMS
from photostrip.pipeline import ADJUSTMENTS, Settings
from photostrip.triangulation.bundle.settings import CALIBRATION, SCREENINGS, TESTS
from photostrip.triangulation.gross_errors.pairs.screening import METHODS
from photostrip.triangulation.image_coordinates.certificate import PLACES
from photostrip.triangulation.independent_models.link_screening import METHODS as LINK_METHODS
from photostrip.triangulation.plausibility import KINDS
from photostrip.triangulation.polynomial.correction import DEGREES
from photostrip.triangulation.strip_formation.scale_transfer import SCALE_TRANSFERS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from photostrip.formats.text.tables import Column

DEFAULTS = Settings()
SCHEMA_NUMBER = 1
FALSE, TRUE = ("false", "no", "off"), ("true", "yes", "on")


class Text(str):
    """A text that the user chose: an id, a name, a path."""

    __slots__ = ()


# ------------------------------------------------------------------------------------------------ single values


def wrong(message: str, *, code: str = "value", expected: str = "", fix: str = "", at: str = "") -> PydanticCustomError:
    """Make the error of one value; `at` is the key inside a mapping that is at fault."""
    context = {"message": message, "expected": expected, "fix": fix, "at": at}
    return PydanticCustomError("photostrip", "{message}", {**context, "code": code})


def _word(value: object, expected: str) -> str:
    """Require a single value."""
    if not isinstance(value, str):
        what = "a list" if isinstance(value, list) else "a mapping"
        raise wrong(f"{what} stands here", code="type", expected=expected)
    if not value:
        raise wrong("no value is given", code="no-value", expected=expected, fix="write one or remove the key")
    return value


def _text(value: object) -> Text:
    word = _word(value, "a text")
    if CONTROL_CHARACTER.search(word):
        raise wrong(f"`{shown(word)}` has a control character or a line break in it", expected="a text on one line")
    return Text(word)


@dataclass(frozen=True, eq=False)
class _Described:
    """What editors are told about a type; each key gets a copy of its own, to which its description is added."""

    schema: dict[str, Any]

    def __get_pydantic_json_schema__(self, core: object, handler: object) -> dict[str, Any]:
        return deepcopy(self.schema)


def _typed(read: Callable[[object], object], schema: dict[str, Any]) -> tuple[PlainValidator, _Described]:
    """Type that is read by a function of our own and described to editors by a schema of our own."""
    return PlainValidator(read), _Described(schema)


def _number(expected: str, least: float = -float("inf"), most: float = float("inf")) -> Callable[[object], float]:
    """Reader of a number strictly between two limits."""

    def read(value: object) -> float:
        word = _word(value, expected)
        try:
            result = read_number(word)
        except NotANumber as why:
            raise wrong(why.message, code="number", expected=expected, fix=why.fix) from None
        if not least < result < most:
            raise wrong(f"{shown(word)} is out of range", code="range", expected=expected)
        return result

    return read


def _or_auto(read: Callable[[object], float]) -> Callable[[object], float | None]:
    """Reader of a number that may also be ``auto`` (None)."""
    return lambda value: None if value == "auto" else read(value)


def _choice(allowed: tuple[str, ...], *later: str) -> tuple[PlainValidator, _Described]:
    """Type of a word from a list; words of a later version are refused by name."""
    expected = allowed[0] if len(allowed) == 1 else f"one of {', '.join(allowed)}"

    def read(value: object) -> str:
        word = _word(value, expected)
        if word in allowed:
            return word
        if word in later:
            raise wrong(f"`{word}` is not available yet", code="not-available", expected=expected)
        raise wrong(f"`{shown(word)}` is not known", code="word", expected=expected, fix=suggestion(word, allowed))

    values = [int(word) if word.isdecimal() else word for word in allowed]
    return _typed(read, {"enum": values})


def _flag(value: object) -> bool:
    word = _word(value, "true or false").casefold()
    if word not in FALSE + TRUE:
        raise wrong(f"`{shown(word)}` is neither true nor false", code="word", expected="true or false")
    return word in TRUE


def _schema_number(value: object) -> int:
    word = _word(value, str(SCHEMA_NUMBER))
    if word != str(SCHEMA_NUMBER):
        message = f"this version of photostrip does not read schema {shown(word)}"
        raise wrong(message, code="schema-number", expected=f"photostrip: {SCHEMA_NUMBER}")
    return SCHEMA_NUMBER


def _axes(value: object) -> tuple[str, str, str]:
    allowed = (GROUND_AXES, CARTESIAN_AXES)
    expected = "a permutation of [east, north, up]; for geocentric coordinates [x, y, z]"
    names = [_word(name, expected) for name in (value if isinstance(value, list) else [value])]
    if not any(sorted(names) == sorted(each) for each in allowed):
        written = shown(", ".join(names))
        raise wrong(f"[{written}] does not say which column is which", code="axes", expected=expected)
    first, second, third = names
    return first, second, third


def _columns(*layouts: Iterable[Column]) -> AfterValidator:
    """Check of the names that a table has for the columns of some layouts."""
    known = tuple(dict.fromkeys(column.name for layout in layouts for column in layout))

    def require(value: dict[str, str]) -> dict[str, str]:
        for name in value:
            if name not in known:
                message = f"`{shown(name)}` is no column of this table"
                fix = suggestion(name, known)
                raise wrong(message, code="word", at=name, expected=f"one of {', '.join(known)}", fix=fix)
        return value

    return AfterValidator(require)


def _if_empty(value: object) -> object:
    """Read a key whose entries are all commented out as an empty mapping."""
    return {} if value == "" else value


_read_number = _number("a number")
_read_positive = _number("a number larger than 0", least=SMALLEST)
_read_fraction = _number("a number between 0 and 1", least=0.0, most=1.0)
_ANY = {"type": ["string", "number", "boolean", "null"]}  # whatever an id looks like, it is read as text
_NUMBER = {"type": "number"}
_POSITIVE = {"type": "number", "exclusiveMinimum": 0}
_FRACTION = {"type": "number", "exclusiveMinimum": 0, "exclusiveMaximum": 1}
_AUTO = {"const": "auto"}
_AXES = {"type": "array", "items": {"enum": [*GROUND_AXES, *CARTESIAN_AXES]}, "minItems": 3, "maxItems": 3}

Id = Annotated[str, *_typed(_text, _ANY)]
Words = Annotated[str, *_typed(_text, {"type": "string", "minLength": 1})]
Number = Annotated[float, *_typed(_read_number, _NUMBER)]
Positive = Annotated[float, *_typed(_read_positive, _POSITIVE)]
Fraction = Annotated[float, *_typed(_read_fraction, _FRACTION)]
PositiveOrAuto = Annotated[float | None, *_typed(_or_auto(_read_positive), {"anyOf": [_AUTO, _POSITIVE]})]
NumberOrAuto = Annotated[float | None, *_typed(_or_auto(_read_number), {"anyOf": [_AUTO, _NUMBER]})]
Flag = Annotated[bool, *_typed(_flag, {"type": "boolean"})]
SchemaNumber = Annotated[int, *_typed(_schema_number, {"const": SCHEMA_NUMBER})]
Pair = tuple[Number, Number]
Axes = Annotated[tuple[str, str, str], *_typed(_axes, _AXES)]
Unit = Annotated[str, *_choice(("mm", "um", "0.1um", "px"))]
MODEL_UNITS = ("mm", "um", "m")
Repeated = Annotated[str, *_choice(REPEATED)]
Columns = Annotated[dict[str, Words], BeforeValidator(_if_empty)]
PointColumns = Annotated[Columns, _columns(OBSERVATIONS, *LAYOUTS)]
MarkColumns = Annotated[Columns, _columns(FIDUCIALS)]
ControlColumns = Annotated[Columns, _columns(CONTROL)]
Place = Annotated[str, *_choice(tuple(PLACES))]
YAxis = Annotated[str, *_choice(("up", "down"))]
Height = Annotated[str, *_choice(("ellipsoidal", "orthometric"))]
Parameter = Annotated[str, *_choice(CALIBRATION)]


def _or(words: tuple[str, ...]) -> str:
    """List words as a sentence does."""
    quoted = [f"`{word}`" for word in words]
    return f"{', '.join(quoted[:-1])} or {quoted[-1]}"


def key(description: str, default: Any = ..., *, unit: str = "") -> Any:  # noqa: ANN401 (pydantic's own manner)
    """Describe one key.

    Parameters
    ----------
    default : object
        Its default; without one the key is required.
    """
    extra: dict[str, Any] | None = {"unit": unit} if unit else None
    return Field(default, description=f"{description} [{unit}]" if unit else description, json_schema_extra=extra)


# ------------------------------------------------------------------------------------------------- the sections


class Section(BaseModel):
    """A mapping of the project file: unknown keys are faults."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)

    @model_validator(mode="before")
    @classmethod
    def _nothing_is_empty(cls, value: object) -> object:
        return _if_empty(value)


class Distortion(Section):
    """Lens distortion of a camera."""

    model: Annotated[str, *_choice(("brown", "radial-table"))] = key("`brown` or `radial-table`")
    direction: Annotated[str, *_choice(("image_to_ideal", "ideal_to_image"))] = key(
        "`image_to_ideal`: ideal = image + D(image); `ideal_to_image`: image = ideal + D(ideal)"
    )
    k: tuple[Number, Number, Number] = key(
        "Radial coefficients k1, k2, k3", (0.0, 0.0, 0.0), unit="mm^-2, mm^-4, mm^-6"
    )
    p: Pair = key("Decentring coefficients p1, p2", (0.0, 0.0), unit="mm^-1")
    b: Pair = key("Affinity b1 and shear b2: D_x gets b1 X + b2 Y", (0.0, 0.0))
    radius: list[Number] = key("Radial table: ascending distances from the principal point", [], unit="mm")
    distortion: list[Number] = key("Radial table: distortion at these distances, outwards positive", [], unit="mm")

    @model_validator(mode="after")
    def _one_model(self) -> Self:
        table = self.model == "radial-table"
        for name in ("k", "p", "b") if table else ("radius", "distortion"):
            if name in self.model_fields_set:
                raise wrong(f"`{name}` does not belong to model {self.model}", at=name, fix="remove it or change model")
        if not table:
            return self
        if len(self.radius) < 2 or len(self.radius) != len(self.distortion):
            message = f"{len(self.radius)} radii and {len(self.distortion)} values of distortion are given"
            raise wrong(message, at="distortion", expected="as many values as radii, at least two")
        steps = zip(self.radius, self.radius[1:], strict=False)
        if self.radius[0] < 0 or any(after <= before for before, after in steps):
            raise wrong("the radii do not ascend", at="radius", expected="distances from 0 upwards")
        return self


class Camera(Section):
    """One camera."""

    principal_distance: Positive = key("Principal distance", unit="mm")
    principal_point: Pair = key("Principal point in the system of the image coordinates", (0.0, 0.0), unit="mm")
    format: tuple[Positive, Positive] | None = key("Width and height of the photo; needed for pixels", None, unit="mm")
    pixel_size: Positive | None = key("Size of a pixel; needed for pixels", None, unit="mm")
    fiducials: Annotated[dict[str, Pair], BeforeValidator(_if_empty)] = key(
        "Coordinates of the fiducial marks, by mark: calibrated, or nominal beside `fiducial_distances`", {}, unit="mm"
    )
    fiducial_places: Annotated[dict[str, Place], BeforeValidator(_if_empty)] = key(
        f"Where on the photo each mark is, for `fiducial_distances` without coordinates: {_or(tuple(PLACES))}", {}
    )
    fiducial_distances: list[tuple[Id, Id, Positive]] = key(
        "Calibrated distances between marks, `[[F1, F2, 211.98], ...]`, where nothing else is calibrated", [], unit="mm"
    )
    distortion: Distortion | None = key("Lens distortion", None)
    self_calibration: list[Parameter] | None = key(
        "Parameters of this camera that the bundle adjustment estimates. Default: `processing.bundle.self_calibration`",
        None,
    )

    @model_validator(mode="after")
    def _marks_have_a_place(self) -> Self:
        if self.fiducial_places and (self.fiducials or not self.fiducial_distances):
            message = "places of fiducial marks are for distances between them without coordinates"
            raise wrong(message, at="fiducial_places", fix="remove them, or give fiducial_distances and no fiducials")
        if self.fiducial_distances and not (self.fiducials or self.fiducial_places):
            message = "distances alone do not say which mark is where"
            fix = "give fiducial_places: {F1: bottom-right, ...}, or nominal coordinates in fiducials"
            raise wrong(message, at="fiducial_distances", fix=fix)
        return self


class Strip(Section):
    """Photos of one flight line."""

    id: Id = key("Id of the strip")
    camera: Id | None = key("Camera of all its photos, a key of `cameras`; not with model coordinates", None)
    photos: Annotated[list[Id], Field(min_length=1)] = key(
        "Photos in flight order: two at least, or one in a bundle adjustment"
    )
    models: Annotated[list[Id], Field(min_length=1)] | None = key(
        "Independent models in flight order, one for every two neighbouring photos. Default: by their perspective"
        " centres",
        None,
    )


COLUMNS = "Names in the header of columns that are called otherwise: `{point: Punkt, x: xs}`"


class Observations(Section):
    """Points measured on photos."""

    file: Words = key("Table `photo,point,x,y[,sx,sy]`, or of pairs, `pair,point,x,y,p,q`, .csv or .csv.gz")
    unit: Unit = key("Unit of the table: `mm`, `um`, `0.1um` or `px`")
    y_axis: YAxis | None = key(
        "Direction of y, `up` or `down`; x grows to the right. Default: `up`; required for px", None
    )
    origin: Annotated[str, *_choice(("center", "top-left", "first-pixel"))] | None = key(
        "Where x = y = 0: `center` of the photo, `top-left` corner of the first pixel, `first-pixel`: its centre."
        " Default: `center`; for px `top-left`. Meaningless with measured fiducial marks",
        None,
    )
    repeated: Repeated | None = key(
        "A point measured again on the same photo: `refuse` or `average`. Default: `refuse`; for pairs `average`", None
    )
    columns: PointColumns = key(COLUMNS, {})
    sigma: Positive | None = key("Standard deviation of rows without sx, sy", None, unit="the table's unit")


Sigma3 = tuple[Positive, Positive, Positive]
ModelColumns = Annotated[Columns, _columns(MODEL_POINTS)]
CenterColumns = Annotated[Columns, _columns(MODEL_CENTERS)]


class ModelCenters(Section):
    """Perspective centres in the systems of the models."""

    file: Words = key("Table `model,photo,x,y,z[,sx,sy,sz]`, .csv or .csv.gz")
    columns: CenterColumns = key(COLUMNS, {})


class Models(Section):
    """Independent models measured on a plotter, in place of image coordinates."""

    file: Words = key(
        "Table `model,point,x,y,z[,sx,sy,sz]`, .csv or .csv.gz; a point with the id of a photo is its centre"
    )
    unit: Annotated[str, *_choice(tuple(MODEL_UNITS))] = key("Unit of the tables: `mm`, `um` or `m`, at model scale")
    axes: Annotated[str, *_choice(("right-handed", "left-handed"))] = key(
        "Whether x, y, z of the plotter are `right-handed` or `left-handed`", "right-handed"
    )
    centers: ModelCenters | None = key("Perspective centres, when they stand in a table of their own", None)
    columns: ModelColumns = key(COLUMNS, {})
    sigma: Sigma3 | None = key("Standard deviations of rows without sx, sy, sz", None, unit="the tables' unit")
    center_sigma: Sigma3 | None = key(
        "Standard deviations of perspective centres without their own; default: `sigma`", None, unit="the tables' unit"
    )


class FiducialMeasurements(Section):
    """Fiducial marks measured on photos."""

    file: Words = key("Table `photo,mark,x,y[,sx,sy]`, .csv or .csv.gz")
    unit: Unit | None = key("Unit of the table; default: that of `observations`", None)
    y_axis: YAxis | None = key("Direction of y; default: that of `observations`", None)
    repeated: Repeated = key("A mark measured again on the same photo: `refuse` or `average`", "refuse")
    columns: MarkColumns = key(COLUMNS, {})
    sigma: Positive | None = key(
        "Standard deviation of rows without sx, sy; default: that of `observations`", None, unit="the table's unit"
    )


class Ellipsoid(Section):
    """Ellipsoid of geocentric coordinates."""

    a: Positive = key("Semi-major axis", unit="m")
    b: Positive = key("Semi-minor axis", unit="m")


CRS = "An authority code (`EPSG:32633`), a PROJ string, WKT, `geocentric`, or `local` (right-handed, metres)"


def _require_axes(axes: tuple[str, str, str] | None, crs: str) -> None:
    """Require the order of the columns, but for geocentric coordinates."""
    if axes is None and crs != "geocentric":
        expected = "axes: [east, north, up], or [north, east, up] where x points north"
        message = "nothing says which of the columns x, y, z is east"
        raise wrong(message, code="missing-key", at="axes", expected=expected)


class Control(Section):
    """One list of given ground coordinates."""

    file: Words = key("Table `point,x,y,z[,use][,role][,sx,sy,sz]`, .csv or .csv.gz")
    crs: Words = key(CRS)
    axes: Axes | None = key(
        "What the columns x, y, z are: a permutation of east, north, up; required, except for geocentric", None
    )
    height: Height = key("`ellipsoidal` or `orthometric`", "ellipsoidal")
    geoid_undulation: Number | None = key(
        "Height of the geoid above the ellipsoid, for orthometric heights", None, unit="m"
    )
    ellipsoid: Ellipsoid | None = key("Ellipsoid of geocentric coordinates; default: WGS 84", None)
    columns: ControlColumns = key(COLUMNS, {})
    sigma: tuple[Positive, Positive, Positive] | None = key(
        "Standard deviations of rows without sx, sy, sz, in the order of `axes`", None, unit="m"
    )

    @model_validator(mode="after")
    def _axes_are_said(self) -> Self:
        _require_axes(self.axes, self.crs)
        return self


class CameraPositions(Section):
    """Measured positions of the cameras, for the bundle adjustment."""

    file: Words = key("Table `photo,x,y,z[,use][,time][,sx,sy,sz]`, .csv or .csv.gz")
    crs: Words = key(CRS)
    axes: Axes | None = key(
        "What the columns x, y, z are: a permutation of east, north, up; required, except for geocentric", None
    )
    height: Height = key("`ellipsoidal` or `orthometric`", "ellipsoidal")
    geoid_undulation: Number | None = key(
        "Height of the geoid above the ellipsoid, for orthometric heights", None, unit="m"
    )
    ellipsoid: Ellipsoid | None = key("Ellipsoid of geocentric coordinates; default: WGS 84", None)
    sigma: tuple[Positive, Positive, Positive] | None = key(
        "Standard deviations of rows without sx, sy, sz, in the order of `axes`", None, unit="m"
    )
    lever_arm: tuple[Number, Number, Number] = key(
        "Antenna as seen from the perspective centre along the image axes: x right, y up, z towards the viewer",
        (0.0, 0.0, 0.0),
        unit="m",
    )
    correction: Annotated[str, *_choice(("none", "offset", "drift"))] = key(
        "Unknown error that the positions of one strip share: `none`, `offset` (constant) or `drift` (constant and"
        " linear in `time`; without times in the number of the photo)",
        "none",
    )

    @model_validator(mode="after")
    def _axes_are_said(self) -> Self:
        _require_axes(self.axes, self.crs)
        return self


class Angles(Section):
    """Angles of the exterior orientations."""

    system: Annotated[str, *_choice(SYSTEMS)] = key(
        "`alpha-omega-kappa`, `omega-phi-kappa` or `phi-omega-kappa`", DEFAULTS.angle_system
    )
    unit: Annotated[str, *_choice(("deg", "gon", "rad"))] = key("`deg`, `gon` or `rad`", DEFAULTS.angle_unit)


class Orientations(Section):
    """Given exterior orientations, for the bundle adjustment."""

    file: Words = key(
        "Table `photo,x,y,z` and the angles by name, as `alpha,omega,kappa`, [,sx,sy,sz][,s_alpha,s_omega,s_kappa]"
    )
    crs: Words = key(CRS)
    axes: Axes | None = key(
        "What the columns x, y, z are: a permutation of east, north, up; required, except for geocentric", None
    )
    height: Height = key("`ellipsoidal` or `orthometric`", "ellipsoidal")
    geoid_undulation: Number | None = key(
        "Height of the geoid above the ellipsoid, for orthometric heights", None, unit="m"
    )
    ellipsoid: Ellipsoid | None = key("Ellipsoid of geocentric coordinates; default: WGS 84", None)
    angles: Angles = key("System and unit of the angles", Angles.model_construct())
    role: Annotated[str, *_choice(("observed", "approximate"))] = key(
        "`observed`: observations with their standard deviations; `approximate`: a start, without influence", "observed"
    )
    sigma: tuple[Positive, Positive, Positive] | None = key(
        "Standard deviations of rows without sx, sy, sz, in the order of `axes`", None, unit="m"
    )
    sigma_angles: tuple[Positive, Positive, Positive] | None = key(
        "Standard deviations of the angles of rows without them, in the order of their system",
        None,
        unit="the angles' unit",
    )

    @model_validator(mode="after")
    def _axes_are_said(self) -> Self:
        _require_axes(self.axes, self.crs)
        return self


class Output(Section):
    """Frame and angles of the results."""

    crs: Words | None = key(f"{CRS}. Default: that of the first control list", None)
    axes: Axes | None = key(
        "Order of x, y, z. Default: that of the first control list; with a crs of its own east, north, up", None
    )
    height: Height | None = key(
        "`ellipsoidal` or `orthometric`; default: that of the first control list, or ellipsoidal", None
    )
    geoid_undulation: Number | None = key(
        "Height of the geoid above the ellipsoid, for orthometric heights", None, unit="m"
    )
    ellipsoid: Ellipsoid | None = key("Ellipsoid of geocentric coordinates; default: WGS 84", None)
    angles: Angles = key("Angles of the exterior orientations", Angles.model_construct())


class Relative(Section):
    """Relative orientation and its search for gross errors."""

    screening: Annotated[str, *_choice(METHODS)] = key(
        f"How gross errors are searched for: {_or(METHODS)}", DEFAULTS.relative.screening
    )
    grubbs_alpha: Fraction = key(
        "Probability of rejecting a good point of a pair without gross errors", DEFAULTS.relative.grubbs_alpha
    )
    parallax_limit: PositiveOrAuto = key(
        "y parallax that needs no rejection; `auto`: four times its standard deviation",
        DEFAULTS.relative.parallax_limit,
        unit="mm",
    )
    keep: list[Id] = key("Measurements, `photo/point`, that are used whatever the tests say", [])
    drop: list[Id] = key("Measurements, `photo/point`, that are left out", [])


class Links(Section):
    """Links of independent models and their search for gross errors."""

    screening: Annotated[str, *_choice(LINK_METHODS)] = key(
        "How gross errors are searched for: `auto` (points of each link one after the other) or `none`",
        DEFAULTS.links.screening,
    )
    alpha: Fraction = key("Probability of rejecting a good point of a link without gross errors", DEFAULTS.links.alpha)
    keep: list[Id] = key("Coordinates, `model/point` or `model/photo`, that are used whatever the test says", [])
    drop: list[Id] = key("Coordinates, `model/point` or `model/photo`, that are left out", [])


class Polynomial(Section):
    """Polynomial adjustment of a strip."""

    degree: Annotated[str, *_choice(DEGREES)] = key(
        "`auto` (decided by evidence, which is printed), `1`, `2` or `3`", DEFAULTS.polynomial.degree
    )


class Covariance(Section):
    """Adjustment of a strip with its own covariance."""

    distances: Flag = key(
        "Let distances of pass points from the common centers of their models count beside the control",
        DEFAULTS.covariance.distances,
    )


class Interior(Section):
    """Interior orientation by fiducial marks."""

    transform: Annotated[str, *_choice(("auto", "conformal", "affine", "bilinear", "projective"))] = key(
        "`auto` (affine from four marks on, else conformal), `conformal`, `affine`, `bilinear` or `projective`",
        DEFAULTS.interior.transform,
    )
    residuals: Annotated[str, *_choice(("ignore", "interpolate"))] = key(
        "What the residuals of the marks do: `ignore`, or `interpolate` them to the points",
        DEFAULTS.interior.residuals,
    )


class Bundle(Section):
    """Bundle adjustment of all strips together."""

    screening: Annotated[str, *_choice(SCREENINGS)] = key(
        "How gross errors are searched for: `snooping` (one after the other), `robust` (re-weighted first) or `none`",
        DEFAULTS.bundle.screening,
    )
    test: Annotated[str, *_choice(TESTS)] = key(
        "`tau`: residuals against the sigma0 found; `baarda`: against the stated standard deviations",
        DEFAULTS.bundle.test,
    )
    alpha: Fraction = key("Probability of rejecting one good observation", DEFAULTS.bundle.alpha)
    power: Fraction = key("Probability with which the minimal detectable errors are found", DEFAULTS.bundle.power)
    variance_components: Flag = key(
        "Estimate the standard deviations of image coordinates, control and camera positions",
        DEFAULTS.bundle.variance_components,
    )
    self_calibration: list[Parameter] = key(f"Parameters of the cameras that are estimated: {_or(CALIBRATION)}", [])
    calibration_sigma: Annotated[dict[str, Positive], BeforeValidator(_if_empty)] = key(
        "A-priori standard deviations of these parameters, by name; free without one",
        {},
        unit="mm, mm^-2 for k1 and so on; 1 for affinity and shear",
    )

    @model_validator(mode="after")
    def _known_parameters(self) -> Self:
        for name in self.calibration_sigma:
            if name not in CALIBRATION:
                message = f"`{shown(name)}` is no parameter of a camera"
                expected, fix = f"one of {', '.join(CALIBRATION)}", suggestion(name, CALIBRATION)
                raise wrong(message, code="word", at="calibration_sigma", expected=expected, fix=fix)
        return self


class Processing(Section):
    """What is computed and how."""

    adjustment: Annotated[str, *_choice(ADJUSTMENTS)] = key(
        "`polynomial` (the strip method), `similarity` (without a polynomial), `covariance` (each strip with its own "
        "covariance) or `bundle` (all strips rigorously)",
        DEFAULTS.adjustment,
    )
    polynomial: Polynomial = key("Polynomial adjustment", Polynomial.model_construct())
    covariance: Covariance = key("Adjustment of a strip with its own covariance", Covariance.model_construct())
    bundle: Bundle = key("Bundle adjustment", Bundle.model_construct())
    relative: Relative = key("Relative orientation", Relative.model_construct())
    links: Links = key("Links of independent models", Links.model_construct())
    scale_transfer: Annotated[str, *_choice(SCALE_TRANSFERS)] = key(
        "`least_squares`: all common points with their precision; `distances`: the textbook's mean of ratios",
        DEFAULTS.formation.scale_transfer,
    )
    earth_curvature: Annotated[str, *_choice(("auto", "model", "image", "none"))] = key(
        "`auto` or `none`: the frames carry it, `local` is truly Cartesian; `model`: D^2/2R, for plane map"
        " coordinates of an unknown projection given as `local`; `image`: the same, photo by photo in the image",
        DEFAULTS.absolute.earth_curvature,
    )
    earth_radius: Positive = key(
        "Radius of the Earth for `earth_curvature: model` and `image`", DEFAULTS.absolute.earth_radius, unit="m"
    )
    precision: Flag = key("Compute standard deviations and covariances of points and photos", DEFAULTS.precision)
    principal_point: Flag = key(
        "Reduce image coordinates to the principal point of the camera", DEFAULTS.refinement.principal_point
    )
    distortion: Flag = key("Take out the lens distortion of the camera", DEFAULTS.refinement.distortion)
    refraction: Flag = key("Correct for atmospheric refraction", DEFAULTS.refinement.refraction)
    flying_height: NumberOrAuto = key(
        "Mean height of the cameras above sea level, for refraction and curvature; `auto`: derived",
        DEFAULTS.refinement.flying_height,
        unit="m",
    )
    ground_height: NumberOrAuto = key(
        "Mean height of the ground above sea level, for refraction and curvature; `auto`: derived",
        DEFAULTS.refinement.ground_height,
        unit="m",
    )
    interior: Interior = key("Interior orientation", Interior.model_construct())


class Tolerances(Section):
    """Largest allowed values; where one is exceeded the exit code is 1."""

    check_rms_xy: Positive | None = key("Largest rms of the check points in plan", None, unit="m")
    check_rms_z: Positive | None = key("Largest rms of the check points in height", None, unit="m")
    check_max_xy: Positive | None = key("Largest difference at a check point in plan", None, unit="m")
    check_max_z: Positive | None = key("Largest difference at a check point in height", None, unit="m")
    control_rms_xy: Positive | None = key("Largest rms of the control points in plan", None, unit="m")
    control_rms_z: Positive | None = key("Largest rms of the control points in height", None, unit="m")
    sigma0_um: Positive | None = key("Largest sigma0 of the image coordinates", None, unit="um")


def _finding(value: object) -> str:
    """Read the code of a finding, alone or with the one id that it is accepted for."""
    expected = "a code such as P201, or P201/1003 for one photo, point or strip"
    word = _word(value, expected)
    code, _, _ = word.partition("/")
    if code not in KINDS:
        message = f"there is no finding `{shown(code)}`"
        raise wrong(message, code="no-such-finding", expected=expected, fix=suggestion(code, KINDS))
    return _text(word)


Accepted = Annotated[str, *_typed(_finding, {"type": "string", "pattern": "^P[0-9]{3}(/.+)?$"})]


class ProjectFile(Section):
    """A project of photostrip: what was measured, what is given, and what is to be done.

    All paths are relative to the file itself. All ids are text, quoted or not.
    """

    photostrip: SchemaNumber = key("Number of this schema")
    name: Words | None = key("Name of the project; default: the file's name without its ending", None)
    extends: Words | None = key("Another file whose keys are taken where this one has none", None)
    cameras: Annotated[dict[str, Camera], BeforeValidator(_if_empty), Field(min_length=1)] = key(
        "Cameras by name; needed with `observations`", {}
    )
    strips: Annotated[list[Strip], Field(min_length=1)] = key("Strips")
    observations: Observations | None = key("Points measured on photos; or `models`", None)
    models: Models | None = key("Independent models measured on a plotter, in place of `observations`", None)
    fiducial_measurements: FiducialMeasurements | None = key("Fiducial marks measured on photos", None)
    control: list[Control] = key(
        "Lists of given ground coordinates, each in its own frame; a bundle adjustment may do without", []
    )
    camera_positions: CameraPositions | None = key("Measured positions of the cameras, for the bundle adjustment", None)
    orientations: Orientations | None = key("Given exterior orientations, for the bundle adjustment", None)
    output: Output = key("Frame and angles of the results", Output.model_construct())
    processing: Processing = key("What is computed and how", Processing.model_construct())
    tolerances: Tolerances = key(
        "Largest allowed values; where one is exceeded the exit code is 1", Tolerances.model_construct()
    )
    accept: list[Accepted] = key(
        "Findings that were looked at and are accepted: codes, or `code/id` for one photo, point or strip",
        [],
    )


def json_schema() -> dict[str, Any]:
    """JSON Schema of the project file, with every key, default and unit.

    Returns
    -------
    dict
        JSON Schema, draft 2020-12; the same on every call.
    """
    sections = (Angles, Output, Relative, Links, Bundle, Polynomial, Covariance, Interior, Processing, Tolerances)
    for section in sections:
        section.model_rebuild()  # early versions of pydantic cannot describe a default of a section not built yet
    measured = {"anyOf": [{"required": ["cameras", "observations"]}, {"required": ["models"]}]}
    return described(ProjectFile, "photostrip project") | measured


def described(kind: type[Section], title: str) -> dict[str, Any]:
    """JSON Schema of a kind of file.

    Returns
    -------
    dict
        JSON Schema, draft 2020-12.
    """
    with warnings.catch_warnings():
        # defaults of nested sections are encoded twice, and the second time a tuple of words is a list
        warnings.filterwarnings("ignore", message="Pydantic serializer warnings", category=UserWarning)
        schema = _for_editors(kind.model_json_schema())
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": title, **schema}


def _for_editors(schema: Any) -> Any:  # noqa: ANN401 (JSON)
    """Take out what pydantic adds: titles made of names, and null, which no key accepts."""
    if isinstance(schema, list):
        return [_for_editors(each) for each in schema]
    if not isinstance(schema, dict):
        return schema
    result = {name: _for_editors(each) for name, each in schema.items() if name != "title" or isinstance(each, dict)}
    if "allOf" in result:  # early versions of pydantic wrap a reference that has a description
        result |= result.pop("allOf")[0]
    if result.get("type") == "object" and "minLength" in result:
        result["minProperties"] = result.pop("minLength")
    kinds = [each for each in result.get("anyOf", []) if each != {"type": "null"}]
    if "anyOf" in result:
        del result["anyOf"]
        result |= kinds[0] if len(kinds) == 1 else {"anyOf": kinds}
    if isinstance(result.get("default"), dict):
        result["default"] = {}  # the keys of the section carry their own
    if "default" in result and result["default"] is None:
        del result["default"]
        if _AUTO in kinds:
            result["default"] = "auto"
    return result
