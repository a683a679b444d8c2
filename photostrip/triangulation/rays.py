"""Points whose rays contradict each other from model to model: which ray is wrong, if that can be told.

An error along the base changes no y parallax. It shows where a point stands in two models: its scale ratio does not
belong. And a point rejected in one pair may still stand in the next one, with the photo they share. The wrong ray is
the only one without which the others meet; where there is no such ray, the point is left out.

Source: derived; see docs/sources.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.statistics import chi2_quantile

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from photostrip.points import PhotoPoints
    from photostrip.triangulation.formation import FormedStrip
    from photostrip.triangulation.relative import Orientation

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]
    Flags = NDArray[np.bool_]

CONFIDENCE = 0.999
ORIENTATION_SHARE = 3.0  # variance of rays of distant photos against that of coordinates: the strip adds to it
FEWEST = 3  # rays from which a wrong one can be told, if it does not lie along the base
UNDECIDED = -1


@dataclass(frozen=True, eq=False)
class Contradictions:
    """Points with rays that contradict each other.

    Parameters
    ----------
    point : ndarray of int, shape (c,)
        The points.
    ray : ndarray of int, shape (c,)
        Row of the wrong measurement in the observations; -1 where it cannot be told and the point is left out.
    value, limit : ndarray, shape (c,)
        Largest deviation of its scale ratios in units of their limit, and 1; NaN when none was beyond it.
    left_out : ndarray of bool, shape (m,)
        Rows of the pairs' table whose model points must not count.
    unfit : ndarray of bool, shape (m,)
        Those of them that must not orient their pair either.
    """

    point: Numbers
    ray: Numbers
    value: Floats
    limit: Floats
    left_out: Flags
    unfit: Flags

    @classmethod
    def none(cls, orientation: Orientation) -> Contradictions:
        """Give the result of a search that found nothing."""
        numbers, no_rows = np.zeros(0, np.intp), np.zeros(len(orientation.point), bool)
        nothing = np.zeros(0)
        return cls(numbers, numbers, nothing, nothing, no_rows, no_rows)


def examine(
    orientation: Orientation,
    formed: FormedStrip,
    observations: PhotoPoints,
    photos: Sequence[str],
    sigma: float,
    kept: Flags | None = None,
) -> Contradictions:
    """Find the wrong ray of every point whose scale ratio was rejected.

    Parameters
    ----------
    orientation : Orientation
        Oriented pairs.
    formed : FormedStrip
        The strip formed from them.
    observations : PhotoPoints
        Image points.
    photos : sequence of str
        Photos of the strip in flight order.
    sigma : float
        Standard deviation of an image coordinate, mm.
    kept : ndarray of bool, shape (m,), optional
        Rows of the pairs' table whose points are not examined.

    Returns
    -------
    Contradictions
        What was found.
    """
    junctions = formed.junctions
    with np.errstate(invalid="ignore"):
        deviation = np.abs(np.log(junctions.ratio / junctions.factor[junctions.joint])) / junctions.limit
    by_ratio = np.unique(junctions.point[~junctions.used])
    halves = _half_rejected(orientation)
    suspects = np.union1d(by_ratio, halves).astype(np.intp)
    if kept is not None:
        suspects = np.setdiff1d(suspects, orientation.point[kept])
    place = {photo: number for number, photo in enumerate(photos)}
    position = np.array([place.get(photo, -1) for photo in observations.photo_ids], np.intp)
    left_out, unfit = np.zeros(len(orientation.point), bool), np.zeros(len(orientation.point), bool)
    wrong = np.full(len(suspects), UNDECIDED)
    for number, point in enumerate(suspects.tolist()):
        rows = np.flatnonzero(orientation.point == point)
        measured = np.unique(orientation.rows[rows])
        ray = _wrong_ray(measured, position, formed, observations, orientation.pairs.focal, sigma)
        hit = rows if ray == UNDECIDED else rows[(orientation.rows[rows] == ray).any(axis=1)]
        wrong[number] = ray
        left_out[hit] = True
        unfit[hit] = point in halves
    values = np.array([deviation[(junctions.point == point) & ~junctions.used].max(initial=0.0) for point in suspects])
    values = np.where(values > 0, values, np.nan)
    # a ray whose pairs have all rejected it already changes nothing
    news = np.isin(suspects, orientation.point[left_out & orientation.used])
    return Contradictions(
        suspects[news],
        wrong[news],
        values[news],
        np.where(values > 0, 1.0, np.nan)[news],
        left_out,
        unfit & orientation.used,
    )


def _half_rejected(orientation: Orientation) -> Numbers:
    """Points that were rejected in one pair and stand in the next or the one before."""
    order = np.lexsort((orientation.pairs.pair, orientation.point))
    point, pair, used = orientation.point[order], orientation.pairs.pair[order], orientation.used[order]
    half = (point[1:] == point[:-1]) & (pair[1:] == pair[:-1] + 1) & (used[1:] != used[:-1])
    return np.unique(point[1:][half])


def _wrong_ray(
    measured: Numbers, position: Numbers, formed: FormedStrip, observations: PhotoPoints, focal: float, sigma: float
) -> int:
    """Row of the only measurement without which the others meet; -1 when there is none or more than one."""
    if len(measured) < FEWEST:
        return UNDECIDED
    photo = position[observations.photo[measured]]
    image = np.column_stack([observations.xy[measured], np.full(len(measured), -focal)])
    direction = np.einsum("nij,nj->ni", formed.rotations[photo], image)
    candidates = []
    for number, row in enumerate(measured.tolist()):
        rest = np.arange(len(measured)) != number
        squares = misfit(formed.centers[photo[rest]], direction[rest]) / (ORIENTATION_SHARE * sigma**2)
        if squares <= chi2_quantile(CONFIDENCE, 2 * int(rest.sum()) - 3):
            candidates.append(row)
    return candidates[0] if len(candidates) == 1 else UNDECIDED


def misfit(centers: Floats, directions: Floats) -> float:
    """Sum of squared distances at photo scale of rays from the point where they meet best.

    Parameters
    ----------
    centers : ndarray, shape (n, 3)
        Perspective centres.
    directions : ndarray, shape (n, 3)
        Rays whose length is that from the centre to the image, mm.

    Returns
    -------
    float
        Sum of squares in mm^2 of the image.
    """
    length = np.linalg.norm(directions, axis=1)
    unit = directions / length[:, None]
    across = np.eye(3) - unit[:, :, None] * unit[:, None, :]
    weight = np.ones(len(unit))
    for _ in range(2):  # the second time with the distances of the first
        normal = np.einsum("n,nij->ij", weight, across)
        meeting = np.linalg.solve(normal, np.einsum("n,nij,nj->i", weight, across, centers))
        arm = meeting - centers
        scale = length / np.einsum("ni,ni->n", arm, unit)
        weight = scale**2
    gap = np.einsum("nij,nj->ni", across, arm) * scale[:, None]
    return float((gap**2).sum())
