"""Least squares of strip polynomials with given terms, axis by axis."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from photostrip.arrays import Flags, Floats
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS, similarity_derivatives
from photostrip.strip.absolute_orientation import Targets
from photostrip.strip.polynomial import terms as polynomial_terms

Terms = tuple[tuple[str, ...], ...]  # of the three axes

ITERATIONS = 4  # plan-only and height-only points take their missing coordinate from the fit itself
CONVERGED = 1e-9  # m


@dataclass(frozen=True, eq=False)
class AxisFit:
    terms: tuple[str, ...]  # names of the terms, keys of ``POWERS``; empty when the axis is not corrected
    # coefficients, sigmas: (k,): coefficients for X and Y in metres and their standard deviations (NaN without
    # redundancy)
    coefficients: Floats
    sigmas: Floats
    effects: Floats  # (k,): size of each term in metres at the end of the control's range and the edge of the strip
    residuals: Floats  # (n,): corrected minus given in metres; 0 for points that do not count in this axis
    # (n, k): orthonormal basis of the weighted design; its rows say how control coordinates share in the fit
    basis: Floats
    sigma0: float  # standard deviation in metres of a control coordinate of mean weight; NaN without redundancy
    redundancy: int
    condition: float  # condition number of the scaled design; NaN without terms

    @property
    def leverage(self) -> Floats:
        """Share of each control coordinate in its own fit, 0 to 1."""
        return np.asarray((self.basis**2).sum(axis=1), float)


@dataclass(frozen=True, eq=False)
class FitProblem:
    """Everything a fit needs: positions, what counts, and the sizes that make columns comparable."""

    xyz: Floats  # (n, 3): control points after the similarity, intermediate frame, metres
    targets: Targets
    # (n, 3): weights along the points' axes (east, north, up), metres^-2; 0 where a coordinate does not count
    weight: Floats
    spacing: float  # distance along the strip that makes two stations different, metres (one base)
    breadth: float  # half width of the strip, metres

    @cached_property
    def sizes(self) -> polynomial_terms.Sizes:
        """What makes columns comparable."""
        reach = max(float(np.abs(self.xyz[:, 0]).max()), 1e-6)
        return polynomial_terms.Sizes(reach, self.breadth, self.spacing)

    @cached_property
    def misclosures(self) -> Floats:
        """Strip minus given after the similarity, intermediate frame, metres."""
        return self.xyz - self.targets.of(self.xyz)

    @cached_property
    def similarity(self) -> tuple[Floats, Floats]:
        """Orthonormal basis (n, 3, 7) of the weighted design of a similarity, and what it leaves, (n, 3), weighted."""
        root = np.sqrt(self.by_axis)
        moved = similarity_derivatives(self.xyz, self.xyz.mean(axis=0)) * root[:, :, None]
        basis, _ = np.linalg.qr(moved.reshape(-1, SIMILARITY_PARAMETERS))
        misclosures = (self.misclosures * root).ravel()
        left = misclosures - basis @ (basis.T @ misclosures)
        return basis.reshape(moved.shape), left.reshape(-1, 3)

    @cached_property
    def by_axis(self) -> Floats:
        """Weights for the axes X, Y, Z: plan weights are those of the two plan coordinates together."""
        plan = self.weight[:, :2].mean(axis=1)
        return np.column_stack([plan, plan, self.weight[:, 2]])


@dataclass(frozen=True, eq=False)
class Design:
    """What the fit of one axis is made of, before there are misclosures."""

    terms: tuple[str, ...]  # terms; empty when the axis is not corrected
    rows: Flags  # (n,): points that count
    columns: Floats  # (n, k): scaled columns of all points
    scales: Floats  # (k,): what they were divided by
    root: Floats  # (n,): square roots of the weights over their mean; 0 for points that do not count
    # basis, triangle: (n, k) and (k, k): the weighted columns, decomposed
    basis: Floats
    triangle: Floats
    condition: float  # condition number of the scaled columns

    @classmethod
    def of(cls, problem: FitProblem, weight: Floats, terms: tuple[str, ...]) -> Design:
        """Decompose the columns of one axis."""
        rows, scales = weight > 0, polynomial_terms.scales(terms, problem.sizes)
        columns = polynomial_terms.columns(problem.xyz, terms) / scales
        root = np.sqrt(weight / weight[rows].mean()) if rows.any() else np.zeros(len(weight))
        basis, triangle = np.zeros(columns.shape), np.zeros((0, 0))
        condition = float("nan")
        if terms:
            basis[rows], triangle = np.linalg.qr(columns[rows] * root[rows, None])
            condition = polynomial_terms.condition(problem.xyz[rows], terms, problem.sizes)
        return cls(
            terms=terms,
            rows=rows,
            columns=columns,
            scales=scales,
            root=root,
            basis=basis,
            triangle=triangle,
            condition=condition,
        )

    def effects(self, misclosure: Floats) -> Floats:
        """Weighted least squares; the misclosure is strip minus given."""
        if not self.terms:
            return np.zeros(0)
        # eq. 151 with the free term X - X': the polynomial equals given minus strip
        return np.asarray(np.linalg.solve(self.triangle, self.basis.T @ (-misclosure * self.root)), float)

    def correction(self, misclosure: Floats) -> Floats:
        """Correct all points, those that do not count too."""
        return self.columns @ self.effects(misclosure)

    def fit(self, misclosure: Floats) -> AxisFit:
        """Fit, with residuals and standard deviations."""
        estimate = self.effects(misclosure)
        residuals = np.where(self.rows, misclosure + self.columns @ estimate, 0.0)
        redundancy = int(self.rows.sum()) - len(self.terms)
        squares = float(((residuals * self.root) ** 2).sum())
        sigma0 = float(np.sqrt(squares / redundancy)) if self.terms and redundancy > 0 else float("nan")
        return AxisFit(
            terms=self.terms,
            coefficients=estimate / self.scales,
            sigmas=sigma0 * np.sqrt((np.linalg.inv(self.triangle) ** 2).sum(axis=1)) / self.scales,
            effects=estimate,
            residuals=residuals,
            basis=self.basis,
            sigma0=sigma0,
            redundancy=redundancy,
            condition=self.condition,
        )


def fit_axes(problem: FitProblem, terms: Terms) -> list[AxisFit]:
    """Fit the terms of X, Y, Z; points that give only some of their coordinates need a few iterations.

    Source: [001] eq. 151.
    """
    of = cache(lambda weights, terms: Design.of(problem, problem.by_axis[:, weights], terms))
    designs = [of(weights, terms[axis]) for axis, weights in enumerate((0, 0, 2))]  # X and Y weigh alike
    misclosure = problem.misclosures
    if not problem.targets.control.use.all():
        for _ in range(ITERATIONS):
            corrections = [design.correction(misclosure[:, axis]) for axis, design in enumerate(designs)]
            before = misclosure
            misclosure = problem.xyz - problem.targets.of(problem.xyz + np.column_stack(corrections))
            if np.abs(misclosure - before).max() < CONVERGED:
                break
    return [design.fit(misclosure[:, axis]) for axis, design in enumerate(designs)]
