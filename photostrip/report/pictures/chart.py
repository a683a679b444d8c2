"""Panels with axes that lie side by side: small multiples of strips, axes of space or photos."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from photostrip.report.pictures import svg

WIDTH = 960.0  # of a picture
LEFT, RIGHT, TOP, BOTTOM = 70.0, 24.0, 64.0, 54.0  # margins of a chart
GAP = 66.0  # between panels, for the numbers of an axis
MOST_STRIPS = 16  # that have a panel each
EMPTY = 1e-12  # a range without extent


class Entry(NamedTuple):
    """A line of a legend."""

    words: str
    kind: str
    shape: str = ""  # of a mark; none: a piece of the line


def legend(entries: Iterable[Entry], y: float = 20.0) -> list[str]:
    """Draw marks and lines with their meaning in a row."""
    found, x = [], LEFT
    for each in entries:
        if each.shape:
            found.append(svg.mark((x + 8.0, y), each.shape, each.kind, "", 5.0))
        else:
            found.append(svg.line((x - 8.0, y), (x + 16.0, y), each.kind))
        found.append(svg.text((x + 22.0, y + 4.5), each.words))
        x += 44.0 + 7.2 * len(each.words)
    return found


def span(values: Iterable[float], *, zero: bool = True, room: float = 0.06) -> tuple[float, float]:
    """Return a range that holds all values, and zero, with a little room."""
    known = [*values, *([0.0] if zero else [])] or [0.0]
    low, high = min(known), max(known)
    if high - low < EMPTY:
        return (low, low + 1.0) if zero else (low - 0.5, low + 0.5)
    spare = room * (high - low)
    return (0.0 if zero and low >= 0 else low - spare), (0.0 if zero and high <= 0 else high + spare)


class Panel(NamedTuple):
    x: svg.Axis
    y: svg.Axis

    def at(self, x: float, y: float) -> svg.Point:
        return self.x(x), self.y(y)

    def clipped(self, y: float) -> float:
        """Return the place of a value; of one beyond the axis its end."""
        return self.y(min(max(y, self.y.low), self.y.high))


class Layout(NamedTuple):
    """Panels of one size in rows and columns."""

    columns: int
    height: float  # of a panel
    number: int

    @property
    def whole(self) -> float:
        """Return the height of the picture."""
        rows = math.ceil(self.number / self.columns)
        return TOP + rows * self.height + (rows - 1) * (BOTTOM + 24.0) + BOTTOM

    def panel(self, place: int, x: tuple[float, float], y: tuple[float, float]) -> Panel:
        row, column = divmod(place, self.columns)
        width = (WIDTH - LEFT - RIGHT - (self.columns - 1) * GAP) / self.columns
        left = LEFT + column * (width + GAP)
        top = TOP + row * (self.height + BOTTOM + 24.0)
        return Panel(
            svg.Axis(low=x[0], high=x[1], start=left, end=left + width),
            svg.Axis(low=y[0], high=y[1], start=top + self.height, end=top),
        )


class Multiples(NamedTuple):
    """A panel for each strip: for all of them, or for the worst, in their order."""

    strips: list[str]
    layout: Layout
    some: str  # what the caption says of those that are not drawn

    def titled(self, strip: str) -> str:
        return f"strip {strip}" if self.some or len(self.strips) > 1 else ""


def multiples(sizes: Mapping[str, float], what: str) -> Multiples:
    """Choose the strips that are drawn; what: those with the largest sizes, in words."""
    chosen = sorted(sizes, key=lambda strip: -sizes[strip])[:MOST_STRIPS]
    number = len(chosen)
    return Multiples(
        strips=[strip for strip in sizes if strip in chosen],
        layout=Layout(columns=1 if number == 1 else 2, height=210.0 if number == 1 else 140.0, number=number),
        some="" if number == len(sizes) else f" {number} of {len(sizes)} strips, those with the {what}.",
    )


def framed(panel: Panel, labels: tuple[str, str], title: str = "") -> list[str]:
    """Draw grid, numbers and names of a panel's axes, and what it shows."""
    found = svg.frame(panel.x, panel.y, labels)
    if title:
        found.append(svg.text((panel.x.start + 4.0, panel.y.end - 12.0), title, "title"))
    return found


def framed_by_photos(panel: Panel, photos: Sequence[str], labels: tuple[str, str], title: str = "") -> list[str]:
    """Draw axes of which the lower one has the ids of photos, from 1, as many as there is room for."""
    room = (panel.x.end - panel.x.start) / (7.5 * max(map(len, photos)) + 8.0)
    every = max(1, math.ceil(len(photos) / room))
    found = [
        svg.text((panel.x(n), panel.y.start + 18.0), photo, "tick", "middle")
        for n, photo in enumerate(photos, 1)
        if (n - 1) % every == 0
    ]
    return [*found, *framed(unnumbered(panel), labels, title)]


def unnumbered(panel: Panel) -> Panel:
    """Return a panel whose lower axis has neither numbers nor lines."""
    return panel._replace(x=panel.x._replace(numbered=False))


def steps(panel: Panel, values: Sequence[tuple[float, float]], kind: str) -> str:
    """Draw a broken line through values."""
    return svg.path([panel.at(*each) for each in values], kind)
