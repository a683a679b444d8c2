"""Distribution functions of the tests, in plain Python.

scipy.special has all of them, and the tests compare every function here with it; but importing it takes 0.18 s, a third
of the whole run of a small project, for a dozen numbers. Continued fractions after Lentz; relative errors are below
1e-11 over the range the tests of photostrip use.
"""

from __future__ import annotations

from math import exp, fabs, inf, lgamma, log, sqrt
from statistics import NormalDist
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

TINY = 1e-300
PRECISION = 1e-16
TERMS = 100_000
STEPS = 200


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
        for m in range(1, TERMS):
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
        for n in range(1, TERMS):
            yield -n * (n - a), x + 2 * n + 1 - a

    return 1 - front / _continued_fraction(terms())


def _solve(excess: Callable[[float], float], start: float, low: float, high: float) -> float:
    """Root of an increasing function, by secants kept within a bracket."""
    x, value = start, excess(start)
    previous, before = x, value
    for _ in range(STEPS):
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


def t_sf(t: float, dof: float) -> float:
    """Upper tail of Student's t for a t that is not negative."""
    total = dof + t * t
    return 0.5 * beta_cdf(dof / total, dof / 2, 0.5, t * t / total)


def t_isf(tail: float, dof: float) -> float:
    """Quantile of Student's t with a given upper tail."""
    if tail > 0.5:  # noqa: PLR2004  the median
        return -t_isf(1 - tail, dof)
    # In the logarithm the tail is nearly straight, so that secants converge for far tails and few degrees alike.
    start = -NormalDist().inv_cdf(max(tail, 1e-300)) if tail < 0.5 else 0.0  # noqa: PLR2004
    root = _solve(lambda s: log(tail) - log(max(t_sf(exp(s), dof), TINY)), log(max(start, 1e-3)), -50.0, 700.0)
    return exp(root) if tail < 0.5 else 0.0  # noqa: PLR2004


def f_sf(f: float, numerator: float, denominator: float) -> float:
    """Upper tail of the F distribution."""
    if f <= 0:
        return 1.0
    total = denominator + numerator * f
    return beta_cdf(denominator / total, denominator / 2, numerator / 2, numerator * f / total)


def f_isf(tail: float, numerator: float, denominator: float) -> float:
    """Quantile of the F distribution with a given upper tail; secants in logarithms, as for Student's t."""
    excess = lambda s: log(tail) - log(max(f_sf(exp(s), numerator, denominator), TINY))  # noqa: E731
    return exp(_solve(excess, 1.0, -50.0, 700.0))


def noncentral_chi2_sf(x: float, dof: float, noncentrality: float) -> float:
    """Upper tail of the noncentral chi-square distribution: a Poisson mixture of central ones."""
    half = noncentrality / 2
    below, weight = 0.0, exp(-half)
    for n in range(TERMS):
        below += weight * gamma_cdf(x / 2, dof / 2 + n)
        weight *= half / (n + 1)
        if n > half and weight < PRECISION:
            break
    return 1.0 - below


def chi2_ppf(probability: float, dof: float) -> float:
    """Quantile of chi-square, from the cube-root approximation of Wilson and Hilferty."""
    z = NormalDist().inv_cdf(probability)
    start = dof * max(1 - 2 / (9 * dof) + z * sqrt(2 / (9 * dof)), 1e-3) ** 3
    return 2 * _solve(lambda x: gamma_cdf(x, dof / 2) - probability, start / 2, 0.0, inf)
