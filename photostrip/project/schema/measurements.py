"""The blocks of a project that name tables of measurements: points on photos, fiducial marks, models."""

from collections.abc import Iterable, Sequence
from typing import Annotated

from photostrip.formats.measured.control import CONTROL
from photostrip.formats.measured.models import MODEL_CENTERS, MODEL_POINTS
from photostrip.formats.measured.observations import FIDUCIALS, OBSERVATIONS
from photostrip.formats.measured.pairs import LAYOUTS
from photostrip.formats.measured.repeated import POLICIES
from photostrip.formats.text.findings import suggestion
from photostrip.formats.text.numbers import shown
from photostrip.formats.text.table_reader import WORDS
from photostrip.formats.text.table_text import MOST_LINES
from photostrip.formats.text.tables import Column
from photostrip.project.schema.sections import (
    After,
    Before,
    Positive,
    Read,
    Section,
    Sigma3,
    Words,
    YAxis,
    choice,
    if_empty,
    key,
    rule,
    text,
    whole,
    wrong,
)


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
    separator: Annotated[str, choice(tuple(WORDS.values()))] = key(
        "What stands between the fields: `comma`, `semicolon`, `tab` or `blank` (any number of blanks and tabs)",
        "comma",
    )
    decimal: Annotated[str, choice(("point", "comma"))] = key(
        "What stands before decimals: `point` or `comma`", "point"
    )
    skip: Annotated[int, Read(_lines_skipped, {"type": "integer", "minimum": 0})] = key(
        "Lines above the table that are passed over", 0
    )

    @rule
    def _commas_mean_one_thing(self) -> None:
        if self.decimal == self.separator:
            message = "commas cannot stand between the fields and before decimals"
            raise wrong(message, at="decimal", fix="say the `separator`: semicolon, tab or blank")


Unit = Annotated[str, choice(("mm", "um", "0.1um", "px"))]
Repeated = Annotated[str, choice(POLICIES)]
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
    origin: Annotated[str, choice(("center", "top-left", "first-pixel"))] | None = key(
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
    unit: Annotated[str, choice(("mm", "um", "m"))] = key("Unit of the tables: `mm`, `um` or `m`, at model scale")
    axes: Annotated[str, choice(("right-handed", "left-handed"))] = key(
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
