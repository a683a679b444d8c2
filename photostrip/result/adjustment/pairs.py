"""Pairs of photos: relative orientation, y parallaxes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.pipeline.results import PhotoStages, Result, StripResult
from photostrip.result.table import Table
from photostrip.strip.pair_screening import SEARCHES, GlobalTest, residual_sigma, tested
from photostrip.strip.pair_screening import stages as tests_of
from photostrip.strip.relative_orientation import ELEMENTS, MINIMUM_POINTS, RelativeSettings


@dataclass(frozen=True, eq=False)
class Parallaxes:
    """What the residual y parallaxes of a strip's pairs come to."""

    squares: Floats  # (p,): sums of weighted squares, mm^2
    redundancy: Numbers  # (p,): points used minus five
    rms: Floats  # (p,): root mean square over the points used, mm
    worst: Numbers  # (p,): row of the largest one in the pairs' table

    @classmethod
    def of(cls, strip: StripResult) -> Parallaxes:
        """Sum up the parallaxes of a strip."""
        oriented = strip.of_photos.orientation
        pairs, used = oriented.pairs, oriented.used
        size = np.where(used, np.abs(oriented.parallax), -1.0)
        peak = np.flatnonzero(size == np.maximum.reduceat(size, pairs.starts)[pairs.pair])
        _, first = np.unique(pairs.pair[peak], return_index=True)
        count = oriented.points_used
        mean = pairs.sums(np.where(used, oriented.parallax**2, 0.0)) / np.maximum(count, 1)
        squares = pairs.sums(pairs.weight * oriented.parallax**2)
        return cls(squares=squares, redundancy=count - MINIMUM_POINTS, rms=np.sqrt(mean), worst=peak[first])


def sigma0(squares: Floats, redundancy: Numbers) -> float:
    """Return the standard deviation of an image coordinate from y parallaxes, in mm; NaN without redundancy.

    A y parallax is the difference of two coordinates: its variance is twice theirs.
    """
    total = int(redundancy.sum())
    return float(np.sqrt(squares.sum() / 2 / total)) if total > 0 else float("nan")


def models_of(result: Result) -> Table:
    """Return the table ``models``: relative orientation and scale of every pair, in flight order."""
    ids = result.refined.observations.point_ids
    parts = (_models(strip, ids, result.settings.relative) for strip in result.photo_strips)
    return Table.joined("models", parts)


def _models(strip: StripResult, ids: Sequence[str], relative: RelativeSettings) -> Table:
    stages, photos, sums = strip.of_photos, strip.strip.photos, Parallaxes.of(strip)
    oriented, formed, used = stages.orientation, stages.formed, stages.orientation.points_used
    columns = {
        "strip": strip.strip.id,
        "left": photos[:-1],
        "right": photos[1:],
        **_of_elements("elements", oriented.elements),
        **_of_elements("sigmas", oriented.sigmas),
        "sigma0_um": 1000.0 * oriented.sigma0,
        "rms_parallax_um": 1000.0 * sums.rms,
        "max_parallax_um": 1000.0 * np.abs(oriented.parallax[sums.worst]),
        "max_parallax_point": [ids[oriented.point[row]] for row in sums.worst],
        "points_used": used,
        "points_rejected": np.bincount(oriented.pairs.pair, minlength=len(used)) - used,
        "redundancy": sums.redundancy,
        **{f"zone_{k + 1}": column for k, column in enumerate(stages.screened.counts.T)},
        "detectable_um": 1000.0 * _detectable(strip),
        "limit_um": 1000.0 * _parallax_limits(stages, relative),
        "masked_errors_suspected": stages.screened.masked,
        "condition": oriented.condition,
        "iterations": oriented.iterations,
        "base": np.linalg.norm(np.diff(strip.centers, axis=0), axis=1),
        "scale_factor": formed.scale_factor,
        "base_direction_deg": np.degrees(formed.base_direction),
        "base_inclination_deg": np.degrees(formed.base_inclination),
    }
    return Table.of("models", columns)


def _of_elements(name: str, values: Floats) -> dict[str, Floats]:
    return {f"{name}_{element}": column for element, column in zip(ELEMENTS, np.degrees(values).T, strict=True)}


def _detectable(strip: StripResult) -> Floats:
    """Largest of the smallest errors that can be found at the points of each pair, mm; NaN where one is never seen."""
    oriented = strip.of_photos.orientation
    size = np.where(oriented.used, strip.of_photos.screened.detectable, 0.0)
    worst = np.maximum.reduceat(np.nan_to_num(size, nan=0.0, posinf=np.inf), oriented.pairs.starts)
    return np.where(np.isfinite(worst), worst, np.nan)


def _parallax_limits(of_photos: PhotoStages, settings: RelativeSettings) -> Floats:
    """Median parallax of each pair, mm, from which on the search takes a point out; NaN where nothing is tested.

    A limit that depends on the redundancy of a point is smaller where there is little of it.
    """
    oriented, test = of_photos.screened.orientation, GlobalTest.of(of_photos.screened.scatter.by_pair)
    pairs, limit = oriented.pairs, np.full(len(oriented.used), np.inf)
    if settings.screening in SEARCHES:
        limit = test.largest_limits(oriented.points_used)[pairs.pair] * residual_sigma(oriented, test.sigma)
    for name, bound in tests_of(settings, of_photos.sigma):
        found = tested(oriented, name, bound)
        limit = np.minimum(limit, found.limit * found.unit)
    known = np.flatnonzero(oriented.used & np.isfinite(limit))
    known = known[np.lexsort((limit[known], pairs.pair[known]))]
    ends = np.searchsorted(pairs.pair[known], np.arange(pairs.size + 1))
    twice = ends[:-1] + ends[1:]
    lower, upper = np.append(limit[known], np.nan)[[(twice - 1) // 2, twice // 2]]
    return np.where(ends[1:] > ends[:-1], (lower + upper) / 2, np.nan)
