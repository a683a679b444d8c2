"""What each photo shows of the ground, and how many show the same."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from photostrip.notes import Document, counted
from photostrip.report.pictures import svg
from photostrip.report.pictures.chart import LEFT, TOP, WIDTH
from photostrip.report.pictures.ground.plan_view import Pair, Plan, middle
from photostrip.report.pictures.ground.sheet import LETTER, LETTER_HEIGHT, bars, ids, north_arrow, sheet_of
from photostrip.report.pictures.ground.terrain import footprints, straightened
from photostrip.report.pictures.svg import Picture

MARGIN = 20.0
OVERLAP_CELLS = 240  # of the overlap along the picture
MOST_COLOURS = 6  # photos that are told apart by colour
STRAIGHT_EDGE = 0.5  # on the picture


def footprint_pictures(document: Document, plan: Plan) -> list[Picture]:
    """Draw the footprints; nothing where formats or orientations are not known."""
    outlines = footprints(document, plan)
    if not outlines:
        return []
    corners = [corner for outline in outlines.values() for corner in outline]
    sheet = sheet_of(corners, MARGIN)
    drawn_outlines = {photo: [sheet.place(corner) for corner in outline] for photo, outline in outlines.items()}
    counts = _overlap(list(drawn_outlines.values()), WIDTH / OVERLAP_CELLS)
    middles = [(photo, middle(outline)) for photo, outline in drawn_outlines.items() if _holds(outline, photo)]
    kind = "outline" if middles else "outline narrow"
    drawn = [_area(runs, f"overlap-{count}", WIDTH / OVERLAP_CELLS) for count, runs in sorted(counts.items())]
    drawn += [
        svg.polygon(straightened(outline, STRAIGHT_EDGE), kind, f"photo {photo}")
        for photo, outline in drawn_outlines.items()
    ]
    drawn += _scale(counts)
    drawn += bars(sheet)
    drawn += north_arrow(plan.north)
    drawn += ids(middles, (), (WIDTH, sheet.height - 30.0), beside=False)
    largest = max(outlines, key=lambda photo: _size(outlines[photo]))
    caption = (
        "What each photo shows of the ground as the adjusted points have it; colours: how many photos show the same. "
        f"The largest footprint is that of photo {largest}, {_size(outlines[largest]) / 1e6:.3g} km²."
    )
    words = f"{counted(len(outlines), 'footprint')}; at most {max(counts, default=0)} photos show the same ground."
    return [svg.picture("footprints", (WIDTH, sheet.height), drawn, "Footprints and overlap", caption, words)]


def _holds(outline: Sequence[svg.Point], name: str) -> bool:
    """Whether there is room for an id within an outline."""
    wide, high = (max(place) - min(place) for place in zip(*outline, strict=True))
    return bool(wide > LETTER * len(name) and high > LETTER_HEIGHT)


def _size(outline: Sequence[Pair]) -> float:
    following = [*outline[1:], outline[0]]
    return abs(sum(a * d - c * b for (a, b), (c, d) in zip(outline, following, strict=True))) / 2


Runs = list[tuple[int, int, int]]  # row, first cell, cell after the last


def _overlap(outlines: Iterable[Sequence[svg.Point]], cell: float) -> dict[int, Runs]:
    """Count the photos over each cell of the picture; returned are runs of cells in rows, by count."""
    changes: dict[int, dict[int, int]] = {}
    for outline in outlines:
        top, bottom = min(y for _, y in outline), max(y for _, y in outline)
        for row in range(math.ceil(top / cell - 0.5), math.ceil(bottom / cell - 0.5)):
            line = changes.setdefault(row, {})
            for number, x in enumerate(_crossings(outline, (row + 0.5) * cell)):
                at = math.ceil(x / cell - 0.5)
                line[at] = line.get(at, 0) + (-1 if number % 2 else 1)
    found: dict[int, Runs] = {}
    for row, line in sorted(changes.items()):
        count, start = 0, 0
        for at in sorted(line):
            if count and at > start:
                found.setdefault(min(count, MOST_COLOURS), []).append((row, start, at))
            count, start = count + line[at], at
    return found


def _crossings(outline: Sequence[svg.Point], y: float) -> list[float]:
    """Return where a line across the picture enters and leaves an outline, in turn."""
    return sorted(
        a + (y - b) / (d - b) * (c - a)
        for (a, b), (c, d) in zip(outline, [*outline[1:], outline[0]], strict=True)
        if (b <= y) != (d <= y)
    )


def _area(runs: Runs, kind: str, cell: float) -> str:
    """Draw cells as one path; runs that are alike in rows that follow each other are one rectangle."""
    tall: dict[tuple[int, int], tuple[int, int]] = {}
    parts: list[str] = []

    def close(span: tuple[int, int], rows: tuple[int, int]) -> None:
        x, y = (svg.number(value * cell) for value in (span[0], rows[0]))
        wide, high = (svg.number(value * cell) for value in (span[1] - span[0], rows[1] - rows[0] + 1))
        parts.append(f"M{x} {y}h{wide}v{high}h-{wide}z")

    for row, start, end in runs:
        rows = tall.get((start, end))
        if rows and rows[1] == row - 1:
            tall[start, end] = rows[0], row
            continue
        if rows:
            close((start, end), rows)
        tall[start, end] = row, row
    for span, rows in tall.items():
        close(span, rows)
    return svg.element("path", d="".join(parts), kind=f"overlap {kind}")


def _scale(counts: Iterable[int]) -> list[str]:
    found, x = [], LEFT
    for count in range(1, max(counts, default=0) + 1):
        words = f"{count}" if count < MOST_COLOURS else f"{MOST_COLOURS} and more"
        found += [
            svg.rectangle((x, TOP - 50.0), (22.0, 14.0), f"overlap overlap-{count}"),
            svg.text((x + 28.0, TOP - 38.5), words),
        ]
        x += 62.0
    return [*found, svg.text((x + 70.0 * (max(counts, default=0) >= MOST_COLOURS), TOP - 38.5), "photos")]
