"""Pictures of plans, SVG or PNG: the same input gives the same bytes.

matplotlib is an extra; it is imported when a picture is drawn.
"""

from __future__ import annotations

from importlib.util import find_spec
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np

from photostrip.errors import Fault, InputError
from photostrip.report.pictures.plan_strip import strip_figure
from photostrip.report.pictures.terrestrial import INSTALL, styled

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Document = dict[str, Any]

ENDINGS = (".png", ".svg")
LEVELS = 9
DOTS = 120  # per inch, of PNG
USE_MARKS = {"xyz": ("^", "control"), "xy": ("s", "control in plan"), "z": ("o", "control in height")}
COLOURS = ("#2471a3", "#c0392b", "#229954", "#8e44ad", "#d68910", "#16a085", "#34495e", "#7f8c8d")


def is_picture(path: Path) -> bool:
    """Whether a file name asks for a picture."""
    return path.suffix.lower() in ENDINGS


def check_picture(path: Path) -> None:
    """Make sure that a picture can be drawn, before anything is computed.

    Raises
    ------
    InputError
        When matplotlib is missing.
    """
    try:
        missing = find_spec("matplotlib") is None
    except ValueError:  # put out of action: sys.modules["matplotlib"] is None
        missing = True
    if missing:
        message = f"{path.name}: pictures need matplotlib, which is not installed"
        raise InputError(Fault(message, "extra", key="--output", fix=INSTALL))


def plan_picture(document: Document, ending: str) -> bytes:
    """Draw a plan.

    Parameters
    ----------
    document : dict
        Document of a plan; of a model with errors on a fine grid.
    ending : str
        ``.svg`` or ``.png``.
    """
    with styled():
        return _file(DRAWINGS[document["kind"]](document), ending.lower())


def _file(figure: Figure, ending: str) -> bytes:
    stream = BytesIO()
    if ending == ".png":
        figure.savefig(stream, format="png", dpi=DOTS, metadata={"Software": "photostrip"})
        return stream.getvalue()
    figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": "photostrip"})
    lines = stream.getvalue().decode().splitlines()
    return "".join(f"{line.rstrip()}\n" for line in lines).encode()


def _figure(width: float, height: float) -> Figure:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


# ----------------------------------------------------------------------------------------------------- one model


def _model(document: Document) -> Figure:
    figure = _figure(10, 5.6)
    figure.suptitle(
        f"{document['name']}: {document['camera']['name']}, 1:{document['geometry']['scale']:g},"
        f" {document['image_sigma_um']:g} µm"
    )
    for place, (name, title) in enumerate((("sigma_plan_m", "plan"), ("sigma_z_m", "height")), 1):
        axes = figure.add_subplot(1, 2, place, aspect="equal", title=f"standard deviation in {title}, m")
        _isolines(axes, document["points"], name)
        _control(axes, document["control"])
    return figure


def _isolines(axes: Axes, points: list[Document], name: str) -> None:
    x = np.unique([point["x_mm"] for point in points])
    y = np.unique([point["y_mm"] for point in points])
    value = {(point["x_mm"], point["y_mm"]): point[name] for point in points}
    field = np.array([[value[a, b] for a in x.tolist()] for b in y.tolist()])
    if np.ptp(field) > 0:
        axes.contourf(x, y, field, levels=LEVELS, cmap="viridis_r", alpha=0.35)
        axes.clabel(axes.contour(x, y, field, levels=LEVELS, cmap="viridis_r"), fmt="%.3g")
    axes.set_xlabel("x along the flight, mm at photo scale")
    axes.set_ylabel("y, mm")


def _control(axes: Axes, control: list[Document]) -> None:
    for use, (marker, label) in USE_MARKS.items():
        here = [point for point in control if point["use"] == use]
        if here:
            places = np.array([(point["x_mm"], point["y_mm"]) for point in here])
            axes.scatter(places[:, 0], places[:, 1], marker=marker, s=40, c="black", label=label, clip_on=False)
    axes.legend(fontsize=7, loc="upper right")


# ------------------------------------------------------------------------------------------------------- cameras


def _cameras(document: Document) -> Figure:
    rows = document["cameras"]
    figure = _figure(9, 1.6 + 0.45 * len(rows))
    figure.suptitle(f"{document['name']}: beside {document['reference']}")
    names = [row["camera"] for row in rows]
    for place, (name, title) in enumerate(
        (("coefficient_mm2", "K = f m_p, mm²"), ("eta_area", "area of a model at equal m_h")), 1
    ):
        axes = figure.add_subplot(1, 2, place, title=title)
        bars = axes.barh(names, [row[name] for row in rows], color=COLOURS[place - 1])
        axes.bar_label(bars, fmt="%.3g", padding=2, fontsize=8)
        axes.invert_yaxis()
        axes.margins(x=0.15)
    return figure


def _strip(document: Document) -> Figure:
    return strip_figure(_figure(11, 7), document)


DRAWINGS: dict[str, Callable[[Document], Figure]] = {
    "model": _model,
    "strip": _strip,
    "cameras": _cameras,
    "source-table": _cameras,
}
