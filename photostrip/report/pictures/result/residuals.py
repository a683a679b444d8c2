"""Image residuals: vectors in the photos, their mean over the image plane of each camera, their distribution."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from photostrip.notes import Document, counted
from photostrip.report.pictures import svg
from photostrip.report.pictures.chart import LEFT, WIDTH
from photostrip.report.pictures.ground.image_plane import Frame, Residual, frame_of, residuals_of
from photostrip.report.pictures.ground.plan_view import Pair, middle
from photostrip.report.pictures.result.histogram import histogram_picture, rms
from photostrip.report.pictures.svg import Picture
from photostrip.report.sections.project import cameras_of

COLUMNS, PHOTO_ROWS = 6, 4  # of photos on the picture
TILE, BETWEEN = 142.0, 14.0  # a photo on the picture
LONGEST = 28.0  # a vector in a photo
CELLS = 8  # of the grid along the longer side of the image plane
PLANE = 400.0  # the image plane of a camera on the picture
LEAST_IN_CELL = 3  # residuals from which a cell has a mean
SHARE_ON_SCALE = 0.95  # share of the vectors that are not longer than LONGEST
CAMERAS = 4  # whose image planes are drawn


def residual_pictures(document: Document) -> list[Picture]:
    """Draw the image residuals; nothing where photos have no orientation of their own."""
    found = residuals_of(document)
    used = [each for each in found if each.used]
    if not used:
        return []
    return [*_vectors(document, found), *_grids(document, used), histogram_picture(document, used)]


def _frame(document: Document, found: Iterable[Residual], photos: set[str]) -> Frame:
    """Return the frame of photos: that of their camera, or what holds their points where the format is not known."""
    cameras = cameras_of(document)
    frames = [frame for photo in sorted(photos) if (frame := frame_of(cameras[photo]))]
    places = [corner for frame in frames for corner in (frame.low, frame.high)]
    places = places or [each.place for each in found if each.photo in photos]
    xs, ys = [x for x, _ in places], [y for _, y in places]
    return Frame((min(xs), min(ys)), (max(xs), max(ys)))


def _unit(lengths: Iterable[float], longest: float) -> tuple[float, float]:
    """Return picture units for each micrometre, and the length of the bar in micrometres."""
    ordered = sorted(lengths)
    typical = max(ordered[min(int(SHARE_ON_SCALE * len(ordered)), len(ordered) - 1)], 1e-3)
    return longest / typical, svg.nice(typical / 2)


def _arrow(start: svg.Point, size: tuple[float, float], factor: float, most: float, kind: str) -> str:
    """Draw a vector, cut at the longest one."""
    length = math.hypot(*size) * factor
    shown = factor * min(1.0, most / length) if length else 0.0
    return svg.line(start, (start[0] + size[0] * shown, start[1] - size[1] * shown), kind)


def _bar(length: float, words: str) -> list[str]:
    return [svg.line((LEFT, 22.0), (LEFT + length, 22.0), "bar"), svg.text((LEFT + length + 8.0, 26.5), words)]


def _vectors(document: Document, found: Sequence[Residual]) -> list[Picture]:
    by_photo: dict[str, list[Residual]] = {}
    for each in found:
        by_photo.setdefault(each.photo, []).append(each)
    sizes = {photo: rms([v for each in rows if each.used for v in each.size]) for photo, rows in by_photo.items()}
    chosen = sorted(by_photo, key=lambda photo: -sizes[photo])[: COLUMNS * PHOTO_ROWS]
    shown = [photo for photo in by_photo if photo in chosen]
    frame = _frame(document, found, set(shown))
    wide, high = frame.high[0] - frame.low[0], frame.high[1] - frame.low[1]
    scale = TILE / max(wide, high)
    tall = high * scale
    factor, bar = _unit((math.hypot(*each.size) for photo in shown for each in by_photo[photo] if each.used), LONGEST)
    drawn: list[str] = []
    left = (WIDTH - COLUMNS * TILE - (COLUMNS - 1) * BETWEEN) / 2 + (TILE - wide * scale) / 2
    for number, photo in enumerate(shown):
        row, column = divmod(number, COLUMNS)
        x, y = left + column * (TILE + BETWEEN), 62.0 + row * (tall + 30.0)
        drawn.append(svg.rectangle((x, y), (wide * scale, tall), "frame"))
        drawn.append(svg.text((x + 2.0, y - 5.0), f"{photo}: {sizes[photo]:.1f} µm", "tick"))
        for each in by_photo[photo]:
            place = x + (each.place[0] - frame.low[0]) * scale, y + (frame.high[1] - each.place[1]) * scale
            drawn.append(_arrow(place, each.size, factor, 2 * LONGEST, "residual"))
            hint = f"point {each.point}: {each.size[0]:+.1f}, {each.size[1]:+.1f} µm"
            kind, shape = ("fill-1", "dot") if each.used else ("left-out", "diamond")
            drawn.append(svg.mark(place, shape, kind, hint, 3.0))
    drawn += _bar(bar * factor, f"{bar:g} µm")
    if any(not each.used for photo in shown for each in by_photo[photo]):
        drawn += [
            svg.mark((LEFT + 180.0, 22.0), "diamond", "left-out", "", 4.0),
            svg.text((LEFT + 194.0, 26.5), "left out"),
        ]
    rows = math.ceil(len(shown) / COLUMNS)
    caption = (
        "Image residuals at their points, measured minus computed, and their rms in each photo. Errors of one point "
        "stand alone; errors of a photo or camera point the same way side by side."
    )
    if len(shown) < len(by_photo):
        caption += f" The {len(shown)} of {len(by_photo)} photos with the largest residuals, in flight order."
    worst = max(sizes, key=lambda photo: sizes[photo])
    words = f"{counted(len(by_photo), 'photo')}; the largest rms is {sizes[worst]:.1f} µm in photo {worst}."
    height = 62.0 + rows * (tall + 30.0)
    return [svg.picture("image-residuals", (WIDTH, height), drawn, "Image residuals by photo", caption, words)]


def _grids(document: Document, used: Sequence[Residual]) -> list[Picture]:
    cameras = cameras_of(document)
    by_camera: dict[str, list[Residual]] = {}
    for each in used:
        by_camera.setdefault(cameras[each.photo]["id"], []).append(each)
    shown = list(by_camera)[:CAMERAS]
    frames = {name: _frame(document, by_camera[name], {each.photo for each in by_camera[name]}) for name in shown}
    cells = {name: _cells(frames[name], by_camera[name]) for name in shown}
    lengths = [math.hypot(*each.mean) for grid in cells.values() for each in grid]
    if not lengths:
        return []
    factor, bar = _unit(lengths, PLANE / CELLS * 0.8)
    drawn: list[str] = []
    top = 0.0
    for number, name in enumerate(shown):
        frame = frames[name]
        scale = PLANE / max(frame.high[0] - frame.low[0], frame.high[1] - frame.low[1])
        wide, high = (frame.high[0] - frame.low[0]) * scale, (frame.high[1] - frame.low[1]) * scale
        row, column = divmod(number, 2)
        x = (WIDTH - PLANE) / 2 if len(shown) == 1 else 50.0 + column * (PLANE + 60.0)
        y = 66.0 + row * (PLANE + 40.0)
        top = max(top, y + high)
        drawn.append(svg.rectangle((x, y), (wide, high), "frame"))
        drawn.append(svg.text((x + 2.0, y - 8.0), f"camera {name}", "title"))
        drawn += [
            svg.line((x + wide / 2, y), (x + wide / 2, y + high), "grid"),
            svg.line((x, y + high / 2), (x + wide, y + high / 2), "grid"),
        ]
        for cell in cells[name]:
            place = x + (cell.place[0] - frame.low[0]) * scale, y + (frame.high[1] - cell.place[1]) * scale
            drawn.append(_arrow(place, cell.mean, factor, PLANE / CELLS, "residual strong"))
            hint = f"{cell.residuals} residuals, mean {cell.mean[0]:+.2f}, {cell.mean[1]:+.2f} µm"
            drawn.append(svg.circle(place, 1.5 + 0.6 * math.sqrt(min(cell.residuals, 60)) / 2, "fill-1", hint))
    drawn += _bar(bar * factor, f"mean {bar:g} µm")
    caption = (
        "Mean image residual in each part of the image plane, over all photos of a camera. Vectors that follow a "
        "pattern tell of a lens, a film or a plate that the calibration does not describe; those of good photos are "
        "short and mixed. Dots grow with the number of residuals."
    )
    words = f"{counted(len(shown), 'camera')}; the largest mean is {max(lengths):.2f} µm."
    return [svg.picture("image-plane", (WIDTH, top + 20.0), drawn, "Mean residuals of the image plane", caption, words)]


class Cell(NamedTuple):
    place: Pair  # mean of its residuals' places
    mean: Pair
    residuals: int


def _cells(frame: Frame, used: Sequence[Residual]) -> list[Cell]:
    """Return the cells of the image plane that have enough residuals."""
    size = max(frame.high[0] - frame.low[0], frame.high[1] - frame.low[1]) / CELLS
    found: dict[tuple[int, int], list[Residual]] = {}
    for each in used:
        cell = math.floor((each.place[0] - frame.low[0]) / size), math.floor((each.place[1] - frame.low[1]) / size)
        found.setdefault(cell, []).append(each)
    return [
        Cell(middle([each.place for each in rows]), middle([each.size for each in rows]), len(rows))
        for _, rows in sorted(found.items())
        if len(rows) >= LEAST_IN_CELL
    ]
