"""Image residuals: in the photos, over the image plane of each camera, their distribution; the distortion of lenses."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import NormalDist, median
from typing import NamedTuple

import numpy as np

from photostrip.notes import Document, counted, given_in_pixels
from photostrip.report.pictures.chart import (
    Areas,
    Bar,
    Floats,
    Layer,
    Line,
    Map,
    Marks,
    Panel,
    Range,
    Segments,
    box,
    chart,
    nice,
)  # fmt: skip
from photostrip.report.pictures.places import Flags, Plan, Rays, format_of, grouped, rays_of, shortened
from photostrip.report.pictures.svg import Picture
from photostrip.report.sections.project import cameras_of

MOST_PHOTOS, COLUMNS = 24, (3, 6)  # on the picture, fewest and most
MOST_RAYS = 1800  # of a photo, over the square of the columns: what a small photo holds
CELLS = 8  # of the grid along the longer side of the image plane
LEAST_IN_CELL = 3  # residuals from which a cell has a mean
SHARE_ON_SCALE = 0.95  # share of the vectors that are not longer than a length of the scale
CAMERAS = 4  # whose image planes are drawn
RADIAL = {"k1": 3, "k2": 5, "k3": 7}  # parameters of a lens, and the powers of the radius that they count
CURVE = 60  # points of a curve
BARS = 33  # of a histogram, an odd number
LEAST_REACH = 4.5  # standard deviations that a histogram holds, at least


def rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0


def residual_pictures(plan: Plan) -> list[Picture]:
    """Draw the image residuals; nothing where photos have no orientation of their own."""
    rays = rays_of(plan.document)
    at = plan.images(rays.photo, rays.point)
    known = np.asarray(np.isfinite(np.hstack([at, rays.v])).all(axis=1))
    if not (known & rays.used).any():
        return []
    return [_vectors(plan, rays, at, known), *_planes(plan, rays, at, known & rays.used), _histogram(plan, rays, known)]


def _extent(plan: Plan, photos: set[str], at: Floats) -> tuple[Range, Range]:
    """Return what photos hold: their camera's format, or their points where that is not known."""
    cameras = cameras_of(plan.document)
    formats = [held for photo in sorted(photos) if photo in cameras and (held := format_of(cameras[photo]))]
    corners = np.array([corner for held in formats for corner in held]) if formats else at
    (a, b), (c, d) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    return (a, c), (b, d)


def _longer(extent: tuple[Range, Range]) -> float:
    return max(high - low for low, high in extent)


def _scale(v: Floats, longest: float) -> tuple[float, float]:
    """Return mm in the photo for each micrometre of a vector, and a round length for the bar, µm."""
    typical = max(float(np.quantile(np.append(np.linalg.norm(v, axis=1), 0.0), SHARE_ON_SCALE)), 1e-3)
    return longest / typical, nice(typical / 2)


class Vectors(NamedTuple):
    """Residuals drawn in photos, each cut at twice a length that few of them exceed."""

    extent: tuple[Range, Range]
    factor: float  # mm in the photo for each micrometre
    longest: float  # mm

    def panel(self, title: str, at: Floats, v: Floats, hints: Sequence[str], used: Flags) -> Map:
        size = np.linalg.norm(v, axis=1, keepdims=True) * self.factor
        ends = at + v * self.factor * np.minimum(1.0, 2 * self.longest / np.maximum(size, 1e-9))
        layers: list[Layer] = [Areas([box(*self.extent)], "open soft thin"), Segments(at, ends, "ink thin")]
        for chosen, kind, shape, words in ((used, "c1", "dot", ""), (~used, "failed open", "diamond", "left out")):
            own = np.flatnonzero(chosen).tolist()
            layers.append(Marks(at[own], kind, shape, [hints[n] for n in own], words, 3.0))
        return Map(layers, title, self.extent)


def _vectors(plan: Plan, rays: Rays, at: Floats, known: Flags) -> Picture:
    rows = grouped((rays.photo[n], n) for n in np.flatnonzero(known).tolist())
    sizes = {photo: rms(rays.v[own][rays.used[own]]) for photo, own in rows.items()}
    worst = sorted(rows, key=lambda photo: -sizes[photo])[:MOST_PHOTOS]
    size = np.linalg.norm(rays.v, axis=1)
    columns = int(np.clip(np.ceil(len(worst) ** 0.5), *COLUMNS))
    most = MOST_RAYS // columns**2
    shown = {photo: sorted(own, key=lambda n: -size[n])[:most] for photo, own in rows.items() if photo in worst}
    called, left_out = shortened(list(rows))
    drawn = [n for own in shown.values() for n in own]
    extent = _extent(plan, set(shown), at[drawn])
    longest = 0.2 * _longer(extent)
    factor, bar = _scale(rays.v[drawn][rays.used[drawn]], longest)
    vectors = Vectors(extent, factor, longest)
    panels = []
    for photo, own in shown.items():
        hints = [f"point {rays.point[n]}: {rays.v[n, 0]:+.1f}, {rays.v[n, 1]:+.1f} µm" for n in own]
        panels.append(
            vectors.panel(f"{called[photo]}: {sizes[photo]:.1f} µm", at[own], rays.v[own], hints, rays.used[own])
        )
    caption = (
        "Image residuals at their points, measured minus computed, and their rms in each photo. Errors of one point "
        "stand alone; errors of a photo or camera point the same way side by side."
    )
    if any(len(rows[photo]) > most for photo in shown):
        caption += f" Of each photo the {most} largest are drawn."
    if len(shown) < len(rows):
        caption += f" The {len(shown)} of {len(rows)} photos with the largest residuals, in flight order."
    caption += left_out
    words = f"{counted(len(rows), 'photo')}; the largest rms is {sizes[worst[0]]:.1f} µm in photo {worst[0]}."
    bars = [Bar(bar * factor, f"{bar:g} µm")]
    return chart("residuals", ("Image residuals by photo", caption, words), panels, columns=columns, bars=bars)


def _planes(plan: Plan, rays: Rays, at: Floats, used: Flags) -> list[Picture]:
    cameras = cameras_of(plan.document)
    rows = grouped((cameras[rays.photo[n]]["id"], n) for n in np.flatnonzero(used).tolist())
    shown = {name: rows[name] for name in list(rows)[:CAMERAS]}
    extents = {name: _extent(plan, {rays.photo[n] for n in own}, at[own]) for name, own in shown.items()}
    cells = {name: _cells(at[own], rays.v[own], _longer(extents[name]) / CELLS) for name, own in shown.items()}
    means = np.concatenate([cell[:, 2:4] for cell in cells.values()])
    if not len(means):
        return []
    longest = 0.8 * max(map(_longer, extents.values())) / CELLS
    factor, bar = _scale(means, longest)
    panels = []
    for name, cell in cells.items():
        hints = [f"{n:.0f} residuals, mean {x:+.2f}, {y:+.2f} µm" for _, _, x, y, n in cell.tolist()]
        vectors = Vectors(extents[name], factor, longest)
        panels.append(vectors.panel(f"camera {name}", cell[:, :2], cell[:, 2:4], hints, np.ones(len(cell), bool)))
    caption = (
        "Mean image residual in each part of the image plane, over all photos of a camera. Vectors that follow a "
        "pattern tell of a lens, a film or a plate that the calibration does not describe; those of good photos are "
        "short and mixed."
    )
    largest = float(np.linalg.norm(means, axis=1).max())
    words = f"{counted(len(shown), 'camera')}; the largest mean is {largest:.2f} µm."
    bars = [Bar(bar * factor, f"mean {bar:g} µm")]
    title = "Mean residuals of the image plane"
    return [chart("image-plane", (title, caption, words), panels, columns=min(2, len(panels)), bars=bars)]


def _cells(at: Floats, v: Floats, size: float) -> Floats:
    """Return place, mean residual and number of the residuals in each cell that has enough of them, (n, 5)."""
    _, cell = np.unique(np.floor(at / size), axis=0, return_inverse=True)
    cell, columns = cell.ravel(), np.column_stack([at, v])
    count = np.bincount(cell)
    means = np.column_stack([np.bincount(cell, column) / count for column in columns.T])
    return np.column_stack([means, count])[count >= LEAST_IN_CELL]


def distortion_pictures(document: Document) -> list[Picture]:
    """Draw the radial distortion of each lens, image to ideal: as given, and as the self-calibration has it."""
    panels = []
    cameras, own_unit = [each for each in document["cameras"] if each["format_mm"]], given_in_pixels(document)
    for camera in cameras:
        radius = np.linspace(0.0, float(np.hypot(*camera["format_mm"])) / 2.0, CURVE)
        given, layers = _given_distortion(camera, radius), list[Layer]()
        pixel = own_unit.get(camera["id"])
        axes = ("px from the principal point", "px") if pixel else ("mm from the principal point", "µm")
        scale = np.array([1.0, 0.001]) / pixel if pixel else np.ones(2)
        found = [row for row in _calibrated(document) if row["camera"] == camera["id"] and row["parameter"] in RADIAL]
        if given is not None:
            layers.append(Line(scale * np.column_stack([radius, given]), "c1 dashed", "given"))
        if found:
            powers = np.column_stack([1000.0 * radius ** RADIAL[row["parameter"]] for row in found])
            adjusted = (0.0 if given is None else given) + powers @ [row["value"] for row in found]
            every = [row["parameter"] for row in _calibrated(document) if row["camera"] == camera["id"]]
            at = [every.index(row["parameter"]) for row in found]
            sigma = np.array([row["sigma"] for row in found])
            covariance = np.outer(sigma, sigma) * [[row["correlations"][n] for n in at] for row in found]
            spread = np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", powers, covariance, powers), 0.0))
            layers.append(Line(scale * np.column_stack([radius, adjusted]), "c2", "adjusted"))
            layers += [
                Line(scale * np.column_stack([radius, adjusted + side * spread]), "c2 thin dotted", words)
                for side, words in ((1.0, "its standard deviation"), (-1.0, ""))
            ]
        if layers:
            panels.append(Panel(layers, camera["id"] if len(cameras) > 1 else "", axes))
    if not panels:
        return []
    caption = "Radial distortion, what is added to an image point away from the principal point to make it ideal."
    words = "Radial distortion of the lens", caption, f"{counted(len(panels), 'lens', 'lenses')}."
    return [chart("distortion", words, panels[:CAMERAS], columns=min(len(panels), 2), height=180.0)]


def _calibrated(document: Document) -> Sequence[Document]:
    return list((document.get("bundle") or {}).get("calibration") or ())


def _given_distortion(camera: Document, radius: Floats) -> Floats | None:
    """Return the distortion, µm, of a lens as it is given; of one that is added to ideal points to first order."""
    sign = 1000.0 if camera["lens_direction"] == "image_to_ideal" else -1000.0
    if camera["lens_radius"]:
        return np.asarray(sign * np.interp(radius, camera["lens_radius"], camera["lens_distortion"]), float)
    if not any(camera["lens_k"] or ()):
        return None
    powers = zip(camera["lens_k"], RADIAL.values(), strict=False)
    return np.asarray(sign * sum(k * radius**power for k, power in powers), float)


def _histogram(plan: Plan, rays: Rays, known: Flags) -> Picture:
    """Draw how what was tested for gross errors is distributed, with the limits.

    That are the image residuals of a bundle, each over its standard deviation, and the y parallaxes of strips; where
    nothing was tested, the image residuals.
    """
    document, tests = plan.document, rays.test[known & rays.used]
    tests = tests[np.isfinite(tests).all(axis=1)]
    limits = [row["limit_um"] for row in document["models"] if row.get("limit_um") is not None]
    if len(tests):
        limits, unit, sigma = [document["bundle"]["screening"]["limit"]], "", 1.0
        values, what = tests.ravel(), "image residuals, each over its own standard deviation"
    else:
        of_rays = document["residuals"]["q_um"].astype(float)
        parallaxes = of_rays[np.isfinite(of_rays)] if limits else np.zeros(0)
        found = len(parallaxes) > 0
        values = parallaxes if found else rays.v[known & rays.used].ravel()
        limits, unit, sigma = limits if found else [], " µm", rms(values) or 1.0
        what = "y parallaxes of the pairs" if found else "image residuals"
    reach = max(LEAST_REACH * sigma, 1.1 * max(limits, default=0.0))
    edges, x = np.linspace(-reach, reach, BARS + 1), np.linspace(-reach, reach, 121)
    counts = np.histogram(np.clip(values, -reach, reach), edges)[0].tolist()
    curve = len(values) * (edges[1] - edges[0]) / sigma * np.exp(-((x / sigma) ** 2) / 2) / np.sqrt(2 * np.pi)
    high = 1.08 * float(max(*counts, curve.max()))
    columns = [n for n in range(BARS) if counts[n]]
    boxes = [box((float(edges[n]), float(edges[n + 1])), (0.0, counts[n])) for n in columns]
    layers: list[Layer] = [
        Areas(boxes, "column", [counted(counts[n], "residual") for n in columns], what.partition(",")[0]),
        Line(np.column_stack([x, curve]), "c2", f"normal curve, σ = {sigma:.3g}{unit}"),
    ]
    caption = f"How the {what}{',' if ',' in what else ''} are distributed"
    if limits:
        limit, ends = median(limits), (min(limits), max(limits))
        words = f"median limit ±{limit:.1f} µm" if unit else f"rejected beyond ±{limit:.2f}"
        foot, head = (np.array([(-limit, y), (limit, y)]) for y in (0.0, high))
        sides = [box((-ends[1], -ends[0]), (0.0, high)), box(ends, (0.0, high))]
        layers = [Areas(sides, "area failed", words="all limits")] * (ends[0] < ends[1]) + layers
        layers.append(Segments(foot, head, "failed dashed", words=words))
        caption += ", with the limits of the search for gross errors"
        caption += f": {ends[0]:.1f} to {ends[1]:.1f} µm for points of ordinary redundancy" if unit else ""
    beyond = int((np.abs(values) > reach).sum())
    if beyond:
        caption += f". At the ends of the axis {counted(beyond, 'residual')} beyond it"
    three, chance = int((np.abs(values) > 3 * sigma).sum()), 2 * NormalDist().cdf(-3.0) * len(values)
    words = f"{len(values)} in all, {three} beyond three standard deviations; {chance:.1f} would be by chance."
    labels = f"residual{f',{unit}' if unit else ' over its standard deviation'}", "number"
    panel = Panel(layers, "", labels, (-reach, reach), (0.0, high))
    return chart("histogram", ("Distribution of the residuals", f"{caption}.", words), [panel], height=240.0)
