"""The scatter that the y parallaxes of a strip should have: the stated one, unless the residuals contradict it.

Source: derived, see docs/sources.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.statistics import SIGMA_FROM_MEDIAN, normal_quantile
from photostrip.triangulation.gross_errors.pairs.global_test import ALPHA, SMALLEST_REDUNDANCY
from photostrip.triangulation.robust import MEDIAN_SPREAD

if TYPE_CHECKING:
    from photostrip.arrays import Floats
    from photostrip.triangulation.relative_orientation.orientation import Orientation


FIFTH_WRONG = (
    1.315  # scale of residuals of which a fifth are large over that of the others: normal_quantile(13/16) * 1.4826
)


@dataclass(frozen=True, eq=False)
class ParallaxScatter:
    """Standard deviations of a y parallax of weight one that the tests are made with."""

    # from the residuals of all pairs of the strip, robust, mm; NaN when they did not contradict the stated one
    found: float
    by_pair: Floats  # (p,): those in force, mm

    @classmethod
    def of(cls, orientation: Orientation, stated: float, spoiled: float = FIFTH_WRONG) -> ParallaxScatter:
        """Decide on the scatter of a strip whose pairs are oriented on points that agree with one another.

        ``stated`` is that of a y parallax, mm. It holds unless the median residual of the whole strip proves more, even
        if wrong points among them should make that ``spoiled`` times too large.
        """
        pairs, share = orientation.pairs, np.nan_to_num(orientation.redundancy)
        tested = orientation.used & (share > SMALLEST_REDUNDANCY)
        found = np.nan
        if tested.any():
            sizes = np.abs(orientation.parallax[tested]) * np.sqrt(pairs.weight[tested] / share[tested])
            scale = SIGMA_FROM_MEDIAN * float(np.median(sizes))
            proof = 1.0 + normal_quantile(1.0 - ALPHA) * MEDIAN_SPREAD / np.sqrt(float(share[tested].sum()))
            found = scale if scale > spoiled * proof * stated else np.nan
        return cls(found, np.full(pairs.size, max(stated, np.nan_to_num(found))))
