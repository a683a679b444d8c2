"""The ground on a picture: its scale, scale bars and north arrow, and ids where there is room for them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from photostrip.report.pictures import svg
from photostrip.report.pictures.chart import LEFT, TOP, WIDTH
from photostrip.report.pictures.ground.plan_view import Pair

LOWEST, HIGHEST = 220.0, 560.0  # of a picture
BARS_HEIGHT = 30.0  # room for the scale bars
LETTER, LETTER_HEIGHT = 6.4, 12.0  # size of a letter of an id on the picture
APART = 4.0  # ids side by side
MOST_TRIED = 600  # ids for which room is looked for


class Sheet(NamedTuple):
    """Where the ground lies on a picture."""

    low: Pair  # smallest place along and across, metres
    origin: svg.Point  # of ``low`` on the picture
    scale: float  # picture units for each metre of the ground
    height: float  # of the picture

    def place(self, spot: Pair) -> svg.Point:
        return self.origin[0] + (spot[0] - self.low[0]) * self.scale, self.origin[1] - (
            spot[1] - self.low[1]
        ) * self.scale


def sheet_of(places: Sequence[Pair], margin: float) -> Sheet:
    """Fit all places on the picture, with a margin around them."""
    along, across = [each[0] for each in places], [each[1] for each in places]
    length, depth = max(along) - min(along), max(across) - min(across)
    scale = min((WIDTH - 2 * margin) / max(length, 1e-9), (HIGHEST - TOP - 2 * margin) / max(depth, 1e-9))
    height = max(TOP + 2 * margin + depth * scale + BARS_HEIGHT, LOWEST)
    return Sheet(
        low=(min(along), min(across)),
        origin=((WIDTH - length * scale) / 2, height - BARS_HEIGHT - margin),
        scale=scale,
        height=height,
    )


def bars(sheet: Sheet, others: Iterable[tuple[float, str, str]] = ()) -> list[str]:
    """Draw the scale bar of the ground and further ones: length on the picture, words, kind."""
    ground = svg.nice(90.0 / sheet.scale)
    found, x, y = [], LEFT, sheet.height - 18.0
    for length, words, kind in ((ground * sheet.scale, f"ground {metres(ground)}", "bar"), *others):
        found += [svg.line((x, y), (x + length, y), kind), svg.text((x + length + 8.0, y + 4.5), words)]
        x += length + 30.0 + 7.5 * len(words)
    return found


def metres(size: float) -> str:
    return f"{size / 1000:g} km" if size >= 1000 else f"{size:g} m" if size >= 1 else f"{size * 1000:g} mm"


def north_arrow(direction: Pair) -> list[str]:
    """Draw an arrow to the north, its western half filled, with its letter before the tip."""
    x, y = WIDTH - 48.0, 44.0
    east, north = (direction[1], -direction[0]), direction

    def at(right: float, ahead: float) -> svg.Point:
        return x + right * east[0] + ahead * north[0], y - right * east[1] - ahead * north[1]

    tip, notch = at(0.0, 18.0), at(0.0, -8.0)
    letter = at(0.0, 28.0)
    return [
        svg.polygon([tip, at(-9.0, -15.0), notch], "north west"),
        svg.polygon([tip, at(9.0, -15.0), notch], "north east"),
        svg.text((letter[0], letter[1] + 4.5), "N", "north-letter", "middle"),
    ]


def ids(
    named: Iterable[tuple[str, svg.Point]], taken: Iterable[svg.Point], size: Pair, *, beside: bool = True
) -> list[str]:
    """Write ids beside or at their places where they cover no other id and no mark, the first ones first.

    size: of the picture.
    """
    found, boxes = [], _Boxes()
    for x, y in taken:
        boxes.add((x - 4.0, y - 4.0, x + 4.0, y + 4.0))
    for number, (name, (x, y)) in enumerate(named):
        if number >= MOST_TRIED:
            break
        wide = LETTER * len(name)
        around = (x + 7.0, y + 4.0), (x - 7.0 - wide, y + 4.0), (x - wide / 2, y - 8.0), (x - wide / 2, y + 16.0)
        for left, low in around if beside else ((x - wide / 2, y + 4.0),):
            box = left - APART / 2, low - LETTER_HEIGHT + 2.0, left + wide + APART / 2, low + 1.0
            if box[0] < 0 or box[1] < 0 or box[2] > size[0] or box[3] > size[1] or not boxes.free(box):
                continue
            boxes.add(box)
            found.append(svg.text((left, low), name, "id"))
            break
    return found


class _Boxes:
    """Rectangles that are taken, found again by the cell of a grid."""

    CELL = 24.0

    def __init__(self) -> None:
        self._cells: dict[tuple[int, int], list[tuple[float, float, float, float]]] = {}

    def _of(self, box: tuple[float, float, float, float]) -> Iterable[tuple[int, int]]:
        low, high = ([math.floor(value / self.CELL) for value in pair] for pair in (box[:2], box[2:]))
        return ((i, j) for i in range(low[0], high[0] + 1) for j in range(low[1], high[1] + 1))

    def add(self, box: tuple[float, float, float, float]) -> None:
        for cell in self._of(box):
            self._cells.setdefault(cell, []).append(box)

    def free(self, box: tuple[float, float, float, float]) -> bool:
        return not any(
            box[0] < other[2] and other[0] < box[2] and box[1] < other[3] and other[1] < box[3]
            for cell in self._of(box)
            for other in self._cells.get(cell, ())
        )
