"""Pictures of plans, as SVG or PNG."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from photostrip.notes import Document
from photostrip.report.pictures.drawing import as_png, as_svg, drawn_alike, isolines, new_figure
from photostrip.report.pictures.plan_strip import strip_figure
from photostrip.report.pictures.style import SERIES, SMALL_TEXT, USES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]

ARROWS = 8  # along an axis


def plan_picture(document: Document, ending: str) -> bytes:
    """Draw the document of a plan, of a model with errors on a fine grid; the ending is ``.svg`` or ``.png``."""
    with drawn_alike():
        figure = DRAWINGS[document["kind"]](document)
        return as_png(figure) if ending.lower() == ".png" else as_svg(figure).encode()


def _model(document: Document) -> Figure:
    title = f"{document['name']}: {document['camera']['name']}, 1:{document['geometry']['scale']:g},"
    bent = document.get("bent")
    figure = new_figure(10, 11.2 if bent else 5.6, f"{title} {document['image_sigma_um']:g} µm")
    rows = 2 if bent else 1
    points = document["points"]
    x = np.unique([point["x_mm"] for point in points])
    y = np.unique([point["y_mm"] for point in points])
    for place, (name, title) in enumerate((("sigma_plan_m", "plan"), ("sigma_z_m", "height")), 1):
        axes = figure.add_subplot(rows, 2, place, aspect="equal", title=f"standard deviation in {title}, m")
        isolines(axes, x, y, _over_grid(points, name, x, y), filled=True)
        _axes(axes, document["control"])
    if bent:
        for place, (name, title) in enumerate(
            (("raised", "bent by the elements, before levelling"), ("left", "what the absolute orientation leaves")), 3
        ):
            axes = figure.add_subplot(rows, 2, place, aspect="equal")
            isolines(axes, x, y, _over_grid(bent, f"{name}_z_m", x, y), filled=False)
            longest = _arrows(axes, bent, name, x, y)
            axes.set_title(f"{title}\nheights, m; longest arrow in plan {longest:.2g} m")
            _axes(axes, document["control"])
    return figure


def _over_grid(points: list[Document], name: str, x: Floats, y: Floats) -> Floats:
    value = {(point["x_mm"], point["y_mm"]): point[name] for point in points}
    return np.array([[value[a, b] for a in x.tolist()] for b in y.tolist()])


def _axes(axes: Axes, control: list[Document]) -> None:
    axes.set_xlabel("x along the flight, mm at photo scale")
    axes.set_ylabel("y, mm")
    _control(axes, control)


def _arrows(axes: Axes, points: list[Document], name: str, x: Floats, y: Floats) -> float:
    """Draw errors in plan at every few points of the grid; return the longest, metres."""
    step_x, step_y = (max(1, (len(axis) - 1) // ARROWS) for axis in (x, y))
    along, across = (_over_grid(points, f"{name}_{axis}_m", x, y)[::step_y, ::step_x] for axis in ("x", "y"))
    longest = float(np.hypot(along, across).max())
    if longest > 0:
        axes.quiver(x[::step_x], y[::step_y], along, across, angles="xy", scale=longest * ARROWS, width=0.004)
    return longest


def _control(axes: Axes, control: list[Document]) -> None:
    for use, (marker, label) in USES.items():
        places = np.array([(point["x_mm"], point["y_mm"]) for point in control if point["use"] == use])
        if len(places):
            axes.scatter(places[:, 0], places[:, 1], marker=marker, s=40, c="black", label=label, clip_on=False)
    axes.legend(fontsize=SMALL_TEXT, loc="upper right")


def _cameras(document: Document) -> Figure:
    rows = document["cameras"]
    figure = new_figure(9, 1.6 + 0.45 * len(rows), f"{document['name']}: beside {document['reference']}")
    names = [row["camera"] for row in rows]
    for place, (name, title) in enumerate(
        (("coefficient_mm2", "K = f m_p, mm²"), ("eta_area", "area of a model at equal m_h"))
    ):
        axes = figure.add_subplot(1, 2, place + 1, title=title)
        bars = axes.barh(names, [row[name] for row in rows], color=SERIES[place])
        axes.bar_label(bars, fmt="%.3g", padding=2, fontsize=SMALL_TEXT + 1)
        axes.invert_yaxis()
        axes.margins(x=0.15)
    return figure


def _displacement(document: Document) -> Figure:
    rows = [row for row in document["points"] if row["place"] == "middle"]
    camera = document["camera"]["name"]
    figure = new_figure(8, 4.5, f"{document['name']}: {camera}, {document['change_sigma_um']:g} µm")
    axes = figure.add_subplot(1, 1, 1)
    distance = [row["distance_m"] for row in rows]
    for number, (axis, label) in enumerate((("x", "right"), ("y", "ahead"), ("z", "up"))):
        for what, line in (("sigma", "-"), ("found", "--")):
            values = [row[f"{what}_{axis}_m"] for row in rows]
            if not any(value is None for value in values):
                name = f"standard deviation, {label}" if what == "sigma" else f"smallest found, {label}"
                axes.plot(distance, values, line, marker="o", color=SERIES[number], label=name)
    axes.set_xlabel("distance, m")
    axes.set_ylabel("displacement of a point in the middle, m")
    axes.legend(fontsize=SMALL_TEXT)
    return figure


def _screening(document: Document) -> Figure:
    layout = document["layout"]
    title = f"{document['name']}: {sum(layout['zone_points'])} points, {document['parallax_sigma_um']:g} µm"
    figure = new_figure(10, 4.5, title)
    for place, (key, label) in enumerate((("size_um", "error of the y parallax, µm"), ("zone", "zone")), 1):
        axes = figure.add_subplot(1, 2, place, xlabel=label, ylabel="errors found, %", ylim=(0, 105))
        for number, method in enumerate(each["method"] for each in document["methods"]):
            rows = [row for row in document["detection"] if row["method"] == method and row["errors"]]
            values = sorted({row[key] for row in rows})
            shares = []
            for value in values:
                those = [row for row in rows if row[key] == value]
                shares.append(100 * sum(row["found"] for row in those) / sum(row["errors"] for row in those))
            axes.plot(values, shares, "o-", color=SERIES[number % len(SERIES)], label=method)
        axes.legend(fontsize=SMALL_TEXT)
    return figure


DRAWINGS: dict[str, Callable[[Document], Figure]] = {
    "model": _model,
    "strip": strip_figure,
    "cameras": _cameras,
    "displacement": _displacement,
    "screening": _screening,
}
