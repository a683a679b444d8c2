"""Marks of given points: what is left at each of them on each photo, in pixels where its camera has some."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from heapq import nlargest
from math import hypot

from photostrip.notes import Document, counted
from photostrip.report.page.numbers import joined, ratio
from photostrip.report.page.parts import Facts, Part, Section, Table, Words
from photostrip.report.page.tables import number, tabulated, words
from photostrip.report.sections.project import cameras_of
from photostrip.report.sections.strip import ALL_SHOWN, worst_first

PIXELS, MICROMETRES = "px", "µm"
MOST_LISTED = 100  # marks: a page of a large block can still be mailed
DECIMALS = {PIXELS: 2, MICROMETRES: 1}


def marks_section(document: Document, *, everything: bool, most: int = ALL_SHOWN) -> Section:
    """Return the section; without parts where no given point has a residual on a photo."""
    place = {row["id"]: number for number, row in enumerate(document["control"])}
    marks = sorted(_marks(document), key=lambda mark: place[mark["point"]])
    text = "Measured minus computed from the adjusted coordinates: what shows here is a mark beside its point."
    parts: list[Part] = [Words(text)] if marks else []
    for unit in DECIMALS:
        own = [mark for mark in marks if mark["unit"] == unit]
        if own:
            parts.append(Facts(tuple(_summed(own))))
            parts.append(_table(own, unit, everything=everything, most=most))
    return Section("Marks of given points", tuple(parts))


def _table(marks: Sequence[Document], unit: str, *, everything: bool, most: int) -> Table:
    """Return the table of marks in one unit."""
    where = ("marks", "marks", "residuals")
    shown, note = worst_first(marks, _length, where, everything=everything, most=most)
    if len(shown) > MOST_LISTED:
        shown = nlargest(MOST_LISTED, marks, key=_length)
        note = f"the worst {MOST_LISTED} of {len(marks)}; `residuals` in result.json has all"
    tested = any(mark["test"] is not None for mark in shown)
    columns = (
        words("point", "point"),
        words("role", "role"),
        words("photo", "photo"),
        number("v x", lambda mark: _sized(mark["x"], unit, "+"), unit=unit),
        number("v y", lambda mark: _sized(mark["y"], unit, "+"), unit=unit),
        *((number("test", "test", ratio),) if tested else ()),
        words("", lambda mark: "" if mark["used"] else "not used"),
    )
    below = joined(note, "test: the larger of both over its standard deviation" if tested else "")
    return tabulated(shown, columns, note=below)


def _length(mark: Document) -> float:
    return float(mark["length"])


def _marks(document: Document) -> Iterator[Document]:
    """Give the rays of given points, photo by photo, with their residuals."""
    roles = {row["id"]: row["role"] for row in document["control"]}
    cameras = cameras_of(document)
    for row in document["residuals"].where(point=set(roles)) if "residuals" in document else ():  # not of a baseline
        x, y = row["vx_um"], row["vy_um"]
        if x is None or y is None:
            continue
        pixel = 1000.0 * (cameras.get(row["photo"], {}).get("pixel_size_mm") or 0.0)
        unit, size = (PIXELS, pixel) if pixel else (MICROMETRES, 1.0)
        tests = [row.get("test_x"), row.get("test_y")]
        yield {
            "point": row["point"],
            "role": roles[row["point"]],
            "photo": row["photo"],
            "x": x / size,
            "y": y / size,
            "unit": unit,
            "length": hypot(x, y) / size,
            "test": None if None in tests else max(map(abs, tests)),
            "used": row["used"],
        }


def _summed(marks: Sequence[Document]) -> Iterator[tuple[str, str]]:
    """Sum up the marks of control and of check points that took part."""
    for role in ("control", "check"):
        own = [mark for mark in marks if mark["used"] and mark["role"] == role]
        if own:
            unit = own[0]["unit"]
            rms = (sum(mark["length"] ** 2 for mark in own) / (2 * len(own))) ** 0.5
            worst = max(own, key=_length)
            largest = f"{_sized(worst['length'], unit)} {unit} at {worst['point']} on {worst['photo']}"
            yield role, f"{counted(len(own), 'mark')}, rms {_sized(rms, unit)} {unit}; largest {largest}"


def _sized(value: float, unit: str, sign: str = "-") -> str:
    return f"{value:{sign}z.{DECIMALS[unit]}f}"
