"""Strip polynomials: the deformation that a similarity leaves, corrected axis by axis."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, partial
from typing import TYPE_CHECKING

import numpy as np

from photostrip.triangulation.polynomial import terms as polynomial_terms
from photostrip.triangulation.polynomial.degree import GROUPS, Evidence, decide
from photostrip.triangulation.polynomial.least_squares import AxisFit, FitProblem, fit_axes

if TYPE_CHECKING:
    from photostrip.arrays import Floats
    from photostrip.triangulation.polynomial.degree import Fits


__all__ = ["DEGREES", "GROUPS", "AxisFit", "Evidence", "FitProblem", "Polynomial", "PolynomialSettings", "fit"]

DEGREES = ("auto", "1", "2", "3")


@dataclass(frozen=True)
class PolynomialSettings:
    """Which polynomial takes out the strip deformation."""

    degree: str = "auto"  # ``"auto"`` (decided by evidence), ``"1"``, ``"2"`` or ``"3"``


@dataclass(frozen=True, eq=False)
class Polynomial:
    """The correction of a strip."""

    degree: int  # highest power of X in use; 0: similarity alone
    axes: tuple[AxisFit, AxisFit, AxisFit]  # fits of X, Y, Z
    evidence: tuple[Evidence, ...]  # degrees that were weighed, ascending
    stations: tuple[int, int]  # different stations along the strip in plan and in height
    reach: tuple[float, float]  # range of the control along X, metres
    asked: str

    def corrections(self, xyz: Floats) -> Floats:
        """Corrections of positions (n, 3) after the similarity, to be added. Source: [001] eq. 150."""
        return np.column_stack([polynomial_terms.columns(xyz, axis.terms) @ axis.coefficients for axis in self.axes])

    def __call__(self, xyz: Floats) -> Floats:
        """Corrected positions; see ``corrections``."""
        return xyz + self.corrections(xyz)


def fit(problem: FitProblem, settings: PolynomialSettings) -> Polynomial:
    """Fit the polynomial that the settings ask for, or the one that the evidence supports.

    It is of degree 0, without terms, when the control carries none or the evidence supports none.
    """
    counts = problem.by_axis > 0
    x = problem.xyz[:, 0]
    stations = tuple(polynomial_terms.count_stations(x[counts[:, axis]], problem.spacing) for axis in (0, 2))
    chosen: list[tuple[str, ...]] = []
    evidence: list[Evidence] = []
    fits_of: Fits = cache(partial(fit_axes, problem))  # plan and height often weigh the same candidates
    for group, axes in GROUPS:
        terms, weighed = decide(problem, (group, axes), settings.degree, fits_of)
        chosen += [terms] * len(axes)
        evidence += weighed
    fits = fits_of(tuple(chosen))
    inside = x[counts.any(axis=1)]
    return Polynomial(
        degree=max(polynomial_terms.degree_of(terms) for terms in chosen),
        axes=(fits[0], fits[1], fits[2]),
        evidence=tuple(evidence),
        stations=(stations[0], stations[1]),
        reach=(float(inside.min()), float(inside.max())),
        asked=settings.degree,
    )
