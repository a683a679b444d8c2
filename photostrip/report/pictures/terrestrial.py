"""Pictures of terrestrial computations, as SVG text."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from photostrip.notes import Document
from photostrip.report.pictures.drawing import as_svg, drawn_alike, isolines, new_figure
from photostrip.report.pictures.style import MOVED, NOT_SIGNIFICANT, SMALL_TEXT, STABLE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ARROW_SHARE = 0.12  # of the size of the picture: length of the longest displacement


def terrestrial_picture(document: Document) -> str:
    """Draw what has a picture: the accuracy over a photo, displacements."""
    return DRAWINGS[document["kind"]](document)


@drawn_alike()
def accuracy_plot(document: Document) -> str:
    """Draw the required accuracy of directions, known on a fine grid over the whole photo."""
    camera = document["camera"]
    title = (
        f"{camera['name']}, f = {camera['principal_distance_mm']:g} mm: accuracy of directions for"
        f" {document['image_sigma_um']:g} µm in the photo ({document['formulas']})"
    )
    columns = {"horizontal_arcsec": "m_lambda, seconds of arc", "vertical_arcsec": "m_beta, seconds of arc"}
    return _over_the_photo(11, title, document["points"], columns)


@drawn_alike()
def theodolite_plot(document: Document) -> str:
    """Draw the image accuracy that a theodolite supports over the photo, known on a fine grid."""
    given = document["theodolite"]
    title = f"{document['camera']['name']}: {given['horizontal_arcsec']:g}″ in one round, {given['rounds']} rounds"
    return _over_the_photo(6.5, title, document["points"], {"supported_um": "supported image accuracy, µm"})


def _over_the_photo(width: float, title: str, points: list[Document], columns: dict[str, str]) -> str:
    """Draw isolines over the photo, a drawing for each column of the points, which form a grid row by row."""
    figure = new_figure(width, 4.6, title)
    x = np.unique([row["x"] for row in points])
    z = np.unique([row["z"] for row in points])
    for place, (key, name) in enumerate(columns.items(), 1):
        axes = figure.add_subplot(1, len(columns), place, aspect="equal")
        surface = np.array([row[key] for row in points]).reshape(len(z), len(x))
        isolines(axes, x, z, surface, filled=False)
        axes.set_title(name)
        axes.set_xlabel("x, mm")
        axes.set_ylabel("z, mm")
    return as_svg(figure)


@drawn_alike()
def displacement_plot(document: Document) -> str:
    """Draw the displacements in plan and in elevation, and as time series."""
    axes_names = document["axes"]
    up = axes_names.index("up")
    right, ahead = sorted(
        (place for place in range(3) if place != up), key=lambda n: axes_names[n] in {"north", "ahead"}
    )
    epochs = document["epochs"]
    figure = new_figure(13, 4.8, f"{document['name']}: displacements from {epochs[0]} to {epochs[-1]}")
    plan = figure.add_subplot(1, 3, 1, aspect="equal", title="plan")
    view = figure.add_subplot(1, 3, 2, aspect="equal", title="elevation")
    _arrows(plan, document, (right, ahead), ellipses=True)
    _arrows(view, document, (right, up), ellipses=False)
    _series(figure.add_subplot(1, 3, 3, title="length since the first epoch"), document)
    return as_svg(figure)


def _arrows(axes: Axes, document: Document, places: tuple[int, int], *, ellipses: bool) -> None:
    """Draw points with their displacements, enlarged, and their confidence ellipses, enlarged alike."""
    names, epochs = document["axes"], document["epochs"]
    first = {row["point"]: row for row in document["positions"] if row["epoch"] == epochs[0]}
    last = [row for row in document["displacements"] if row["epoch"] == epochs[-1] and row["length"] is not None]
    shown = [(row, first[row["point"]], row) for row in last]
    keys = ["xyz"[each] for each in places]
    start = np.array([[place[key] for key in keys] for _, place, _ in shown]).reshape(-1, 2)
    moved = np.array([[step[f"d{key}"] for key in keys] for _, _, step in shown]).reshape(-1, 2)
    colours = [_colour(point, step) for point, _, step in shown]
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
        _name_beside(axes, point, (base[0], base[1]), (3, 3))
        if ellipses and step["ellipse_major"] is not None:
            _ellipse(axes, base + shift * factor, step, factor)
    axes.set_xlabel(f"{names[places[0]]}, m (displacements × {factor:g})")
    axes.set_ylabel(f"{names[places[1]]}, m")
    axes.margins(0.15)


def _colour(point: Document, step: Document | None) -> str:
    """Return the colour of a point by its displacement since the first epoch."""
    if point["stable"]:
        return STABLE
    return MOVED if step is not None and step["significant"] else NOT_SIGNIFICANT


def _name_beside(axes: Axes, point: Document, place: tuple[Any, Any], shift: tuple[int, int]) -> None:
    axes.annotate(point["point"], place, xytext=shift, textcoords="offset points", fontsize=SMALL_TEXT)


def _ellipse(axes: Axes, centre: Any, step: Document, factor: float) -> None:  # noqa: ANN401 (a row of an array)
    from matplotlib.patches import Ellipse

    major, minor = step["ellipse_major"], step["ellipse_minor"]
    patch = Ellipse(
        (float(centre[0]), float(centre[1])),
        2 * factor * minor,
        2 * factor * major,
        angle=-step["azimuth_deg"],  # azimuths run clockwise from the upright axis
        fill=False,
        linewidth=0.6,
        edgecolor=NOT_SIGNIFICANT,
    )
    axes.add_patch(patch)


def _round_down(value: float) -> float:
    """Give 1, 2 or 5 times a power of ten that is not larger."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(step * power for step in (1, 2, 5) if step * power <= value * (1 + 1e-9)))


def _series(axes: Axes, document: Document) -> None:
    """Draw the length of each displacement over the epochs."""
    epochs, timed = document["epochs"], bool(document["times"])
    times = [document["times"][epoch] if timed else number for number, epoch in enumerate(epochs)]
    series: dict[str, list[Document]] = {}
    for row in document["displacements"]:
        series.setdefault(row["point"], []).append(row)
    for steps in series.values():
        lengths = [0.0, *(np.nan if step["length"] is None else step["length"] for step in steps)]
        axes.plot(times, lengths, marker="o", markersize=3, linewidth=0.8, color=_colour(steps[-1], steps[-1]))
        _name_beside(axes, steps[-1], (times[-1], lengths[-1]), (3, 0))
    if not timed:
        axes.set_xticks(times, epochs)
    unit = document["time_unit"]
    axes.set_xlabel(unit if timed else "epoch")
    axes.set_ylabel("m")
    axes.legend(handles=_legend(), fontsize=SMALL_TEXT)


def _legend() -> list[Any]:
    from matplotlib.lines import Line2D

    words = ((MOVED, "moved"), (NOT_SIGNIFICANT, "not significant"), (STABLE, "stable"))
    return [Line2D([], [], color=colour, marker="o", markersize=3, label=word) for colour, word in words]


DRAWINGS: dict[str, Callable[[Document], str]] = {
    "direction-accuracy": accuracy_plot,
    "theodolite-accuracy": theodolite_plot,
    "displacements": displacement_plot,
}
