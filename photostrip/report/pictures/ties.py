"""Which photos and strips hold together, and by how many points."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from itertools import combinations

import numpy as np

from photostrip.notes import counted, listed
from photostrip.report.pictures.chart import Layer, Map, Marks, Names, Segments, chart, ground_bar
from photostrip.report.pictures.places import Plan, rays_of
from photostrip.report.pictures.svg import Picture

MOST_PHOTOS = 300  # more of them are drawn as strips
STRONG = 6  # points from which a tie is drawn thick
FEW = 3  # points from which a tie is not weak
LOOKS = {"thick": f"{STRONG} points and more", "": f"{FEW} to {STRONG - 1}", "dotted": f"fewer than {FEW}"}
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
                colour = f"c2 faint {kind}" if across else f"c1 faint {kind}"
                both = f"{words}, {'between strips' if across else 'in a strip'}"
                layers.append(Segments(start, end, colour, hints, words if whole else both, BOW))
    at = np.array(list(nodes.values()))
    layers.append(
        Marks(at, "photo", "dot", [f"{what} {name}" for name in nodes], size=6.0 if len(nodes) <= 100 else 4.0)
    )
    layers.append(Names(at, list(nodes)))
    caption = f"Lines join {what}s that have points in common."
    weak = sum(count < FEW for count in ties.values()) if whole else 0
    if weak:
        caption += f" {counted(weak, 'tie')} of fewer than {FEW} points."
    lone = [name for name in nodes if not any(name in pair for pair in ties)]
    if lone:
        caption += f" Without a common point: {listed(lone)}."
    words = f"{counted(len(nodes), what)}, {counted(len(ties), 'tie')}."
    bars = [ground_bar(float(np.ptp(at, axis=0).max()))]
    return [chart("ties", (f"Ties between {what}s", caption, words), [Map(layers)], bars=bars, north=plan.north)]


def _shared(sights: Iterable[tuple[str, str]]) -> Counter[tuple[str, str]]:
    """Count the points that two have in common."""
    holders: dict[str, list[str]] = {}
    for name, point in sorted(sights):
        holders.setdefault(point, []).append(name)
    return Counter(pair for names in holders.values() for pair in combinations(names, 2))
