"""Points taken back into their pairs: what the final orientation predicts well was rejected wrongly."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.triangulation.gross_errors.pairs.pair_global_test import global_limits, squares
from photostrip.triangulation.relative_orientation.orientation import orient_again
from photostrip.triangulation.relative_orientation.solution import (
    in_front_of_cameras,
    linearised_parallaxes,
    normal_matrices,
)

if TYPE_CHECKING:
    from photostrip.arrays import Floats, Numbers
    from photostrip.triangulation.relative_orientation.orientation import Orientation


READMIT = 3.0  # standard deviations of the predicted residual


def readmit(orientation: Orientation, rows: Numbers, given: Floats, sigma: Floats) -> tuple[Orientation, Numbers]:
    """Take points back that the final elements predict well, the best of each pair first; also which rows came back.

    ``given`` (m,) are the weights before any was taken out.
    """
    if not len(rows):
        return orientation, np.zeros(0, np.intp)
    todo = np.unique(orientation.pairs.pair[rows])
    result, place = orientation.take(todo), orientation.pairs.rows_of(todo)
    given, sigma = given[place], sigma[todo]
    pairs = result.pairs
    back: list[int] = []
    waiting = np.searchsorted(place, np.unique(rows))
    while len(waiting):
        number = pairs.pair[waiting]
        value, growth = _predicted(result, waiting, given, sigma)
        total = squares(result, sigma)[number] + growth
        allowed = (value <= READMIT) & (total <= global_limits(result.points_used + 1)[number])
        allowed &= in_front_of_cameras(result.elements, pairs)[waiting]
        if not allowed.any():
            break
        order = np.lexsort((np.where(allowed, value, np.inf), number))
        _, first = np.unique(number[order], return_index=True)
        best = order[first]
        best = best[allowed[best]]
        weight = result.pairs.weight.copy()
        weight[waiting[best]] = given[waiting[best]]
        back += waiting[best].tolist()
        result = orient_again(result, weight, np.unique(number[best]))
        waiting = np.delete(waiting, best)
    if not back:
        return orientation, np.zeros(0, np.intp)
    return orientation.with_pairs(todo, result), place[np.array(back, np.intp)]


def _predicted(orientation: Orientation, rows: Numbers, given: Floats, sigma: Floats) -> tuple[Floats, Floats]:
    """Predicted residuals in units of their standard deviation, and what they would add to the sum of squares."""
    pairs = orientation.pairs
    with np.errstate(all="ignore"):
        _, jacobian = linearised_parallaxes(orientation.elements, pairs)
    normal = normal_matrices(jacobian, pairs)
    cofactors = np.linalg.pinv(np.nan_to_num(normal), hermitian=True)[pairs.pair[rows]]
    part = jacobian[:, rows]
    spread = 1 / given[rows] + np.einsum("im,mij,jm->m", part, cofactors, part)
    value = np.abs(orientation.parallax[rows]) / (sigma[pairs.pair[rows]] * np.sqrt(spread))
    value = np.where(np.isfinite(value), value, np.inf)
    return value, value**2
