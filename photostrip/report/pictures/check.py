"""Check points against the standard deviations that the result states."""

from __future__ import annotations

import numpy as np

from photostrip.notes import Document, counted
from photostrip.report.pictures.chart import Areas, Layer, Marks, Names, Panel, Segments, box, chart
from photostrip.report.pictures.places import numbers
from photostrip.report.pictures.svg import Picture

LIMITS = {"plan": 2.448, "height": 1.960}  # 95 % of a length in plan by its covariance, and of a height


def check_pictures(document: Document) -> list[Picture]:
    """Draw check points over their standard deviations; nothing where these are not known."""
    rows: list[Document] = document.get("precision", {}).get("check", {}).get("points") or []
    sizes = numbers(rows, *LIMITS)
    if not np.isfinite(sizes).any():
        return []
    ids = np.array([row["id"] for row in rows])
    ends = 0.0, len(rows) + 1.0
    panels = []
    for (part, limit), size in zip(LIMITS.items(), sizes.T, strict=True):
        at = np.column_stack([np.arange(1, len(rows) + 1), size])
        worst = np.argsort(-np.abs(np.nan_to_num(size)), kind="stable")
        sides = np.array([[limit], [-limit if part == "height" else limit]])
        band = box(ends, (-limit if part == "height" else 0.0, limit))
        left, right = (np.hstack([np.full_like(sides, end), sides]) for end in ends)
        layers: list[Layer] = [Areas([band], "area c1")]
        layers.append(Segments(left, right, "failed dashed", words="limit of 95 %"))
        layers.append(Segments(at * (1.0, 0.0), at, "check thin"))
        outside = np.abs(size) > limit
        looks = (~outside, "inside", "square", "check"), (outside, "outside", "diamond", "failed open")
        for chosen, words, shape, kind in looks:
            own = np.flatnonzero(chosen)
            hints = [f"check point {ids[n]}: {size[n]:+.2f}" for n in own]
            layers += [Marks(at[own], kind, shape, hints, words, 4.0)] if len(own) else []
        known = [n for n in worst if np.isfinite(size[n])]
        layers.append(Names(at[known], ids[known].tolist()))
        panels.append(Panel(layers, part, ("check points in their order", "z"), x=ends, names=[""] * len(rows)))
    caption = (
        "Differences at check points over their standard deviations: in plan the length in the metric of the "
        "covariance, in height with its sign. 95 % lie inside the band when these standard deviations are right."
    )
    beyond = int((np.abs(sizes) > list(LIMITS.values())).any(axis=1).sum())
    words = f"{counted(len(rows), 'check point')}, {beyond} outside the limits in plan or height."
    return [chart("check", ("Check points against their precision", caption, words), panels)]
