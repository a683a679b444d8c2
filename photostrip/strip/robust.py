"""The robust estimator of the program: weights that fall with the residual, in units of a scale from the median.

Least squares follow a gross error; an adjustment repeated with falling weights comes to rest on the observations that
agree. It is a start: what the tests then find wrong is left out, and the rest adjusted by least squares.

Source: the weights of [Krarup 1980]; the scale is the median absolute deviation [Hampel 1974].
"""

from __future__ import annotations

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.statistics import SIGMA_FROM_MEDIAN

TUNING = 3.0  # standard deviations up to which an observation keeps its weight [Krarup 1980]
# standard deviation of a scale from the median of n normal residuals, over the scale, times sqrt(n) [Hampel 1974]
MEDIAN_SPREAD = 1.1664
SMALLEST_WEIGHT = 1e-5  # that everything keeps, so that unknowns stay determined


def falling_weights(size: Floats) -> Floats:
    """Factors of the weights, 1 up to three standard deviations and exp(1 - e^2) at e times three.

    size: absolute residuals in units of their scale.
    """
    with np.errstate(over="ignore"):
        weight: Floats = np.exp(1.0 - np.maximum(size / TUNING, 1.0) ** 2)
    return np.maximum(weight, SMALLEST_WEIGHT)


def medians(values: Floats, weight: Floats, group: Numbers, groups: int) -> Floats:
    """Lower weighted median of each group; NaN for a group whose weights are all zero."""
    count = np.bincount(group, minlength=groups)
    order = np.lexsort((values, group))
    table, weights = np.zeros((2, groups, int(count.max(initial=0)) + 1))
    place = np.arange(len(values)) - (np.cumsum(count) - count)[group[order]]
    table[group[order], place], weights[group[order], place] = values[order], weight[order]
    total = np.cumsum(weights, axis=1)
    middle = (total < total[:, -1:] / 2).sum(axis=1)
    return np.where(total[:, -1] > 0, table[np.arange(groups), middle], np.nan)


def scales(size: Floats, weight: Floats, group: Numbers, groups: int) -> Floats:
    """Estimate the standard deviation of each group from its median absolute residual; NaN for a group without any."""
    return SIGMA_FROM_MEDIAN * medians(size, (weight > 0).astype(float), group, groups)
