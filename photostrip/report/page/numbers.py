"""Numbers as they are printed: fixed decimals for each quantity, a dash where there is none; counts with their noun."""

from __future__ import annotations

from photostrip.report.page.parts import DASH

Number = float | None

LEAST_PROBABILITY = 0.001  # smaller ones are all shown as smaller than this


def fixed(value: Number, decimals: int) -> str:
    """Return a number with fixed decimals, never -0."""
    return DASH if value is None else f"{value:z.{decimals}f}"


def metres(value: Number) -> str:
    return fixed(value, 3)


def signed(value: Number) -> str:
    return DASH if value is None else f"{value:+z.3f}"


def micrometres(value: Number) -> str:
    """Give micrometres to the tenth."""
    return fixed(value, 1)


def ratio(value: Number) -> str:
    return fixed(value, 2)


def short(value: Number, digits: int = 4) -> str:
    return DASH if value is None else f"{value:.{digits}g}"


def calibrated(value: Number) -> str:
    """Return a calibrated length with all its digits."""
    return short(value, 9)


def power(value: Number, digits: int = 4) -> str:
    return DASH if value is None else f"{value:.{digits}e}"


def percent(part: float, whole: float) -> str:
    return f"{100 * part / whole:.1f} %" if whole else DASH


def joined(*notes: str) -> str:
    """Return notes below a table as one, without the empty ones."""
    return "; ".join(note for note in notes if note)


def unit(name: str) -> str:
    """Return a unit of the document as it is printed."""
    return name.replace("um", "µm")
