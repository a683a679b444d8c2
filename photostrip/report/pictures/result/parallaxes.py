"""y parallaxes by the six standard zones of a pair: pair by pair, and all pairs together."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from photostrip.notes import Document, counted
from photostrip.report.pictures import svg
from photostrip.report.pictures.chart import WIDTH, Entry, Layout, Panel, framed_by_photos, legend
from photostrip.report.pictures.svg import Picture

# as the zones lie in the left photo, by rows: 3 and 4 on top, 1 and 2 on the base, 5 and 6 below
ZONES = {3: "top left", 4: "top right", 1: "left centre", 2: "right centre", 5: "bottom left", 6: "bottom right"}
MOST_POINTS = 2400  # of all zones that are drawn one by one
SHARE_ON_AXIS = 0.995  # share of the parallaxes that the axis holds; those beyond stand at its end
STACKED_AT = 1.04  # where the mean of all pairs is drawn, in widths of a panel


class Parallax(NamedTuple):
    pair: int  # from 1
    names: str  # its photos
    point: str
    size: float  # µm
    used: bool


def parallax_pictures(document: Document) -> list[Picture]:
    """Draw the y parallaxes; nothing where none are known."""
    zones: dict[int, list[Parallax]] = {zone: [] for zone in ZONES}
    rows = [row for row in document["models"] if "zone_1" in row]  # of photos
    number = {(row["strip"], row["left"]): pair for pair, row in enumerate(rows, 1)}
    for row in document["parallaxes"]:
        if row["q_um"] is not None and row["zone"] in zones:
            pair, names = number[row["strip"], row["left"]], f"{row['left']} – {row['right']}"
            zones[row["zone"]].append(
                Parallax(pair=pair, names=names, point=row["point"], size=row["q_um"], used=row["used"])
            )
    everything = [each for zone in zones.values() for each in zone]
    if not everything:
        return []
    pairs, lefts = len(rows), [row["left"] for row in rows]
    limit = _limit([each for each in everything if each.used] or everything)
    layout = Layout(columns=2, height=130.0, number=len(ZONES))
    borders = _borders(rows)
    drawn: list[str] = []
    for place, (zone, where) in enumerate(ZONES.items()):
        panel = layout.panel(place, (0.0, pairs + 1.0), (-limit, limit))
        drawn += framed_by_photos(panel, lefts, ("left photo of the pair", "µm"), f"zone {zone}, {where}")
        drawn += [svg.line((panel.x(at), panel.y.start), (panel.x(at), panel.y.end), "border") for at in borders]
        drawn += _parallaxes(panel, zones[zone], single=len(everything) <= MOST_POINTS)
    entries = [Entry("point", "fill-4", "dot")] if len(everything) <= MOST_POINTS else []
    if any(not each.used for each in everything):
        entries.append(Entry("left out", "left-out", "diamond"))
    entries.append(Entry("mean of the pair", "curve curve-1"))
    drawn += legend([*entries, Entry("mean and scatter of all pairs", "spread", "square")])
    worst = max((each for each in everything if each.used), key=lambda each: abs(each.size), default=everything[0])
    beyond = sum(abs(each.size) > limit for each in everything if each.used or len(everything) <= MOST_POINTS)
    caption = (
        "Residual y parallaxes in the six standard zones, laid out as in the left photo, pair after pair. At the right "
        "of each zone all pairs together: mean, its two standard deviations (thick) and the scatter of one point "
        "(thin). A mean off zero in all pairs alike tells of the camera, not of the pairs."
    )
    if beyond:
        caption += f" At the ends of the axis {counted(beyond, 'parallax', 'parallaxes')} beyond it."
    if borders:
        caption += " Upright lines part the strips."
    largest = f"{worst.size:.1f} µm at point {worst.point} of {worst.names}"
    words = f"{counted(pairs, 'pair')}; the largest parallax is {largest}."
    return [svg.picture("parallaxes", (WIDTH, layout.whole), drawn, "y parallaxes by standard zone", caption, words)]


def _limit(everything: Sequence[Parallax]) -> float:
    sizes = sorted(abs(each.size) for each in everything)
    return svg.nice(max(sizes[min(int(SHARE_ON_AXIS * len(sizes)), len(sizes) - 1)], 1e-6)) * 1.05


def _borders(rows: Sequence[Document]) -> list[float]:
    """Return the places between the strips."""
    strips = [row["strip"] for row in rows]
    return [n + 0.5 for n in range(1, len(strips)) if strips[n] != strips[n - 1]]


def _parallaxes(panel: Panel, found: Sequence[Parallax], *, single: bool) -> list[str]:
    drawn: list[str] = []
    used: dict[int, list[float]] = {}
    for each in found:
        place = panel.x(each.pair), panel.clipped(each.size)
        hint = f"point {each.point} of {each.names}: {each.size:+.1f} µm"
        if not each.used:
            drawn.append(svg.mark(place, "diamond", "left-out", hint, 4.0))
        else:
            used.setdefault(each.pair, []).append(each.size)
            if single:
                drawn.append(svg.circle(place, 2.0, "fill-4", hint))
    means = [(float(pair), math.fsum(sizes) / len(sizes)) for pair, sizes in sorted(used.items())]
    if means:
        drawn.append(svg.path([(panel.x(pair), panel.clipped(mean)) for pair, mean in means], "curve curve-1 thin"))
        drawn += _stacked(panel, [size for sizes in used.values() for size in sizes])
    return drawn


def _stacked(panel: Panel, sizes: Sequence[float]) -> list[str]:
    mean = math.fsum(sizes) / len(sizes)
    scatter = math.sqrt(math.fsum((size - mean) ** 2 for size in sizes) / max(len(sizes) - 1, 1))
    own = 2.0 * scatter / math.sqrt(len(sizes))
    x = panel.x.start + STACKED_AT * (panel.x.end - panel.x.start)
    hint = f"{len(sizes)} points: mean {mean:+.2f} µm, scatter {scatter:.2f} µm"

    def bar(reach: float, kind: str) -> str:
        return svg.line((x, panel.clipped(mean - reach)), (x, panel.clipped(mean + reach)), kind)

    return [
        bar(scatter, "spread-thin"),
        bar(own, "spread-thick"),
        svg.mark((x, panel.clipped(mean)), "square", "spread", hint, 4.0),
    ]
