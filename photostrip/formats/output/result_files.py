"""The files of a result: result.json and the CSV tables beside it."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from photostrip.formats.output.result_json import to_json
from photostrip.result import columns as tables
from photostrip.result.numbers import PER_RADIAN, Document
from photostrip.result.points.image_coordinates import refined_rows
from photostrip.result.records import Records

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from photostrip.pipeline import Result
    from photostrip.result.columns import Column
    from photostrip.result.description import Quantity

ODD = re.compile(r'[",\s]')  # without these no id needs quotes
NEEDS_QUOTES = re.compile(r'[",\r\n]|^\s|\s$')
BY_UNIT_DECIMALS = 2  # of numbers whose unit stands in another column


def result_files(document: Document, resolved: str = "", refined: str = "") -> dict[str, str]:
    """Return all files of a result: content by file name.

    result.json comes last: when it is there, all are. `resolved` is the text of project.resolved.yaml, `refined` that
    of refined.csv, which is not rendered from the document; they are not written when they are empty.
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
    return {**files, "result.json": to_json(document)}


def refined_csv(result: Result) -> str:
    """Return refined.csv: the ideal image coordinates of all points; empty for independent models."""
    found = refined_rows(result)
    if not found["photo"]:
        return ""
    listed = tables.refined_csv()
    form = ",".join("%s" if each.quantity.decimals is None else f"%.{each.quantity.decimals}f" for each in listed)
    rows = zip(
        _texts(found["photo"]), _texts(found["point"]), *(found[column.key] for column in listed[2:]), strict=True
    )
    return "\n".join([_header(listed), *(form % row for row in rows)]) + "\n"


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


def _checked_rays(residuals: Iterable[Document]) -> Iterator[Document]:
    """Return a record for each ray that took part in the bundle adjustment."""
    names = [column.key for column in tables.reliability_csv()[1:]]
    for group in residuals:
        for values in zip(*(group[name] for name in names), strict=True):
            if values[1] is not None:
                yield {"photo": group["photo"], **dict(zip(names, values, strict=True))}


def _table(columns: Sequence[Column], rows: Iterable[Document]) -> str:
    """Write a table; an empty cell is a number that does not exist."""
    if not isinstance(rows, Records):
        listed = list(rows)
        rows = Records({column.key: [row.get(column.key) for row in listed] for column in columns})
    nothing = [None] * len(rows)
    cells = [_cells(column.quantity, rows.columns.get(column.key, nothing)) for column in columns]
    line = ",".join(form for form, _ in cells)
    return "\n".join([_header(columns), *(line % row for row in zip(*(each for _, each in cells), strict=True))]) + "\n"


def _header(columns: Iterable[Column]) -> str:
    return ",".join(column.name for column in columns)


def _cells(quantity: Quantity, values: Sequence[Any]) -> tuple[str, Sequence[Any]]:
    """Return the form of the cells of a column, and what is written in that form."""
    decimals = BY_UNIT_DECIMALS if quantity.unit_key else quantity.decimals
    if quantity.kind == "text" and decimals is None:
        return "%s", _texts(values)
    form = f"%.{decimals}f" if decimals is not None else "%d" if quantity.kind in {"count", "flag"} else "%s"
    if None not in values:
        return form, values
    return "%s", ["" if value is None else form % value for value in values]


def _texts(values: Sequence[str | Sequence[str] | None]) -> list[str]:
    """Quote ids where CSV needs it; all are looked at together first."""
    known = {value: value for value in values if isinstance(value, str)}
    if "" in known or ODD.search("".join(known)):
        known = {value: _cell(value) for value in known}
    return [known[value] if isinstance(value, str) else _cell(value) for value in values]


def _cell(text: str | Sequence[str] | None) -> str:
    """Quote an id where CSV needs it."""
    if not isinstance(text, str):
        text = ";".join(text or ()) or None
    if text is None:
        return ""
    return '"' + text.replace('"', '""') + '"' if NEEDS_QUOTES.search(text) or not text else text


def _grouped(columns: Sequence[Column], groups: Iterable[Document]) -> str:
    """Write points that stand together under a photo or a pair: its ids, then a line for each point."""
    first = [column.key for column in columns].index("points")
    heads, numbers = columns[:first], columns[first + 1 : -1]
    groups = list(groups)
    names = dict.fromkeys(point for group in groups for point in group["points"])
    cells = dict(zip(names, _texts(list(names)), strict=True))
    blocks = [f"{_header(columns)}\n"]
    for group in groups:
        head = ",".join(_cell(group[column.key]) for column in heads).replace("%", "%%")
        points = [cells[point] for point in group["points"]]
        values, forms = [group[column.key] for column in numbers], [f"%.{each.quantity.decimals}f" for each in numbers]
        if any(None in column for column in values):
            values = [
                ["" if value is None else form % value for value in column]
                for form, column in zip(forms, values, strict=True)
            ]
            forms = ["%s"] * len(forms)
        line = f"{head},%s,{','.join(forms)},%d\n"
        blocks += [line % row for row in zip(points, *values, group["used"], strict=True)]
    return "".join(blocks)
