"""The blocks of a project that name tables of measurements: points on photos, fiducial marks, models."""

from collections.abc import Iterable
from typing import Annotated

from photostrip.formats.measured.control import CONTROL
from photostrip.formats.measured.models import MODEL_CENTERS, MODEL_POINTS
from photostrip.formats.measured.observations import FIDUCIALS, OBSERVATIONS
from photostrip.formats.measured.pairs import LAYOUTS
from photostrip.formats.measured.repeated import POLICIES
from photostrip.formats.text.findings import suggestion
from photostrip.formats.text.numbers import shown
from photostrip.formats.text.tables import Column
from photostrip.project.schema.sections import After, Before, Section, key, wrong
from photostrip.project.schema.values import Positive, Sigma3, Words, YAxis, choice, if_empty


def header_names(*layouts: Iterable[Column]) -> After:
    """Check of the names that a table has for the columns of some layouts."""
    known = tuple(dict.fromkeys(column.name for layout in layouts for column in layout))

    def require(value: dict[str, str]) -> dict[str, str]:
        for name in value:
            if name not in known:
                message = f"`{shown(name)}` is no column of this table"
                fix = suggestion(name, known)
                raise wrong(message, code="word", at=name, expected=f"one of {', '.join(known)}", fix=fix)
        return value

    return After(require)


Unit = Annotated[str, choice(("mm", "um", "0.1um", "px"))]
Repeated = Annotated[str, choice(POLICIES)]
Columns = Annotated[dict[str, Words], Before(if_empty)]
PointColumns = Annotated[Columns, header_names(OBSERVATIONS, *LAYOUTS)]
MarkColumns = Annotated[Columns, header_names(FIDUCIALS)]
ControlColumns = Annotated[Columns, header_names(CONTROL)]
ModelColumns = Annotated[Columns, header_names(MODEL_POINTS)]
CenterColumns = Annotated[Columns, header_names(MODEL_CENTERS)]
COLUMNS = "Names in the header of columns that are called otherwise: `{point: Punkt, x: xs}`"


class Observations(Section):
    """Points measured on photos."""

    file: Words = key("Table `photo,point,x,y[,sx,sy]`, or of pairs, `pair,point,x,y,p,q`, .csv or .csv.gz")
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


class ModelCenters(Section):
    """Perspective centres in the systems of the models."""

    file: Words = key("Table `model,photo,x,y,z[,sx,sy,sz]`, .csv or .csv.gz")
    columns: CenterColumns = key(COLUMNS, {})


class Models(Section):
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
