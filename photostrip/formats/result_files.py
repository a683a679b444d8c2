"""Tables as CSV: the files of a result beside result.json, and others."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator, Mapping
from io import StringIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from photostrip import number_columns
from photostrip.notes import Document
from photostrip.number_columns import Cells
from photostrip.pipeline.results import Result
from photostrip.result.description import Quantity
from photostrip.result.points import refined_table
from photostrip.result.table import Table


def to_csv(names: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """Write a table as CSV: empty cells for nothing, 1 and 0 for yes and no."""
    stream = StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(names)
    writer.writerows([_cell(cell) for cell in row] for row in rows)
    return stream.getvalue()


def _cell(value: object) -> object:
    """Return a number without an exponent, a truth value as 1 or 0."""
    if isinstance(value, bool):
        return int(value)
    return np.format_float_positional(value, trim="0") if isinstance(value, float) else value


NEEDS_QUOTES = re.compile(r'[",\r\n]|^\s|\s$')
ODD = re.compile(r'[",\s]')  # without these no text of a column needs quotes
BY_UNIT_DECIMALS = 2  # of numbers whose unit stands in another column
LINES = 8000  # that are written at a time: all together take more memory than the result
IDS = {"points": "point", "control": "point", "ties": "point", "not_determined": "point", "photos": "photo"}
# Tables whose files have other names: these are those of measured and given coordinates, and may stand beside them.
FILES = {"control": "given_points", "fiducials": "interior", "models": "pairs", "positions": "camera_positions"}
WORDS = {"findings", "notes", "tolerances"}  # tables that hold no measurements


def beside_json(document: Document, resolved: str, result: Result | None) -> dict[str, Iterable[str]]:
    """Return the files beside result.json: by file name the content in pieces, made when they are written.

    Every table of the document is one, and refined.csv, the image coordinates of the `result` as they were adjusted.
    `resolved` is the text of project.resolved.yaml, not written when it is empty.
    """
    files: dict[str, Iterable[str]] = {
        f"{FILES.get(name, name)}.csv": csv_pieces(table, _names(name, document["angles"]))
        for name, table in document.items()
        if isinstance(table, Table) and name not in WORDS and (len(table) or name == "rejected")
    }
    if result is not None and len(result.refined.observations):  # of independent models there are none
        files["refined.csv"] = csv_pieces(refined_table(result))
    return files | ({"project.resolved.yaml": [resolved]} if resolved else {})


def _names(table: str, angles: Mapping[str, str]) -> dict[str, str]:
    """Return what columns are called in a file that is read alone: whose id, which angle in which unit."""
    named = {f"angle_{k}": f"{name}_{angles['unit']}" for k, name in enumerate(angles["system"].split("-"), 1)}
    if table == "photos":
        named |= {f"sigma_{key}": f"sigma_{name}" for key, name in named.items()}
    return named | ({"id": IDS[table]} if table in IDS else {})


def csv_pieces(table: Table, names: Mapping[str, str] | None = None) -> Iterator[str]:
    """Write a table, some rows at a time; an empty cell is a value that does not exist."""
    yield ",".join((names or {}).get(name, name) for name in table.columns) + "\n"
    for start in range(0, len(table), LINES):
        part = table[start : start + LINES]
        columns = [_cells(table.quantities[name], part[name]) for name in part.columns]
        parts = [each for cells in columns for each in (cells, number_columns.repeated(",", len(part)))]
        yield number_columns.joined(parts[:-1], "\n")
        yield "\n"


def _cells(quantity: Quantity, values: NDArray[Any]) -> Cells:
    if values.dtype.kind in "iub":
        return number_columns.as_whole(values.astype(np.int64))
    decimals = BY_UNIT_DECIMALS if quantity.unit_key else quantity.decimals
    if values.dtype.kind == "f":
        if decimals is None and quantity.kind == "number":
            return number_columns.as_texts(["" if np.isnan(each) else repr(each) for each in values.tolist()])
        return number_columns.as_fixed(values, decimals or 0, "")
    return number_columns.as_texts(_texts(values.tolist()))


def _texts(values: list[Any]) -> list[str]:
    """Write texts, lists of them and what else there is, quoted where CSV needs it."""
    texts = [";".join(map(str, value)) if isinstance(value, list) else value for value in values]
    if set(map(type, texts)) == {str} and "" not in texts and not ODD.search("".join(set(texts))):
        return texts
    return ["" if value is None else _quoted(str(int(value) if isinstance(value, bool) else value)) for value in texts]


def _quoted(text: str) -> str:
    return '"' + text.replace('"', '""') + '"' if NEEDS_QUOTES.search(text) else text
