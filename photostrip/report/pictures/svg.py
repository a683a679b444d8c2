"""Elements of SVG for the pictures of a result: in a page, whose style sheet gives them their colours, or as files.

matplotlib draws plans and terrestrial results; docs/design.md says why not the pictures of a result. Hints at marks,
colours of a dark screen and ids that are unique on the page would have to be written into its SVG afterwards.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple
from xml.sax.saxutils import escape, quoteattr

Point = tuple[float, float]

TICKS = 6  # about so many on an axis


class Picture(NamedTuple):
    """A picture with the words that go with it."""

    name: str
    title: str
    caption: str
    svg: str  # the picture; its title and description are those for readers who cannot see it


class Axis(NamedTuple):
    """A scale from numbers to places on the picture."""

    low: float
    high: float
    start: float
    end: float
    numbered: bool = True  # False: what it has is not numbers, but named by who draws it

    def __call__(self, value: float) -> float:
        """Return the place of a number."""
        return self.start + (value - self.low) / (self.high - self.low) * (self.end - self.start)

    def ticks(self) -> list[float]:
        """Give round numbers along the axis."""
        step = nice((self.high - self.low) / TICKS)
        first = math.ceil(self.low / step - 1e-9)
        last = math.floor(self.high / step + 1e-9)
        return [number * step for number in range(first, last + 1)]


def nice(size: float) -> float:
    """Return the next round number, 1, 2 or 5 times a power of ten, that is not smaller."""
    if size <= 0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(size))
    return next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= size * (1 - 1e-9))


def number(value: float) -> str:
    """Return a coordinate of the picture with one decimal, never -0."""
    text = f"{value:z.1f}"
    return text.removesuffix(".0")


def element(name: str, content: str = "", **attributes: str | float) -> str:
    """Return one element; underscores in names of attributes stand for hyphens, ``kind`` for ``class``."""
    parts = [f"<{name}"]
    for key, value in attributes.items():
        words = f'"{number(value)}"' if isinstance(value, float) else quoteattr(str(value))
        parts.append(f" {'class' if key == 'kind' else key.replace('_', '-')}={words}")
    parts.append(f">{content}</{name}>" if content else "/>")
    return "".join(parts)


def text(place: Point, words: str, kind: str = "", anchor: str = "start") -> str:
    x, y = place
    return element("text", escape(words), x=x, y=y, kind=f"label {kind}".strip(), text_anchor=anchor)


def line(start: Point, end: Point, kind: str) -> str:
    return element("line", x1=start[0], y1=start[1], x2=end[0], y2=end[1], kind=kind)


def path(points: Iterable[Point], kind: str) -> str:
    steps = " ".join(f"{number(x)},{number(y)}" for x, y in points)
    return element("polyline", points=steps, kind=kind)


def titled(hint: str) -> str:
    """Return what a pointer over an element shows."""
    return element("title", escape(hint)) if hint else ""


def polygon(points: Iterable[Point], kind: str, hint: str = "") -> str:
    corners = " ".join(f"{number(x)},{number(y)}" for x, y in points)
    return element("polygon", titled(hint), points=corners, kind=kind)


def rectangle(corner: Point, size: Point, kind: str, hint: str = "") -> str:
    """Return a rectangle by its upper left corner, width and height."""
    title = titled(hint)
    return element("rect", title, x=corner[0], y=corner[1], width=size[0], height=size[1], kind=kind)


def circle(place: Point, radius: float, kind: str, hint: str = "") -> str:
    title = titled(hint)
    return element("circle", title, cx=place[0], cy=place[1], r=radius, kind=kind)


def dots(places: Iterable[Point], radius: float, kind: str) -> str:
    """Return many dots as one path: a tenth of the bytes, and no hints."""
    steps = "".join(f"M{number(x)} {number(y)}h0" for x, y in places)
    return element("path", d=steps, kind=f"dots {kind}", stroke_width=2 * radius)


def mark(place: Point, shape: str, kind: str, hint: str, size: float = 5.0) -> str:
    """Return a mark: a triangle, a square, a diamond or a dot; the hint is what a pointer over it shows."""
    x, y = place
    if shape == "dot":
        return circle(place, size * 0.6, kind, hint)
    corners: dict[str, Sequence[Point]] = {
        "triangle": ((0, -1.2), (1.1, 0.8), (-1.1, 0.8)),
        "square": ((-0.85, -0.85), (0.85, -0.85), (0.85, 0.85), (-0.85, 0.85)),
        "diamond": ((0, -1.2), (1.2, 0), (0, 1.2), (-1.2, 0)),
    }
    return polygon([(x + dx * size, y + dy * size) for dx, dy in corners[shape]], kind, hint)


def tested(place: Point, hint: str, inside: tuple[str, str], size: float, *, outside: bool) -> str:
    """Return the mark of what was tested; inside: shape and kind of a mark within its limit."""
    shape, kind = ("diamond", "left-out") if outside else inside
    return mark(place, shape, kind, hint, size)


def picture(name: str, size: Point, content: Iterable[str], title: str, caption: str, description: str) -> Picture:
    """Return a picture with its words; the description is for readers who cannot see it."""
    head = element("title", escape(title), id=f"picture-{name}-title") + element(
        "desc", escape(description), id=f"picture-{name}-desc"
    )
    svg = element(
        "svg",
        f"{head}\n" + "\n".join(content) + "\n",
        xmlns="http://www.w3.org/2000/svg",
        viewBox=f"0 0 {number(size[0])} {number(size[1])}",
        role="img",
        aria_labelledby=f"picture-{name}-title picture-{name}-desc",
    )
    return Picture(name=name, title=title, caption=caption, svg=svg)


def frame(x: Axis, y: Axis, labels: tuple[str, str]) -> list[str]:
    """Give grid lines, numbers and names of two axes."""
    found = []
    for value in x.ticks() if x.numbered else ():
        found.append(line((x(value), y.start), (x(value), y.end), "grid"))
        found.append(text((x(value), y.start + 18.0), f"{value:.6g}", "tick", "middle"))
    for value in y.ticks():
        kind = "zero" if abs(value) < 1e-12 * max(abs(y.high), abs(y.low), 1e-300) else "grid"
        found.append(line((x.start, y(value)), (x.end, y(value)), kind))
        found.append(text((x.start - 8.0, y(value) + 4.0), f"{value:.6g}", "tick", "end"))
    found.append(text(((x.start + x.end) / 2, y.start + 38.0), labels[0], "axis", "middle"))
    found.append(text((x.start - 8.0, y.end - 12.0), labels[1], "axis", "end"))
    return found
