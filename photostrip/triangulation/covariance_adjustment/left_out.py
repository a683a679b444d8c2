"""Errors at control that takes no part, without adjusting again: all of it from the one eliminated system.

Source: derived. With Pi the part of K^-1 (docs/precision.md, eq. 7) that belongs to a group of conditions and lambda
their correlates, everything else predicts the group with the error Pi^-1 lambda, whose covariance is Pi^-1.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.frozen import NamedTuple
from photostrip.triangulation.covariance_adjustment.system import System

UNCHECKED = 1e-9  # smallest eigenvalue of the scaled Pi of a group that the others determine


class LeftOut(NamedTuple):
    """A group of control coordinates as all the others predict it."""

    errors: Floats  # (k,): strip minus given, metres; infinite where the others do not determine it
    squares: float  # e^T Pi e, for a variance factor of 1: expected to be k


def left_out_errors(found: System, groups: Sequence[Numbers]) -> list[LeftOut]:
    """Predict groups of control coordinates (rows of the misclosures), each from all the others."""
    layout = found.layout
    rows = found.conditions.of_control(np.concatenate(groups))
    block, position = layout.block[rows], layout.position[rows]
    right = np.zeros((layout.blocks, layout.height, len(rows)))
    right[block, position, np.arange(len(rows))] = 1.0
    inverse = found.factors.solve(right)[block, position]
    ends = np.cumsum([0, *(len(group) for group in groups)])
    return [
        _predicted(inverse[start:stop, start:stop], found.correlates[rows[start:stop]])
        for start, stop in pairwise(ends.tolist())
    ]


def _predicted(cofactors: Floats, correlates: Floats) -> LeftOut:
    square = np.diag(cofactors)
    if (square > 0.0).all():
        size = np.sqrt(square)
        scaled = cofactors / size / size[:, None]
        if np.linalg.eigvalsh(scaled)[0] >= UNCHECKED:
            errors = np.linalg.solve(scaled, correlates / size) / size
            return LeftOut(np.asarray(errors, float), float(errors @ correlates))
    return LeftOut(np.full(len(correlates), np.inf), np.inf)
