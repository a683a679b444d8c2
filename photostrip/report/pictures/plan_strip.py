"""The plan of a strip: standard deviations along it, and where its control lies."""

from __future__ import annotations

import numpy as np

from photostrip.notes import Document, counted
from photostrip.report.pictures.chart import Layer, Line, Marks, Panel, chart
from photostrip.report.pictures.places import numbers
from photostrip.report.pictures.svg import Picture

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
