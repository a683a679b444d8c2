"""Pictures of terrestrial computations, as SVG text: the same input gives the same bytes.

matplotlib is an extra; it is imported when a picture is drawn.
"""

from __future__ import annotations

from contextlib import contextmanager
from importlib.util import find_spec
from io import StringIO
from typing import TYPE_CHECKING, Any

import numpy as np

from photostrip.errors import Fault, InputError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Document = dict[str, Any]

INSTALL = "pip install photostrip[report]"
METADATA = {"Date": None, "Creator": "photostrip"}
FINE = 81  # points across the photo
LEVELS = 9
ARROW_SHARE = 0.12  # of the size of the picture: length of the longest displacement
MOVED, STILL, STABLE = "#c0392b", "#7f8c8d", "#2471a3"


def check_plot(file: str) -> None:
    """Make sure that a picture can be drawn and written, before anything is computed.

    Raises
    ------
    InputError
        When matplotlib is missing or the name does not end in .svg.
    """
    if not file.lower().endswith(".svg"):
        message = "pictures are written as SVG"
        raise InputError(Fault(message, "plot-format", file, key="--plot", expected="a name that ends in .svg"))
    if not _available():
        raise InputError(Fault("pictures need matplotlib, which is not installed", "extra", key="--plot", fix=INSTALL))


def _available() -> bool:
    try:
        return find_spec("matplotlib") is not None
    except ValueError:  # put out of action: sys.modules["matplotlib"] is None
        return False


@contextmanager
def styled() -> Iterator[None]:
    """Draw in matplotlib's own style, whatever the user's configuration says, and without random ids."""
    import matplotlib as mpl

    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams["svg.hashsalt"] = "photostrip"
        mpl.rcParams["svg.fonttype"] = "none"
        yield


def _figure(width: float, height: float) -> Figure:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def _svg(figure: Figure) -> str:
    stream = StringIO()
    figure.savefig(stream, format="svg", metadata=METADATA)
    return "".join(f"{line.rstrip()}\n" for line in stream.getvalue().splitlines())


@styled()
def accuracy_plot(document: Document, fine: Document) -> str:
    """Draw the required accuracy of directions over the photo.

    Parameters
    ----------
    document : dict
        The document of required accuracies, for title and names.
    fine : dict
        The same on a fine grid over the whole photo.
    """
    camera = document["camera"]
    figure = _figure(11, 4.6)
    figure.suptitle(
        f"{camera['name']}, f = {camera['principal_distance_mm']:g} mm: accuracy of directions for"
        f" {document['image_sigma_um']:g} µm in the photo ({document['formulas']})"
    )
    for place, (key, name) in enumerate((("horizontal", "m_lambda"), ("vertical", "m_beta")), 1):
        axes = figure.add_subplot(1, 2, place, aspect="equal")
        _isolines(axes, fine["points"], f"{key}_arcsec", f"{name}, seconds of arc")
    return _svg(figure)


@styled()
def theodolite_plot(document: Document, fine: Document) -> str:
    """Draw the image accuracy that a theodolite supports over the photo.

    Parameters
    ----------
    document : dict
        The document of supported accuracies, for title and names.
    fine : dict
        The same on a fine grid over the whole photo.
    """
    camera, given = document["camera"], document["theodolite"]
    figure = _figure(6.5, 4.6)
    figure.suptitle(f"{camera['name']}: {given['horizontal_arcsec']:g}″ in one round, {given['rounds']} rounds")
    axes = figure.add_subplot(1, 1, 1, aspect="equal")
    _isolines(axes, fine["points"], "supported_um", "supported image accuracy, µm")
    return _svg(figure)


def _isolines(axes: Axes, points: list[Document], key: str, title: str) -> None:
    """Draw lines of equal value over the photo."""
    x = np.unique([row["x"] for row in points])
    z = np.unique([row["z"] for row in points])
    values = np.array([row[key] for row in points]).reshape(len(z), len(x))
    if np.ptp(values) > 0:
        lines = axes.contour(x, z, values, levels=LEVELS, cmap="viridis")
        axes.clabel(lines, fmt="%.3g")
    axes.set_title(title)
    axes.set_xlabel("x, mm")
    axes.set_ylabel("z, mm")


@styled()
def displacement_plot(document: Document) -> str:
    """Draw the displacements in plan and in elevation, and as time series."""
    axes_names = document["frame"]["axes"]
    up = axes_names.index("up")
    right, ahead = sorted(
        (place for place in range(3) if place != up), key=lambda n: axes_names[n] in {"north", "ahead"}
    )
    figure = _figure(13, 4.8)
    epochs = [epoch["id"] for epoch in document["epochs"]]
    figure.suptitle(f"{document['name']}: displacements from {epochs[0]} to {epochs[-1]}")
    plan = figure.add_subplot(1, 3, 1, aspect="equal", title="plan")
    view = figure.add_subplot(1, 3, 2, aspect="equal", title="elevation")
    _arrows(plan, document, (right, ahead), ellipses=True)
    _arrows(view, document, (right, up), ellipses=False)
    _series(figure.add_subplot(1, 3, 3, title="length since the first epoch"), document)
    return _svg(figure)


def _arrows(axes: Axes, document: Document, places: tuple[int, int], *, ellipses: bool) -> None:
    """Draw points with their displacements, enlarged, and their confidence ellipses, enlarged alike."""
    names = document["frame"]["axes"]
    found = [(point, point["epochs"][0], point["epochs"][-1].get("since_first")) for point in document["points"]]
    shown = [(point, place, step) for point, place, step in found if step is not None]
    keys = ["xyz"[each] for each in places]
    start = np.array([[place[key] for key in keys] for _, place, _ in shown]).reshape(-1, 2)
    moved = np.array([[step[f"d{key}"] for key in keys] for _, _, step in shown]).reshape(-1, 2)
    colours = [STABLE if point["stable"] else MOVED if step["significant"] else STILL for point, _, step in shown]
    size = max(float(np.ptp(start, axis=0).max()), 1.0) if len(start) else 1.0
    longest = float(np.linalg.norm(moved, axis=1).max()) if len(moved) else 0.0
    factor = _round_down(ARROW_SHARE * size / longest) if longest else 1.0
    if len(start):
        axes.scatter(start[:, 0], start[:, 1], s=12, c=colours)
        arrow = moved * factor
        axes.quiver(
            start[:, 0],
            start[:, 1],
            arrow[:, 0],
            arrow[:, 1],
            color=colours,
            angles="xy",
            scale_units="xy",
            scale=1,
            width=0.005,
        )
    for (point, _, step), base, shift in zip(shown, start, moved, strict=True):
        axes.annotate(point["id"], (base[0], base[1]), xytext=(3, 3), textcoords="offset points", fontsize=7)
        if ellipses and step["ellipse"]["major"] is not None:
            _ellipse(axes, base + shift * factor, step["ellipse"], factor)
    axes.set_xlabel(f"{names[places[0]]}, m (displacements × {factor:g})")
    axes.set_ylabel(f"{names[places[1]]}, m")
    axes.margins(0.15)


def _ellipse(axes: Axes, centre: Any, ellipse: Document, factor: float) -> None:  # noqa: ANN401 (a row of an array)
    from matplotlib.patches import Ellipse

    patch = Ellipse(
        (float(centre[0]), float(centre[1])),
        2 * factor * ellipse["minor"],
        2 * factor * ellipse["major"],
        angle=-ellipse["azimuth_deg"],  # azimuths run clockwise from the upright axis
        fill=False,
        linewidth=0.6,
        edgecolor=STILL,
    )
    axes.add_patch(patch)


def _round_down(value: float) -> float:
    """Give 1, 2 or 5 times a power of ten that is not larger."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(step * power for step in (1, 2, 5) if step * power <= value * (1 + 1e-9)))


def _series(axes: Axes, document: Document) -> None:
    """Draw the length of each displacement over the epochs."""
    epochs = document["epochs"]
    timed = all("time" in epoch for epoch in epochs)
    times = [epoch["time"] if timed else number for number, epoch in enumerate(epochs)]
    for point in document["points"]:
        steps = [entry.get("since_first") for entry in point["epochs"]]
        lengths = [0.0, *(np.nan if step is None else step["length"] for step in steps[1:])]
        last = steps[-1]
        moved = last is not None and last["significant"]
        colour = STABLE if point["stable"] else MOVED if moved else STILL
        axes.plot(times, lengths, marker="o", markersize=3, linewidth=0.8, color=colour)
        axes.annotate(point["id"], (times[-1], lengths[-1]), xytext=(3, 0), textcoords="offset points", fontsize=7)
    if not timed:
        axes.set_xticks(times, [epoch["id"] for epoch in epochs])
    unit = document["units"]["rate"].rpartition(" ")[2]
    axes.set_xlabel(unit if timed else "epoch")
    axes.set_ylabel("m")
    axes.legend(handles=_legend(), fontsize=7)


def _legend() -> list[Any]:
    from matplotlib.lines import Line2D

    words = ((MOVED, "moved"), (STILL, "not significant"), (STABLE, "stable"))
    return [Line2D([], [], color=colour, marker="o", markersize=3, label=word) for colour, word in words]
