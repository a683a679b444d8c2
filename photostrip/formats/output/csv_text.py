"""Tables of documents as CSV."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from io import StringIO

import numpy as np


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
