"""The files of a result beside result.json: CSV tables, and the project as it was resolved."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from itertools import chain, compress
from typing import Any

import numpy as np

from photostrip.formats.text import number_columns
from photostrip.formats.text.number_columns import Cells
from photostrip.notes import Document
from photostrip.pipeline.results import Result
from photostrip.result import columns as tables
from photostrip.result.columns import Column
from photostrip.result.description import Quantity
from photostrip.result.numbers import PER_RADIAN
from photostrip.result.points.image_coordinates import refined_rows
from photostrip.result.records import Grouped, Records

ODD = re.compile(r'[",\s]')  # without these no id needs quotes
NEEDS_QUOTES = re.compile(r'[",\r\n]|^\s|\s$')
BY_UNIT_DECIMALS = 2  # of numbers whose unit stands in another column


def beside_json(document: Document, resolved: str, refined: str) -> dict[str, str]:
    """Return the files beside result.json: content by file name.

    `resolved` is the text of project.resolved.yaml, `refined` that of refined.csv, which is not rendered from the
    document; they are not written when they are empty.
    """
    frame, photos = document["frame"], document["photos"]
    angles = photos[0]["angles"] if photos else {"system": "alpha-omega-kappa", "unit": "deg"}
    unit = angles["unit"]
    files = {
        "points.csv": _table(tables.in_frame(tables.points_csv(unit), frame), _flat_points(document["points"], unit)),
        "photos.csv": _table(tables.in_frame(tables.photos_csv(angles), frame), map(tables.flat_photo, photos)),
        "residuals.csv": _grouped(tables.residuals_csv(), document["residuals"]),
        "parallaxes.csv": _grouped(tables.parallaxes_csv(), document["parallaxes"]),
        "rejected.csv": rejected_csv(document),
    }
    if "bundle" in document:
        files["reliability.csv"] = _table(tables.reliability_csv(), _checked_rays(document["residuals"]))
    if "link_residuals" in document:
        files["links.csv"] = _grouped(tables.links_csv(), document["link_residuals"])
    if refined:
        files["refined.csv"] = refined
    if resolved:
        files["project.resolved.yaml"] = resolved
    return files


def refined_csv(result: Result) -> str:
    """Return refined.csv: the ideal image coordinates of all points; empty for independent models."""
    found = refined_rows(result)
    if not len(found["x_mm"]):
        return ""
    listed = tables.refined_csv()
    ids = [_cells(column.quantity, names)[:, number] for column in listed[:2] for names, number in [found[column.key]]]
    return _written(listed, ids + [_cells(column.quantity, found[column.key]) for column in listed[2:]])


def rejected_csv(document: Document) -> str:
    """Return rejected.csv: measurements that were taken out, and why."""
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


def _table(columns: Sequence[Column], rows: Iterable[Document]) -> str:
    """Write a table; an empty cell is a number that does not exist."""
    if not isinstance(rows, Records):
        listed = list(rows)
        rows = Records({column.key: [row.get(column.key) for row in listed] for column in columns})
    nothing = [None] * len(rows)
    return _written(columns, [_cells(column.quantity, rows.columns.get(column.key, nothing)) for column in columns])


def _written(columns: Iterable[Column], cells: Sequence[Cells]) -> str:
    """Write the cells of columns below their names."""
    count = cells[0].shape[1]
    parts = [part for each in cells for part in (each, number_columns.repeated(",", count))]
    return f"{_header(columns)}\n" + number_columns.joined([*parts[:-1], number_columns.repeated("\n", count)])


def _header(columns: Iterable[Column]) -> str:
    return ",".join(column.name for column in columns)


def _cells(quantity: Quantity, values: Sequence[Any]) -> Cells:
    """Write the cells of a column; nothing where there is no number."""
    decimals = BY_UNIT_DECIMALS if quantity.unit_key else quantity.decimals
    if decimals is None and quantity.kind in {"count", "flag"}:
        decimals = 0
    if decimals is not None:
        return number_columns.as_fixed(np.array(values, float), decimals, "")
    if quantity.kind == "text":
        return number_columns.as_texts(_texts(values))
    return number_columns.as_texts(["" if value is None else str(value) for value in values])


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


def _grouped(columns: Sequence[Column], groups: Records | list[Document]) -> str:
    """Write points that stand together under a photo or a pair: its ids, then a line for each point."""
    first = [column.key for column in columns].index("points")
    found = {column.key: _column(groups, column.key) for column in columns}
    counts = list(map(len, found["points"]))
    heads = [_cells(column.quantity, found[column.key]) for column in columns[:first]]
    of_points = [_cells(column.quantity, _flat(found[column.key])) for column in columns[first:]]
    return _written(columns, [*(np.repeat(head, counts, axis=1) for head in heads), *of_points])


def _column(rows: Records | list[Document], key: str) -> Sequence[Any]:
    return rows.columns.get(key, ()) if isinstance(rows, Records) else [row[key] for row in rows]


def _flat(column: Sequence[Any]) -> Sequence[Any]:
    return column.values if isinstance(column, Grouped) else list(chain.from_iterable(column))
