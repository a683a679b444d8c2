"""Pictures of plans, as SVG or PNG."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.report.pictures.drawing import as_png, as_svg, check_matplotlib, drawn_alike, isolines, new_figure
from photostrip.report.pictures.plan_strip import strip_figure
from photostrip.report.pictures.style import SERIES, SMALL_TEXT, USES

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from photostrip.report.page.parts import Document

ENDINGS = (".png", ".svg")


def is_picture(path: Path) -> bool:
    """Whether a file name asks for a picture."""
    return path.suffix.lower() in ENDINGS


def check_picture(path: Path) -> None:
    """Refuse a picture that cannot be drawn, before anything is computed."""
    check_matplotlib("--output", f"{path.name}: ")


def plan_picture(document: Document, ending: str) -> bytes:
    """Draw the document of a plan, of a model with errors on a fine grid; the ending is ``.svg`` or ``.png``."""
    with drawn_alike():
        figure = DRAWINGS[document["kind"]](document)
        return as_png(figure) if ending.lower() == ".png" else as_svg(figure).encode()


def _model(document: Document) -> Figure:
    title = f"{document['name']}: {document['camera']['name']}, 1:{document['geometry']['scale']:g},"
    figure = new_figure(10, 5.6, f"{title} {document['image_sigma_um']:g} µm")
    points = document["points"]
    x = np.unique([point["x_mm"] for point in points])
    y = np.unique([point["y_mm"] for point in points])
    for place, (name, title) in enumerate((("sigma_plan_m", "plan"), ("sigma_z_m", "height")), 1):
        axes = figure.add_subplot(1, 2, place, aspect="equal", title=f"standard deviation in {title}, m")
        value = {(point["x_mm"], point["y_mm"]): point[name] for point in points}
        surface = np.array([[value[a, b] for a in x.tolist()] for b in y.tolist()])
        isolines(axes, x, y, surface, filled=True)
        axes.set_xlabel("x along the flight, mm at photo scale")
        axes.set_ylabel("y, mm")
        _control(axes, document["control"])
    return figure


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


DRAWINGS: dict[str, Callable[[Document], Figure]] = {
    "model": _model,
    "strip": strip_figure,
    "cameras": _cameras,
    "source-table": _cameras,
}
