"""Displacements of points between epochs: in plan, in elevation, and over time."""

from __future__ import annotations

import numpy as np

from photostrip.notes import Document, counted
from photostrip.report.pictures.chart import (
    Areas,
    Bar,
    Layer,
    Line,
    Map,
    Marks,
    Names,
    Panel,
    Segments,
    chart,
    ellipse,
    length,
    nice,
)  # fmt: skip
from photostrip.report.pictures.places import numbers
from photostrip.report.pictures.svg import Picture

LONGEST = 0.1  # about so long is the longest displacement, in shares of the extent
LOOKS = {"failed": "moved", "new": "not significant", "check": "stable"}


def displacement_picture(document: Document) -> Picture:
    """Draw where points moved to since the first epoch, enlarged, and how their displacements grew."""
    axes, epochs = document["axes"], document["epochs"]
    up = axes.index("up")
    right, ahead = sorted((n for n in range(3) if n != up), key=lambda n: axes[n] in {"north", "ahead"})
    steps = [row for row in document["displacements"] if row["epoch"] == epochs[-1]]
    first = {row["point"]: row for row in document["positions"] if row["epoch"] == epochs[0]}
    looks = ["check" if step["stable"] else "failed" if step["significant"] else "new" for step in steps]
    start = numbers([first[step["point"]] for step in steps], "x", "y", "z")
    moved = numbers(steps, "dx", "dy", "dz")
    known = np.flatnonzero(np.isfinite(start + moved).all(axis=1))
    extent = max(float(np.ptp(start[known], axis=0).max()) if len(known) else 0.0, 1.0)
    longest = float(np.linalg.norm(moved[known], axis=1).max(initial=0.0)) or 1.0
    factor = nice(LONGEST * extent / longest)
    outlines = [
        start[n, [right, ahead]]
        + factor * (moved[n, [right, ahead]] + ellipse(shape["ellipse_major"], shape["ellipse_minor"], turn))
        for n in known
        if (shape := steps[n])["ellipse_major"] is not None
        for turn in (np.pi / 2 - np.radians(shape["azimuth_deg"]),)
    ]
    panels: list[Panel | Map] = []
    for name, pair in (("plan", [right, ahead]), ("elevation", [right, up])):
        layers: list[Layer] = [Areas(outlines, "open ellipse")] if name == "plan" else []
        for look, words in LOOKS.items():
            own = [n for n in known if looks[n] == look]
            at = start[own][:, pair]
            hints = [f"{steps[n]['point']}: {steps[n]['length']:.4g} m" for n in own]
            layers.append(Segments(at, at + factor * moved[own][:, pair], look))
            layers += [Marks(at, look, "dot", hints, words)] if own else []
        layers.append(Names(start[known][:, pair], [steps[n]["point"] for n in known]))
        panels.append(Map(layers, f"{name}: {axes[pair[0]]} to the right, {axes[pair[1]]} upwards"))
    timed = bool(document["times"])
    times = np.array([document["times"][epoch] if timed else n for n, epoch in enumerate(epochs, 1)], float)
    layers = []
    for step, look in zip(steps, looks, strict=True):
        later = [row for row in document["displacements"] if row["point"] == step["point"]]
        at = np.column_stack([times, np.vstack([[0.0], numbers(later, "length")])])
        layers.append(Line(at, f"{look} thin"))
        layers.append(Marks(at, look, "dot", [step["point"]] * len(at), size=3.0))
    unit = document["time_unit"]
    names: list[str] = [] if timed else epochs
    panels.append(Panel(layers, "length since the first epoch", (unit if timed else "epoch", "m"), names=names))
    title = f"{document['name']}: displacements from {epochs[0]} to {epochs[-1]}"
    said = title, "Displacements with their confidence ellipses in plan.", f"{counted(len(known), 'point')}."
    size = nice(extent / 10)
    bars = [Bar(size, length(size)), Bar(size, f"displacements {length(size / factor)}", "soft")]
    return chart("displacements", said, panels, columns=3, height=300.0, heading=title, bars=bars)
