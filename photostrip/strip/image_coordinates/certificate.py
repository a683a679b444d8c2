"""Coordinates of fiducial marks from the distances between them, where an old certificate has nothing else.

Distances fix the figure of the marks, not where it lies. Its place comes from nominal coordinates, or from the words
that say where on the photo a mark is: then the lines between opposite marks meet in the origin, as on the camera, and
the figure is turned as little as possible against the words.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.errors import Fault, InputError

PLACES = {
    f"{vertical}-{horizontal}".strip("-"): (x, y)
    for vertical, y in (("bottom", -1.0), ("", 0.0), ("top", 1.0))
    for horizontal, x in (("left", -1.0), ("", 0.0), ("right", 1.0))
    if (x, y) != (0.0, 0.0)
}
POOR_FIT = 0.03  # mm; distances were measured to a hundredth
LOOSE_FIGURE = 1e-4  # relative size of a singular value below which the figure can change without changing a distance
CONVERGED = 1e-10  # mm
ITERATIONS = 50


@dataclass(frozen=True, eq=False)
class Certificate:
    """Marks solved from distances."""

    marks: dict[str, tuple[float, float]]  # coordinates by mark, mm
    residuals: Floats  # (d,): computed minus given distances, mm
    sigma0: float  # standard deviation of a distance, mm; NaN without redundancy
    redundancy: int  # distances more than the figure needs


def solve(
    distances: Sequence[tuple[str, str, float]],
    *,
    nominal: Mapping[str, tuple[float, float]] | None = None,
    places: Mapping[str, str] | None = None,
) -> Certificate:
    """Coordinates of fiducial marks, mm, from measured distances: least squares with all distances of equal weight.

    distances: two marks and the distance between them, mm.
    nominal: nominal coordinates of the marks, mm: a start, and the place of the figure.
    places: instead, where on the photo each mark is: a key of ``PLACES``.
    Raises InputError with a fault for each distance between marks that are not known or not two, and when the distances
        do not fix the figure, or contradict each other so much that there is none.

    Source: derived; trilateration with inner constraints.
    """
    start = {name: PLACES[place] for name, place in (places or {}).items()} if nominal is None else dict(nominal)
    names = list(start)
    ends, given = _distances(distances, names)
    xy = np.array(list(start.values()), float)
    unit = xy
    if nominal is None:
        lengths = np.linalg.norm(np.subtract(*np.moveaxis(xy[ends], 1, 0)), axis=1)
        xy = xy * float(given.sum() / lengths.sum())
        xy = _turned(_adjusted(xy, ends, given), unit)
    else:  # shifted and turned to lie on the nominal coordinates
        mean = xy.mean(axis=0)
        figure = _adjusted(xy, ends, given)
        xy = _turned(figure, unit - mean, figure.mean(axis=0)) + mean
    residuals = _lengths(xy, ends)[0] - given
    redundancy = len(given) - (2 * len(names) - 3)
    sigma0 = float(np.sqrt((residuals**2).sum() / redundancy)) if redundancy else float("nan")
    marks = {name: (float(x), float(y)) for name, (x, y) in zip(names, xy, strict=True)}
    return Certificate(marks=marks, residuals=residuals, sigma0=sigma0, redundancy=redundancy)


def _distances(distances: Sequence[tuple[str, str, float]], names: list[str]) -> tuple[Numbers, Floats]:
    """Return the marks at both ends of each distance, (d, 2), and the distances; unknown marks are refused."""
    faults = []
    for number, (first, second, _) in enumerate(distances):
        unknown = [name for name in (first, second) if name not in names]
        if unknown:
            message, expected = f"the camera has no mark {unknown[0]}", f"one of {', '.join(names)}"
            faults.append(Fault(message, code="unknown-mark", key=f"fiducial_distances[{number}]", expected=expected))
        elif first == second:
            message = f"a distance from mark {first} to itself"
            faults.append(Fault(message, code="certificate", key=f"fiducial_distances[{number}]"))
    if faults:
        raise InputError(faults)
    ends = np.array([[names.index(first), names.index(second)] for first, second, _ in distances], np.intp)
    return ends.reshape(-1, 2), np.array([length for *_, length in distances], float)


def _lengths(xy: Floats, ends: Numbers) -> tuple[Floats, Floats]:
    """Distances, and their derivatives by all coordinates, shape (d, 2 n)."""
    arms = xy[ends[:, 1]] - xy[ends[:, 0]]
    lengths = np.linalg.norm(arms, axis=1)
    design = np.zeros((len(ends), len(xy), 2))
    rows = np.arange(len(ends))
    design[rows, ends[:, 1]] = arms / lengths[:, None]
    design[rows, ends[:, 0]] = -arms / lengths[:, None]
    return lengths, design.reshape(len(ends), -1)


def _adjusted(xy: Floats, ends: Numbers, given: Floats) -> Floats:
    """Least squares with inner constraints: the figure moves as little as possible from where it started."""
    unknowns = 2 * len(xy) - 3
    for _ in range(ITERATIONS):
        lengths, design = _lengths(xy, ends)
        values = np.linalg.svd(design, compute_uv=False)
        rank = int((values > LOOSE_FIGURE * values[:1]).sum())
        if rank < unknowns:
            message = f"{rank} independent distances do not fix a figure of {len(xy)} marks; it takes {unknowns}"
            fix = "give a diagonal, or distances of the loose mark to two others"
            raise InputError(Fault(message, code="certificate", key="fiducial_distances", fix=fix))
        step = np.linalg.lstsq(design, given - lengths, rcond=LOOSE_FIGURE)[0]
        xy = xy + step.reshape(-1, 2)
        if np.abs(step).max() <= CONVERGED:
            return xy
    message = "the distances between the fiducial marks contradict each other: no figure has them"
    fix = "check which marks each distance joins, and its digits"
    raise InputError(Fault(message, code="certificate", key="fiducial_distances", fix=fix))


def _turned(xy: Floats, unit: Floats, centre: Floats | None = None) -> Floats:
    """Turn the figure about its centre as its marks should lie."""
    xy = xy - (_centre(xy, unit) if centre is None else centre)
    along, across = (xy * unit).sum(), (xy[:, 0] * unit[:, 1] - xy[:, 1] * unit[:, 0]).sum()
    cos, sin = np.array([along, across]) / np.hypot(along, across)
    return np.asarray(xy @ np.array([[cos, sin], [-sin, cos]]), np.float64)


def _centre(xy: Floats, unit: Floats) -> Floats:
    """Where the lines between opposite marks meet; the mean of the marks when no two pairs are opposite."""
    pairs = [(i, j) for i, j in combinations(range(len(xy)), 2) if (unit[i] == -unit[j]).all()]
    if len(pairs) < 2:
        return np.asarray(xy.mean(axis=0), np.float64)
    first, second = xy[[i for i, _ in pairs]], xy[[j for _, j in pairs]]
    along = (second - first) / np.linalg.norm(second - first, axis=1, keepdims=True)
    across = np.eye(2) - along[:, :, None] * along[:, None, :]
    return np.asarray(np.linalg.solve(across.sum(axis=0), np.einsum("nij,nj->i", across, first)), np.float64)
