"""Photos and points on the plan: what is left at given points, how precise points are."""

from __future__ import annotations

import numpy as np

from photostrip.notes import Document, counted
from photostrip.report.page.tables import short
from photostrip.report.pictures.chart import (
    Areas,
    Bar,
    Floats,
    Layer,
    Line,
    Map,
    Marks,
    Names,
    Segments,
    chart,
    ellipse,
    ground_bar,
    length,
    nice,
)  # fmt: skip
from photostrip.report.pictures.places import Plan, numbers
from photostrip.report.pictures.svg import Picture

# in shares of the plan's extent: the vector or half axis in the middle, and the longest, at which others are cut off
TYPICAL, LONGEST = 0.02, 0.12
MOST_ELLIPSES = 90  # more of them are a grey cloud: new points go without
ROLES = {
    "new": ("new point", "dot", 3.0),
    "check": ("check point", "square", 5.0),
    "control": ("control point", "triangle", 5.0),
}
CLASSES = 6


def plan_picture(plan: Plan) -> Picture:
    document = plan.document
    at, moved = plan.points[:, :2], plan.shift[:, :2]
    everything = np.concatenate([at, plan.photos[np.isfinite(plan.photos).all(axis=1), :2]])
    extent = max(float(np.ptp(everything, axis=0).max()), 1.0) if len(everything) else 1.0
    sizes = np.concatenate([np.linalg.norm(moved, axis=1), plan.ellipse[:, 0]])
    sizes = sizes[np.isfinite(sizes) & (sizes > 0)]
    typical = max(float(np.median(sizes)), 1e-9) if len(sizes) else 1e-9
    factor, most = float(f"{TYPICAL * extent / typical:.2g}"), LONGEST * extent
    drawn = factor * moved
    drawn *= np.minimum(1.0, most / np.maximum(np.linalg.norm(drawn, axis=1, keepdims=True), 1e-9))
    axes = plan.ellipse * [factor, factor, 1.0]
    axes[:, :2] *= np.minimum(1.0, most / np.maximum(axes[:, :1], 1e-9))
    cut = factor * float(np.max(sizes, initial=0.0)) > most
    known = np.isfinite(plan.ellipse).all(axis=1)
    crowded = int(known.sum()) > MOST_ELLIPSES
    layers: list[Layer] = [Line(plan.photos[rows, :2], "photo thin dashed") for rows in plan.strips.values() if rows]
    shown = np.flatnonzero(known & ~(crowded & (plan.role == "new")))
    layers.append(Areas([at[n] + ellipse(*axes[n]) for n in shown], "open ellipse"))
    for role, (words, shape, size) in ROLES.items():
        rows = np.flatnonzero(plan.role == role)
        if len(rows):
            hints = [f"{words} {_hint(plan, n)}" for n in rows.tolist()]
            layers.append(Segments(at[rows], at[rows] + drawn[rows], role))
            layers.append(Marks(at[rows], role, shape, hints, words, size))
    seen = np.isfinite(plan.photos).all(axis=1)
    if seen.any():
        hints = [f"photo {name}" for name in plan.photo_ids]
        layers.append(Marks(plan.photos[:, :2], "photo open", "diamond", hints, "photo", 4.0))
    named = _named(document)
    ring = [n for n, name in enumerate(plan.ids) if name in named]
    if ring:
        hints = [f"point {plan.ids[n]}: {', '.join(named[plan.ids[n]])}" for n in ring]
        layers.append(Marks(at[ring], "failed open", "dot", hints, "named by a finding or warning", 15.0))
    order = sorted(range(len(plan.ids)), key=lambda n: (plan.ids[n] not in named, plan.role[n] == "new"))
    centres = np.flatnonzero(seen)
    names = [plan.ids[n] for n in order], [plan.photo_ids[n] for n in centres]
    first = sum(plan.ids[n] in named or plan.role[n] != "new" for n in order)
    places = np.concatenate([at[order[:first]], plan.photos[centres, :2], at[order[first:]]])
    layers.append(Names(places, [*names[0][:first], *names[1], *names[0][first:]]))
    bar = nice(2 * typical)
    caption = (
        f"Vectors: adjusted minus given in plan; ellipses: standard deviations{' of given points' if crowded else ''}. "
        f"Both are {factor:.0f} times as large as the ground{', the longest cut off' if cut else ''}. "
        f"{_towards(plan)} to the right."
    )
    description = (
        f"{counted(len(plan.strips), 'strip')}, {counted(len(plan.ids), 'point')}; "
        "the tables of control and check points have the numbers."
    )
    bars = [ground_bar(extent), Bar(bar * factor, f"residuals {length(bar)}", "soft")]
    title = f"Plan of {document['name']}"
    return chart("plan", (title, caption, description), [Map(layers)], bars=bars, north=plan.north)


def _towards(plan: Plan) -> str:
    if not next(iter(plan.strips.values()), []):
        return "East is"
    return "The first strip runs" if plan.document["strips"] else "The photos run"


def _hint(plan: Plan, n: int) -> str:
    """Name a point with its numbers."""
    shift, (a, b, _) = plan.shift[n], plan.ellipse[n]
    words = plan.ids[n]
    if np.isfinite(shift[:2]).all():
        words += f", plan {short(float(np.hypot(*shift[:2])), 3)} m"
    if np.isfinite(shift[2]):
        words += f", height {shift[2]:+.3g} m"
    return words + (f", ellipse {short(a, 3)} x {short(b, 3)} m" if np.isfinite(a) else "")


def _named(document: Document) -> dict[str, list[str]]:
    """Return the codes of the findings and warnings that name a point, by point."""
    codes: dict[str, list[str]] = {}
    warnings = [note for note in document["notes"] if note["severity"] == "warning"]
    for row in (*document.get("findings", ()), *warnings):
        for name in row.get("points") or ():
            codes.setdefault(name, []).extend([] if row["code"] in codes.get(name, ()) else [row["code"]])
    return codes


def precision_maps(plan: Plan) -> list[Picture]:
    """Draw the standard deviations of points in plan and height; nothing where they are not known."""
    points, axes = plan.document["points"], plan.document["frame"]["axes"]
    height = numbers(points, f"sigma_{'xyz'[axes.index('up')]}")[:, 0] if "up" in axes else np.full(len(points), np.nan)
    return [
        *_precision_map(plan, "plan", plan.ellipse[:, 0], "larger semi-axis of the standard error ellipse"),
        *_precision_map(plan, "height", height, "standard deviation of the height"),
    ]


def _precision_map(plan: Plan, part: str, sigma: Floats, what: str) -> list[Picture]:
    order = np.flatnonzero(np.isfinite(sigma))
    if not len(order):
        return []
    order = order[np.argsort(sigma[order], kind="stable")]  # the worst are drawn over the others, and named first
    at, ordered = plan.points[order, :2], sigma[order]
    step = nice(float(np.ptp(ordered)) / CLASSES)
    limits = [round(float(ordered[0] // step + n) * step, 9) for n in range(1, CLASSES)]
    limits = [limit for limit in limits if limit < ordered[-1]] or limits[:1]
    share = min(1.0, max(0.35, 12.0 / len(order) ** 0.5))
    layers: list[Layer] = []
    for level in range(len(limits) + 1):
        rows = np.flatnonzero(np.searchsorted(limits, ordered) == level)
        words = f"to {length(limits[level])}" if level < len(limits) else f"above {length(limits[-1])}"
        hints = [f"{plan.ids[order[n]]}: {short(float(ordered[n]), 3)} m" for n in rows]
        layers.append(
            Marks(at[rows], f"level-{level + 1}", "dot", hints, words, (4.0 + 1.3 * level) * share, len(order))
        )
    layers.append(Names(at[::-1], [plan.ids[n] for n in order[::-1]]))
    caption = f"The {what} of each point: strong, large dots are known worst, and are named first."
    worst = f"the largest is {short(float(ordered[-1]), 3)} m at {plan.ids[order[-1]]}"
    said = f"Precision in {part}", caption, f"{counted(len(order), 'point')}; {worst}."
    bars = [ground_bar(float(np.ptp(at, axis=0).max()))]
    return [chart(f"precision-{part}", said, [Map(layers)], bars=bars, north=plan.north)]
