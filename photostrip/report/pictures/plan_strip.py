"""The picture of the plan of a strip: standard deviations along it, and where its control lies."""

from __future__ import annotations

from typing import TYPE_CHECKING

from photostrip.notes import Document
from photostrip.report.pictures.drawing import new_figure
from photostrip.report.pictures.style import INK, METHODS, SERIES, SMALL_TEXT, USES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def strip_figure(document: Document) -> Figure:
    rows = len(document["layouts"])
    title = (
        f"{document['name']}: {document['camera']['name']}, 1:{document['geometry']['scale']:g},"
        f" {document['geometry']['photos']} photos, {document['image_sigma_um']:g} µm"
    )
    figure = new_figure(11, 6.0 + 0.45 * rows, title)
    parts = figure.add_gridspec(2, 1, height_ratios=[4, 1 + 0.35 * rows])
    upper, lower = figure.add_subfigure(parts[0]), figure.add_subfigure(parts[1])
    for place, (name, title) in enumerate((("plan_m", "plan"), ("z_m", "height")), 1):
        axes = upper.add_subplot(1, 2, place, title=f"worst standard deviation in {title}, m")
        _curves(axes, document, name)
        _limit(axes, document["required_m"][title])
        if place == 2:
            axes.legend(fontsize=SMALL_TEXT - 1, loc="upper left", bbox_to_anchor=(1.01, 1.0))
    _places(lower.add_subplot(1, 1, 1), document)
    return figure


def _curves(axes: Axes, document: Document, name: str) -> None:
    colour = {layout["name"]: SERIES[k % len(SERIES)] for k, layout in enumerate(document["layouts"])}
    curves: dict[tuple[str, str], list[float]] = {}
    for row in document["along"]:
        curves.setdefault((row["layout"], row["method"]), []).append(row[name])
    for (layout, method), values in curves.items():
        label, line = f"{layout}, {method}", METHODS[method]
        photos = range(1, len(values) + 1)
        axes.plot(photos, values, color=colour[layout], linestyle=line, linewidth=1.1, label=label)
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter("{x:g}")
    axes.tick_params(axis="y", which="both", labelsize=SMALL_TEXT)
    axes.set_xlabel("photo")


def _limit(axes: Axes, limit: float | None) -> None:
    if limit is not None:
        axes.axhline(limit, color=INK, linewidth=0.8)
        axes.annotate("required", (1, limit), xytext=(0, 2), textcoords="offset points", fontsize=SMALL_TEXT)


def _places(axes: Axes, document: Document) -> None:
    """Draw where the control of each layout lies, one strip below the other."""
    rows = document["geometry"]["rows"]
    layouts = [(layout["name"], layout["points"]) for layout in document["layouts"]]
    layouts += [
        (row["control"], row["points"]) for row in document.get("placed", ()) if row["control"] == "places found"
    ]
    for number, (_, points) in enumerate(layouts):
        for use, (marker, _) in USES.items():
            of_use = [point for point in points if point["use"] == use]
            x = [point["photo"] for point in of_use]
            y = [-number + 0.3 - 0.6 * (point["row"] - 1) / (rows - 1) for point in of_use]
            axes.scatter(x, y, marker=marker, s=18, color=SERIES[number % len(SERIES)])
    axes.set_yticks([-number for number in range(len(layouts))], [name for name, _ in layouts], fontsize=SMALL_TEXT)
    axes.set_xlim(0.5, document["geometry"]["photos"] + 0.5)
    axes.set_ylim(-len(layouts) + 0.4, 0.6)
    axes.set_xlabel("photo (triangles: control in full, squares: in plan, circles: in height)", fontsize=SMALL_TEXT + 1)
