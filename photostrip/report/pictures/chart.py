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
CROWD = 0.4  # power of the number of dots with which their size falls
CELL = 4.0  # of the picture, that a name, a mark or a line takes
MOST_NAMED, MOST_TRIED = 60, 400  # names that stand wherever they can; others for which much room is looked for
SPARE = 12.0  # of the picture, around names that need not stand
STEPS = 60  # along a line that names keep clear of
LONGEST_ROW = 15.0  # length of a map over its height, from about which it is cut into rows
MOST_HIGH = 1.1  # rows of a map together, over their length
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
        decimals = max(0, -math.floor(math.log10(step) + 1e-9))
        return [(n * step, f"{n * step:.{decimals}f}" if n else "0") for n in range(first, last + 1)]


class Frame(NamedTuple):
    """A panel on the picture; of a long map the first of its rows, which go on below each other."""

    x: Axis
    y: Axis
    rows: int = 1
    start: float = 0.0  # of the first row, in coordinates of the map
    length: float = 1.0  # of each row
    down: float = 0.0  # from row to row, on the picture

    def row(self, at: Floats) -> NDArray[np.float64]:
        """Return in which row each place stands."""
        along = (np.nan_to_num(np.asarray(at, np.float64).reshape(-1, 2)[:, 0]) - self.start) / self.length
        return np.clip(np.floor(along), 0.0, self.rows - 1.0)

    def places(self, at: Floats, about: Floats | None = None) -> Floats:
        """Return places on the picture; what belongs together stands in the row of the places it is about."""
        at = np.asarray(at, np.float64).reshape(-1, 2)
        row = self.row(at if about is None else about)
        return np.column_stack([self.x(at[:, 0] - row * self.length), self.y(at[:, 1]) + row * self.down])


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
            drawn = places[:: self.every].tolist()
            yield svg.dots(drawn, self.size * min(1.0, (MOST_HINTS / max(len(drawn), 1)) ** CROWD), self.kind)
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
        for part in np.split(frame.places(known), np.flatnonzero(np.diff(frame.row(known))) + 1):
            if len(part):
                yield svg.path(part.tolist(), f"line {self.kind}")

    def course(self, frame: Frame) -> Floats:
        return between(*(frame.places(ends) for ends in (self.at[:-1], self.at[1:])))


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

    def ends(self, frame: Frame) -> tuple[Floats, Floats, Floats]:
        """Return on the picture where each starts, towards where it bows, and where it ends."""
        start, end = np.split(frame.places(self.at, np.tile(np.asarray(self.start).reshape(-1, 2), (2, 1))), 2)
        return start, (start + end) / 2 + self.bow * (end - start)[:, ::-1] * (1.0, -1.0), end

    def course(self, frame: Frame) -> Floats:
        start, over, end = self.ends(frame)
        middle = (start + 2 * over + end) / 4
        return np.concatenate([between(start, middle), between(middle, end)])

    def draw(self, frame: Frame) -> Iterator[str]:
        start, over, end = self.ends(frame)
        way = end - start
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

    def course(self, frame: Frame) -> Floats:
        """Return where the borders run, of outlines that are not filled."""
        if "open" not in self.kind or not self.outlines:
            return np.zeros((0, 2))
        return np.concatenate([between(each, np.roll(each, 1, axis=0)) for each in self.corners(frame)])

    def corners(self, frame: Frame) -> list[Floats]:
        return [frame.places(outline, np.tile(outline.mean(axis=0), (len(outline), 1))) for outline in self.outlines]

    def draw(self, frame: Frame) -> Iterator[str]:
        corners = [each.tolist() for each in self.corners(frame)]
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


def between(start: Floats, end: Floats) -> Floats:
    """Return places along lines."""
    share = np.linspace(0.0, 1.0, STEPS)[:, None, None]
    return np.asarray((start + share * (end - start)).reshape(-1, 2))


@dataclass(frozen=True)
class Names:
    """Names beside their places that cover no other name, and marks and lines only where there is no other way.

    The first ones stand wherever they can; the others only where there is much room, so that a crowd stays readable:
    of many all, unless it is said how many are first.
    """

    at: Floats
    names: Sequence[str]
    beside: bool = True  # in the middle of what they name otherwise
    first: int | None = None
    words: str = ""

    def draw(self, frame: Frame, others: Iterable[Layer]) -> Iterator[str]:
        places = frame.places(self.at)
        top, bottom = min(frame.y.start, frame.y.end), max(frame.y.start, frame.y.end) + (frame.rows - 1) * frame.down
        taken, drawn = (np.zeros((int(bottom / CELL) + 8, int(WIDTH / CELL) + 2), bool) for _ in range(2))
        for layer in others:
            if isinstance(layer, Marks):
                _take(drawn, frame.places(layer.at), layer.size)
            elif not isinstance(layer, Names):
                _take(drawn, layer.course(frame))
        first = self.first or len(places) * (self.first is None and len(places) <= MOST_NAMED)
        if self.beside:
            _take(taken, places[:first], 0.75 * CELL)
        rest = range(first, len(places))
        for n in (*range(min(first, len(places))), *rest[:: len(rest) // MOST_TRIED + 1]):
            spare = SPARE if n >= first else 0.0
            free: list[tuple[int, int, float, float, tuple[slice, slice]]] = []
            wide = LETTER * len(self.names[n])
            for left, base in self._around(places[n], wide):
                inside = frame.x.start - CELL < left < frame.x.end + RIGHT - wide and top - 8.0 < base < bottom + 16.0
                text = _box(left, base, wide, 0.0)
                if inside and not taken[_box(left, base, wide, spare)].any():
                    free.append((int(drawn[text].sum()), len(free), left, base, text))
            if free and (spare == 0.0 or min(free)[0] == 0):
                *_, left, base, text = min(free)
                taken[text] = True
                yield svg.text((left, base), self.names[n], "id")

    def _around(self, place: Floats, wide: float) -> list[svg.Point]:
        """Return where the text of a name may start."""
        x, y = place.tolist()
        if not self.beside:
            steps = sorted(((dx, dy) for dx in (-12, 0, 12) for dy in (-10, 0, 10)), key=np.hypot.reduce)
            return [(x - wide / 2 + dx, y + 4.0 + dy) for dx, dy in steps]
        sides = (x + 9.0, y + 4.0), (x - 9.0 - wide, y + 4.0), (x - wide / 2, y - 8.0), (x - wide / 2, y + 16.0)
        return [*sides, *((left, base) for left in (x + 6.0, x - 6.0 - wide) for base in (y - 7.0, y + 15.0))]


def _take(cells: NDArray[np.bool_], places: Floats, size: float = 0.0) -> None:
    """Say that places, and what is near to them, are taken."""
    known = places[np.isfinite(places).all(axis=1)]
    near = {-size, 0.0, size}
    for x, y in ((known[:, 0] + dx, known[:, 1] + dy) for dx in near for dy in near):
        row, column = (
            np.clip(at / CELL, 0, limit - 1).astype(int) for at, limit in zip((y, x), cells.shape, strict=True)
        )
        cells[row, column] = True


def _box(left: float, base: float, wide: float, spare: float) -> tuple[slice, slice]:
    """Return the cells that a text takes."""
    ends = (base - LETTER_HEIGHT + 2.0 - spare, base + spare), (left - 2.0 - spare, left + wide + 2.0 + spare)
    rows, columns = (slice(max(0, int(low / CELL)), max(0, int(high / CELL) + 1)) for low, high in ends)
    return rows, columns


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
        (x, y, *_), bottom = frame, max(frame.y.start, frame.y.end)
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
        yield svg.text((x.start + 4.0, top - 12.0), fitted(self.title, x.end - x.start + RIGHT, LETTER + 1.0), "title")


@dataclass(frozen=True)
class Map:
    """Layers to scale: what goes to the right is as long as what goes up."""

    layers: Sequence[Layer]
    title: str = ""
    extent: tuple[Range, Range] | None = None  # along x and y, in place of all that the layers hold
    rows: int = 1  # below each other, into which a long map is cut

    def first_row(self) -> tuple[Floats, Floats, float]:
        """Return the lower and the upper end of what the first row shows, and the room at its sides."""
        if self.extent:
            low, high = np.array(self.extent).T
            return low, high, 0.0
        at = np.concatenate([np.zeros((0, 2)), *(layer.at for layer in self.layers)])
        at = at[np.isfinite(at).all(axis=1)]
        low, high = (at.min(axis=0), at.max(axis=0)) if len(at) else (np.zeros(2), np.ones(2))
        high[0] = low[0] + (high[0] - low[0]) / self.rows
        room = max(ROOM * float((high - low).max()), 1e-6)
        return low - room, high + room, room

    def height(self, width: float) -> float:
        """Return the height of the map on a picture, of one in one row at most ``HIGHEST``."""
        low, high, _ = self.first_row()
        height = width * (high[1] - low[1]) / (high[0] - low[0])
        return float(min(HIGHEST, height) if self.rows == 1 else self.rows * height)

    def framed(self, corner: svg.Point, width: float, height: float) -> Frame:
        low, high, room = self.first_row()
        down = height / self.rows
        scale = min(width / (high[0] - low[0]), down / (high[1] - low[1]))
        spare = (np.array([width, down]) / scale - (high - low)) / 2
        (a, c), (b, d) = (low - spare).tolist(), (high + spare).tolist()
        left, top = corner
        x, y = Axis(a, b, left, left + width), Axis(c, d, top + down, top)
        return Frame(x, y, self.rows, float(low[0]) + room, float(high[0] - low[0]) - 2.0 * room or 1.0, down)

    def surround(self, frame: Frame) -> Iterator[str]:
        words = fitted(self.title, frame.x.end - frame.x.start, LETTER)
        yield svg.text((frame.x.start + 2.0, frame.y.end - 5.0), words, "tick")


def fitted(words: str, room: float, letter: float) -> str:
    """Return words that fit, without their middle where they are too long."""
    most = int(room / letter)
    return words if len(words) <= most else f"{words[: most // 2 - 1]}…{words[len(words) - most // 2 :]}"


class Bar(NamedTuple):
    """A scale bar below the maps."""

    length: float  # in coordinates of the first map
    words: str
    kind: str = "ink"


def rows_of(at: Floats) -> int:
    """Return into how many rows a map is cut: into one unless it is much longer than high."""
    wide, high = np.ptp(at[np.isfinite(at).all(axis=1)], axis=0).tolist() if len(at) else (1.0, 1.0)
    ratio = min(wide / max(high, FLAT), 1000.0)
    most = ratio * (math.sqrt(ROOM**2 + MOST_HIGH / ratio) - ROOM)  # n * (n / ratio + 2 * ROOM) = MOST_HIGH
    return max(1, int(min(ratio / LONGEST_ROW, most)))


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
            for layer in panel.layers:
                drawn += layer.draw(frame, panel.layers) if isinstance(layer, Names) else layer.draw(frame)
        top += high + below
    if north is not None:
        drawn += _north_arrow(north)
    drawn += _bars(bars, frames[0], top + 10.0)
    thinned = [
        f" Of {max(len(layer.at), layer.number)} points one in {layer.every} is drawn; `points` in result.json has all."
        for panel in panels
        for layer in panel.layers
        if isinstance(layer, Marks) and layer.every > 1
    ]
    cut = [
        f" Cut into {panel.rows} rows, from the top." for panel in panels if isinstance(panel, Map) and panel.rows > 1
    ]
    extent = WIDTH, top + (26.0 if bars else 0.0 if maps else -24.0)
    return svg.picture(name, extent, drawn, title, caption + "".join(dict.fromkeys(cut + thinned)), description)


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
