"""Distribution functions in plain Python, quantiles and critical values of the tests.

scipy.special has the distributions, and the tests compare every function here with it; but importing it takes 0.18 s, a
third of the whole run of a small project, for a dozen numbers. Continued fractions after Lentz; relative errors are
below 1e-11 over the range the tests of photostrip use.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import lru_cache
from math import erfc, exp, fabs, inf, lgamma, log, pi, sqrt

# A sound result calls for a second look with this probability at the most, for whatever reason: sigma0, pairs, points
# that the adjustment has not seen, given points that stand out, deformed models, control against a strip's covariance.
# Each of these six has the same share of it.
SECOND_LOOK = 0.05
TEST_LEVEL = SECOND_LOOK / 6
HALVINGS = 60  # of an interval around a root
SIGMA_FROM_MEDIAN = 1.4826  # standard deviation over the median of |x|, of a normal distribution
TINY = 1e-300
PRECISION = 1e-16
MOST_TERMS = 100_000
MOST_STEPS = 200


def _continued_fraction(terms: Iterator[tuple[float, float]]) -> float:
    """Evaluate b0 + a1/(b1 + a2/(b2 + ...)) from pairs (a, b), the first (0, b0), by Lentz's method."""
    _, value = next(terms)
    value = value or TINY
    c, d = value, 0.0
    for a, b in terms:
        d = 1 / (b + a * d or TINY)
        c = b + a / c or TINY
        value *= c * d
        if fabs(c * d - 1) < PRECISION * 10:
            break
    return value


def beta_cdf(x: float, a: float, b: float, rest: float | None = None) -> float:
    """Regularised incomplete beta function I_x(a, b): the probability below x of the beta distribution.

    `rest` is 1 - x, where the caller knows it to more digits than the difference has.

    Source: derived; the continued fraction stands in every handbook of functions.
    """
    rest = 1 - x if rest is None else rest
    if x <= 0 or rest <= 0:
        return float(rest <= 0)
    if x > (a + 1) / (a + b + 2):
        return 1 - beta_cdf(rest, b, a, x)

    def terms() -> Iterator[tuple[float, float]]:
        yield 0.0, 1.0
        yield -(a + b) * x / (a + 1), 1.0
        for m in range(1, MOST_TERMS):
            yield m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m)), 1.0
            yield -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1)), 1.0

    front = exp(lgamma(a + b) - lgamma(a) - lgamma(b) + a * log(x) + b * log(rest)) / a
    return front / _continued_fraction(terms())


def gamma_cdf(x: float, a: float) -> float:
    """Regularised lower incomplete gamma function P(a, x): the probability below x of the gamma distribution.

    Source: derived; series below a + 1, continued fraction above.
    """
    if x <= 0:
        return 0.0
    front = exp(a * log(x) - x - lgamma(a))
    if x < a + 1:
        term = total = 1 / a
        n = a
        while term > total * PRECISION:
            n += 1
            term *= x / n
            total += term
        return front * total

    def terms() -> Iterator[tuple[float, float]]:
        yield 0.0, x + 1 - a
        for n in range(1, MOST_TERMS):
            yield -n * (n - a), x + 2 * n + 1 - a

    return 1 - front / _continued_fraction(terms())


def _solve(excess: Callable[[float], float], start: float, low: float, high: float) -> float:
    """Root of an increasing function, by secants kept within a bracket."""
    x, value = start, excess(start)
    previous, before = x, value
    for _ in range(MOST_STEPS):
        low, high = (low, min(high, x)) if value > 0 else (max(low, x), high)
        slope = (value - before) / (x - previous) if x != previous else 0.0
        guess = x - value / slope if slope else inf
        if not low < guess < high:
            guess = (low + high) / 2 if high < inf else 2 * max(low, 1.0)
        if fabs(guess - x) <= 4 * PRECISION * max(fabs(x), 1e-3):
            return guess
        previous, before = x, value
        x, value = guess, excess(guess)
        if value == 0:
            break
    return x


@lru_cache(maxsize=4096)
def normal_quantile(probability: float) -> float:
    """Quantile of the normal distribution by Newton's method; ``statistics.NormalDist`` loads decimal numbers."""
    tail = min(probability, 1 - probability)
    if not tail > 0:
        message = f"a probability lies between 0 and 1, not at {probability}"
        raise ValueError(message)
    x = sqrt(
        -2 * log(2 * tail)
    )  # from above, where the logarithm of the tail, which is concave, leads down to the root
    for _ in range(MOST_STEPS):
        upper = erfc(x / sqrt(2)) / 2
        step = log(tail / upper) * upper * sqrt(2 * pi) * exp(x * x / 2)
        x -= step
        if fabs(step) <= 4 * PRECISION * x:
            break
    return x if probability > tail else -x


def t_sf(t: float, dof: float) -> float:
    """Upper tail of Student's t for a t that is not negative."""
    total = dof + t * t
    return 0.5 * beta_cdf(dof / total, dof / 2, 0.5, t * t / total)


def t_p_value(t: float, dof: float) -> float:
    """Two-sided p value of a t ratio: the probability of one at least as large by chance."""
    return 2 * t_sf(abs(t), dof)


@lru_cache(maxsize=4096)
def t_quantile(probability: float, dof: float) -> float:
    tail = min(probability, 1 - probability)
    if tail == 0.5:  # noqa: PLR2004  the median
        return 0.0
    # In the logarithm the tail is nearly straight, so that secants converge for far tails and few degrees alike.
    start = log(max(-normal_quantile(max(tail, 1e-300)), 1e-3))
    size = exp(_solve(lambda s: log(tail) - log(max(t_sf(exp(s), dof), TINY)), start, -50.0, 700.0))
    return size if probability > tail else -size


def f_p_value(f: float, dof_numerator: float, dof_denominator: float) -> float:
    """Upper tail of the F distribution: the probability of a ratio at least as large by chance."""
    if f <= 0:
        return 1.0
    total = dof_denominator + dof_numerator * f
    return beta_cdf(dof_denominator / total, dof_denominator / 2, dof_numerator / 2, dof_numerator * f / total)


@lru_cache(maxsize=4096)
def f_quantile(probability: float, dof_numerator: float, dof_denominator: float) -> float:
    """Quantile of F; secants in logarithms, as for Student's t."""
    tail = 1 - probability
    excess = lambda s: log(tail) - log(max(f_p_value(exp(s), dof_numerator, dof_denominator), TINY))  # noqa: E731
    return exp(_solve(excess, 1.0, -50.0, 700.0))


@lru_cache(maxsize=4096)
def chi2_quantile(probability: float, dof: float) -> float:
    """Quantile of chi-square, from the cube-root approximation of Wilson and Hilferty."""
    z = normal_quantile(probability)
    start = dof * max(1 - 2 / (9 * dof) + z * sqrt(2 / (9 * dof)), 1e-3) ** 3
    return 2 * _solve(lambda x: gamma_cdf(x, dof / 2) - probability, start / 2, 0.0, inf)


def binomial_p_value(count: float, number: float, probability: float) -> float:
    """Probability of `count` or more among `number` cases of a probability; the numbers need not be whole."""
    return beta_cdf(probability, count, number - count + 1) if count > 0 else 1.0


def noncentral_chi2_sf(x: float, dof: float, noncentrality: float) -> float:
    """Upper tail of the noncentral chi-square distribution: a Poisson mixture of central ones."""
    half = noncentrality / 2
    below, weight = 0.0, exp(-half)
    for n in range(MOST_TERMS):
        below += weight * gamma_cdf(x / 2, dof / 2 + n)
        weight *= half / (n + 1)
        if n > half and weight < PRECISION:
            break
    return 1.0 - below


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
