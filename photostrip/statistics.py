"""Quantiles and critical values of the tests."""

from __future__ import annotations

from functools import lru_cache
from math import sqrt
from statistics import NormalDist

from photostrip.distributions import beta_cdf, chi2_ppf, f_isf, f_sf, noncentral_chi2_sf, t_isf, t_sf

# A sound result calls for a second look with this probability at the most, for whatever reason: sigma0, pairs, points
# that the adjustment has not seen, given points that stand out, deformed models, control against a strip's covariance.
# Each of these six has the same share of it.
SECOND_LOOK = 0.05
TEST_LEVEL = SECOND_LOOK / 6
HALVINGS = 60  # of an interval around a root
SIGMA_FROM_MEDIAN = 1.4826  # standard deviation over the median of |x|, of a normal distribution


@lru_cache(maxsize=4096)
def t_quantile(probability: float, dof: float) -> float:
    """Quantile of Student's t."""
    return -t_isf(probability, dof)


@lru_cache(maxsize=4096)
def normal_quantile(probability: float) -> float:
    """Quantile of the standard normal distribution."""
    return NormalDist().inv_cdf(probability)


def t_p_value(t: float, dof: float) -> float:
    """Two-sided p value of a t ratio: the probability of one at least as large by chance."""
    return 2 * t_sf(abs(t), dof)


def f_p_value(f: float, dof_numerator: float, dof_denominator: float) -> float:
    """Upper tail of the F distribution: the probability of a ratio at least as large by chance."""
    return f_sf(f, dof_numerator, dof_denominator)


@lru_cache(maxsize=4096)
def f_quantile(probability: float, dof_numerator: float, dof_denominator: float) -> float:
    return f_isf(1 - probability, dof_numerator, dof_denominator)


def binomial_p_value(count: float, number: float, probability: float) -> float:
    """Probability of `count` or more among `number` cases of a probability; the numbers need not be whole."""
    return beta_cdf(probability, count, number - count + 1) if count > 0 else 1.0


@lru_cache(maxsize=4096)
def chi2_quantile(probability: float, dof: float) -> float:
    return chi2_ppf(probability, dof)


@lru_cache(maxsize=256)
def noncentrality(significance: float, power: float, dof: float) -> float:
    """Return the noncentrality that a chi-square test at a significance finds with a power, below 1 - 1e-6.

    Its root is how many standard deviations an error of one coordinate must have: 4.13 at 0.1 % and 80 %.
    """
    limit = chi2_quantile(1 - significance, dof)
    small, large = 0.0, 1.0
    while noncentral_chi2_sf(limit, dof, large) < power:
        small, large = large, 2 * large
    for _ in range(HALVINGS):
        middle = (small + large) / 2
        small, large = (middle, large) if noncentral_chi2_sf(limit, dof, middle) < power else (small, middle)
    return large


@lru_cache(maxsize=4096)
def grubbs_limit(n: int, alpha: float) -> float:
    """Critical value of Grubbs' test for one outlier among n values, n at least 3: limit of max |value - mean| / s.

    `alpha` is the probability of rejecting a value of a clean sample; the sign of the outlier is unknown. Where it is
    known, one-sided, the limit is that of twice the probability.

    Source: [004a]; [Grubbs 1969] as a function of Student's t.
    """
    t2 = t_quantile(1 - alpha / (2 * n), n - 2) ** 2
    return (n - 1) / sqrt(n) * sqrt(t2 / (n - 2 + t2))


@lru_cache(maxsize=4096)
def tau_limit(n: int, unknowns: int, alpha: float) -> float:
    """Critical value of the largest studentised residual |v| / (sigma0 sqrt(r)) (Pope's tau, Bonferroni).

    `alpha` is the probability of rejecting an observation of a clean adjustment; n - unknowns must be at least 2. For
    one unknown it is Grubbs' two-sided limit for the largest |v| / (s sqrt((n-1)/n)).

    Source: [Pope 1976].
    """
    nu = n - unknowns
    t = t_quantile(1 - alpha / (2 * n), nu - 1)
    return t * sqrt(nu) / sqrt(nu - 1 + t * t)
