"""Angles as they are printed: in the unit that the project asks for.

The keys of a result name their units, most of them degrees or seconds of arc; tables show the unit of the angles of the
photos.
"""

from __future__ import annotations

from typing import NamedTuple

from photostrip.notes import Document
from photostrip.report.page.numbers import Number, fixed


class AngleUnit(NamedTuple):
    """A unit of angles with one for small angles, and how they are written."""

    name: str
    per_degree: float
    more: int  # decimals more than degrees have
    small: str  # unit of small angles
    per_second: float  # its number in a second of arc

    def text(self, degrees: Number, decimals: int) -> str:
        """Return an angle without its unit; ``decimals`` are those of degrees."""
        return fixed(self.of(degrees), decimals + self.more)

    def of(self, degrees: Number) -> Number:
        return None if degrees is None else degrees * self.per_degree

    def of_seconds(self, seconds: Number) -> Number:
        """Return a small angle in the unit of small angles."""
        return None if seconds is None else seconds * self.per_second


UNITS = {
    unit.name: unit
    for unit in (
        AngleUnit(name="deg", per_degree=1.0, more=0, small="″", per_second=1.0),
        AngleUnit(name="gon", per_degree=10 / 9, more=0, small="mgon", per_second=10 / 32.4),
        AngleUnit(name="rad", per_degree=0.017453292519943295, more=2, small="µrad", per_second=4.84813681109536),
    )
}


def angle_unit(document: Document) -> AngleUnit:
    return UNITS[document["angles"]["unit"]]
