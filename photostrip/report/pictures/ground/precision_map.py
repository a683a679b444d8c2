"""Where points are known well and where not: their standard deviations on the plan."""

from __future__ import annotations

from collections.abc import Sequence

from photostrip.notes import Document, counted
from photostrip.report.page.numbers import short
from photostrip.report.pictures import svg
from photostrip.report.pictures.chart import LEFT, TOP, WIDTH
from photostrip.report.pictures.ground.plan_view import Dot, Plan
from photostrip.report.pictures.ground.sheet import bars, ids, metres, north_arrow, sheet_of
from photostrip.report.pictures.svg import Picture

CLASSES = 6
SMALLEST_DOT, LARGEST_DOT = 2.5, 6.5  # dots of the first and the last class: they differ without colour, too
MARGIN = 24.0
MOST_HINTS = 1500  # more points have none
CROWDED = 5.0  # smaller dots where there are many
WORST_NAMED = 40  # ids that are tried


def precision_maps(document: Document, plan: Plan) -> list[Picture]:
    """Draw the standard deviations in plan and height; nothing where they are not known."""
    rows = {row["id"]: row for row in document["points"]}
    found = []
    for part, title in (("plan", "Precision in plan"), ("height", "Precision in height")):
        sizes = {spot.id: _sigma(document, rows[spot.id], part) for spot in plan.spots}
        known = [(spot, size) for spot in plan.spots if (size := sizes[spot.id]) is not None]
        if known:
            found.append(_map(plan, part, title, known))
    return found


def _sigma(document: Document, row: Document, part: str) -> float | None:
    """Return the larger semi-axis in plan, or the standard deviation of the height."""
    if part == "plan":
        return row.get("ellipse_a")
    axes = document["frame"]["axes"]
    return row.get(f"sigma_{'xyz'[axes.index('up')]}") if "up" in axes else None


def _map(plan: Plan, part: str, title: str, known: Sequence[tuple[Dot, float]]) -> Picture:
    sheet = sheet_of([(spot.along, spot.across) for spot in plan.everything], MARGIN)
    limits = _limits([size for _, size in known])
    share = min(1.0, max(0.35, 30.0 / len(known) ** 0.5 / CROWDED))
    ordered = sorted(known, key=lambda each: each[1])
    places = [(spot.id, sheet.place((spot.along, spot.across))) for spot, _ in ordered]
    by_level: dict[int, list[int]] = {}
    for number, (_, size) in enumerate(ordered):
        by_level.setdefault(sum(size > limit for limit in limits), []).append(number)
    drawn: list[str] = []
    for level, numbers in by_level.items():
        radius = _radius(level) * share
        if len(known) > MOST_HINTS:
            drawn.append(svg.dots([places[n][1] for n in numbers], radius, f"dots-{level + 1}"))
        else:
            drawn += [
                svg.circle(places[n][1], radius, f"level-{level + 1}", f"{places[n][0]}: {short(ordered[n][1], 3)} m")
                for n in numbers
            ]
    x = LEFT
    for level in range(len(limits) + 1):
        words = f"to {metres(limits[level])}" if level < len(limits) else f"above {metres(limits[-1])}"
        drawn += [
            svg.circle((x, TOP - 40.0), _radius(level), f"level-{level + 1}"),
            svg.text((x + 12.0, TOP - 35.5), words),
        ]
        x += 40.0 + 7.5 * len(words)
    drawn += [*bars(sheet), *north_arrow(plan.north)]
    worst = places[::-1][:WORST_NAMED]
    drawn += ids(worst, [at for _, at in worst], (WIDTH, sheet.height - 30.0))
    spot, largest = max(known, key=lambda each: each[1])
    what = "larger semi-axis of the standard error ellipse" if part == "plan" else "standard deviation of the height"
    caption = f"The {what} of each point: strong, large dots are known worst. The ids are those of the worst points."
    words = f"{counted(len(known), 'point')}; the largest is {short(largest, 3)} m at {spot.id}."
    return svg.picture(f"precision-{part}", (WIDTH, sheet.height), drawn, title, caption, words)


def _radius(level: int) -> float:
    return SMALLEST_DOT + (LARGEST_DOT - SMALLEST_DOT) * level / (CLASSES - 1)


def _limits(sizes: Sequence[float]) -> list[float]:
    """Return round limits of classes from the smallest to the largest size."""
    low, high = min(sizes), max(sizes)
    step = svg.nice((high - low) / CLASSES)
    start = (low // step + 1) * step
    return [round(start + n * step, 9) for n in range(CLASSES - 1) if start + n * step < high] or [round(start, 9)]
