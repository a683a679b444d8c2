"""Which photos and strips hold together, and by how many points."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from itertools import combinations
from typing import NamedTuple

from photostrip.notes import Document, counted
from photostrip.report.pictures import svg
from photostrip.report.pictures.chart import TOP, WIDTH, Entry, legend
from photostrip.report.pictures.ground.plan_view import Pair, Plan, middle
from photostrip.report.pictures.ground.sheet import bars, ids, north_arrow, sheet_of
from photostrip.report.pictures.svg import Picture

MOST_PHOTOS = 300  # more of them are drawn as strips
MOST_HINTS = 1000  # more ties have none
BOW = 0.16  # of a line, in shares of its length
MARGIN = 50.0
WIDEST_LINE = 5.0  # the line of the strongest tie
FEW_TIES = 3  # points from which a tie between strips is weak


class Tie(NamedTuple):
    one: str
    other: str
    points: int
    across: bool  # between two strips


def tie_pictures(document: Document, plan: Plan) -> list[Picture]:
    """Draw photos, or strips where there are many photos, tied by common points."""
    strip_of = {photo["id"]: photo["strip"] for photo in document["photos"]}
    on: dict[str, list[str]] = {}
    for row in document["residuals"]:
        if row["used"]:
            on.setdefault(row["photo"], []).append(row["point"])
    places = {spot.id: (spot.along, spot.across) for strip in plan.strips for spot in strip}
    whole = len(places) > MOST_PHOTOS and len(set(strip_of.values())) > 1
    if whole:
        nodes = _strip_places(places, strip_of)
        shared = _shared((strip_of[photo], points) for photo, points in on.items())
    else:
        nodes, shared = places, _shared(on.items())
    ties = [
        Tie(one=one, other=other, points=count, across=whole or strip_of[one] != strip_of[other])
        for (one, other), count in shared.items()
        if one in nodes and other in nodes
    ]
    if not ties:
        return []
    return [_picture(plan, nodes, ties, "strip" if whole else "photo")]


def _strip_places(places: dict[str, Pair], strip_of: dict[str, str]) -> dict[str, Pair]:
    by_strip: dict[str, list[Pair]] = {}
    for photo, place in places.items():
        by_strip.setdefault(strip_of[photo], []).append(place)
    return {strip: middle(own) for strip, own in by_strip.items()}


def _shared(rows: Iterable[tuple[str, list[str]]]) -> Counter[tuple[str, str]]:
    """Count the points that two have in common."""
    holders: dict[str, dict[str, None]] = {}
    for name, points in rows:
        for point in points:
            holders.setdefault(point, {})[name] = None
    return Counter(pair for names in holders.values() for pair in combinations(names, 2))


def _picture(plan: Plan, nodes: dict[str, Pair], ties: list[Tie], what: str) -> Picture:
    sheet = sheet_of(list(nodes.values()), MARGIN)
    at = {name: sheet.place(place) for name, place in nodes.items()}
    strongest = max(tie.points for tie in ties)
    radius = 4.0 if len(nodes) <= MOST_PHOTOS / 3 else 2.5
    hints = len(ties) <= MOST_HINTS
    drawn = [
        line
        for across in (False, True)
        for line in _lines([tie for tie in ties if tie.across == across], at, strongest if hints else 0)
    ]
    drawn += [svg.circle(place, radius, "node", f"{what} {name}") for name, place in at.items()]
    drawn += ids(at.items(), at.values(), (WIDTH, sheet.height - 30.0))
    both = {tie.across for tie in ties} == {True, False}
    entries = [Entry("in a strip", "tie-inside"), Entry("between strips", "tie-across")] if both else []
    weak = [tie for tie in ties if tie.across and tie.points < FEW_TIES] if what == "strip" else []
    drawn += [*legend(entries, TOP - 40.0), *bars(sheet), *north_arrow(plan.north)]
    groups = _groups(nodes, ties)
    caption = f"Lines join {what}s that have points in common"
    if hints:
        caption += f"; the more points, the thicker (at most {strongest} points). Pointing at a line shows how many"
    caption += "."
    if groups > 1:
        caption += f" The {what}s fall into {groups} groups that no point ties together."
    if weak:
        caption += f" {counted(len(weak), 'tie')} of fewer than {FEW_TIES} points."
    tied = {name for tie in ties for name in tie[:2]}
    lone = [name for name in nodes if name not in tied]
    if lone:
        caption += f" Without a common point: {', '.join(lone[:8])}."
    words = f"{counted(len(nodes), what)}, {counted(len(ties), 'tie')}; {counted(groups, 'connected group')}."
    return svg.picture("ties", (WIDTH, sheet.height), drawn, f"Ties between {what}s", caption, words)


def _lines(ties: list[Tie], at: dict[str, svg.Point], strongest: int) -> list[str]:
    """Draw ties as lines with hints, the strongest as the thickest; where that is 0, as one path."""
    if not ties:
        return []
    kind = "tie-across" if ties[0].across else "tie-inside"
    if not strongest:
        return [svg.element("path", d="".join(_curve(at[tie.one], at[tie.other]) for tie in ties), kind=kind)]
    found = []
    for tie in ties:
        title = svg.titled(f"{tie.one} and {tie.other}: {counted(tie.points, 'point')}")
        width = max(0.6, WIDEST_LINE * tie.points / strongest)
        curve = _curve(at[tie.one], at[tie.other])
        found.append(svg.element("path", title, d=curve, kind=kind, stroke_width=width))
    return found


def _curve(start: svg.Point, end: svg.Point) -> str:
    """Return a bow: photos that are no neighbours lie on one line, and each of their ties is to be seen."""
    (a, b), (c, d) = start, end
    middle = (a + c) / 2 + BOW * (d - b), (b + d) / 2 - BOW * (c - a)
    return "M{} {}Q{} {} {} {}".format(*map(svg.number, (a, b, *middle, c, d)))


def _groups(nodes: Iterable[str], ties: Iterable[Tie]) -> int:
    """Count the groups that hold together."""
    head = {name: name for name in nodes}

    def top(name: str) -> str:
        while head[name] != name:
            head[name] = head[head[name]]
            name = head[name]
        return name

    for tie in ties:
        head[top(tie.one)] = top(tie.other)
    return len({top(name) for name in head})
