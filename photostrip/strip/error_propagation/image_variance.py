"""The variance factor of image coordinates: what the y parallaxes of the pairs say of the stated precision."""

from __future__ import annotations

from photostrip.statistics import chi2_quantile
from photostrip.strip.relative_orientation.orientation import Orientation
from photostrip.strip.relative_orientation.pairs import MINIMUM_POINTS

A_PRIORI, A_POSTERIORI = "a-priori", "a-posteriori"
SIGMA_LEVEL = 0.01  # of the test that keeps the stated standard deviation of the image coordinates


def image_variance(orientation: Orientation, sigma: float) -> tuple[float, str]:
    """Variance factor of the image coordinates, and its basis: 1 unless the y parallaxes contradict what is stated.

    A y parallax of weight one has twice the variance of an image coordinate (``sigma``, mm): f = q^T W q / (2 sigma^2
    r).
    """
    redundancy = int((orientation.points_used - MINIMUM_POINTS).sum())
    squares = float((orientation.pairs.weight * orientation.parallax**2)[orientation.used].sum()) / (2 * sigma**2)
    return variance_factor(squares, redundancy)


def variance_factor(squares: float, redundancy: int) -> tuple[float, str]:
    """Variance found over that stated, and its basis: 1 unless the weighted sum of squares contradicts it."""
    if redundancy < 1:
        return 1.0, A_PRIORI
    low, high = (chi2_quantile(p, redundancy) for p in (SIGMA_LEVEL / 2, 1 - SIGMA_LEVEL / 2))
    return (1.0, A_PRIORI) if low <= squares <= high else (squares / redundancy, A_POSTERIORI)
