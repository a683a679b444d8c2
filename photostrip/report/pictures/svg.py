"""Elements of SVG. ``templates/pictures.css`` gives their classes form and colour, on light and dark screens."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from functools import cache
from importlib import resources
from typing import NamedTuple
from xml.sax.saxutils import escape, quoteattr

from photostrip.visible import visible

Point = Sequence[float]  # x to the right, y down

SHAPES: dict[str, Sequence[Point]] = {  # corners of marks of size 1; a dot is a circle
    "triangle": ((0, -1.2), (1.1, 0.8), (-1.1, 0.8)),
    "square": ((-0.85, -0.85), (0.85, -0.85), (0.85, 0.85), (-0.85, 0.85)),
    "diamond": ((0, -1.2), (1.2, 0), (0, 1.2), (-1.2, 0)),
}


class Picture(NamedTuple):
    """A picture with the words that go with it."""

    name: str
    title: str
    caption: str
    svg: str  # for a page that has the style; its title and description are for readers who cannot see it

    def file(self) -> str:
        """Return the picture as a file of its own, with the style of the light page."""
        return visible(self.svg.replace(">", f">\n<style>\n{_style()}\n</style>\n", 1)) + "\n"

    def _repr_svg_(self) -> str:
        """Show the picture in a notebook."""
        return self.file()


@cache
def _style() -> str:
    """Return the style of pictures with the colours written out: many programs know no variables of CSS."""
    folder = resources.files("photostrip.report") / "templates"
    page = (folder / "report.css").read_text(encoding="utf-8")
    colours = dict(re.findall(r"--(\w+): (#\w+);", page[: page.index("@media")]))
    rules = (folder / "pictures.css").read_text(encoding="utf-8").strip()
    return re.sub(r"var\(--(\w+)\)", lambda variable: colours[variable[1]], rules)


def number(value: float) -> str:
    """Return a coordinate of the picture with one decimal, never -0."""
    return f"{value:z.1f}".removesuffix(".0")


def element(name: str, content: str = "", **attributes: str | float) -> str:
    """Return one element; underscores in names of attributes stand for hyphens, ``kind`` for ``class``."""
    parts = [f"<{name}"]
    for key, value in attributes.items():
        words = quoteattr(value) if isinstance(value, str) else f'"{number(value)}"'
        parts.append(f" {'class' if key == 'kind' else key.replace('_', '-')}={words}")
    parts.append(f">{content}</{name}>" if content else "/>")
    return "".join(parts)


def titled(hint: str) -> str:
    """Return what a pointer over an element shows."""
    return element("title", escape(hint)) if hint else ""


def text(place: Point, words: str, kind: str = "", anchor: str = "start") -> str:
    x, y = place
    return element("text", escape(words), x=float(x), y=float(y), kind=f"label {kind}".strip(), text_anchor=anchor)


def line(start: Point, end: Point, kind: str, hint: str = "") -> str:
    x1, y1, x2, y2 = map(float, (*start, *end))
    return element("line", titled(hint), x1=x1, y1=y1, x2=x2, y2=y2, kind=kind)


def joined(places: Iterable[Point]) -> str:
    return " ".join(f"{number(x)},{number(y)}" for x, y in places)


def path(places: Iterable[Point], kind: str) -> str:
    return element("polyline", points=joined(places), kind=kind)


def polygon(corners: Iterable[Point], kind: str, hint: str = "") -> str:
    return element("polygon", titled(hint), points=joined(corners), kind=kind)


def mark(place: Point, shape: str, kind: str, hint: str, size: float) -> str:
    """Return a triangle, a square, a diamond or a dot; the hint is what a pointer over it shows."""
    x, y = map(float, place)
    if shape == "dot":
        return element("circle", titled(hint), cx=x, cy=y, r=size * 0.6, kind=kind)
    return polygon([(x + dx * size, y + dy * size) for dx, dy in SHAPES[shape]], kind, hint)


def dots(places: Iterable[Point], size: float, kind: str) -> str:
    """Return many dots as one path: a tenth of the bytes, and no hints."""
    steps = "".join(f"M{number(x)} {number(y)}h0" for x, y in places)
    return element("path", d=steps, kind=f"dots {kind}", stroke_width=1.2 * size)


def picture(name: str, size: Point, content: Iterable[str], title: str, caption: str, description: str) -> Picture:
    head = element("title", escape(title), id=f"picture-{name}-title")
    head += element("desc", escape(description), id=f"picture-{name}-desc")
    svg = element(
        "svg",
        f"{head}\n" + "\n".join(content) + "\n",
        xmlns="http://www.w3.org/2000/svg",
        viewBox=f"0 0 {number(size[0])} {number(size[1])}",
        role="img",
        aria_labelledby=f"picture-{name}-title picture-{name}-desc",
    )
    return Picture(name=name, title=title, caption=caption, svg=svg)
