"""Rows of a table, a column at a time.

Where every separator ends a field, the places of all fields and the digits of all numbers of a column are found
together: 30 000 rows take 15 ms, in ``csv`` and by ``float`` 40.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.formats.text.numbers import LARGEST_NUMBER

Cells = Sequence[str]

LONGEST_FIELD = 100  # characters; ids are filled up to the longest one of a column
MOST_DIGITS = 15  # of a whole number that a float holds, as it does the power of ten that divides it
TENS = np.array([float(f"1e{decimals}") for decimals in range(MOST_DIGITS + 1)])
LINE_END, PLUS, MINUS, ZERO = map(ord, "\n+-0")


class PlainRows:
    """Rows of a text, with the places where their fields begin and end."""

    def __init__(self, text: str, signs: NDArray[np.uint32], starts: Numbers, ends: Numbers, *, decimal: str) -> None:
        self.text, self.signs, self.decimal = text, signs, decimal
        self.starts, self.ends = starts, ends  # (n, width)

    def __len__(self) -> int:
        return len(self.ends)

    def texts(self, column: int) -> list[str]:
        starts, ends = self.starts[:, column], self.ends[:, column]
        longest = max(int((ends - starts).max()), 1)
        found = np.zeros((len(self), longest), np.uint32)
        for place in range(longest):
            at = starts + place
            found[:, place] = self.signs.take(at, mode="clip") * (at < ends)
        texts: list[str] = found.view(f"U{longest}").ravel().tolist()
        return texts

    def numbers(self, column: int) -> Floats | None:
        """Return the numbers that stand in a column; None when a cell needs a closer look."""
        found = self._few_digits(column)
        return _numbers(self.texts(column), self.decimal) if found is None else found

    def _few_digits(self, column: int) -> Floats | None:
        """Return what ``float`` makes of a column; None where a cell is no decimal number of few digits."""
        starts, ends = self.starts[:, column], self.ends[:, column]
        first, decimal = self.signs[starts], ord(self.decimal)
        negative = first == MINUS
        starts = starts + (negative | (first == PLUS))
        count, digits, decimals = np.zeros((3, len(self)), np.int64)
        after_point = np.zeros(len(self), bool)
        for place in range(int((ends - starts).max()), 0, -1):
            at = ends - place
            inside, sign = at >= starts, self.signs[at]
            digit, point = sign - np.uint32(ZERO), inside & (sign == decimal)
            is_digit = inside & (digit < 10)  # what stands before 0 has wrapped around
            if (inside & ~is_digit & ~point).any() or (point & after_point).any():
                return None
            count = np.where(is_digit, count * 10 + digit, count)
            digits += is_digit
            decimals += is_digit & after_point
            after_point |= point
        if digits.min() < 1 or digits.max() > MOST_DIGITS:
            return None
        values = count / TENS[decimals]
        return np.negative(values, out=values, where=negative)


class SplitRows:
    """Rows whose fields are texts, column by column."""

    def __init__(self, columns: Sequence[Cells], decimal: str = ".") -> None:
        self.columns, self.decimal = columns, decimal

    def texts(self, column: int) -> Cells:
        return self.columns[column]

    def numbers(self, column: int) -> Floats | None:
        """Return the numbers that stand in a column; None when a cell needs a closer look."""
        return _numbers(self.columns[column], self.decimal)


def _numbers(cells: Cells, decimal: str) -> Floats | None:
    joined = "".join(cells)
    if decimal != ".":
        if "." in joined:
            return None
        cells = [cell.replace(decimal, ".") for cell in cells]
    if not joined.isascii() or "_" in joined:  # float() takes digits of every script, and 1_000
        return None
    try:
        values = np.fromiter(map(float, cells), float, len(cells))
    except ValueError:
        return None
    return values if (np.abs(values) <= LARGEST_NUMBER).all() else None


def plain_rows(block: bytes, width: int, separator: str = ",", decimal: str = ".") -> PlainRows | None:
    """Find the fields of rows; None where ``csv`` might find others, and where a row has not as many as `width`."""
    block = block.replace(b"\r\n", b"\n")
    blanks = separator == " "
    if not block or any(sign in block for sign in (b'"', b"\r", *(() if blanks else (b" ",)))):
        return None
    text = block.decode() if block.endswith(b"\n") else block.decode() + "\n"
    signs = np.frombuffer(text.encode("utf-32-le"), np.uint32)
    gap = (signs == ord(separator)) | (signs == LINE_END)
    starts, ends = _between_blanks(gap) if blanks else _between(gap)
    rows, rest = divmod(len(ends), width)
    if rest or text.count("\n") != rows or (ends - starts).max() >= LONGEST_FIELD:
        return None
    last = ends[width - 1 :: width]
    if blanks:  # more of them may follow the last field
        line_ends = np.flatnonzero(signs == LINE_END)
        whole = (last <= line_ends).all() and (line_ends[:-1] < starts[width::width]).all()
    else:
        whole = (signs[last] == LINE_END).all()
    if not whole:
        return None
    return PlainRows(text, signs, starts.reshape(rows, width), ends.reshape(rows, width), decimal=decimal)


def _between(gap: Flags) -> tuple[Numbers, Numbers]:
    """Find where fields begin and end of which each ends at one sign."""
    ends = np.flatnonzero(gap)
    return np.append(0, ends[:-1] + 1), ends


def _between_blanks(gap: Flags) -> tuple[Numbers, Numbers]:
    """Find the same where one more blank ends no field, and none begins at the end of a line."""
    filled = np.append(False, ~gap)
    return np.flatnonzero(filled[1:] & ~filled[:-1]), np.flatnonzero(~filled[1:] & filled[:-1])
