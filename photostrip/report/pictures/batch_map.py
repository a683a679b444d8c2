"""Where the strips of a batch lie: a picture for each body, the strips of all projects by their verdicts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import cos, dist, radians

from photostrip.notes import Document, counted
from photostrip.report.pictures import svg
from photostrip.report.pictures.chart import TOP, WIDTH, Entry, legend
from photostrip.report.pictures.ground.sheet import bars, ids, sheet_of

MARGIN = 60.0
NAMED = 40  # projects whose names stand in the description
ARROW_LENGTH = 18.0  # on the picture
SHAPES = {"good": "dot", "unverified": "square", "look": "diamond", "failed": "triangle"}


def batch_maps(outcomes: Sequence[Document]) -> list[svg.Picture]:
    """Draw the projects whose place on a body is known; of several bodies, that of the most projects first."""
    bodies: dict[float, list[Document]] = {}
    for each in outcomes:
        if each.get("track"):
            bodies.setdefault(each["body"], []).append(each)
    ranked = sorted(bodies.values(), key=len, reverse=True)
    return [_map(number, projects) for number, projects in enumerate(ranked, 1)]


def _map(number: int, projects: Sequence[Document]) -> svg.Picture:
    ends = [end for each in projects for strip in each["track"] for end in strip]
    middle = sum(latitude for _, latitude in ends) / len(ends)
    degree = radians(1.0) * projects[0]["body"]
    narrow = cos(radians(middle))

    def ground(end: Sequence[float]) -> tuple[float, float]:
        return degree * narrow * end[0], degree * end[1]

    sheet = sheet_of([ground(end) for end in ends], MARGIN)
    found = [*legend(_entries(projects)), *bars(sheet)]
    spots = [sheet.place(ground(each["track"][0][0])) for each in projects]
    for each, spot in zip(projects, spots, strict=True):
        found += [
            svg.line(sheet.place(ground(one)), sheet.place(ground(other)), f"track {each['status']}")
            for one, other in each["track"]
        ]
        hint = f"{each['project']}: {each['status']}"
        found.append(svg.mark(spot, SHAPES[each["status"]], f"verdict-mark {each['status']}", hint))
    ways = [_ahead(spot, sheet.place(ground(each["track"][0][1]))) for each, spot in zip(projects, spots, strict=True)]
    found += ids(zip(map(_name, projects), spots, strict=True), [*spots, *ways], (WIDTH, sheet.height - 30.0))
    places = ", ".join(f"{_name(each)} ({each['status']})" for each in projects[:NAMED])
    texts = (
        f"{counted(len(projects), 'project')} on a body of {projects[0]['body'] / 1000:.0f} km radius",
        f"A line for each strip, a mark at its first photo; north is up, true lengths at latitude {middle:.1f}°",
        f"Strips of {places}",
    )
    return svg.picture(f"map-{number}", (WIDTH, max(sheet.height, TOP)), found, *texts)


def _ahead(start: svg.Point, end: svg.Point) -> svg.Point:
    """Return where a strip goes from its first photo: its name stands elsewhere."""
    share = ARROW_LENGTH / max(dist(start, end), ARROW_LENGTH)
    return start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])


def _entries(projects: Iterable[Document]) -> list[Entry]:
    there = {each["status"] for each in projects}
    return [Entry(status, f"verdict-mark {status}", shape) for status, shape in SHAPES.items() if status in there]


def _name(outcome: Document) -> str:
    """Return the folder of a project, by which its result is called."""
    return str(outcome["output"] or outcome["project"])
