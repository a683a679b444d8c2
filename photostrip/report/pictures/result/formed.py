"""How strips were formed: gaps between models, drift of the scale."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise

from photostrip.notes import Document, counted
from photostrip.report.pictures import svg
from photostrip.report.pictures.chart import WIDTH, Entry, framed, framed_by_photos, legend, multiples, span, steps
from photostrip.report.pictures.ground.plan_view import Dot, DrawnGrid, Pair, Plan, course_of
from photostrip.report.pictures.result.along import origin_of, polynomial_at, polynomial_entry, polynomials_of
from photostrip.report.pictures.svg import Picture

SHAPES = {"along": "dot", "across": "square", "up": "triangle"}
KINDS = {"along": "1", "across": "2", "up": "3"}
PPM = 1e6
MOST_MARKS = 600  # on a picture; more are lines without them


def junction_pictures(document: Document) -> list[Picture]:
    """Draw what neighbouring models differ by at the points that they have in common."""
    rows = document["junctions"] or document.get("links", [])
    rows = [row for row in rows if row["discrepancy_um_along"] is not None]
    if not rows:
        return []
    sizes: dict[str, float] = {}
    for row in rows:
        sizes[row["strip"]] = max(sizes.get(row["strip"], 0.0), _gap(row))
    shown, high, drawn = multiples(sizes, "largest gaps"), span(sizes.values()), []
    marked = len(KINDS) * sum(row["strip"] in shown.strips for row in rows) <= MOST_MARKS
    for place, strip in enumerate(shown.strips):
        own = [row for row in rows if row["strip"] == strip]
        panel = shown.layout.panel(place, (0.0, len(own) + 1.0), high)
        drawn += framed_by_photos(panel, [row["photo"] for row in own], ("photo", "µm"), shown.titled(strip))
        for name, kind in KINDS.items():
            values = [(n, row[f"discrepancy_um_{name}"]) for n, row in enumerate(own, 1)]
            drawn.append(steps(panel, values, f"curve curve-{kind} thin"))
            for n, size in values if marked else ():
                hint = f"photo {own[n - 1]['photo']}, {name}: {size:.1f} µm"
                drawn.append(svg.mark(panel.at(n, size), SHAPES[name], f"fill-{kind}", hint, 4.0))
    drawn += legend(
        Entry(name, f"fill-{kind}", SHAPES[name]) if marked else Entry(name, f"curve curve-{kind} thin")
        for name, kind in KINDS.items()
    )
    scale = "model" if document.get("links") else "photo"
    caption = f"Rms differences of the common points of two models at {scale} scale, at the photo that joins them."
    words = f"{counted(len(rows), 'junction')}; the largest gap is at photo {max(rows, key=_gap)['photo']}."
    extent = WIDTH, shown.layout.whole
    return [svg.picture("junctions", extent, drawn, "Gaps between models", caption + shown.some, words)]


def _gap(row: Document) -> float:
    return float(max(row[f"discrepancy_um_{name}"] for name in KINDS))


def scale_pictures(document: Document, plan: Plan) -> list[Picture]:
    """Draw what the adjustment did to the scale along each strip.

    A strip is formed of pairs with bases of length 1, so that scale of model and strip give the base that was formed.
    """
    grid = DrawnGrid(document)
    up = {photo["id"]: grid.up(photo) for photo in document["photos"] if photo["x"] is not None}
    scale = {row["strip"]: row["scale"] for row in document["absolute"]}
    formed = {
        (row["left"], row["right"]): row.get("base_formed")
        if "id" in row
        else row["scale_factor"] * scale[row["strip"]]
        for row in document["models"]
        if row["strip"] in scale
    }
    strips = zip(document["strips"], plan.strips, strict=False)
    found = {strip["id"]: _base_ratios(flown, formed, up) for strip, flown in strips if len(flown) > 2}
    found = {strip: values for strip, values in found.items() if len(values) > 1}
    return [_scale_picture(document, plan, found)] if found else []


def _base_ratios(
    flown: list[Dot], formed: Mapping[tuple[str, str], float | None], up: Mapping[str, float]
) -> list[Pair]:
    """Return the places of bases, km, and adjusted over formed length, ppm from the mean of the strip."""
    course, found = course_of(flown), []
    for left, right in pairwise(flown):
        before = formed.get((left.id, right.id))
        if before:
            after = math.dist((left.along, left.across, up[left.id]), (right.along, right.across, up[right.id]))
            middle = (left.along + right.along) / 2, (left.across + right.across) / 2
            found.append((course.along(middle) / 1000, (after / before - 1.0) * PPM))
    mean = math.fsum(ratio for _, ratio in found) / max(len(found), 1)
    return [(at, ratio - mean) for at, ratio in found]


def _scale_picture(document: Document, plan: Plan, found: dict[str, list[Pair]]) -> Picture:
    sizes = {strip: max(abs(size) for _, size in values) for strip, values in found.items()}
    shown = multiples(sizes, "largest drift")
    curves = {strip: _polynomial(document, plan, strip, found[strip]) for strip in shown.strips}
    high = span(size for strip in shown.strips for values in (found[strip], curves[strip]) for _, size in values)
    drawn: list[str] = []
    marked = sum(len(found[strip]) for strip in shown.strips) <= MOST_MARKS
    for place, strip in enumerate(shown.strips):
        panel = shown.layout.panel(place, span((at for at, _ in found[strip]), zero=False, room=0.02), high)
        drawn += framed(panel, ("km along the strip", "ppm"), shown.titled(strip))
        drawn.append(steps(panel, found[strip], "curve curve-1 thin"))
        if marked:
            drawn += [svg.circle(panel.at(*each), 2.6, "fill-1", f"{each[1]:+.0f} ppm") for each in found[strip]]
        if curves[strip]:
            drawn.append(steps(panel, curves[strip], "curve curve-2"))
    bases = "bases, adjusted against formed"
    entries = [Entry(bases, "fill-1", "dot") if marked else Entry(bases, "curve curve-1 thin")]
    drawn += legend([*entries, *([polynomial_entry(document)] if any(curves.values()) else [])])
    caption = (
        "How much longer each base became by the adjustment, against the mean of its strip: the drift of the scale."
    )
    worst = max(sizes, key=lambda strip: sizes[strip])
    words = f"{counted(len(sizes), 'strip')}; the largest departure is {sizes[worst]:.0f} ppm in strip {worst}."
    extent = WIDTH, shown.layout.whole
    return svg.picture("scale", extent, drawn, "Drift of the scale", caption + shown.some, words)


def _polynomial(document: Document, plan: Plan, strip: str, values: Sequence[Pair]) -> list[Pair]:
    """Return the change of scale by the polynomial at each base, ppm from its mean."""
    block = polynomials_of(document).get(strip)
    if block is None or not block["x"]:
        return []
    number = [each["id"] for each in document["strips"]].index(strip)
    course, spots = course_of(plan.strips[number]), {spot.id: spot for spot in plan.spots}
    given = [spots[row["id"]] for row in document["misclosures"] if row["strip"] == strip and row["id"] in spots]
    if not given:
        return []
    start, step = origin_of(block, [course.along((spot.along, spot.across)) for spot in given]), 1.0
    slopes = [
        (polynomial_at(block, "x", 1000 * at + start + step) - polynomial_at(block, "x", 1000 * at + start - step))
        / (2 * step)
        for at, _ in values
    ]
    mean = math.fsum(slopes) / len(slopes)
    return [(at, (slope - mean) * PPM) for (at, _), slope in zip(values, slopes, strict=True)]
