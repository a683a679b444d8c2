"""The plan of a result: photos and points with residual vectors and error ellipses."""

from __future__ import annotations

import math
from collections.abc import Container

from photostrip.notes import Document, counted
from photostrip.report.page.numbers import short
from photostrip.report.pictures import svg
from photostrip.report.pictures.chart import TOP, WIDTH, Entry, legend
from photostrip.report.pictures.ground.plan_view import Dot, Plan
from photostrip.report.pictures.ground.sheet import Sheet, bars, ids, metres, north_arrow, sheet_of
from photostrip.report.pictures.svg import Picture

LONGEST = 70.0  # the longest vector or half axis on the plan
MOST_ELLIPSES = 90  # more of them are a grey cloud: new points go without
MOST_HINTS = 1500  # of more points and photos new points are dots without hints
CROWDED = 12.0  # photos nearer to each other on the plan are drawn smaller
SHAPES = {"control": "triangle", "check": "square", "new": "dot", "photo": "diamond"}
WORDS = {"control": "control point", "check": "check point", "new": "new point", "photo": "photo"}
FIRST = "control", "check", "photo", "new"  # whose ids get room first, after those of points named by findings
RING = 9.0


def plan_picture(document: Document, plan: Plan) -> Picture:
    everything = plan.everything
    longest = max(_longest(plan), 1e-9)
    bar = svg.nice(longest / 2)
    sheet = sheet_of([(spot.along, spot.across) for spot in everything], LONGEST)
    factor = LONGEST / max(longest, bar)
    crowded = sum(spot.ellipse is not None for spot in plan.spots) > MOST_ELLIPSES
    share = mark_share(plan, sheet)
    drawn = [svg.path((place_of(spot, sheet) for spot in strip), "flight") for strip in plan.strips if strip]
    drawn += [
        _ellipse(spot, sheet, factor) for spot in plan.spots if spot.ellipse and not (crowded and spot.role == "new")
    ]
    drawn += [_vector(spot, sheet, factor) for spot in plan.spots if spot.shift is not None]
    many = len(everything) > MOST_HINTS
    if many:
        new = [place_of(spot, sheet) for spot in everything if spot.role == "new"]
        drawn.append(svg.dots(new, 1.8 * share, "dots-new"))
    drawn += [_spot(spot, sheet, share) for spot in everything if not (many and spot.role == "new")]
    named = _named(document)
    drawn += [
        svg.circle(place_of(spot, sheet), RING, "ring", f"point {spot.id}: {', '.join(named[spot.id])}")
        for spot in plan.spots
        if spot.id in named
    ]
    ring = (
        [Entry("named by a finding or warning", "ring", "dot")] if any(spot.id in named for spot in plan.spots) else []
    )
    drawn += legend([*roles(everything), *ring], TOP - 40.0)
    drawn += bars(sheet, [(bar * factor, f"residuals {metres(bar)}", "bar vector")])
    drawn += north_arrow(plan.north)
    drawn += _ids(everything, sheet, named)
    larger = factor / sheet.scale
    enlarged = f"{float(f'{larger:.2g}'):.0f}" if larger > 1 else short(larger, 2)
    caption = (
        f"Vectors: adjusted minus given in plan; ellipses: standard deviations{' of given points' if crowded else ''}. "
        f"Both are {enlarged} times as large as the ground. "
        f"{'East is' if not plan.strips[0] else 'The first strip runs' if document['strips'] else 'The photos run'} "
        "to the right."
    )
    counts = counted(len(plan.strips), "strip"), counted(len(plan.spots), "point")
    words = f"{', '.join(counts)}; the tables of control and check points have the numbers."
    return svg.picture("plan", (WIDTH, sheet.height), drawn, f"Plan of {document['name']}", caption, words)


def place_of(spot: Dot, sheet: Sheet) -> svg.Point:
    return sheet.place((spot.along, spot.across))


def mark_share(plan: Plan, sheet: Sheet) -> float:
    """Return how large marks are drawn: smaller in a long strip."""
    length = max(spot.along - sheet.low[0] for spot in plan.everything) * sheet.scale
    return min(1.0, length / max(1, *map(len, plan.strips)) / CROWDED)


def roles(spots: list[Dot]) -> list[Entry]:
    found = {spot.role for spot in spots}
    return [Entry(WORDS[role], f"mark {role}", SHAPES[role]) for role in WORDS if role in found]


def _named(document: Document) -> dict[str, list[str]]:
    """Return the codes of the findings and warnings that name a point, by point."""
    found: dict[str, list[str]] = {}
    warnings = [note for note in document["notes"] if note["severity"] == "warning"]
    for each in (*document.get("findings", ()), *warnings):
        for name in each.get("points") or ():
            codes = found.setdefault(name, [])
            codes += [] if each["code"] in codes else [each["code"]]
    return found


def _ids(spots: list[Dot], sheet: Sheet, named: Container[str]) -> list[str]:
    """Write the ids of spots where there is room, those of points named by findings first, then of given points."""
    places = [place_of(spot, sheet) for spot in spots]

    def rank(number: int) -> tuple[bool, int]:
        spot = spots[number]
        return spot.role == "photo" or spot.id not in named, FIRST.index(spot.role)

    order = sorted(range(len(spots)), key=rank)
    return ids([(spots[n].id, places[n]) for n in order], places, (WIDTH, sheet.height - 30.0))


def _longest(plan: Plan) -> float:
    vectors = [math.hypot(*spot.shift) for spot in plan.spots if spot.shift is not None]
    return max([*vectors, *(spot.ellipse[0] for spot in plan.spots if spot.ellipse is not None)], default=0.0)


def _ellipse(spot: Dot, sheet: Sheet, factor: float) -> str:
    a, b, angle = spot.ellipse or (0.0, 0.0, 0.0)
    x, y = place_of(spot, sheet)
    turn = f"rotate({svg.number(-math.degrees(angle))} {svg.number(x)} {svg.number(y)})"
    return svg.element("ellipse", cx=x, cy=y, rx=a * factor, ry=b * factor, transform=turn, kind="ellipse")


def _vector(spot: Dot, sheet: Sheet, factor: float) -> str:
    along, across = spot.shift or (0.0, 0.0)
    x, y = place_of(spot, sheet)
    return svg.line((x, y), (x + along * factor, y - across * factor), f"vector {spot.role}")


def _spot(spot: Dot, sheet: Sheet, share: float) -> str:
    """Draw the mark of a spot; its hint has its id and numbers."""
    hint = f"{WORDS[spot.role]} {spot.id}"
    if spot.shift is not None:
        hint += f", plan {short(math.hypot(*spot.shift), 3)} m"
    if spot.up is not None:
        hint += f", height {spot.up:+.3g} m"
    if spot.ellipse is not None:
        hint += f", ellipse {short(spot.ellipse[0], 3)} x {short(spot.ellipse[1], 3)} m"
    size = {"new": 3.0 * share, "photo": 4.0 * share}.get(spot.role, 5.0)
    return svg.mark(place_of(spot, sheet), SHAPES[spot.role], f"mark {spot.role}", hint, size)
