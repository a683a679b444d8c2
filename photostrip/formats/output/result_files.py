"""The files of a result beside result.json: CSV tables, and the project as it was resolved."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import lru_cache
from itertools import chain, compress
from typing import Any

import numpy as np

from photostrip import number_columns
from photostrip.notes import Document
from photostrip.number_columns import Cells, Texts
from photostrip.pipeline.results import Result
from photostrip.result import columns as tables
from photostrip.result.columns import Column
from photostrip.result.description import Quantity
from photostrip.result.numbers import PER_RADIAN, RoundedColumn
from photostrip.result.points.image_coordinates import refined_rows
from photostrip.result.quantities import COUNTS_AND_FLAGS
from photostrip.result.records import Grouped, Named, Records

ODD = re.compile(r'[",\s]')  # without these no id needs quotes
NEEDS_QUOTES = re.compile(r'[",\r\n]|^\s|\s$')
BY_UNIT_DECIMALS = 2  # of numbers whose unit stands in another column
LINES = 8000  # that are written at a time


def beside_json(document: Document, resolved: str, result: Result | None) -> dict[str, Iterable[str]]:
    """Return the files beside result.json: by file name the content in pieces, made when they are written.

    `resolved` is the text of project.resolved.yaml, not written when it is empty; refined.csv is that of the `result`.
    """
    frame, photos = document["frame"], document["photos"]
    angles = photos[0]["angles"] if photos else {"system": "alpha-omega-kappa", "unit": "deg"}
    of_photos = tables.photos_csv(angles)
    unit = angles["unit"]
    files: dict[str, Iterable[str]] = {
        "points.csv": _table(tables.in_frame(tables.points_csv(unit), frame), _flat_points(document["points"], unit)),
        "photos.csv": _table(
            tables.in_frame(of_photos, frame), tables.flat_photos(photos, of_photos) if photos else ()
        ),
        "residuals.csv": _grouped(tables.residuals_csv(), document["residuals"]),
        "parallaxes.csv": _grouped(tables.parallaxes_csv(), document["parallaxes"]),
        "rejected.csv": rejected_csv(document),
    }
    if "bundle" in document and "link_residuals" not in document:
        files["reliability.csv"] = _table(tables.reliability_csv(), _checked_rays(document["residuals"]))
    if "link_residuals" in document:
        files["links.csv"] = _grouped(tables.links_csv(), document["link_residuals"])
    if result is not None and len(result.refined.observations):  # of independent models there are none
        files["refined.csv"] = refined_csv(result)
    if resolved:
        files["project.resolved.yaml"] = [resolved]
    return files


def refined_csv(result: Result) -> Iterator[str]:
    """Give refined.csv: the ideal image coordinates of all points."""
    return _table(tables.refined_csv(), refined_rows(result))


def rejected_csv(document: Document) -> Iterator[str]:
    """Give rejected.csv: measurements that were taken out, and why."""
    return _table(tables.rejected_csv(), document["rejected"])


def _flat_points(points: Iterable[Document], unit: str) -> Iterable[Document]:
    """Return the points with the azimuths of their ellipses in the unit of the output."""
    if unit == "deg":
        return points
    key, per_degree = f"ellipse_azimuth_{unit}", PER_RADIAN[unit] / PER_RADIAN["deg"]
    known = ((point, point["ellipse_azimuth_deg"]) for point in points)
    return ({**point, key: None if azimuth is None else azimuth * per_degree} for point, azimuth in known)


def _checked_rays(residuals: Sequence[Document]) -> Records:
    """Return a record for each ray that took part in the bundle adjustment."""
    names = [column.key for column in tables.reliability_csv()[1:]]
    columns = {name: [value for group in residuals for value in group[name]] for name in names}
    columns["photo"] = [group["photo"] for group in residuals for _ in group[names[0]]]
    tested = [value is not None for value in columns[names[1]]]
    return Records({name: list(compress(column, tested)) for name, column in columns.items()})


def _table(columns: Sequence[Column], rows: Iterable[Document]) -> Iterator[str]:
    """Write a table; an empty cell is a number that does not exist."""
    if not isinstance(rows, Records):
        listed = list(rows)
        rows = Records({column.key: [row.get(column.key) for row in listed] for column in columns})
    nothing = [None] * len(rows)
    found = [(column.quantity, _with_texts(rows.columns.get(column.key, nothing))) for column in columns]
    return _pieces(columns, len(rows), LINES, lambda part: [_cells(quantity, cells[part]) for quantity, cells in found])


def _pieces(
    columns: Iterable[Column], count: int, at_once: int, cells: Callable[[slice], Sequence[Cells]]
) -> Iterator[str]:
    """Write cells of columns below their names, some rows at a time: all together take more memory than the result."""
    yield f"{_header(columns)}\n"
    for start in range(0, count, at_once):
        found = cells(slice(start, start + at_once))
        lines = found[0].shape[1]
        parts = [part for each in found for part in (each, number_columns.repeated(",", lines))]
        yield number_columns.joined(parts[:-1], "\n")
        yield "\n"


def _header(columns: Iterable[Column]) -> str:
    return ",".join(column.name for column in columns)


def _cells(quantity: Quantity, values: Sequence[Any]) -> Cells:
    """Write the cells of a column; nothing where there is no number."""
    decimals = BY_UNIT_DECIMALS if quantity.unit_key else quantity.decimals
    if decimals is None and quantity.kind in {"count", "flag"}:
        decimals = 0
    if isinstance(values, Named):
        return number_columns.as_texts(np.asarray(values.names)[values.numbers])
    if isinstance(values, RoundedColumn) and values.values.dtype.kind in COUNTS_AND_FLAGS:
        return number_columns.as_whole(values.values.astype(np.int64))
    if decimals is not None:
        return number_columns.as_fixed(np.array(values, float), decimals, "")
    if quantity.kind == "text":
        return number_columns.as_texts(_texts(values))
    return number_columns.as_texts(["" if value is None else str(value) for value in values])


def _with_texts(column: Sequence[Any]) -> Sequence[Any]:
    """Write the texts that stand once for all lines, however many of these are written at a time."""
    if isinstance(column, Grouped):
        return Grouped(_with_texts(column.values), column.ends)
    return Named(_quoted(tuple(column.names)), column.numbers) if isinstance(column, Named) else column


@lru_cache(maxsize=2)  # the points of a result stand in several tables
def _quoted(names: tuple[str, ...]) -> Texts:
    return number_columns.texts_of(_texts(names))


def _texts(values: Sequence[Any]) -> Sequence[Any]:
    """Quote ids where CSV needs it; all are looked at together first."""
    if set(map(type, values)) == {str} and "" not in (known := set(values)) and not ODD.search("".join(known)):
        return values
    return list(map(_cell, values))


def _cell(text: str | Sequence[str] | None) -> str:
    """Quote an id where CSV needs it."""
    if not isinstance(text, str):
        text = ";".join(text or ()) or None
    if text is None:
        return ""
    return '"' + text.replace('"', '""') + '"' if NEEDS_QUOTES.search(text) or not text else text


def _grouped(columns: Sequence[Column], groups: Records | list[Document]) -> Iterator[str]:
    """Write points that stand together under a photo or a pair: its ids, then a line for each point."""
    first = [column.key for column in columns].index("points")
    found = [_with_texts(_column(groups, column.key)) for column in columns]
    points = found[first]
    counts = np.diff(points.ends).tolist() if isinstance(points, Grouped) else list(map(len, points))

    def cells(part: slice) -> list[Cells]:
        each = [column[part] for column in found]
        heads = [_cells(column.quantity, ids) for column, ids in zip(columns[:first], each[:first], strict=True)]
        lists = zip(columns[first:], each[first:], strict=True)
        of_points = [_cells(column.quantity, _flat(values)) for column, values in lists]
        return [*(np.repeat(head, counts[part], axis=1) for head in heads), *of_points]

    return _pieces(columns, len(counts), max(LINES * len(counts) // max(sum(counts), 1), 1), cells)


def _column(rows: Records | list[Document], key: str) -> Sequence[Any]:
    return rows.columns.get(key, ()) if isinstance(rows, Records) else [row[key] for row in rows]


def _flat(column: Sequence[Any]) -> Sequence[Any]:
    return column.values if isinstance(column, Grouped) else list(chain.from_iterable(column))
