"""The document of a result as text: result.json, and the CSV tables beside it."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

from photostrip.errors import Fault, InputError
from photostrip.formats.text.files import MEGABYTE, decode, read_bytes, refuse
from photostrip.result import columns as tables

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from photostrip.result.columns import Column
    from photostrip.result.numbers import Document, Plain
    from photostrip.result.quantities import Quantity

LARGEST_RESULT = 1000 * MEGABYTE
SCHEMA = 1
LINE = 160  # characters up to which a dictionary stands on one line
NEEDS_QUOTES = re.compile(r'[",\r\n]|^\s|\s$')
BY_UNIT_DECIMALS = 2  # of numbers whose unit stands in another column

_encode = json.JSONEncoder(ensure_ascii=False, allow_nan=False).encode
_encode_ascii = json.JSONEncoder(ensure_ascii=True, allow_nan=False).encode


def to_json(document: Document, *, ascii_only: bool = False) -> str:
    """Return the text of result.json.

    Each element of a list of records stands on a line of its own, so that results can be compared line by line.
    """
    encode = _encode_ascii if ascii_only else _encode
    return "{\n" + ",\n".join(f"{encode(key)}: {_block(value, encode)}" for key, value in document.items()) + "\n}\n"


def _block(value: Plain, encode: Callable[[Plain], str]) -> str:
    text = encode(value)
    if isinstance(value, list) and value and isinstance(value[0], dict):
        # One call for the whole list, lines broken afterwards, in front of the first key of each record. Inside a
        # string these signs cannot stand, its quotation marks being escaped; between records a line feed is a blank.
        begin = f"{{{encode(next(iter(value[0])))}: "
        return "[\n" + text[1:-1].replace(f"}}, {begin}", f"}},\n{begin}") + "\n]"
    if isinstance(value, dict) and len(text) > LINE:
        return "{\n" + ",\n".join(f"  {encode(key)}: {encode(each)}" for key, each in value.items()) + "\n}"
    return text


def read_result(file: str) -> Document:
    """Read a result.json.

    Raises
    ------
    InputError
        When the file cannot be read, is not JSON or not a result of photostrip.
    """
    text, _ = decode(file, read_bytes(file, LARGEST_RESULT))
    try:
        document: Any = json.loads(text)
    except json.JSONDecodeError as error:
        message = f"is not JSON: {error.msg[:1].lower()}{error.msg[1:]}"
        fix = "a result.json that was not written to its end? run the project again"
        raise InputError(Fault(message, "result-json", file, error.lineno, error.colno, fix=fix)) from None
    except RecursionError:
        refuse(file, "result-json", "is nested too deeply", expected="a result.json of photostrip")
    if not isinstance(document, dict) or "photostrip_result" not in document:
        refuse(file, "result-kind", "has no key `photostrip_result`", expected="a result.json of photostrip")
    if document["photostrip_result"] != SCHEMA:
        refuse(
            file,
            "result-schema",
            f"has the result format {document['photostrip_result']!r}",
            expected=str(SCHEMA),
            fix="run the project again with this version of photostrip",
        )
    return document


# ------------------------------------------------------------------------------------------------------- tables


def result_files(document: Document, resolved: str = "") -> dict[str, str]:
    """Return all files of a result: content by file name.

    result.json comes last: when it is there, all are. `resolved` is the text of project.resolved.yaml; none is written
    when it is empty.
    """
    frame, photos = document["frame"], document["photos"]
    angles = photos[0]["angles"] if photos else {"system": "alpha-omega-kappa", "unit": "deg"}
    files = {
        "points.csv": _table(tables.in_frame(tables.points_csv(), frame), document["points"]),
        "photos.csv": _table(tables.in_frame(tables.photos_csv(angles), frame), map(_flat_photo, photos)),
        "residuals.csv": _grouped(tables.residuals_csv(), document["residuals"]),
        "parallaxes.csv": _grouped(tables.parallaxes_csv(), document["parallaxes"]),
        "rejected.csv": rejected_csv(document),
    }
    if "bundle" in document:
        files["reliability.csv"] = _table(tables.reliability_csv(), _checked_rays(document["residuals"]))
    if "link_residuals" in document:
        files["links.csv"] = _grouped(tables.links_csv(), document["link_residuals"])
    if resolved:
        files["project.resolved.yaml"] = resolved
    return {**files, "result.json": to_json(document)}


def rejected_csv(document: Document) -> str:
    """Return rejected.csv: measurements that were taken out, and why."""
    return _table(tables.rejected_csv(), document["rejected"])


def _flat_photo(photo: Document) -> Document:
    """Return a photo with a key for each angle, each number of the matrix and each standard deviation."""
    angles, sigma = photo["angles"], photo["sigma"] or {}
    names = [f"{name}_{angles['unit']}" for name in angles["system"].split("-")]
    return {
        **photo,
        **dict(zip(names, angles["values"] or (), strict=False)),
        **dict(zip(tables.MATRIX, photo["rotation"] or (), strict=False)),
        **{f"sigma_{axis}": sigma.get(axis) for axis in "xyz"},
        **{f"sigma_{name}": value for name, value in zip(names, sigma.get("angles") or (), strict=False)},
    }


def _checked_rays(residuals: Iterable[Document]) -> Iterator[Document]:
    """Return a record for each ray that took part in the bundle adjustment."""
    names = [column.key for column in tables.reliability_csv()[1:]]
    for group in residuals:
        for values in zip(*(group[name] for name in names), strict=True):
            if values[1] is not None:
                yield {"photo": group["photo"], **dict(zip(names, values, strict=True))}


def _table(columns: Sequence[Column], rows: Iterable[Document]) -> str:
    """Write a table; an empty cell is a number that does not exist."""
    cells = [(column.key, _writer(column.quantity)) for column in columns]
    lines = [",".join([write(row.get(key)) for key, write in cells]) for row in rows]
    return "\n".join([_header(columns), *lines]) + "\n"


def _header(columns: Iterable[Column]) -> str:
    return ",".join(column.name for column in columns)


def _writer(quantity: Quantity) -> Callable[[Any], str]:
    """Return what writes a cell."""
    decimals = BY_UNIT_DECIMALS if quantity.unit_key else quantity.decimals
    if decimals is not None:
        form = f"%.{decimals}f"
        return lambda value: "" if value is None else form % value
    if quantity.kind == "text":
        return _cell
    whole = quantity.kind in {"count", "flag"}
    return lambda value: "" if value is None else str(int(value)) if whole else str(value)


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
    cells: dict[str, str] = {}
    blocks = [f"{_header(columns)}\n"]
    for group in groups:
        head = ",".join(_cell(group[column.key]) for column in heads).replace("%", "%%")
        points = [cells.get(point) or cells.setdefault(point, _cell(point)) for point in group["points"]]
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
