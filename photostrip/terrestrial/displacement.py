"""Displacements of points between two epochs, from pseudo-parallaxes in the normal case.

A pseudo-parallax is the difference of a coordinate on two photos taken from the same station at different times.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Floats
from photostrip.statistics import chi2_quantile

SPACE = 3  # components of a displacement
SINGULAR = 1e-12  # reciprocal condition of a covariance matrix below which there is no test


def displacements(first: Floats, second: Floats, principal_distance: float, base: float) -> Floats:
    """Displacements dX, dY, dZ in the axes of the normal case, second minus first epoch, shape (n, 3), metres.

    Exactly the difference of the intersected points, without its loss of digits.

    first, second: (n, 4), x, z of the left and x, z of the right photo in mm in two epochs.
    """
    f = principal_distance
    change = second - first
    p = first[:, 0] - first[:, 2]
    dp = change[:, 0] - change[:, 2]
    depth = base * f / p
    dy = -depth * dp / (p + dp)
    dx = (depth * change[:, 0] + dy * second[:, 0]) / f
    dz = (depth * change[:, 1] + dy * second[:, 1]) / f
    return np.column_stack([dx, dy, dz])


def statistic(displacement: Floats, covariance: Floats) -> Floats:
    """Test value d^T C^-1 d of displacements: chi-square with three degrees of freedom where nothing moved.

    NaN where the covariance (n, 3, 3) is singular or has no value.
    """
    value = np.full(len(displacement), np.nan)
    sound = np.flatnonzero(np.isfinite(displacement).all(axis=1) & np.isfinite(covariance).all(axis=(1, 2)))
    size = np.linalg.eigvalsh(covariance[sound])
    sound = sound[size[:, 0] > SINGULAR * size[:, -1]]
    d = displacement[sound]
    value[sound] = np.einsum("ni,ni->n", d, np.linalg.solve(covariance[sound], d[:, :, None])[:, :, 0])
    return value


def limit(significance: float, components: int = SPACE) -> float:
    """Critical value of ``statistic``, for the probability of calling a point moved that did not move."""
    return chi2_quantile(1 - significance, components)


class Ellipses(NamedTuple):
    """Confidence ellipses in plan."""

    # major, minor: (...): semi-axes, metres
    major: Floats
    minor: Floats
    azimuth: Floats  # (...): direction of the major axis clockwise from the second axis, in [0, pi), radians


def ellipses(covariance: ArrayLike, probability: float) -> Ellipses:
    """Confidence ellipses in plan.

    covariance: (..., 2, 2), covariance of the first two components (to the right and ahead, or east and north), m^2.
    probability: probability that the ellipse around the estimate covers the truth.
    """
    c = np.asarray(covariance, float)
    half_sum = (c[..., 0, 0] + c[..., 1, 1]) / 2
    half_difference = (c[..., 1, 1] - c[..., 0, 0]) / 2
    radius = np.hypot(half_difference, c[..., 0, 1])
    factor = chi2_quantile(probability, 2)
    azimuth = np.mod(np.arctan2(c[..., 0, 1], half_difference) / 2, np.pi)
    major, minor = (np.sqrt(factor * np.maximum(half_sum + each, 0)) for each in (radius, -radius))
    return Ellipses(major, minor, azimuth)
