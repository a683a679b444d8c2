"""Misclosures of a strip of independent models at its control, and their covariance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.strip.error_propagation.control_errors import Misclosures
from photostrip.strip.independent_models import model_errors
from photostrip.strip.independent_models.model_errors import ModelErrors


def weights(found: Misclosures, rows: Numbers, operator: Floats | None = None) -> tuple[Numbers, Floats]:
    """Nodes of given points, and sums of their coordinates as weighted sums of the nodes; by default each one."""
    if operator is None:
        operator = np.eye(len(found.point))
    weights = np.zeros((len(rows), len(operator), 3))
    np.add.at(weights, found.point, operator.T[:, :, None] * found.direction[:, None, :])
    return rows, weights.transpose(1, 0, 2)


def covariance(errors: ModelErrors, found: Misclosures, rows: Numbers, factor: float) -> Floats:
    """Covariance of misclosures, strip and control together, metres^2, shape (w, w), but for a common similarity.

    It is relative to the first model that holds one of the points: an adjustment of the misclosures by a similarity
    does not depend on that.

    rows: (n,), rows of the control points in the points of the strip.
    factor: variance factor of the model coordinates.
    """
    used, point = np.unique(found.point, return_inverse=True)
    nodes, each = weights(replace(found, point=point), rows[used])
    part = model_errors.section(errors, nodes)
    spread = model_errors.covariance_of_sums(part, model_errors.sums(part, nodes, each))
    return np.asarray(spread * factor + np.diag(found.variance), float)
