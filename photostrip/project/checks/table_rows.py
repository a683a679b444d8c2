"""What became of every row of every table, with the reason for those that are not used."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Flags, Numbers
from photostrip.formats.measured.control import ControlTable
from photostrip.formats.measured.exterior import OrientationTable, PositionTable
from photostrip.formats.measured.measurements import Measurements
from photostrip.formats.text.tables import Table
from photostrip.notes import Document
from photostrip.pipeline.inputs import Inputs, MeasuredModels
from photostrip.project.loading import Project
from photostrip.project.tables import Tables, rays

IN_NO_STRIP = "its photo belongs to no strip"
ONCE = "the point is measured on one photo only"
NO_NEIGHBOUR = "the point is not on two neighbouring photos of one strip"
IN_NO_MODEL = "its model belongs to no strip"
NO_MODEL = "not measured in any model of the strips"
OFF = "switched off (use: off)"
NO_BUNDLE = "only the bundle adjustment uses it"
NOT_MEASURED = "not measured on any photo of the strips"


class Reason(NamedTuple):
    """Why rows are not used, which of them, and whose they are."""

    why: str
    rows: Flags
    ids: Sequence[str]
    of_rows: Numbers  # which of the ids each row has


def observations_used(inputs: Inputs) -> Numbers:
    """Return the strip in which each image point takes part, shape (n,); -1 where no neighbouring photo shows it."""
    observations = inputs.observations
    places = {photo: (i, j) for i, strip in enumerate(inputs.strips) for j, photo in enumerate(strip.photos)}
    strip, place = np.array([places[name] for name in observations.photo_ids], np.intp).reshape(-1, 2).T
    strip, place = strip[observations.photo], place[observations.photo]
    # a photo's number in one long row of all strips, with a gap between strips: neighbours differ by one
    starts = np.cumsum([0, *(len(each.photos) + 1 for each in inputs.strips)])
    position = starts[strip] + place
    key = observations.point * (int(starts[-1]) + 1) + position
    present = np.sort(key)

    def shown(wanted: Numbers) -> Flags:
        at = np.searchsorted(present, wanted)
        return np.asarray(present[np.minimum(at, len(present) - 1)] == wanted)

    if not len(key):
        return np.zeros(0, np.intp)
    return np.where(shown(key - 1) | shown(key + 1), strip, -1)


def gaps_of(inputs: Inputs, used: Numbers) -> list[str]:
    """Name the points measured on two photos or more, of which no two are neighbours in a strip.

    used: what ``observations_used`` returns.
    """
    observations = inputs.observations
    paired = np.zeros(len(observations.point_ids), bool)
    paired[observations.point[used >= 0]] = True
    free = tuple(strip.id for strip in inputs.strips if not strip.listed)
    paired[observations.point[observations.places(free) >= 0]] = True  # neighbours are yet to be found
    count = np.bincount(observations.point, minlength=len(observations.point_ids))
    return [observations.point_ids[code] for code in np.flatnonzero(~paired & (count > 1))]


def table_rows(project: Project, tables: Tables, used: Numbers) -> list[Document]:
    """Count what became of the rows of each table; used and unused rows add up to all rows.

    The keys are ``file``, ``rows``, ``used`` and ``unused``: reason, number of rows, ids, first line.
    """
    inputs = project.inputs
    photos = {photo for strip in inputs.strips for photo in strip.photos}
    if tables.models is not None and inputs.models is not None:
        return model_rows(tables, inputs.models)
    found = []
    bundle = project.settings.together
    apart = set() if bundle else set(gaps_of(inputs, used))  # a bundle takes points of any two photos
    control = {name for name, use in zip(inputs.control.ids, inputs.control.use, strict=True) if use.all()}
    count: dict[str, int] = {}
    if tables.observations is not None:
        count = rays(tables.observations, photos)
        found += _measured(tables.observations, photos, count, apart, control if bundle else set())
    if (marks := tables.fiducials) is not None:
        reasons = [_outside(IN_NO_STRIP, marks.photo_ids, photos, marks.photo)]
        found += _blocks(marks.table, reasons, marks.times)
    if bundle:  # and control of a single one
        count = {name: max(number, 2) for name, number in count.items()}
    found += [_given(read, count, apart) for read in tables.control if read is not None]
    found += [_cameras(read, photos, bundle) for read in (tables.positions, tables.orientations) if read is not None]
    return found


def model_rows(tables: Tables, models: MeasuredModels) -> list[Document]:
    """Count what became of the rows of each table of a project of independent models, as ``table_rows``."""
    found = []
    known = set(models.points.model_ids)
    read = tables.models
    for each in () if read is None else (read.points, read.centers):
        if each is not None:
            reasons = [_outside(IN_NO_MODEL, each.model_ids, known, each.models)]
            found.append(_block(each.table, reasons))
    points = set(models.points.point_ids)
    for control in tables.control:
        if control is not None:
            missing = _outside(NO_MODEL, control.ids, points)
            off = missing._replace(why=OFF, rows=~control.used)
            reasons = [off, missing._replace(rows=control.used & missing.rows)]
            found.append(_block(control.table, reasons))
    return found


def _outside(why: str, ids: Sequence[str], known: set[str], of_rows: Numbers | None = None) -> Reason:
    """Rows whose id is not known; without `of_rows` each row has an id of its own."""
    of_rows = np.arange(len(ids)) if of_rows is None else of_rows
    rows = np.array([name not in known for name in ids], bool)[of_rows]
    return Reason(why=why, rows=rows, ids=ids, of_rows=of_rows)


def _cameras(read: PositionTable | OrientationTable, photos: set[str], bundle: bool) -> Document:  # noqa: FBT001
    outside = _outside(IN_NO_STRIP, read.ids, photos)
    off = ~read.used if isinstance(read, PositionTable) else np.zeros(len(read.ids), bool)
    reasons = [
        outside,
        outside._replace(why=OFF, rows=~outside.rows & off),
        outside._replace(why=NO_BUNDLE, rows=~outside.rows & ~off & (not bundle)),
    ]
    return _block(read.table, reasons)


def _measured(
    read: Measurements, photos: set[str], count: dict[str, int], gaps: set[str], whole: set[str]
) -> list[Document]:
    """Sort the rows of measured points by what becomes of them."""
    outside = _outside(IN_NO_STRIP, read.photo_ids, photos, read.photo)
    once = np.array([count.get(name) == 1 and name not in whole for name in read.target_ids], bool)[read.target]
    apart = np.array([name in gaps for name in read.target_ids], bool)[read.target]
    ids: Document = {"ids": read.target_ids, "of_rows": read.target}
    reasons = [
        outside,
        Reason(why=ONCE, rows=~outside.rows & once, **ids),
        Reason(why=NO_NEIGHBOUR, rows=~outside.rows & ~once & apart, **ids),
    ]
    return _blocks(read.table, reasons, read.times)


def _given(read: ControlTable, count: dict[str, int], gaps: set[str]) -> Document:
    number = np.array([count.get(name, 0) for name in read.ids], np.intp)
    apart = np.array([name in gaps for name in read.ids], bool)
    ids: Document = {"ids": read.ids, "of_rows": np.arange(len(read.ids))}
    reasons = [
        Reason(why=OFF, rows=~read.used, **ids),
        Reason(why=NOT_MEASURED, rows=read.used & (number == 0), **ids),
        Reason(why=ONCE, rows=read.used & (number == 1), **ids),
        Reason(why=NO_NEIGHBOUR, rows=read.used & (number > 1) & apart, **ids),
    ]
    return _block(read.table, reasons)


def _blocks(table: Table, reasons: list[Reason], times: Numbers) -> list[Document]:
    """Count the rows of each file of a table; `times` says of how many rows of the file each of them is made."""
    found = []
    for file, inside in table.files:
        of_file = [each._replace(rows=each.rows & inside) for each in reasons]
        found.append(_block(table, of_file, np.where(inside, times, 0)) | {"file": file})
    return found


def _block(table: Table, reasons: list[Reason], times: Numbers | None = None) -> Document:
    times = np.ones(len(table.lines), np.intp) if times is None else times
    unused: list[Document] = []
    for reason in reasons:
        at = np.flatnonzero(reason.rows)
        if len(at):
            ids = list(dict.fromkeys(reason.ids[code] for code in reason.of_rows[at].tolist()))
            line = int(table.lines[at[0]])
            unused.append({"why": reason.why, "rows": int(times[at].sum()), "ids": ids, "first_line": line})
    rows = int(times.sum())
    return {"file": table.file, "rows": rows, "used": rows - sum(each["rows"] for each in unused), "unused": unused}
