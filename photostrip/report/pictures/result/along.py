"""Along the strips: what is left at given points before and after, the polynomial, precision."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from photostrip.notes import Document, counted
from photostrip.report.page.numbers import short
from photostrip.report.pictures import svg
from photostrip.report.pictures.chart import WIDTH, Entry, Layout, framed, legend, multiples, span, steps
from photostrip.report.pictures.ground.plan import SHAPES, WORDS
from photostrip.report.pictures.ground.plan_view import Course, Dot, Pair, Plan, course_of
from photostrip.report.pictures.svg import Picture

MOST_STRIPS = 8  # that are drawn one below the other
AXES = "along", "across", "up"
KEYS = "x", "y", "z"  # of the polynomials
MOST_HINTS = 150  # more points of a strip have none
CURVE_STEPS = 48


class Uncorrected(NamedTuple):
    """A control point of a strip before its polynomial."""

    id: str
    at: float  # along the strip, m
    parts: tuple[float | None, ...]  # strip minus given: along, across, up


class Strip(NamedTuple):
    id: str
    after: list[tuple[Dot, float, tuple[float | None, ...]]]  # point, place along the strip, adjusted minus given
    before: list[Uncorrected]
    curve: dict[str, list[Pair]]  # what the polynomial takes out: place along the strip, size, by axis
    ends: Pair


def deformation_pictures(document: Document, plan: Plan) -> list[Picture]:
    """Draw differences at given points along each strip; nothing without given points."""
    strips = [each for each in _strips(document, plan) if each.after or each.before]
    if not strips:
        return []
    shown = sorted(sorted(strips, key=_largest, reverse=True)[:MOST_STRIPS], key=strips.index)
    layout = Layout(columns=3, height=150.0 if len(shown) > 1 else 230.0, number=3 * len(shown))
    drawn: list[str] = []
    for row, strip in enumerate(shown):
        for column, axis in enumerate(AXES):
            drawn += _panel(layout, 3 * row + column, strip, axis, len(document["strips"]))
    roles = [role for role in ("control", "check") if any(spot.role == role for s in shown for spot, *_ in s.after)]
    entries = [Entry(WORDS[role], f"mark {role}", SHAPES[role]) for role in roles]
    if any(strip.before for strip in shown):
        entries.append(Entry("control before", "before", "dot"))
    if any(strip.curve for strip in shown):
        entries.append(polynomial_entry(document))
    drawn += legend(entries)
    line = "each strip" if document["strips"] else "the line from the first photo to the last"
    caption = f"Differences at given points along {line}, along it, across it and in height: adjusted minus given"
    if any(strip.before for strip in shown):
        caption += "; circles: strip minus given after the similarity alone"
    if any(strip.curve for strip in shown):
        caption += "; the line: what the polynomial takes out, on the axis of the strip"
    if len(shown) < len(strips):
        caption += f". {len(shown)} of {len(strips)} strips, those with the largest differences"
    sizes = [(abs(part), spot.id, axis) for s in shown for spot, _, parts in s.after
             for part, axis in zip(parts, AXES, strict=True) if part is not None]  # fmt: skip
    words = f"{counted(len(shown), 'strip')}"
    if sizes:
        largest, name, axis = max(sizes)
        words += f"; the largest difference is {largest:.3f} m at {name}, {axis}"
    title = "Differences at given points" + (", before and after" if any(strip.before for strip in shown) else "")
    return [svg.picture("deformation", (WIDTH, layout.whole), drawn, title, f"{caption}.", f"{words}.")]


def _strips(document: Document, plan: Plan) -> list[Strip]:
    names = [strip["id"] for strip in document["strips"]] or [""]
    members = {row["id"]: row["strips"] for row in document["control"] if row["measured"]}
    polynomials = polynomials_of(document)
    spots = {spot.id: spot for spot in plan.spots}
    found = []
    for name, flown in zip(names, plan.strips, strict=False):
        if not flown:  # independent models without centres
            continue
        course = course_of(flown)
        after = [
            (spot, course.along((spot.along, spot.across)), _parts(course, spot.shift, spot.up))
            for spot in plan.spots
            if (spot.shift is not None or spot.up is not None) and (not name or name in members.get(spot.id, ()))
        ]
        before = [
            Uncorrected(row["id"], course.along((spot.along, spot.across)), _misclosed(plan, course, row))
            for row in document.get("misclosures", [])
            if row["strip"] == name and (spot := spots.get(row["id"]))
        ]
        weighed = polynomials.get(name)
        ends = 0.0, course.along((flown[-1].along, flown[-1].across))
        curve = _curves(weighed, before, ends)
        found.append(Strip(id=name, after=after, before=before, curve=curve, ends=ends))
    return found


def _parts(course: Course, shift: Pair | None, up: float | None) -> tuple[float | None, ...]:
    return (*(course.turned(shift) if shift is not None else (None, None)), up)


def _misclosed(plan: Plan, course: Course, row: Document) -> tuple[float | None, ...]:
    known = row["east"] is not None and row["north"] is not None
    return _parts(course, plan.turned(row["east"], row["north"]) if known else None, row["up"])


def polynomials_of(document: Document) -> dict[str, Document]:
    """Return the polynomial of each strip, its terms with their coefficients under each axis."""
    found = {row["strip"]: {**row, **{axis: {} for axis in KEYS}} for row in document.get("polynomials", [])}
    for row in document.get("polynomial_terms", []):
        found[row["strip"]][row["axis"]][row["term"]] = row["coefficient"]
    return found


def polynomial_at(block: Document, axis: str, x: float) -> float:
    total = 0.0
    for term, coefficient in block[axis].items():
        found = re.fullmatch(r"(?:1|X(?:\^(\d))?)", term)
        if found:  # the others vanish where Y is 0
            total += coefficient * x ** (0 if term == "1" else int(found[1] or 1))
    return total


def polynomial_entry(document: Document) -> Entry:
    taken = document["adjustment"] == "polynomial"
    return Entry("polynomial" if taken else "polynomial, not taken", "curve curve-2")


def origin_of(block: Document, places: Sequence[float]) -> float:
    """Return X of the first photo: the range of the control is known in X and on the plan."""
    return float(block["reach_from"]) - min(places)


def _curves(block: Document | None, before: Sequence[Uncorrected], ends: Pair) -> dict[str, list[Pair]]:
    if block is None or not block["degree"] or not before:
        return {}
    start = origin_of(block, [each.at for each in before])
    low, high = min(*ends, *(each.at for each in before)), max(*ends, *(each.at for each in before))
    places = [low + (high - low) * n / CURVE_STEPS for n in range(CURVE_STEPS + 1)]
    return {
        axis: [(at, -polynomial_at(block, key, at + start)) for at in places]
        for axis, key in zip(AXES, KEYS, strict=True)
        if block[key]
    }


def _largest(strip: Strip) -> float:
    return max((abs(part) for *_, parts in strip.after for part in parts if part is not None), default=0.0)


def _panel(layout: Layout, place: int, strip: Strip, axis: str, strips: int) -> list[str]:
    number = AXES.index(axis)
    before = [(each.id, each.at, each.parts[number]) for each in strip.before]
    after = [(spot, at, parts[number]) for spot, at, parts in strip.after]
    curve = strip.curve.get(axis, [])
    sizes = [size for size in (*(each[2] for each in before), *(each[2] for each in after)) if size is not None]
    sizes += [size for _, size in curve]
    reach = [*(each[1] for each in before), *(each[1] for each in after)]
    hints = len(after) <= MOST_HINTS
    panel = layout.panel(place, span((x / 1000 for x in (*strip.ends, *reach)), zero=False, room=0.02), span(sizes))
    title = f"strip {strip.id}, {axis}" if strips > 1 else axis
    drawn = framed(panel, ("km along the strip" if strips else "km from the first photo", "m"), title)
    if curve:
        drawn.append(steps(panel, [(x / 1000, size) for x, size in curve], "curve curve-2"))
    drawn += [
        svg.circle(panel.at(at / 1000, size), 4.5, "before", f"{name} before: {size:+.3f} m" if hints else "")
        for name, at, size in before
        if size is not None
    ]
    for spot, at, size in after:
        if size is not None:
            hint = f"{WORDS[spot.role]} {spot.id}: {size:+.3f} m" if hints else ""
            drawn.append(svg.line(panel.at(at / 1000, 0.0), panel.at(at / 1000, size), f"stem {spot.role}"))
            drawn.append(svg.mark(panel.at(at / 1000, size), SHAPES[spot.role], f"mark {spot.role}", hint, 4.0))
    return drawn


CURVES = (
    ("plan", "points, plan", "curve-1"),
    ("height", "points, height", "curve-2"),
    ("centre_plan", "perspective centres, plan", "curve-3"),
    ("centre_height", "perspective centres, height", "curve-4"),
)


def precision_pictures(document: Document) -> list[Picture]:
    """Draw the standard deviations of points and perspective centres along every strip."""
    rows: list[Document] = document.get("precision", {}).get("along") or []
    if not rows:
        return []
    sizes: dict[str, float] = {}
    for row in rows:
        sizes[row["strip"]] = max(sizes.get(row["strip"], 0.0), *(row[key] or 0.0 for key, *_ in CURVES))
    shown, high, drawn = multiples(sizes, "largest of them"), span(sizes.values()), []
    for place, strip in enumerate(shown.strips):
        own = [row for row in rows if row["strip"] == strip]
        panel = shown.layout.panel(place, span((row["distance"] / 1000 for row in own), zero=False, room=0.02), high)
        drawn += framed(panel, ("km along the strip", "m"), shown.titled(strip))
        for key, _, kind in CURVES:
            known = [(row["distance"] / 1000, row[key]) for row in own if row[key] is not None]
            if known:
                drawn.append(steps(panel, known, f"curve {kind}"))
    drawn += legend(Entry(words, f"curve {kind}") for _, words, kind in CURVES)
    caption = (
        "Standard deviations along each strip, mean of the points near each photo: they are smallest where the control"
        f" stands.{shown.some}"
    )
    points = document["precision"]["points"]
    worst = [f"{name} {short(points[name]['max'], 3)} m at {points[name]['worst']}" for name in ("plan", "height")
             if points[name]["max"] is not None]  # fmt: skip
    extent, words = (WIDTH, shown.layout.whole), "; ".join(worst) or "Not known."
    return [svg.picture("precision", extent, drawn, "Precision along the strip", caption, words)]
