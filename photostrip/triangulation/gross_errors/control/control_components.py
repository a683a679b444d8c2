"""Variance components: what may be wrong where much of the control is wrong at once.

Errors that hide each other are found by no test of single points. So plan and height of every point, and every bend of
the strip, get a variance of their own beside the covariance of the misclosures. All begin as large as the largest
misclosure, and each is multiplied by its own test value, the root of (M w)_K^T (M w)_K / tr M_KK, as often as there are
parts (by the square, as in the source, into worse sets): those of wrong coordinates stay as candidates for the tests.

Source: [Förstner 1979].
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.triangulation.gross_errors.control.control_deletion import projected

if TYPE_CHECKING:
    from photostrip.triangulation.gross_errors.control.control_deletion import Columns, JointAdjustment


def candidates(whole: JointAdjustment) -> Columns:
    """Columns whose own variance exceeds that with which all others predict them; as many as leave a check."""
    part = np.concatenate([np.full(len(columns), number) for number, columns in enumerate(whole.parts)])
    columns = np.concatenate([np.array(columns) for columns in whole.parts])
    errors = whole.errors[:, columns]
    variance = np.full(len(whole.parts), float(np.abs(whole.w).max() ** 2 + whole.covariance.max()))
    for _ in whole.parts:
        covariance = whole.covariance + (errors * variance[part]) @ errors.T
        projector = projected(covariance, whole.design)
        squares = np.bincount(part, (errors.T @ (projector @ whole.w)) ** 2)
        expected = np.bincount(part, np.einsum("ij,ij->j", errors, projector @ errors))
        # of what nothing checks, rounding leaves less than nothing
        variance *= np.sqrt(np.divide(squares, expected, out=np.ones_like(squares), where=expected > 0.0))
    predicted = np.bincount(part, (whole.matrix.diagonal() * whole.size**2)[columns]) / np.bincount(part)
    share = variance * predicted
    found: list[int] = []
    for number in np.argsort(-share, kind="stable").tolist():
        if share[number] <= 1 or len(found) + len(whole.parts[number]) >= whole.freedom:
            break
        found += whole.parts[number]
    return tuple(found)
