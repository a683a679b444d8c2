"""Charts: panels with axes, or maps to scale, side by side; layers in them hold what is drawn, in their coordinates.

Rows of coordinates are x, y; those with NaN are not drawn. A layer with ``words`` stands in the legend once.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from photostrip.report.pictures import svg

Floats = NDArray[np.float64]
Range = tuple[float, float]

WIDTH = 960.0  # of a picture
LEFT, RIGHT, BELOW, GAP = 70.0, 24.0, 54.0, 66.0  # beside and between panels with axes
MARGIN, BETWEEN = 24.0, 14.0  # beside and between maps
HIGHEST = 460.0  # map
ROOM = 0.05  # around what a map shows, in shares of its extent
TICKS = 6  # about so many on an axis
LETTER, LETTER_HEIGHT = 7.2, 12.0  # at most so large
MOST_HINTS = 1500  # more marks have none
MOST_DOTS = 10_000  # more are thinned, and the caption says so
MOST_TRIED = 400  # names for which room is looked for
CELL = 4.0  # of the picture, that a name or mark takes
FLAT = 1e-12  # a range without extent
CIRCLE = np.linspace(0.0, 2.0 * np.pi, 25)[:-1]


def nice(size: float) -> float:
    """Return the next round number, 1, 2 or 5 times a power of ten, that is not smaller."""
    if size <= 0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(size))
    return next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= size * (1 - 1e-9))


def span(values: ArrayLike, *, zero: bool = True, room: float = 0.06) -> Range:
    """Return a range that holds all values, and zero, with a little room."""
    known = np.asarray(values, np.float64).ravel()
    known = np.append(known[np.isfinite(known)], [0.0] if zero else [])
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 0.0)
    if high - low < FLAT:
        return (low, low + 1.0) if zero else (low - 0.5, low + 0.5)
    spare = room * (high - low)
    return (0.0 if zero and low >= 0 else low - spare), (0.0 if zero and high <= 0 else high + spare)


class Axis(NamedTuple):
    """A scale from numbers to places on the picture; numbers beyond it stand at its ends."""

    low: float
    high: float
    start: float
    end: float
    log: bool = False
    names: Sequence[str] = ()  # at 1, 2, ... in place of numbers

    def __call__(self, values: ArrayLike) -> Floats:
        at, ends = np.clip(values, self.low, self.high), np.array([self.low, self.high])
        if self.log:
            at, ends = np.log10(at), np.log10(ends)
        share: Floats = (at - ends[0]) / (ends[1] - ends[0])
        return self.start + share * (self.end - self.start)

    def ticks(self) -> list[tuple[float, str]]:
        """Give round numbers along the axis; of names as many as there is room for."""
        if self.names:
            room = abs(self.end - self.start) / (LETTER * max(map(len, self.names)) + 8.0)
            every = max(1, math.ceil(len(self.names) / room))
            return [(float(n), name) for n, name in enumerate(self.names, 1)][::every]
        if self.log:
            decades = range(math.floor(math.log10(self.low)), math.ceil(math.log10(self.high)) + 1)
            rounded = [digit * 10.0**decade for decade in decades for digit in (1, 2, 5)]
            return [(value, f"{value:g}") for value in rounded if self.low <= value <= self.high]
        step = nice((self.high - self.low) / TICKS)
        first, last = math.ceil(self.low / step - 1e-9), math.floor(self.high / step + 1e-9)
        return [(n * step, f"{n * step:.6g}") for n in range(first, last + 1)]


class Frame(NamedTuple):
    """A panel on the picture."""

    x: Axis
    y: Axis

    def places(self, at: Floats) -> Floats:
        at = np.asarray(at, np.float64).reshape(-1, 2)
        return np.column_stack([self.x(at[:, 0]), self.y(at[:, 1])])


# ------------------------------------------------------------------------------------------------------------- layers


@dataclass(frozen=True)
class Marks:
    at: Floats
    kind: str = "c1"  # classes of the style sheet: colour, and form where it is not filled
    shape: str = "dot"
    hints: Sequence[str] = ()
    words: str = ""
    size: float = 5.0
    number: int = 0  # of marks of this kind in all layers, where there are several

    def draw(self, frame: Frame) -> Iterator[str]:
        known = np.flatnonzero(np.isfinite(self.at).all(axis=1))
        places = frame.places(self.at[known])
        if max(len(known), self.number) > MOST_HINTS:
            yield svg.dots(places[:: self.every].tolist(), self.size, self.kind)
            return
        for place, row in zip(places.tolist(), known.tolist(), strict=True):
            yield svg.mark(place, self.shape, f"mark {self.kind}", self.hints[row] if self.hints else "", self.size)

    @property
    def every(self) -> int:
        """Tell which of very many marks are drawn."""
        return math.ceil(max(len(self.at), self.number) / MOST_DOTS)


@dataclass(frozen=True)
class Line:
    at: Floats
    kind: str = "c1"
    words: str = ""

    def draw(self, frame: Frame) -> Iterator[str]:
        known = self.at[np.isfinite(self.at).all(axis=1)]
        if len(known):
            yield svg.path(frame.places(known).tolist(), f"line {self.kind}")


@dataclass(frozen=True)
class Segments:
    """Lines from one place to another, each by itself: vectors, stems, limits."""

    start: Floats
    end: Floats
    kind: str = "c1"
    hints: Sequence[str] = ()
    words: str = ""
    bow: float = 0.0  # of each, in shares of its length

    @property
    def at(self) -> Floats:
        return np.concatenate([np.asarray(self.start).reshape(-1, 2), np.asarray(self.end).reshape(-1, 2)])

    def draw(self, frame: Frame) -> Iterator[str]:
        start, end = np.split(frame.places(self.at), 2)
        way = end - start
        over = (start + end) / 2 + self.bow * way[:, ::-1] * (1.0, -1.0)
        rows = np.concatenate([start, over, end] if self.bow else [start, end], axis=1)
        steps = "M{} {}Q{} {} {} {}" if self.bow else "M{} {}L{} {}"
        known = np.flatnonzero(np.isfinite(way).all(axis=1)).tolist()
        pieces = [steps.format(*map(svg.number, row)) for row in rows[known].tolist()]
        if len(known) > MOST_HINTS:
            yield svg.element("path", d="".join(pieces), kind=f"line {self.kind}")
            return
        for row, piece in zip(known, pieces, strict=True):
            hint = svg.titled(self.hints[row]) if self.hints else ""
            yield svg.element("path", hint, d=piece, kind=f"line {self.kind}")


@dataclass(frozen=True)
class Areas:
    outlines: Sequence[Floats]
    kind: str = "area c1"
    hints: Sequence[str] = ()
    words: str = ""

    @property
    def at(self) -> Floats:
        return np.concatenate([np.zeros((0, 2)), *self.outlines])

    def draw(self, frame: Frame) -> Iterator[str]:
        corners = [frame.places(outline).tolist() for outline in self.outlines]
        if not self.hints:
            yield svg.element("path", d="".join(f"M{svg.joined(each)}z" for each in corners), kind=self.kind)
            return
        for hint, each in zip(self.hints, corners, strict=True):
            yield svg.polygon(each, self.kind, hint)


def box(x: Range, y: Range) -> Floats:
    return np.array([(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])])


def ellipse(a: float, b: float, angle: float) -> Floats:
    """Return the outline of an ellipse around the origin; the angle is that of a, counter-clockwise from x."""
    x, y, cosine, sine = a * np.cos(CIRCLE), b * np.sin(CIRCLE), np.cos(angle), np.sin(angle)
    return np.column_stack([x * cosine - y * sine, x * sine + y * cosine])


@dataclass(frozen=True)
class Names:
    """Names beside their places where they cover no other name and no mark, the first ones first."""

    at: Floats
    names: Sequence[str]
    beside: bool = True
    words: str = ""

    def draw(self, frame: Frame) -> Iterator[str]:
        places = frame.places(self.at)
        top, bottom = sorted((frame.y.start, frame.y.end))
        taken = np.zeros((int(bottom / CELL) + 8, int(WIDTH / CELL) + 1), bool)
        if self.beside:
            column, row = (places / CELL).astype(int).T
            taken[row, column] = True
        for name, (x, y) in list(zip(self.names, places.tolist(), strict=True))[:MOST_TRIED]:
            wide = 0.9 * LETTER * len(name)
            around = (x + 7.0, y + 4.0), (x - 7.0 - wide, y + 4.0), (x - wide / 2, y - 8.0), (x - wide / 2, y + 16.0)
            for left, base in around if self.beside else ((x - wide / 2, y + 4.0),):
                if left < CELL or left + wide > WIDTH - CELL or not top - 4.0 < base < bottom + 16.0:
                    continue
                rows = slice(int((base - LETTER_HEIGHT + 2.0) / CELL), int(base / CELL) + 1)
                box = taken[rows, int((left - 2.0) / CELL) : int((left + wide + 2.0) / CELL) + 1]
                if not box.any():
                    box[:] = True
                    yield svg.text((left, base), name, "id")
                    break


Layer = Marks | Line | Segments | Areas | Names


def _entry(layer: Layer, x: float, y: float) -> str:
    """Draw what stands before the words of a layer in the legend."""
    if isinstance(layer, Marks):
        return svg.mark((x + 8.0, y), layer.shape, f"mark {layer.kind}", "", 5.0)
    if isinstance(layer, Areas):
        return svg.mark((x + 8.0, y), "square", layer.kind, "", 6.0)
    return svg.line((x - 8.0, y), (x + 16.0, y), "" if isinstance(layer, Names) else f"line {layer.kind}")


# ------------------------------------------------------------------------------------------------------------- panels


@dataclass(frozen=True)
class Panel:
    """Layers between two axes; a range that is not given holds all layers, that of y with zero."""

    layers: Sequence[Layer]
    title: str = ""
    labels: tuple[str, str] = ("", "")
    x: Range | None = None
    y: Range | None = None
    names: Sequence[str] = ()  # at 1, 2, ... of the lower axis
    rows: Sequence[str] = ()  # at 1, 2, ... of the upright axis
    log: bool = False  # upright axis

    def framed(self, corner: svg.Point, width: float, height: float) -> Frame:
        at = np.concatenate([np.zeros((0, 2)), *(layer.at for layer in self.layers)])
        (left, top), bottom = corner, corner[1] + height
        x = (0.5, len(self.names) + 0.5) if self.names else span(at[:, 0], zero=False, room=0.02)
        lower = Axis(*(self.x or x), left, left + width, names=self.names)
        if self.rows:  # from above
            return Frame(lower, Axis(0.4, len(self.rows) + 0.6, top, bottom, names=self.rows))
        y = self.y or span(at[:, 1])
        if self.log:
            positive = at[:, 1][at[:, 1] > 0] if (at[:, 1] > 0).any() else np.ones(1)
            y = float(positive.min()) * 0.8, float(positive.max()) * 1.25
        return Frame(lower, Axis(*y, bottom, top, self.log))

    def surround(self, frame: Frame) -> Iterator[str]:
        """Draw grid lines, numbers and names of the axes."""
        (x, y), bottom = frame, max(frame.y.start, frame.y.end)
        top = min(frame.y.start, frame.y.end)
        for value, words in x.ticks():
            at = float(x(value))
            if not self.names:
                yield svg.line((at, bottom), (at, top), "grid")
            yield svg.text((at, bottom + 18.0), words, "tick", "middle")
        for value, words in y.ticks():
            at = float(y(value))
            yield svg.line((x.start, at), (x.end, at), "zero" if abs(value) < FLAT * abs(y.high - y.low) else "grid")
            yield svg.text((x.start - 8.0, at + 4.0), words, "tick", "end")
        yield svg.text(((x.start + x.end) / 2, bottom + 38.0), self.labels[0], "axis", "middle")
        yield svg.text((x.start - 8.0, top - 12.0), self.labels[1], "axis", "end")
        yield svg.text((x.start + 4.0, top - 12.0), self.title, "title")


@dataclass(frozen=True)
class Map:
    """Layers to scale: what goes to the right is as long as what goes up."""

    layers: Sequence[Layer]
    title: str = ""
    extent: tuple[Range, Range] | None = None  # along x and y, in place of all that the layers hold

    def ranges(self) -> tuple[Range, Range]:
        if self.extent:
            return self.extent
        at = np.concatenate([np.zeros((0, 2)), *(layer.at for layer in self.layers)])
        at = at[np.isfinite(at).all(axis=1)]
        low, high = (at.min(axis=0), at.max(axis=0)) if len(at) else (np.zeros(2), np.ones(2))
        room = max(ROOM * float((high - low).max()), 1e-6)
        (a, b), (c, d) = (low - room).tolist(), (high + room).tolist()
        return (a, c), (b, d)

    def height(self, width: float) -> float:
        """Return the height of the map on a picture, at most ``HIGHEST``."""
        x, y = self.ranges()
        return min(HIGHEST, width * (y[1] - y[0]) / (x[1] - x[0]))

    def framed(self, corner: svg.Point, width: float, height: float) -> Frame:
        x, y = self.ranges()
        scale = min(width / (x[1] - x[0]), height / (y[1] - y[0]))
        wide, high = width / scale - (x[1] - x[0]), height / scale - (y[1] - y[0])
        x, y = (x[0] - wide / 2, x[1] + wide / 2), (y[0] - high / 2, y[1] + high / 2)
        left, top = corner
        return Frame(Axis(*x, left, left + width), Axis(*y, top + height, top))

    def surround(self, frame: Frame) -> Iterator[str]:
        yield svg.text((frame.x.start + 2.0, frame.y.end - 5.0), self.title, "tick")


class Bar(NamedTuple):
    """A scale bar below the maps."""

    length: float  # in coordinates of the first map
    words: str
    kind: str = "ink"


def ground_bar(extent: float) -> Bar:
    size = nice(extent / 10)
    return Bar(size, f"ground {length(size)}")


def length(size: float) -> str:
    return f"{size / 1000:g} km" if size >= 1000 else f"{size:g} m" if size >= 1 else f"{size * 1000:g} mm"


def chart(
    name: str,
    words: tuple[str, str, str],
    panels: Sequence[Panel | Map],
    *,
    columns: int = 1,
    height: float = 150.0,
    heading: str = "",
    bars: Sequence[Bar] = (),
    north: Floats | None = None,
) -> svg.Picture:
    """Draw panels row by row below one legend.

    words: title; caption; description for readers who cannot see it.
    height: of a panel with axes.
    north: direction to the north, of length 1.
    """
    title, caption, description = words
    maps = all(isinstance(panel, Map) for panel in panels)
    left, right, gap, below = (MARGIN, MARGIN, BETWEEN, 20.0) if maps else (LEFT, RIGHT, GAP, BELOW + 24.0)
    width = (WIDTH - left - right - (columns - 1) * gap) / columns
    drawn, y = _legend([layer for panel in panels for layer in panel.layers], heading)
    top = max(y + 40.0, 0.0 if north is None else 80.0)
    frames: list[Frame] = []
    for first in range(0, len(panels), columns):
        row = panels[first : first + columns]
        high = max(panel.height(width) if isinstance(panel, Map) else height for panel in row)
        for n, panel in enumerate(row):
            frame = panel.framed((left + n * (width + gap), top), width, high)
            frames.append(frame)
            drawn += panel.surround(frame)
            drawn += [each for layer in panel.layers for each in layer.draw(frame)]
        top += high + below
    if north is not None:
        drawn += _north_arrow(north)
    drawn += _bars(bars, frames[0], top + 10.0)
    thinned = [
        f" Of {max(len(layer.at), layer.number)} points one in {layer.every} is drawn."
        for panel in panels
        for layer in panel.layers
        if isinstance(layer, Marks) and layer.every > 1
    ]
    extent = WIDTH, top + (26.0 if bars else 0.0)
    return svg.picture(name, extent, drawn, title, caption + "".join(dict.fromkeys(thinned)), description)


def _legend(layers: Iterable[Layer], heading: str) -> tuple[list[str], float]:
    """Draw marks and lines with their meaning, and return how far down they reach."""
    drawn, x, y = [], LEFT, 20.0
    if heading:
        drawn, y = [svg.text((MARGIN, y), heading, "title")], 44.0
    entries: dict[str, Layer] = {}
    for layer in layers:
        if layer.words and len(layer.at):
            entries.setdefault(layer.words, layer)
    for words, layer in entries.items():
        wide = 44.0 + LETTER * len(words)
        if x + wide > WIDTH - 70.0 and x > LEFT:
            x, y = LEFT, y + 22.0
        drawn += [_entry(layer, x, y), svg.text((x + 22.0, y + 4.5), words)]
        x += wide
    return drawn, y


def _bars(bars: Iterable[Bar], frame: Frame, y: float) -> Iterator[str]:
    x, scale = LEFT, abs(frame.x.end - frame.x.start) / (frame.x.high - frame.x.low)
    for bar in bars:
        length = bar.length * scale
        yield svg.line((x, y), (x + length, y), f"bar {bar.kind}")
        yield svg.text((x + length + 8.0, y + 4.5), bar.words)
        x += length + 38.0 + LETTER * len(bar.words)


def _north_arrow(direction: Floats) -> Iterator[str]:
    """Draw an arrow to the north, its western half filled, with its letter before the tip."""
    north = np.array([direction[0], -direction[1]])  # on the picture y goes down
    east, origin = np.array([-north[1], north[0]]), np.array([WIDTH - 48.0, 44.0])
    corners = (0, 18), (-9, -15), (0, -8), (9, -15)
    tip, west, notch, right = ((origin + a * east + b * north).tolist() for a, b in corners)
    yield svg.polygon([tip, west, notch], "north ink mark")
    yield svg.polygon([tip, right, notch], "north ink open")
    yield svg.text((origin + 28.0 * north + (0.0, 4.5)).tolist(), "N", "title", "middle")
