"""Columns of numbers as text, as Python writes them: the digits of a whole column together, in a fifth of the time.

The cells of a column are a matrix of bytes, a column for each cell, filled up with NUL: a digit of all cells lies
together. Matrices are put on each other for lines; what fills them is taken out at the end.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from photostrip.arrays import Flags, Floats

Cells = NDArray[np.uint8]  # (w, n)
Texts = NDArray[np.bytes_]  # (n,)
Count = NDArray[np.uint64]

MOST_DIGITS = 15  # of a decimal number that no other one of as many shares its float with
EXPONENT_FROM = 1e16  # numbers from which on Python writes an exponent
EXPONENT_BELOW = 1e-4  # below which Python writes one
DECIMALS_TRIED = (2, 4, 9, 12)  # decimals
SMALL_DIGITS = 10  # from which on a number does not fit into 32 bits
TIE = 1e-3  # parts of the last digit by which a number must be off the middle between two


def as_repr(values: Floats, missing: str) -> Cells:
    """Write numbers as ``repr`` does, what is not finite as ``missing``."""
    size, least = np.minimum(np.abs(values), EXPONENT_FROM), 0.9 * np.count_nonzero(np.isfinite(values))
    for decimals in DECIMALS_TRIED:
        scaled = np.rint(size * 10.0**decimals)
        known = (scaled / 10.0**decimals == size) & (scaled < 10.0**MOST_DIGITS)
        if np.count_nonzero(known) >= least:
            break
    known &= (size >= EXPONENT_BELOW) | (size == 0.0)
    cells = _written(values < 0.0, np.where(known, scaled, 0.0).astype(np.uint64), decimals, short=True)
    return _with_others(cells, values, known, missing, repr)


def as_fixed(values: Floats, decimals: int, missing: str) -> Cells:
    """Write numbers with this many decimals as ``%.3f`` does, what is not finite as ``missing``."""
    scaled = np.minimum(np.abs(values), EXPONENT_FROM) * 10.0**decimals
    known = (scaled < 10.0 ** (MOST_DIGITS - 3)) & (np.abs(scaled - np.floor(scaled) - 0.5) > TIE)
    cells = _written(np.signbit(values), np.where(known, np.rint(scaled), 0.0).astype(np.uint64), decimals, short=False)
    return _with_others(cells, values, known, missing, f"{{:.{decimals}f}}".format)


def as_whole(values: NDArray[np.int64]) -> Cells:
    return _written(values < 0, np.abs(values).astype(np.uint64), 0, short=False)


def as_texts(texts: Sequence[str] | Texts) -> Cells:
    """Take texts as they are; none may hold a NUL."""
    cells = texts_of(texts)
    return cells.view(np.uint8).reshape(len(texts), cells.itemsize).T


def texts_of(texts: Sequence[str] | Texts) -> Texts:
    try:
        return np.asarray(texts, "S")
    except UnicodeEncodeError:
        return np.array([text.encode() for text in map(str, texts)])


def repeated(text: str, count: int) -> Cells:
    """Write the same for every cell."""
    return np.broadcast_to(np.frombuffer(text.encode(), np.uint8)[:, None], (len(text.encode()), count))


def joined(columns: Sequence[Cells], between: str) -> str:
    """Join the cells of columns line by line, with something between the lines."""
    cells = np.concatenate([*columns, repeated(between, columns[0].shape[1])])
    return cells.T.tobytes().translate(None, b"\0")[: -len(between)].decode()


def _with_others(cells: Cells, values: Floats, known: Flags, missing: str, write: Callable[[float], str]) -> Cells:
    """Put in what is not written together with the rest."""
    if known.all():
        return cells
    nothing = ~np.isfinite(values)
    single = np.flatnonzero(~known & ~nothing)
    texts = as_texts([write(value) for value in values[single].tolist()] or [""])
    result = np.zeros((max(len(cells), len(texts), len(missing)), len(values)), np.uint8)
    result[: len(cells)] = cells
    result[:, ~known] = 0
    result[: len(missing), nothing] = np.frombuffer(missing.encode(), np.uint8)[:, None]
    result[: len(texts), single] = texts[:, : len(single)]
    return result


def _written(negative: Flags, count: Count, decimals: int, *, short: bool) -> Cells:
    """Write numbers counted in units of their last decimal; ``short`` leaves out zeros at the end but the first."""
    whole = count // np.uint64(10**decimals)
    sign, width = int(negative.any()), len(str(int(whole.max(initial=0))))
    point = sign + width
    result = np.empty((point + (decimals > 0) + decimals, len(count)), np.uint8)
    result[:sign] = negative * np.uint8(ord("-"))
    _write_digits(whole, result[sign:point])
    for place in range(1, width):
        result[point - 1 - place] *= whole >= 10**place
    if decimals:
        result[point] = ord(".")
        _write_digits(count - whole * np.uint64(10**decimals), result[point + 1 :])
        zero = np.ones(len(count), bool)
        for place in range(len(result) - 1, point + 1, -1) if short else ():
            zero &= result[place] == ord("0")
            result[place] *= ~zero
    return result


def _write_digits(number: Count, result: Cells) -> None:
    """Write the last digits of numbers, with zeros in front."""
    rest = number.astype(np.uint32) if len(result) < SMALL_DIGITS else number
    ten, zero = rest.dtype.type(10), rest.dtype.type(ord("0"))
    for place in range(len(result) - 1, -1, -1):
        before = rest // ten
        result[place] = rest - before * ten + zero
        rest = before
