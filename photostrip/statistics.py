"""Quantiles, p values and critical values of the tests, by scipy.special."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import chdtrc, chdtri, chndtrinc, fdtrc, ndtri, stdtr, stdtrit

from photostrip.arrays import Floats, Numbers

# A sound result calls for a second look with this probability at the most, by all tests of the verdict together:
# sigma0, pairs, points that the adjustment has not seen, given points that stand out. Each of these questions
# has a fifth of it, and the tests of a question share that.
SECOND_LOOK = 0.01
TEST_LEVEL = SECOND_LOOK / 5
SLIGHTLY = 0.05  # probability below which points that were not seen speak against a result that the verdict lets pass
SIGMA_FROM_MEDIAN = 1.4826  # standard deviation over the median of |x|, of a normal distribution


def normal_quantile(probability: float) -> float:
    return float(ndtri(probability))


def t_quantile(probability: float, dof: float) -> float:
    return float(stdtrit(dof, probability))


def t_p_value(t: float, dof: float) -> float:
    """Two-sided p value of a t ratio: the probability of one at least as large by chance."""
    return float(2 * stdtr(dof, -abs(t)))


def f_p_value(f: float, dof_numerator: float, dof_denominator: float) -> float:
    """Upper tail of the F distribution: the probability of a ratio at least as large by chance."""
    return float(fdtrc(dof_numerator, dof_denominator, max(f, 0.0)))


def chi2_p_value(squares: float, dof: float) -> float:
    """Upper tail of chi-square: the probability of a larger sum of squares by chance; 1 without redundancy."""
    return float(chdtrc(dof, max(squares, 0.0))) if dof > 0 else 1.0


def squares_p_value(squares: float, correlations: Sequence[Floats]) -> float:
    """Probability of a larger sum of squares of standard normal variables that go together.

    correlations: of the variables; one matrix for each set of them that is independent of the others.

    The sum has the cumulants tr R, 2 tr R^2, 8 tr R^3; the chi-square of the same skewness stands for it.
    Source: [Imhof 1961].
    """
    mean = sum(float(np.trace(each)) for each in correlations)
    second = sum(float((each**2).sum()) for each in correlations)
    third = sum(float(((each @ each) * each).sum()) for each in correlations)
    dof = second**3 / third**2
    return chi2_p_value(dof + (squares - mean) * (dof / second) ** 0.5, dof)


def chi2_quantile(probability: float, dof: float) -> float:
    return float(chdtri(dof, 1 - probability))


def noncentrality(significance: float, power: float, dof: float) -> float:
    """Return the noncentrality that a chi-square test at a significance finds with a power.

    Its root is how many standard deviations an error of one coordinate must have: 4.13 at 0.1 % and 80 %.
    """
    return float(chndtrinc(chdtri(dof, significance), dof, 1 - power))


def grubbs_limit(n: int | Numbers, alpha: float) -> Floats:
    """Critical values of Grubbs' test for one outlier among n values, n at least 3: limit of max |value - mean| / s.

    `alpha` is the probability of rejecting a value of a clean sample; the sign of the outlier is unknown. Where it is
    known, one-sided, the limit is that of twice the probability.

    Source: [004a]; [Grubbs 1969] as a function of Student's t.
    """
    t2 = stdtrit(n - 2, 1 - alpha / (2 * n)) ** 2
    return np.asarray((n - 1) / np.sqrt(n) * np.sqrt(t2 / (n - 2 + t2)))


def tau_limit(n: int | Numbers, unknowns: int, alpha: float) -> Floats:
    """Critical values of the largest studentised residual |v| / (sigma0 sqrt(r)) (Pope's tau, Bonferroni).

    `alpha` is the probability of rejecting an observation of a clean adjustment; n - unknowns must be at least 2. For
    one unknown it is Grubbs' two-sided limit for the largest |v| / (s sqrt((n-1)/n)).

    Source: [Pope 1976].
    """
    nu = n - unknowns
    t = stdtrit(nu - 1, 1 - alpha / (2 * n))
    return np.asarray(t * np.sqrt(nu) / np.sqrt(nu - 1 + t * t))
