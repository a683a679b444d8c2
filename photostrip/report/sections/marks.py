"""Marks of given points: what is left at each of them on each photo, in pixels where its camera has some."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from math import hypot

from photostrip.notes import Document, counted
from photostrip.report.page.numbers import joined, ratio
from photostrip.report.page.parts import Facts, Section, Words
from photostrip.report.page.tables import number, tabulated, words
from photostrip.report.sections.project import cameras_of
from photostrip.report.sections.strip import ALL_SHOWN, worst_first

PIXELS, MICROMETRES = "px", "µm"
DECIMALS = {PIXELS: 2, MICROMETRES: 1}


def marks_section(document: Document, *, everything: bool, most: int = ALL_SHOWN) -> Section:
    """Return the section; without parts where no given point has a residual on a photo."""
    place = {row["id"]: number for number, row in enumerate(document["control"])}
    marks, title = sorted(_marks(document), key=lambda mark: place[mark["point"]]), "Marks of given points"
    if not marks:
        return Section(title, ())
    where = ("marks", "marks", "residuals")
    shown, note = worst_first(marks, lambda mark: float(mark["length_um"]), where, everything=everything, most=most)
    tested = any(mark["test"] is not None for mark in shown)
    columns = (
        words("point", "point"),
        words("role", "role"),
        words("photo", "photo"),
        *(number(f"v {axis}", lambda mark, axis=axis: _sized(mark[axis], mark["unit"], "+")) for axis in "xy"),
        words("", "unit"),
        *((number("test", "test", ratio),) if tested else ()),
        words("", lambda mark: "" if mark["used"] else "not used"),
    )
    text = "Measured minus computed from the adjusted coordinates: what shows here is a mark beside its point."
    below = joined(note, "test: the larger of both over its standard deviation" if tested else "")
    return Section(title, (Words(text), Facts(tuple(_summed(marks))), tabulated(shown, columns, note=below)))


def _marks(document: Document) -> Iterator[Document]:
    """Give the rays of given points, photo by photo, with their residuals."""
    roles = {row["id"]: row["role"] for row in document["control"]}
    cameras, photos = cameras_of(document), document["residuals"]
    for row in photos.rows() if hasattr(photos, "rows") else photos:  # a million rays are not made at once
        given = [place for place, point in enumerate(row["points"]) if point in roles]
        if not given:
            continue
        pixel = 1000.0 * cameras.get(row["photo"], {}).get("pixel_size_mm", 0.0)
        unit, size = (PIXELS, pixel) if pixel else (MICROMETRES, 1.0)
        points, xs, ys, used = row["points"], row["vx_um"], row["vy_um"], row["used"]
        tests = list(zip(row["test_x"], row["test_y"], strict=True)) if "test_x" in row else None
        for place in given:
            x, y = xs[place], ys[place]
            if x is None or y is None:
                continue
            test = None if tests is None or None in tests[place] else max(map(abs, tests[place]))
            yield {
                "point": points[place],
                "role": roles[points[place]],
                "photo": row["photo"],
                "x": x / size,
                "y": y / size,
                "unit": unit,
                "length_um": hypot(x, y),
                "test": test,
                "used": used[place],
            }


def _summed(marks: Sequence[Document]) -> Iterator[tuple[str, str]]:
    """Sum up the marks that took part, of control and of check points, in each unit."""

    def kind(mark: Document) -> tuple[bool, str]:
        return mark["role"] == "check", mark["unit"]

    for (check, unit), group in groupby(sorted((mark for mark in marks if mark["used"]), key=kind), key=kind):
        own = list(group)
        rms = (sum(mark["x"] ** 2 + mark["y"] ** 2 for mark in own) / (2 * len(own))) ** 0.5
        worst = max(own, key=lambda mark: float(mark["length_um"]))
        largest = f"{_sized(hypot(worst['x'], worst['y']), unit)} {unit} at {worst['point']} on {worst['photo']}"
        text = f"{counted(len(own), 'mark')}, rms {_sized(rms, unit)} {unit}; largest {largest}"
        yield "check" if check else "control", text


def _sized(value: float, unit: str, sign: str = "-") -> str:
    return f"{value:{sign}z.{DECIMALS[unit]}f}"
