"""From which residual y parallax on the search for gross errors takes a point out of its pair."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.statistics import grubbs_limit, tau_limit
from photostrip.triangulation.gross_errors.pairs.global_test import GlobalTest
from photostrip.triangulation.gross_errors.pairs.screening import LIMIT_FACTOR, NEGLIGIBLE
from photostrip.triangulation.relative_orientation.pairs import MINIMUM_POINTS
from photostrip.triangulation.relative_orientation.zones import MINIMUM_LEFT

if TYPE_CHECKING:
    from photostrip.arrays import Floats
    from photostrip.pipeline.results import PhotoStages
    from photostrip.triangulation.relative_orientation.orientation import Orientation, RelativeSettings


def parallax_limits(stages: PhotoStages, settings: RelativeSettings) -> Floats:
    """Return the median limit of the points of each pair, mm, as the search left it; NaN where nothing is tested.

    A limit that depends on the redundancy of a point is smaller where there is little of it.
    """
    oriented, scatter = stages.screened.orientation, stages.screened.scatter.by_pair
    pairs, count = oriented.pairs, oriented.points_used
    if settings.screening == "none":
        return np.full(pairs.size, np.nan)
    if settings.screening == "parallax+grubbs":
        bound = settings.parallax_limit
        first = LIMIT_FACTOR * np.sqrt(2.0) * stages.sigma if bound is None else bound
        return np.minimum(first, _grubbs(oriented, settings.grubbs_alpha))
    if settings.screening == "tau":
        tested = (count - MINIMUM_POINTS >= 3) & (oriented.sigma0 > NEGLIGIBLE)
        alpha, most = settings.grubbs_alpha, np.zeros(pairs.size)
        most[tested] = [tau_limit(n, MINIMUM_POINTS, alpha) for n in count[tested].tolist()]
        whole = np.where(tested, most * np.sqrt(2.0) * oriented.sigma0, np.nan)
    else:
        test = GlobalTest.of(scatter)
        whole = np.where(count > MINIMUM_POINTS, test.largest_limits(count) * test.sigma, np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        size = whole[pairs.pair] * np.sqrt(np.maximum(oriented.redundancy, 0.0) / pairs.weight)
    parts = np.split(np.where(oriented.used, size, np.nan), pairs.starts[1:])
    return np.array([np.median(part[np.isfinite(part)]) if np.isfinite(part).any() else np.nan for part in parts])


def _grubbs(oriented: Orientation, alpha: float) -> Floats:
    """Return the deviation from the mean of its pair that Grubbs' test allows, mm; infinite where it tests nothing."""
    pairs, count = oriented.pairs, oriented.points_used
    mean = pairs.sums(np.where(oriented.used, oriented.parallax, 0.0)) / count
    off = np.where(oriented.used, oriented.parallax - mean[pairs.pair], 0.0)
    spread = np.sqrt(pairs.sums(off**2) / (count - 1))
    tested = (count > MINIMUM_LEFT) & (spread > NEGLIGIBLE)
    limits = [grubbs_limit(n, alpha) if ok else np.inf for n, ok in zip(count.tolist(), tested, strict=True)]
    return np.asarray(np.array(limits) * np.where(tested, spread, 1.0))
