"""On the plan: given points, precision, what photos show of the ground, which of them hold together.

The ground under a photo is the plane through the points near by. In simulated relief the rms errors at the corners of
photos, in percent of their sides, are 0.9 with hills of 60 m from 1530 m, 3.1 with hills of 200 m, 1.5 where hills of
60 m stand on a slope of 18 %; distortion is left aside.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import combinations, pairwise

import numpy as np

from photostrip.notes import Document, counted, listed
from photostrip.report.page.tables import short
from photostrip.report.pictures.chart import (
    MOST_NAMED,
    Areas,
    Bar,
    Floats,
    Layer,
    Line,
    Map,
    Marks,
    Names,
    Segments,
    box,
    chart,
    ellipse,
    ground_bar,
    length,
    nice,
)
from photostrip.report.pictures.places import Plan, format_of, grouped, numbers, rays_of, shortened
from photostrip.report.pictures.svg import Picture
from photostrip.report.sections.project import cameras_of

# in shares of the plan's extent: the vector or half axis in the middle, and the longest, at which others are cut off
TYPICAL, LONGEST = 0.03, 0.12
MANY = 100  # photos, from which their marks are small
WORST_NAMED = 25  # points on a map of precision
MOST_ELLIPSES = 90  # more of them are a grey cloud: new points go without
ROLES = {
    "new": ("new point", "dot", 3.0),
    "check": ("check point", "square", 5.0),
    "control": ("control point", "triangle", 5.0),
}
RANKS = {"control": 1, "check": 2, "photo": 3, "new": 4}  # of names; those of findings go before
CLASSES = 6


def plan_picture(plan: Plan) -> Picture:
    document = plan.document
    at, moved = plan.points[:, :2], plan.shift[:, :2]
    extent = max(_extent(plan, plan.everything), 1.0)
    known = np.isfinite(plan.ellipse).all(axis=1)
    crowded = int(known.sum()) > MOST_ELLIPSES
    shown = np.flatnonzero(known & ~(crowded & (plan.role == "new")))
    sizes = np.concatenate([np.linalg.norm(moved, axis=1), plan.ellipse[shown, 0]])
    sizes = sizes[np.isfinite(sizes) & (sizes > 0)]
    typical = max(float(np.median(sizes)), 1e-9) if len(sizes) else 1e-9
    factor, most = float(f"{TYPICAL * extent / typical:.2g}"), LONGEST * extent / min(plan.map_rows, 2)
    drawn = factor * moved
    drawn *= np.minimum(1.0, most / np.maximum(np.linalg.norm(drawn, axis=1, keepdims=True), 1e-9))
    axes = plan.ellipse * [factor, factor, 1.0]
    axes[:, :2] *= np.minimum(1.0, most / np.maximum(axes[:, :1], 1e-9))
    cut = factor * float(np.max(sizes, initial=0.0)) > most
    layers: list[Layer] = [
        Line(plan.photos[rows, :2], "photo thin dashed") for strip, rows in plan.strips.items() if strip and rows
    ]
    layers.append(Areas([at[n] + ellipse(*axes[n]) for n in shown], "open ellipse"))
    for role, (words, shape, size) in ROLES.items():
        rows = np.flatnonzero(plan.role == role)
        hints = [f"{words} {_hint(plan, n)}" for n in rows.tolist()]
        layers.append(Segments(at[rows], at[rows] + drawn[rows], role))
        layers.append(Marks(at[rows], role, shape, hints, words, size))
    centres = np.flatnonzero(np.isfinite(plan.photos).all(axis=1))
    hints = [f"photo {plan.photo_ids[n]}" for n in centres]
    size = 4.0 if len(centres) <= MANY else 2.5
    layers.append(Marks(plan.photos[centres, :2], "photo open", "diamond", hints, "photo", size))
    named = _named(document)
    ring = [n for n, name in enumerate(plan.ids) if name in named]
    hints = [f"point {plan.ids[n]}: {', '.join(named[plan.ids[n]])}" for n in ring]
    layers.append(Marks(at[ring], "failed open", "dot", hints, "named by a finding or warning", 15.0))
    called, left_out = shortened(plan.photo_ids)
    names = [*plan.ids, *(called[plan.photo_ids[n]] for n in centres)]
    ranks = [0 if name in named else RANKS[role] for name, role in zip(plan.ids, plan.role.tolist(), strict=True)]
    rank = np.array(ranks + [RANKS["photo"]] * len(centres))
    order, counts = np.argsort(rank, kind="stable"), [int((rank <= last).sum()) for last in range(RANKS["new"])]
    first = max((count for count in counts if count <= MOST_NAMED), default=MOST_NAMED)
    layers.append(Names(np.concatenate([at, plan.photos[centres, :2]])[order], [names[n] for n in order], first=first))
    bar = nice(2 * typical)
    caption = (
        f"Vectors: adjusted minus given in plan; ellipses: standard deviations{' of given points' if crowded else ''}; "
        f"both enlarged {factor:.0f} times against the ground{', the longest cut off' if cut else ''}. "
        f"{_towards(plan)} to the right.{left_out}"
    )
    description = (
        f"{counted(len(plan.strips), 'strip')}, {counted(len(plan.ids), 'point')}; "
        "the tables of control and check points have the numbers."
    )
    said = f"Plan of {document['name']}", caption, description
    return _map(plan, "plan", said, layers, extent, Bar(bar * factor, f"residuals {length(bar)}", "soft"))


def _map(
    plan: Plan, name: str, words: tuple[str, str, str], layers: Sequence[Layer], extent: float, *bars: Bar
) -> Picture:
    """Draw layers to scale, in as many rows as the plan takes, with a bar for an extent on the ground, metres."""
    of_ground = Map(layers, rows=plan.map_rows)
    return chart(name, words, [of_ground], bars=[ground_bar(extent), *bars], north=plan.north)


def _extent(plan: Plan, at: Floats) -> float:
    """Return how far a map of places reaches, each of its rows."""
    return float(np.ptp(at, axis=0).max()) / plan.map_rows if len(at) else 1.0


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
    worst_named = order[: -WORST_NAMED - 1 : -1]
    layers.append(Names(plan.points[worst_named, :2], [plan.ids[n] for n in worst_named]))
    caption = f"The {what} of each point: strong, large dots are known worst; the worst have their names."
    worst = f"the largest is {short(float(ordered[-1]), 3)} m at {plan.ids[order[-1]]}"
    said = f"Precision in {part}", caption, f"{counted(len(order), 'point')}; {worst}."
    return [_map(plan, f"precision-{part}", said, layers, _extent(plan, at))]


NEAR = 1.5  # distances to the points of a photo, within which all points tell of the ground
STEADY = 0.15  # extent of points, in distances to them, from which their plane may slope
LOWEST_RAY = 0.1  # descent towards the plane, in principal distances, from which a ray meets the ground
SQUARE_KM = 1e6  # m²
CELLS = 140  # of the overlap along the longer side
MOST_COLOURS = 6  # photos that are told apart by colour


def footprints(plan: Plan) -> dict[str, Floats]:
    """Return the corners of what each photo shows of the ground on the plan.

    What looks at the sky or hardly down is cut off; a photo that shows nothing else, or has no points, has none.
    """
    cameras, rays = cameras_of(plan.document), rays_of(plan.document)
    rows = plan.rows(rays.point).tolist()
    seen = grouped(pair for pair in zip(rays.photo, rows, strict=True) if pair[1] >= 0)
    outlines = {}
    for photo, own in seen.items():
        camera, n = cameras.get(photo), plan.photo_row.get(photo, -1)
        held = format_of(camera) if camera else None
        centre = plan.photos[n]
        if camera is None or held is None or n < 0 or not np.isfinite(plan.axes[n]).all():
            continue
        reach = float(np.sqrt(np.mean(np.sum((plan.points[own] - centre) ** 2, axis=1))))
        middle = plan.points[own, :2].mean(axis=0)
        near = plan.points[(np.abs(plan.points[:, :2] - middle) <= NEAR * reach).all(axis=1)]
        distance = camera["principal_distance_mm"]
        (a, b), (c, d) = held
        corners = np.array([(a, b), (c, b), (c, d), (a, d)])
        rays_down = np.column_stack([corners, np.full(4, -distance)]) @ plan.axes[n]
        slope, foot = _plane(near, reach)
        above = float(centre[2] - foot - centre[:2] @ slope)
        border = _descending(rays_down, rays_down[:, :2] @ slope - rays_down[:, 2], LOWEST_RAY * distance)
        if len(border) and above > 0:
            outlines[photo] = centre[:2] + border[:, :2] * (above / (border[:, :2] @ slope - border[:, 2]))[:, None]
    return outlines


def _plane(points: Floats, distance: float) -> tuple[Floats, float]:
    """Return slope of the plane through points, and its height at the origin; few points tell of the height only."""
    middle = points.mean(axis=0)
    off = points - middle
    spread = off[:, :2].T @ off[:, :2] / len(points) + np.eye(2) * (STEADY * distance) ** 2
    slope = np.linalg.solve(spread, off[:, :2].T @ off[:, 2] / len(points))
    return slope, float(middle[2] - middle[:2] @ slope)


def _descending(corners: Floats, descent: Floats, least: float) -> Floats:
    """Cut off what does not descend towards the plane."""
    kept = []
    for n in range(len(corners)):
        here, last = descent[n] - least, descent[n - 1] - least
        if (here < 0) != (last < 0):
            kept.append(corners[n] + (corners[n - 1] - corners[n]) * (here / (here - last)))
        if here >= 0:
            kept.append(corners[n])
    return np.array(kept).reshape(-1, 3)


def footprint_pictures(plan: Plan) -> list[Picture]:
    """Draw the footprints; nothing where formats or orientations are not known."""
    outlines = footprints(plan)
    if not outlines:
        return []
    corners = list(outlines.values())
    layers: list[Layer] = [
        Areas(boxes, f"overlap overlap-{count}", words=counted(count, "photo") + " and more" * (count == MOST_COLOURS))
        for count, boxes in enumerate(overlaps(corners, plan.map_rows), 1)
        if boxes
    ]
    kind = "open photo thin" if len(corners) <= MANY else "open photo hair"
    layers.append(Areas(corners, kind, [f"photo {photo}" for photo in outlines]))
    called, left_out = shortened(list(outlines))
    many = len(corners) > MOST_NAMED  # then there is room for names outside only
    at = np.array([each[np.argmax(each[:, 1])] if many else each.mean(axis=0) for each in corners])
    layers.append(Names(at, list(called.values()), beside=many))
    sizes = {photo: area(outline) for photo, outline in outlines.items()}
    largest = max(sizes, key=lambda photo: sizes[photo])
    caption = (
        "What each photo shows of the ground as the adjusted points have it; colours: how many photos show the same. "
        f"The largest footprint is that of photo {largest}, {_square(sizes[largest])}."
    )
    if gsd := plan.document["summary"].get("gsd"):
        caption += f" Ground sample distance {short(gsd['median'], 3)} m, the median of the photos."
    words = "Footprints and overlap", caption + left_out, f"{counted(len(outlines), 'footprint')}."
    return [_map(plan, "footprints", words, layers, _extent(plan, np.concatenate(corners)))]


def area(outline: Floats) -> float:
    x, y = outline.T
    return abs(float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))) / 2


def _square(size: float) -> str:
    return f"{float(f'{size / SQUARE_KM:.3g}'):g} km²" if size >= SQUARE_KM / 10 else f"{size:.0f} m²"


def overlaps(outlines: list[Floats], rows: int = 1) -> list[list[Floats]]:
    """Count the photos over each cell of a grid; returned are boxes that cover the cells of 1, 2, ... photos.

    rows: of the map, in none of which a box goes on in the next.
    """
    everything = np.concatenate(outlines)
    low, cell = everything.min(axis=0), max(float(np.ptp(everything, axis=0).max()) / (CELLS * rows), 1e-9)
    shape = np.ceil(np.ptp(everything, axis=0) / cell).astype(int) + 1
    counts = np.zeros((shape[1], shape[0]), int)
    for outline in outlines:
        first, last = ((outline.min(axis=0) - low) / cell).astype(int), ((outline.max(axis=0) - low) / cell).astype(int)
        y, x = np.mgrid[first[1] : last[1] + 1, first[0] : last[0] + 1]
        at = low + cell * (np.stack([x, y], axis=-1) + 0.5)
        turn = np.sign(_turn(outline[0], outline[1], outline[2]))
        inside = np.ones(x.shape, bool)
        for start, end in zip(outline, np.roll(outline, -1, axis=0), strict=True):
            inside &= turn * _turn(start, end, at) >= 0
        counts[first[1] : last[1] + 1, first[0] : last[0] + 1] += inside
    boxes: list[list[Floats]] = [[] for _ in range(MOST_COLOURS)]
    growing: dict[tuple[int, int, int], int] = {}  # first row of the runs of cells that go on from row to row
    for row, line in enumerate([*np.minimum(counts, MOST_COLOURS), np.zeros(shape[0], int)]):
        borders = np.arange(CELLS, len(line), CELLS)
        ends = np.union1d(np.flatnonzero(np.diff(line, prepend=0, append=0)), borders).tolist()
        runs = {(start, end, int(line[start])) for start, end in pairwise(ends) if line[start]}
        for start, end, count in sorted(growing.keys() - runs):
            boxes[count - 1].append(low + cell * box((start, end), (growing[start, end, count], row)))
        growing = {run: growing.get(run, row) for run in sorted(runs)}
    return boxes


def _turn(start: Floats, end: Floats, at: Floats) -> Floats:
    """Tell on which side of a line places lie: positive to its left."""
    way, off = end - start, at - start
    return np.asarray(way[0] * off[..., 1] - way[1] * off[..., 0])


MOST_PHOTOS = 300  # more of them are drawn as strips
STRONG = 6  # points from which a tie is drawn thick
FEW = 3  # points from which a tie is not weak
LOOKS = {"thick": f"{STRONG} points and more", "": f"{FEW} to {STRONG - 1}", "dotted": f"fewer than {FEW}"}
CROWDED = 3  # ties of a photo, from which the strong ones are hairlines, so that the weak ones show
BOW = 0.16  # of a line: photos that are no neighbours lie on one line, and each of their ties is to be seen


def tie_pictures(plan: Plan) -> list[Picture]:
    """Draw photos, or strips where there are many photos, tied by common points."""
    strip_of = {plan.photo_ids[n]: strip for strip, rows in plan.strips.items() for n in rows}
    alone = plan.document["strips"] == []
    whole = len(strip_of) > MOST_PHOTOS and len(plan.strips) > 1
    if whole:
        nodes = {strip: plan.photos[rows, :2].mean(axis=0) for strip, rows in plan.strips.items() if rows}
    else:
        nodes = {photo: plan.photos[plan.photo_row[photo], :2] for photo in strip_of}
    rays = rays_of(plan.document)
    sights = {
        (strip_of[photo] if whole else photo, point)
        for photo, point, used in zip(rays.photo, rays.point, rays.used.tolist(), strict=True)
        if used and photo in strip_of
    }
    ties = _shared(sights)
    if not ties:
        return []
    what = "strip" if whole else "photo"
    layers: list[Layer] = []
    crowded = len(ties) > CROWDED * len(nodes)
    for across in (False, True):
        for kind, words in LOOKS.items():
            pairs = {
                pair: count
                for pair, count in ties.items()
                if across == (whole or alone or strip_of[pair[0]] != strip_of[pair[1]])
                and kind == ("thick" if count >= STRONG else "" if count >= FEW else "dotted")
            }
            if pairs:
                start, end = (np.array([nodes[pair[side]] for pair in pairs]) for side in (0, 1))
                hints = [f"{one} and {other}: {counted(count, 'point')}" for (one, other), count in pairs.items()]
                look = "hair" if crowded and kind == "thick" else f"faint {kind}"
                colour = f"{'c2' if across and not alone else 'c1'} {look}"
                both = f"{words}, {'between strips' if across else 'in a strip'}"
                layers.append(Segments(start, end, colour, hints, words if whole or alone else both, BOW))
    at = np.array(list(nodes.values()))
    size = 6.0 if len(nodes) <= MANY else 4.0
    layers.append(Marks(at, "photo", "dot", [f"{what} {name}" for name in nodes], size=size))
    called, left_out = (dict.fromkeys(nodes), "") if whole else shortened(list(nodes))
    layers.append(Names(at, [called[name] or name for name in nodes]))
    caption = f"Lines join {what}s that have points in common.{left_out}"
    caption += " The strongest are drawn thinnest, so that the weak ones show." * crowded
    weak = sum(count < FEW for count in ties.values()) if whole else 0
    if weak:
        caption += f" {counted(weak, 'tie')} of fewer than {FEW} points."
    lone = [name for name in nodes if not any(name in pair for pair in ties)]
    if lone:
        caption += f" Without a common point: {listed(lone)}."
    words = f"{counted(len(nodes), what)}, {counted(len(ties), 'tie')}."
    return [_map(plan, "ties", (f"Ties between {what}s", caption, words), layers, _extent(plan, at))]


def _shared(sights: Iterable[tuple[str, str]]) -> Counter[tuple[str, str]]:
    """Count the points that two have in common."""
    holders: dict[str, list[str]] = {}
    for name, point in sorted(sights):
        holders.setdefault(point, []).append(name)
    return Counter(pair for names in holders.values() for pair in combinations(names, 2))
