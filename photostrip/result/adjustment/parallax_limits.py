"""From which residual y parallax on the search for gross errors takes a point out of its pair."""

from __future__ import annotations

import numpy as np

from photostrip.arrays import Floats
from photostrip.pipeline.results import PhotoStages
from photostrip.triangulation.gross_errors.pairs.global_test import GlobalTest, residual_sigma
from photostrip.triangulation.gross_errors.pairs.screening import SEARCHES, stages, tested
from photostrip.triangulation.relative_orientation.orientation import RelativeSettings


def parallax_limits(of_photos: PhotoStages, settings: RelativeSettings) -> Floats:
    """Return the median limit of the points of each pair, mm, as the search left it; NaN where nothing is tested.

    A limit that depends on the redundancy of a point is smaller where there is little of it.
    """
    oriented, test = of_photos.screened.orientation, GlobalTest.of(of_photos.screened.scatter.by_pair)
    pairs, limit = oriented.pairs, np.full(len(oriented.used), np.inf)
    if settings.screening in SEARCHES:
        limit = test.largest_limits(oriented.points_used)[pairs.pair] * residual_sigma(oriented, test.sigma)
    for name, bound in stages(settings, of_photos.sigma):
        found = tested(oriented, name, bound)
        limit = np.minimum(limit, found.limit * found.unit)
    known = np.flatnonzero(oriented.used & np.isfinite(limit))
    known = known[np.lexsort((limit[known], pairs.pair[known]))]
    ends = np.searchsorted(pairs.pair[known], np.arange(pairs.size + 1))
    twice = ends[:-1] + ends[1:]
    lower, upper = np.append(limit[known], np.nan)[[(twice - 1) // 2, twice // 2]]
    return np.where(ends[1:] > ends[:-1], (lower + upper) / 2, np.nan)
