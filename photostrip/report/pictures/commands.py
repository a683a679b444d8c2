"""Pictures of commands beside ``run``: where the strips of a batch lie, the plan of a strip, displacements."""

from __future__ import annotations

from collections.abc import Sequence

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
    ground_bar,
    length,
    nice,
)
from photostrip.report.pictures.places import numbers
from photostrip.report.pictures.svg import Picture

NAMED = 40  # projects whose names stand in the description
LOOKS = {
    "good": ("dot", "good"),
    "unverified": ("square", "look"),
    "look": ("diamond", "look"),
    "failed": ("triangle", "failed"),
}


def batch_maps(outcomes: Sequence[Document]) -> list[Picture]:
    """Draw the projects whose place on a body is known; of several bodies, that of the most projects first."""
    bodies: dict[float, list[Document]] = {}
    for outcome in outcomes:
        if outcome.get("track"):
            bodies.setdefault(outcome["body"], []).append(outcome)
    ranked = sorted(bodies.values(), key=len, reverse=True)
    return [_map(number, projects) for number, projects in enumerate(ranked, 1)]


def _map(number: int, projects: Sequence[Document]) -> Picture:
    degrees = np.array([end for each in projects for strip in each["track"] for end in strip])
    middle = float(degrees[:, 1].mean())
    metres = np.radians(projects[0]["body"]) * np.array([np.cos(np.radians(middle)), 1.0])
    names = [str(each["output"] or each["project"]) for each in projects]
    layers: list[Layer] = []
    for status, (shape, colour) in LOOKS.items():
        own = [n for n, each in enumerate(projects) if each["status"] == status]
        if own:
            ends = np.array([strip for n in own for strip in projects[n]["track"]]) * metres
            first = np.array([projects[n]["track"][0][0] for n in own]) * metres
            hints = [f"{projects[n]['project']}: {status}" for n in own]
            layers.append(Segments(ends[:, 0], ends[:, 1], colour))
            layers.append(Marks(first, colour, shape, hints, status))
    layers.append(Names(np.array([each["track"][0][0] for each in projects]) * metres, names, first=len(names)))
    places = ", ".join(f"{name} ({each['status']})" for name, each in list(zip(names, projects, strict=True))[:NAMED])
    words = (
        f"{counted(len(projects), 'project')} on a body of {projects[0]['body'] / 1000:.0f} km radius",
        f"A line for each strip, a mark at its first photo; north is up, true lengths at latitude {middle:.1f}°",
        f"Strips of {places}",
    )
    bars = [ground_bar(float(np.ptp(degrees * metres, axis=0).max()))]
    return chart(f"map-{number}", words, [Map(layers)], bars=bars)


COLOURS = "c1", "c2", "c3", "c4", "failed", "good", "soft", "ink"  # of layouts
DASHES = {
    "similarity": "dotted",
    "degree 1": "thin dotted",
    "degree 2": "dashed",
    "degree 3": "thin dashed",
    "bundle": "",
}
USES = {"xyz": "triangle", "xy": "square", "z": "dot"}


def strip_plan_picture(document: Document) -> Picture:
    geometry, layouts = document["geometry"], document["layouts"]
    colour = {layout["name"]: COLOURS[n % len(COLOURS)] for n, layout in enumerate(layouts)}
    ends = 0.5, geometry["photos"] + 0.5
    panels = []
    for key, part in (("plan_m", "plan"), ("z_m", "height")):
        layers: list[Layer] = []
        curves: dict[tuple[str, str], list[Document]] = {}
        for row in document["along"]:
            curves.setdefault((row["layout"], row["method"]), []).append(row)
        for (layout, method), rows in curves.items():
            at = np.hstack([np.arange(1.0, len(rows) + 1.0)[:, None], numbers(rows, key)])
            layers.append(Line(at, f"{colour[layout]} {DASHES[method]}", f"{layout}, {method}"))
        required = document["required_m"][part]
        if required is not None:
            limit = np.array([(end, required) for end in ends])
            layers.append(Line(limit, "ink thin", "required"))
        panels.append(Panel(layers, f"worst standard deviation in {part}", ("photo", "m"), x=ends, log=True))
    shown = [(layout["name"], layout["points"]) for layout in layouts]
    shown += [(row["control"], row["points"]) for row in document.get("placed", ()) if row["control"] == "places found"]
    layers = []
    for n, (_, points_of) in enumerate(shown, 1):
        for use, shape in USES.items():
            points = numbers([point for point in points_of if point["use"] == use], "photo", "row")
            across = 0.6 * (points[:, 1] - 1) / (geometry["rows"] - 1) - 0.3
            places = np.column_stack([points[:, 0], n + across])
            layers.append(Marks(places, COLOURS[(n - 1) % len(COLOURS)], shape, size=4.0))
    panels.append(Panel(layers, "control", ("photo", ""), x=ends, rows=[name for name, _ in shown]))
    heading = (
        f"{document['name']}: {document['camera']['name']}, 1:{geometry['scale']:g}, {geometry['photos']} photos, "
        f"{document['image_sigma_um']:g} µm"
    )
    caption = (
        "Worst standard deviations over each photo; triangles: control in full, squares: in plan, dots: in height."
    )
    words = f"Plan of {document['name']}", caption, f"{counted(len(layouts), 'layout')} of control."
    return chart("plan-strip", words, panels, height=max(180.0, 60.0 * len(shown)), heading=heading)


LONGEST = 0.1  # about so long is the longest displacement, in shares of the extent
MOVED = {"failed": "moved", "new": "not significant", "check": "stable"}


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
        for look, words in MOVED.items():
            own = [n for n in known if looks[n] == look]
            at = start[own][:, pair]
            hints = [f"{steps[n]['point']}: {steps[n]['length']:.4g} m" for n in own]
            layers.append(Segments(at, at + factor * moved[own][:, pair], look))
            layers.append(Marks(at, look, "dot", hints, words))
        layers.append(Names(start[known][:, pair], [steps[n]["point"] for n in known]))
        panels.append(Map(layers, f"{name}: {axes[pair[0]]} →, {axes[pair[1]]} ↑"))
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
