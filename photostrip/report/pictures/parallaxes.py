"""y parallaxes by the six standard zones of a pair: pair by pair, and all pairs together."""

from __future__ import annotations

import numpy as np

from photostrip.notes import Document, counted
from photostrip.report.pictures.chart import Layer, Line, Marks, Panel, Segments, chart, nice
from photostrip.report.pictures.svg import Picture

# as the zones lie in the left photo, by rows: 3 and 4 on top, 1 and 2 on the base, 5 and 6 below
ZONES = {3: "top left", 4: "top right", 1: "left centre", 2: "right centre", 5: "bottom left", 6: "bottom right"}
MOST_POINTS = 2400  # of all zones that are drawn one by one
SHARE_ON_AXIS = 0.995  # share of the parallaxes that the axis holds; those beyond stand at its end


def _hint(ray: Document, right: str, size: float) -> str:
    return f"point {ray['point']} of {ray['photo']} – {right}: {size:+.1f} µm"


def parallax_pictures(document: Document) -> list[Picture]:
    """Draw the y parallaxes; nothing where none are known."""
    pairs = list(document["models"])
    pair_of = {pair["left"]: (n, pair["right"]) for n, pair in enumerate(pairs, 1)}
    left_out = document["rejected"].where(stage="relative", readmitted=False)
    rows = [
        (pair_of[ray["photo"]][0], ray["zone"], size, key == "q_um", _hint(ray, pair_of[ray["photo"]][1], size))
        for rays, key in ((document["residuals"], "q_um"), (left_out, "parallax_um"))
        for ray in rays
        if (size := ray[key]) is not None and ray["zone"] in ZONES and ray["photo"] in pair_of
    ]
    if not rows:
        return []
    number, zones, size, used = (np.array(column) for column in list(zip(*rows, strict=True))[:4])
    used, hints, strips = used.astype(bool), [row[4] for row in rows], [pair["strip"] for pair in pairs]
    tested = np.abs(size[used] if used.any() else size)
    limit = 1.05 * nice(max(float(np.quantile(tested, SHARE_ON_AXIS)), 1e-6))
    borders = np.array([(n + 0.5, limit) for n in range(1, len(pairs)) if strips[n] != strips[n - 1]]).reshape(-1, 2)
    at = np.column_stack([number, size])
    panels = []
    for zone, where in ZONES.items():
        own, out = np.flatnonzero((zones == zone) & used), np.flatnonzero((zones == zone) & ~used)
        layers: list[Layer] = [Segments(borders * (1.0, -1.0), borders, "soft thin dashed")]
        if len(rows) <= MOST_POINTS:
            layers.append(Marks(at[own], "new", "dot", [hints[n] for n in own], "point", 3.3))
        layers += (
            [Marks(at[out], "failed open", "diamond", [hints[n] for n in out], "left out", 4.0)] if len(out) else []
        )
        title = f"zone {zone}, {where}"
        if len(own):
            there, of_pair = np.unique(number[own], return_inverse=True)
            means = np.bincount(of_pair, size[own]) / np.bincount(of_pair)
            layers.append(Line(np.column_stack([there, means]), "c1 thin", "mean of the pair"))
            scatter = float(np.std(size[own], ddof=min(1, len(own) - 1)))
            title += f": {size[own].mean():+.1f} ± {scatter / len(own) ** 0.5:.1f} µm, scatter {scatter:.1f}"
        lefts = [pair["left"] for pair in pairs]
        panels.append(Panel(layers, title, ("left photo of the pair", "µm"), y=(-limit, limit), names=lefts))
    caption = (
        "Residual y parallaxes in the six standard zones, laid out as in the left photo, pair after pair. Above each "
        "zone the mean of all pairs and the scatter of one point: a mean off zero in all pairs alike tells of the "
        "camera, not of the pairs."
    )
    beyond = int((np.abs(size) > limit)[used | (len(rows) <= MOST_POINTS)].sum())
    if beyond:
        caption += f" At the ends of the axis {counted(beyond, 'parallax', 'parallaxes')} beyond it."
    if len(borders):
        caption += " Upright lines part the strips."
    worst = int(np.argmax(np.where(used, np.abs(size), -1.0)))
    words = "y parallaxes by standard zone", caption, f"{counted(len(pairs), 'pair')}; the largest is {hints[worst]}."
    return [chart("parallaxes", words, panels, columns=2, height=130.0)]
