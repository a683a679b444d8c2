"""Pictures of a strip: its plan with residual vectors and error ellipses, heights and precision along it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from photostrip.notes import counted
from photostrip.report.page.numbers import short
from photostrip.report.pictures import svg
from photostrip.report.pictures.plan_view import Plan, Spot, plan_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from photostrip.report.page.parts import Document
    from photostrip.report.pictures.svg import Axis, Picture

WIDTH, LOWEST, HIGHEST = 960.0, 220.0, 560.0  # of a picture
LEFT, RIGHT, TOP, BOTTOM = 70.0, 24.0, 64.0, 54.0  # margins
LONGEST = 70.0  # the longest vector or half axis on the plan
MOST_ELLIPSES = 90  # more of them are a grey cloud: new points go without
CROWDED = 12.0  # photos nearer to each other on the plan are drawn smaller
SHAPES = {"control": "triangle", "check": "square", "new": "dot", "photo": "diamond"}
WORDS = {"control": "control point", "check": "check point", "new": "new point", "photo": "photo"}


def strip_pictures(document: Document) -> list[Picture]:
    """Draw a result: its plan; heights along the strip and precision, where they are known."""
    plan = plan_of(document)
    found = [_plan_picture(document, plan)]
    if any(spot.up is not None for spot in plan.spots):
        found.append(_height_picture(document, plan))
    if document.get("precision", {}).get("along"):
        found.append(_precision_picture(document))
    return found


class Sheet(NamedTuple):
    """Where the ground and what is enlarged on it lie on the picture of the plan."""

    low: tuple[float, float]  # smallest place along and across, metres
    origin: tuple[float, float]  # of ``low`` on the picture
    scale: float  # picture units for each metre of the ground
    factor: float  # and of a residual or half axis
    height: float  # of the picture

    def place(self, spot: Spot) -> svg.Point:
        along, across = spot.along - self.low[0], spot.across - self.low[1]
        return self.origin[0] + along * self.scale, self.origin[1] - across * self.scale


def _sheet(spots: Sequence[Spot], longest: float) -> Sheet:
    """Fit all spots on the picture, with room for the longest vector around them."""
    along, across = [spot.along for spot in spots], [spot.across for spot in spots]
    length, width = max(along) - min(along), max(across) - min(across)
    scale = min((WIDTH - 2 * LONGEST) / max(length, 1e-9), (HIGHEST - TOP - 2 * LONGEST) / max(width, 1e-9))
    height = max(TOP + 2 * LONGEST + width * scale + 30.0, LOWEST)
    return Sheet(
        low=(min(along), min(across)),
        origin=((WIDTH - length * scale) / 2, height - 30.0 - LONGEST),
        scale=scale,
        factor=LONGEST / longest,
        height=height,
    )


def _plan_picture(document: Document, plan: Plan) -> Picture:
    everything = [*plan.spots, *(spot for strip in plan.strips for spot in strip)]
    longest = max(_longest(plan), 1e-9)
    bar = svg.nice(longest / 2)
    sheet = _sheet(everything, max(longest, bar))
    crowded = sum(spot.ellipse is not None for spot in plan.spots) > MOST_ELLIPSES
    spacing = max(spot.along - sheet.low[0] for spot in everything) * sheet.scale / max(len(plan.strips[0]), 1)
    drawn = [svg.path(map(sheet.place, strip), "flight") for strip in plan.strips]
    drawn += [_ellipse(spot, sheet) for spot in plan.spots if spot.ellipse and not (crowded and spot.role == "new")]
    drawn += [_vector(spot, sheet) for spot in plan.spots if spot.shift is not None]
    drawn += [_spot(spot, sheet, min(1.0, spacing / CROWDED)) for spot in everything]
    drawn += _legend([role for role in WORDS if any(spot.role == role for spot in everything)], TOP - 40.0)
    drawn += _bars(sheet, bar, plan.north)
    larger = sheet.factor / sheet.scale
    enlarged = f"{float(f'{larger:.2g}'):.0f}" if larger > 1 else short(larger, 2)
    caption = (
        f"Vectors: adjusted minus given in plan; ellipses: standard deviations{' of given points' if crowded else ''}. "
        f"Both are {enlarged} times as large as the ground. The first strip runs to the right."
    )
    counts = counted(len(plan.strips), "strip"), counted(len(plan.spots), "point")
    words = f"{', '.join(counts)}; the tables of control and check points have the numbers."
    return svg.picture("plan", (WIDTH, sheet.height), svg.Texts(f"Plan of {document['name']}", caption, words), drawn)


def _longest(plan: Plan) -> float:
    vectors = [math.hypot(*spot.shift) for spot in plan.spots if spot.shift is not None]
    return max([*vectors, *(spot.ellipse[0] for spot in plan.spots if spot.ellipse is not None)], default=0.0)


def _ellipse(spot: Spot, sheet: Sheet) -> str:
    a, b, angle = spot.ellipse or (0.0, 0.0, 0.0)
    x, y = sheet.place(spot)
    turn = f"rotate({svg.number(-math.degrees(angle))} {svg.number(x)} {svg.number(y)})"
    return svg.element("ellipse", cx=x, cy=y, rx=a * sheet.factor, ry=b * sheet.factor, transform=turn, kind="ellipse")


def _vector(spot: Spot, sheet: Sheet) -> str:
    along, across = spot.shift or (0.0, 0.0)
    x, y = sheet.place(spot)
    return svg.line((x, y), (x + along * sheet.factor, y - across * sheet.factor), f"vector {spot.role}")


def _spot(spot: Spot, sheet: Sheet, share: float) -> str:
    """Draw the mark of a spot, smaller in a long strip; its hint has its id and numbers."""
    hint = f"{WORDS[spot.role]} {spot.id}"
    if spot.shift is not None:
        hint += f", plan {short(math.hypot(*spot.shift), 3)} m"
    if spot.up is not None:
        hint += f", height {spot.up:+.3g} m"
    if spot.ellipse is not None:
        hint += f", ellipse {short(spot.ellipse[0], 3)} x {short(spot.ellipse[1], 3)} m"
    size = {"new": 3.0 * share, "photo": 4.0 * share}.get(spot.role, 5.0)
    return svg.mark(sheet.place(spot), SHAPES[spot.role], f"mark {spot.role}", hint, size)


def _legend(roles: Iterable[str], y: float) -> list[str]:
    """Give marks with their meaning in a row."""
    found, x = [], LEFT
    for role in roles:
        found += [svg.mark((x, y), SHAPES[role], f"mark {role}", "", 5.0), svg.text((x + 12.0, y + 4.5), WORDS[role])]
        x += 24.0 + 7.5 * len(WORDS[role])
    return found


def _bars(sheet: Sheet, residual: float, north: tuple[float, float]) -> list[str]:
    """Return the scale bars of the ground and of the residuals, and the direction of north."""
    ground = svg.nice(90.0 / sheet.scale)
    found, x, y = [], LEFT, sheet.height - 18.0
    for length, words, kind in (
        (ground * sheet.scale, f"ground {_metres(ground)}", "bar"),
        (residual * sheet.factor, f"residuals {_metres(residual)}", "bar vector"),
    ):
        found += [svg.line((x, y), (x + length, y), kind), svg.text((x + length + 8.0, y + 4.5), words)]
        x += length + 30.0 + 7.5 * len(words)
    middle = (WIDTH - 60.0, 40.0)
    tip = (middle[0] + 16.0 * north[0], middle[1] - 16.0 * north[1])
    tail = (middle[0] - 16.0 * north[0], middle[1] + 16.0 * north[1])
    return [*found, svg.line(tail, tip, "north"), svg.mark(tip, "dot", "north", "", 4.0),
            svg.text((tip[0] + 14.0 * north[0], tip[1] - 14.0 * north[1] + 4.5), "N", "", "middle")]  # fmt: skip


def _metres(size: float) -> str:
    return f"{size / 1000:g} km" if size >= 1000 else f"{size:g} m" if size >= 1 else f"{size * 1000:g} mm"


def _axes(xs: Sequence[float], ys: Sequence[float], height: float) -> tuple[Axis, Axis]:
    """Give axes that hold all numbers and zero, with a little room."""
    low, high = min(*ys, 0.0), max(*ys, 0.0)
    if high - low < 1e-12:  # noqa: PLR2004
        high = 1.0
    room = 0.06 * (high - low)
    low, high = low - room if low < 0 else 0.0, high + room
    spare = 0.02 * max(max(xs) - min(xs), 1e-6)
    return (
        svg.Axis(low=min(xs) - spare, high=max(xs) + spare, start=LEFT, end=WIDTH - RIGHT),
        svg.Axis(low=low, high=high, start=height - BOTTOM, end=TOP),
    )


def _height_picture(document: Document, plan: Plan) -> Picture:
    """Draw what is left in height at given points, and what was there before the polynomial."""
    spots = [spot for spot in plan.spots if spot.up is not None]
    ups = {spot.id: (spot.along / 1000, spot.up or 0.0) for spot in spots}
    before = [
        (ups[row["id"]][0], row["up"])
        for row in document["misclosures"]
        if document["adjustment"] == "polynomial" and row["id"] in ups and row.get("up") is not None
    ]
    height = 320.0
    places = [*ups.values(), *before]
    x, y = _axes([each[0] for each in places], [each[1] for each in places], height)
    drawn = svg.frame(x, y, ("along the strip, km", "m"))
    drawn += [svg.element("circle", cx=x(at), cy=y(size), r=4.5, kind="before") for at, size in before]
    for spot in spots:
        at, size = ups[spot.id]
        hint = f"{WORDS[spot.role]} {spot.id}: {size:+.3f} m"
        drawn.append(svg.line((x(at), y(0.0)), (x(at), y(size)), f"stem {spot.role}"))
        drawn.append(svg.mark((x(at), y(size)), SHAPES[spot.role], f"mark {spot.role}", hint))
    roles = [role for role in ("control", "check") if any(spot.role == role for spot in spots)]
    drawn += _legend(roles, 20.0)
    if before:
        drawn += [
            svg.element("circle", cx=LEFT + 270.0, cy=20.0, r=4.5, kind="before"),
            svg.text((LEFT + 282.0, 24.5), "control before the polynomial"),
        ]
    caption = "Adjusted minus given heights along the first strip" + (
        "; circles: strip minus given after the similarity, before the polynomial." if before else "."
    )
    largest = max(spots, key=lambda spot: abs(spot.up or 0.0))
    words = f"{len(spots)} given heights; the largest difference is {largest.up:+.3f} m at {largest.id}."
    return svg.picture("heights", (WIDTH, height), svg.Texts("Heights along the strip", caption, words), drawn)


CURVES = (
    ("plan", "points, plan", "curve-1"),
    ("height", "points, height", "curve-2"),
    ("centre_plan", "perspective centres, plan", "curve-3"),
    ("centre_height", "perspective centres, height", "curve-4"),
)


def _precision_picture(document: Document) -> Picture:
    """Draw the standard deviations of points and perspective centres along every strip."""
    rows = document["precision"]["along"]
    height = 320.0
    values = [row[key] for row in rows for key, *_ in CURVES if row[key] is not None]
    x, y = _axes([row["distance"] / 1000 for row in rows], values or [1.0], height)
    drawn = svg.frame(x, y, ("along the strip, km", "m"))
    place = LEFT
    for key, words, kind in CURVES:
        for strip in dict.fromkeys(row["strip"] for row in rows):
            curve = [
                (x(row["distance"] / 1000), y(row[key]))
                for row in rows
                if row["strip"] == strip and row[key] is not None
            ]
            drawn.append(svg.path(curve, f"curve {kind}"))
        drawn += [svg.line((place, 20.0), (place + 28.0, 20.0), f"curve {kind}"), svg.text((place + 34.0, 24.5), words)]
        place += 52.0 + 7.0 * len(words)
    caption = (
        "Standard deviations along each strip, mean of the points near each photo: they are smallest where the control"
        " stands."
    )
    points = document["precision"]["points"]
    worst = [f"{name} {short(points[name]['max'], 3)} m at {points[name]['worst']}" for name in ("plan", "height")
             if points[name]["max"] is not None]  # fmt: skip
    return svg.picture(
        "precision", (WIDTH, height), svg.Texts("Precision along the strip", caption, "; ".join(worst)), drawn
    )
