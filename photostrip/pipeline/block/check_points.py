"""Errors at the check points of a bundle adjustment with their joint covariance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.network.cofactors import coordinates_of, joint_cofactors
from photostrip.pipeline.given_points import axes_of, compare_with_given
from photostrip.pipeline.results import AdjustedStrips, Bundle
from photostrip.points import ControlPoints
from photostrip.strip.error_propagation.check_errors import CheckErrors

MOST_TESTED = 40  # check points that are tested together; in a block of 400 photos 60 of them take 11 % of a run


def check_errors(
    bundle: Bundle, adjusted: AdjustedStrips, given: ControlPoints, frames: Sequence[GroundFrame]
) -> CheckErrors | None:
    """Compare a bundle adjustment with its check points; None without any."""
    points = adjusted.points
    places, differences = compare_with_given(given, frames, points, adjusted.observations)
    rows = np.flatnonzero(given.check & np.isfinite(differences).any(axis=1))
    if not len(rows):
        return None
    if len(rows) > MOST_TESTED:
        rows = rows[np.linspace(0, len(rows) - 1, MOST_TESTED).round().astype(int)]
    rows = rows[np.argsort(places[rows], kind="stable")]
    at = places[rows]
    axes = axes_of(given.frame[rows], frames, points.cartesian[at])
    solution = bundle.screened.solution
    joint = (
        joint_cofactors(solution, coordinates_of(solution, points.number[at])).reshape(len(at), 3, len(at), 3)
        * bundle.unit**2
    )
    turned = np.einsum("iap,ipjq,jbq->iajb", axes, joint, axes).reshape(3 * len(at), 3 * len(at))
    difference = differences[rows].ravel()
    known = np.flatnonzero(np.isfinite(difference))
    covariance = turned[np.ix_(known, known)] + np.diag(given.sigma[rows].ravel()[known] ** 2)
    return CheckErrors(
        ids=given.take(rows).ids,
        point=known // 3,
        axis=known % 3,
        difference=difference[known],
        covariance=covariance,
    )
