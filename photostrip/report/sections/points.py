"""Sections on given points, ties, photos, points, what was rejected and what is not determined."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from itertools import groupby
from math import fabs
from operator import itemgetter

from photostrip.notes import Document, before, counted, listed
from photostrip.report.page.numbers import joined, metres, micrometres, ratio, signed, unit
from photostrip.report.page.parts import DASH, Facts, Part, Section, Table, Words
from photostrip.report.page.tables import number, tabulated, words
from photostrip.report.sections.models import scale_word
from photostrip.report.sections.strip import ALL_SHOWN, WORST_SHOWN, column_of, elsewhere, worst_first

AXES = ("x", "y", "z")
LETTERS = {"east": "x", "north": "y", "up": "z"}  # of `use`
DIFFERENCES = ("dx", "dy", "dz")
IDS_NAMED = 12
WORST_POINTS = 8


def control_section(document: Document, *, everything: bool, most: int = ALL_SHOWN) -> Section:
    rows = [row for row in document["control"] if row["role"] == "control" and row["measured"] and row["use"] != "off"]
    text = (
        "Adjusted minus given. These points took part in the adjustment: what is left here is smaller than the errors "
        "between them."
    )
    if any(row["rejected"] for row in rows):
        text += (
            " Coordinates with a minus under `use` were found wrong and were not used; the last lines leave them out."
        )
    parts: list[Part] = [
        Words(text),
        given_table(document, rows, "control", everything=everything, most=most),
        *_unused(document),
    ]
    return Section("Control points", tuple(parts))


def given_table(document: Document, given: Sequence[Document], role: str, *, everything: bool, most: int) -> Table:
    """Return the table of given points of a role with their differences, the worst first."""
    axes, summary = document["frame"]["axes"], document["summary"]
    where = ("points", role, "control")
    shown, note = worst_first(given, lambda row: row["normalised"] or 0.0, where, everything=everything, most=most)
    columns = (
        words("point", "id"),
        words("use", _used),
        *(number(f"d {axis}", key, signed, "m") for axis, key in zip(axes, DIFFERENCES, strict=True)),
        number("plan", "plan_um", 1, "µm"),
        number("height", "height_um", 1, "µm"),
        number("ratio", "normalised", 2, rank=1),
        *(number(f"σ {axis}", _sigma(n), 3, "m", rank=2) for n, axis in enumerate(axes)),
        words("strips", lambda row: ", ".join(row["strips"]), rank=3),
    )
    plan, height = summary[role]["plan"], summary[role]["height"]
    rms, mean = summary[f"{role}_rms"], summary[f"{role}_mean"]
    blank = ("",) * (len(columns) - 8)
    foot = (
        (
            "rms",
            "",
            *(metres(rms[a]) for a in AXES),
            micrometres(plan["rms_um"]),
            micrometres(height["rms_um"]),
            ratio(summary[role]["normalised"]),
            *blank,
        ),
        ("mean", "", *(signed(mean[a]) for a in AXES), "", "", "", *blank),
        (
            "largest",
            "",
            *(largest(given, key, axis) for key, axis in zip(DIFFERENCES, axes, strict=True)),
            micrometres(plan["max_um"]),
            micrometres(height["max_um"]),
            _most(given),
            *blank,
        ),
    )
    other = "the adjustment" if "bundle" in document else "a model point"
    scale = scale_word(document)
    below = (
        f"plan, height: at {scale} scale; ratio: to the combined standard deviation of the given point and of {other}"
    )
    return tabulated(shown, columns, foot, joined(note, below))


def _sigma(place: int) -> Callable[[Document], float | None]:
    return lambda row: row[f"sigma_{place + 1}"]


def _used(row: Document) -> str:
    """Coordinates that count, then with a minus those that were found wrong."""
    if not row["rejected"]:
        return str(row["use"])
    kept = "".join(letter for letter in row["use"] if letter not in row["rejected"])
    return f"{kept} -{row['rejected']}".strip()


def largest(rows: Sequence[Document], key: str, axis: str) -> str:
    """Return the largest difference along an axis of those that were not rejected."""
    letter = LETTERS.get(axis, axis)
    rows = [row for row in rows if letter not in row.get("rejected", "")]
    return signed(max((value for row in rows if (value := row[key]) is not None), key=fabs, default=None))


def _most(rows: Sequence[Document]) -> str:
    known = (value for row in rows if (value := row["normalised"]) is not None and not row["rejected"])
    return ratio(max(known, default=None))


def _unused(document: Document) -> list[Part]:
    """Given points that were not used, and why."""
    rows = document["control"]
    refused = {each["id"] for each in document["not_determined"]}
    lost = [row["id"] for row in rows if not row["measured"]]
    off = [row["id"] for row in rows if row["measured"] and row["role"] == "control" and row["use"] == "off"]
    named = {
        "given, but not measured": [name for name in lost if name not in refused],
        "without coordinates": [name for name in lost if name in refused],
        "switched off": off,
    }
    facts = tuple((label, listed(names, IDS_NAMED)) for label, names in named.items() if names)
    return [Facts(facts)] if facts else []


def ties_section(document: Document, *, everything: bool) -> Section:
    """Differences of points that two strips share."""
    ties, axes = document["ties"], document["frame"]["axes"]
    if not ties:
        return Section("Ties between strips", (Words("The strips have no points in common."),))
    shown, note = worst_first(
        ties, lambda t: max(t["plan_um"], abs(t["height_um"])), ("points", "ties", "ties"), everything=everything
    )
    columns = (
        words("point", "id"),
        words("strips", lambda t: " – ".join(t["strips"])),
        *(number(f"d {axis}", key, signed, "m") for axis, key in zip(axes, DIFFERENCES, strict=True)),
        number("plan", "plan_um", 1, "µm"),
        number("height", "height_um", 1, "µm"),
    )
    foot = (
        (
            "rms",
            "",
            *(metres(_rms(ties, key)) for key in DIFFERENCES),
            *(micrometres(_rms(ties, key)) for key in ("plan_um", "height_um")),
        ),
    )
    below = "second strip minus first; the result is their mean"
    return Section("Ties between strips", (tabulated(shown, columns, foot, joined(note, below)),))


def _rms(rows: Sequence[Document], key: str) -> float:
    return float((sum(row[key] ** 2 for row in rows) / len(rows)) ** 0.5)


def image_section(document: Document) -> Section:
    """Photos and points with the largest image residuals under the final orientations."""
    summary = document["summary"]
    text = (
        "Photos and points come from one adjustment. "
        if "bundle" in document
        else "Every photo is oriented again on its adjusted points, so that orientations and points agree. "
    )
    text += f"rms of the image residuals {micrometres(summary['image_rms_um'])} µm."
    photos, points = _worst(document["photos"]), _worst(document["points"])
    rays = Counter(column_of(document["points"], "rays"))
    facts = Facts((("points by photos", ", ".join(f"{rays[n]} on {counted(n, 'photo')}" for n in sorted(rays))),))
    rms = number("rms", "image_rms_um", 1, "µm")
    worst_photos = tabulated(
        photos, (words("worst photos", "id"), rms, number("points", "points"), words("strip", "strip", rank=1))
    )
    worst_points = tabulated(
        points, (words("worst points", "id"), rms, number("photos", "rays"), words("role", "role", rank=1))
    )
    return Section("Image residuals", (Words(text), facts, worst_photos, worst_points))


def _worst(rows: Sequence[Document]) -> list[Document]:
    """Return the photos or points with the largest residuals."""
    size = column_of(rows, "image_rms_um")
    places = sorted(range(len(size)), key=lambda place: float(size[place] or 0.0), reverse=True)
    return [rows[place] for place in places[:WORST_POINTS]]


def rejected_section(document: Document, *, everything: bool) -> Section:
    rejected = standing_rejections(document)
    if not rejected:
        return Section("Rejected", (Words("Nothing was rejected."),))
    shown, note = worst_first(
        rejected,
        lambda r: abs(r["parallax_um"] or 0.0),
        ("rejections", "rejected", "rejected"),
        everything=everything,
    )
    columns = (
        words("point", lambda row: row["point"] or DASH),
        words("photos", lambda row: " – ".join(row[key] for key in ("photo", "other_photo") if row[key] is not None)),
        words("test", "test"),
        number("value", _tested("value")),
        number("limit", _tested("limit")),
        words("", lambda row: unit(row["unit"])),
        words("why", "reason", rank=1),
    )
    return Section("Rejected", (tabulated(shown, columns, note=note),))


def standing_rejections(document: Document) -> list[Document]:
    """Return the measurements that were rejected and not taken back."""
    return [row for row in document["rejected"] if not row["readmitted"]]


def _tested(key: str) -> Callable[[Document], str]:
    """Return what writes a value of a test: micrometres, or a ratio where it has no unit."""
    return lambda row: micrometres(row[key]) if row["unit"] else ratio(row[key])


def not_determined_section(document: Document, *, everything: bool) -> Section:
    """Points that have no coordinates, by reason."""
    parts: list[Part] = []
    for reason, names in missing_points(document):
        named = listed(names, len(names) if everything else IDS_NAMED)
        parts.append(Words(f"{counted(len(names), 'point')} ({reason}): {named}", mark="-"))
    return Section("Points without coordinates", tuple(parts) or (Words("None."),))


def missing_points(document: Document) -> list[tuple[str, list[str]]]:
    missing = sorted(document["not_determined"], key=itemgetter("reason"))
    return [(reason, [row["id"] for row in group]) for reason, group in groupby(missing, key=itemgetter("reason"))]


def notes_section(document: Document, *, everything: bool) -> Section:
    notes = document["notes"]
    limit = len(notes) if everything else 2 * WORST_SHOWN
    parts: list[Part] = [
        Words(f"{note['severity']}: {sentence_of(note)}", "look" if note["severity"] == "warning" else "", "-")
        for note in notes[:limit]
    ]
    if len(notes) > limit:
        parts.append(Words(elsewhere(len(notes) - limit, "notes", "notes", "notes")))
    return Section("Notes", tuple(parts) or (Words("None."),))


def sentence_of(note: Document) -> str:
    """Return a note with its place."""
    return before(note["file"], note["line"], note["column"]) + str(note["message"])
