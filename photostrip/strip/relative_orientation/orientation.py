"""Relative orientation of stereopairs: oriented pairs, how good they are, and which cannot be used.

Source: [001] for the elements; precision and criteria are derived.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from photostrip.arrays import Flags, Floats, Numbers, pieces
from photostrip.errors import GeometryError
from photostrip.geometry.rotation import from_alpha_omega_kappa
from photostrip.points import take_rows
from photostrip.strip.relative_orientation import solution
from photostrip.strip.relative_orientation.pairs import MINIMUM_POINTS, Pairs

CONDITION_LIMIT = 1e6  # of the column-normalised Jacobian
SMALLEST_PARALLAX = 1e-3  # of the principal distance, mean over a pair: below it there is no base to speak of
LEAST_IN_FRONT = 0.5  # share of the points of a pair
SCREENINGS = ("auto", "parallax+grubbs", "tau", "deletion", "robust", "none")  # searches for gross errors
# whose cofactors are laid out together: those of 87 000 rows are the largest block of a run, and once it is freed, the
# C library keeps all smaller ones for itself, too
ROWS = 32_768
BY_PAIR = ("elements", "sigmas", "sigma0", "condition", "iterations", "cofactors")
BY_ROW = ("parallax", "redundancy")


@dataclass(frozen=True)
class RelativeSettings:
    """How pairs are oriented and their gross errors found."""

    screening: str = "auto"  # of ``SCREENINGS``; ``auto``: robust start where needed, then deletion search
    grubbs_alpha: float = 0.05  # probability of rejecting a point of a pair without gross errors
    # largest y parallax in mm that needs no rejection; None: four times its a-priori standard deviation
    parallax_limit: float | None = None
    # keep, drop: measurements, ``photo/point``, that are used or left out whatever the tests say
    keep: list[str] = field(default_factory=list)
    drop: list[str] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class Orientation:
    """Relative orientation of all pairs of a strip."""

    pairs: Pairs  # measurements with the weights in force; rejected points have weight 0
    # elements, sigmas: (p, 5): elements and their standard deviations in radians; NaN without redundancy
    elements: Floats
    sigmas: Floats
    sigma0: Floats  # (p,): standard deviation of an image coordinate of weight one, in mm; NaN without redundancy
    condition: Floats  # (p,): condition number of the column-normalised Jacobian
    iterations: Numbers  # (p,): steps of the iteration
    parallax: Floats  # (m,): residual y parallaxes in mm, of rejected points too
    redundancy: Floats  # (m,): redundancy numbers; NaN for rejected points
    # (p, 5, 5): cofactors of the elements for a y parallax of weight one, rad^2/mm^2; NaN for a degenerate pair
    cofactors: Floats

    @property
    def point(self) -> Numbers:
        """Point of each row, shape (m,)."""
        return self.pairs.point

    @property
    def rows(self) -> Numbers:
        """Rows of the left and right measurement in the table of image points, shape (m, 2)."""
        return self.pairs.rows

    @property
    def used(self) -> Flags:
        """Rows that took part."""
        return self.pairs.weight > 0

    @property
    def points_used(self) -> Numbers:
        return self.pairs.sums(self.used.astype(float)).astype(np.intp)

    @cached_property
    def relative(self) -> tuple[Floats, Floats]:
        """Base direction (p, 3) and rotation of the right photo (p, 3, 3), both in the left photo's frame."""
        al1, ka1, al2, om2, ka2 = self.elements.T
        left = from_alpha_omega_kappa(al1, 0.0, ka1)
        right = from_alpha_omega_kappa(al2, om2, ka2)
        return left[:, 0, :], left.transpose(0, 2, 1) @ right

    @cached_property
    def rays(self) -> tuple[Floats, Floats]:
        """Image rays of the left and the right photo in the base frame, mm, shape (3, m) each."""
        return solution.base_rays(self.elements, self.pairs)

    def take(self, numbers: Numbers) -> Orientation:
        """Take some of the pairs, given by ascending numbers; they are renumbered from 0."""
        part = take_rows(take_rows(self, numbers, BY_PAIR), self.pairs.rows_of(numbers), BY_ROW)
        return replace(part, pairs=self.pairs.take(numbers))

    def with_pairs(self, numbers: Numbers, part: Orientation) -> Orientation:
        """Put pairs that were taken, and oriented in another way, back in their places."""
        if not len(numbers):
            return replace(self)  # shares the columns, but not the rays that were found
        rows = self.pairs.rows_of(numbers)
        by_pair = {name: _put(getattr(self, name), numbers, getattr(part, name)) for name in BY_PAIR}
        by_row = {name: _put(getattr(self, name), rows, getattr(part, name)) for name in BY_ROW}
        weight = _put(self.pairs.weight, rows, part.pairs.weight)
        return replace(self, pairs=replace(self.pairs, weight=weight), **by_pair, **by_row)


def _put(values: NDArray[Any], rows: Numbers, fresh: NDArray[Any]) -> NDArray[Any]:
    result = values.copy()
    result[rows] = fresh
    return result


def orient_pairs(pairs: Pairs, photos: Sequence[str]) -> Orientation:
    """Relative orientation of all pairs, refusing those that cannot be oriented."""
    result, converged = orient_unchecked(pairs)
    refuse_unusable(result, converged, photos)
    return result


def orient_unchecked(pairs: Pairs) -> tuple[Orientation, Flags]:
    """Relative orientation of all pairs, whatever comes of it, and whether the iteration of each converged."""
    solved = solution.solve_elements(pairs)
    return assess_pairs(solved.elements, pairs, solved.iterations), solved.converged


def orient_again(
    orientation: Orientation, weight: Floats, numbers: Numbers, lost_before: Flags | None = None
) -> Orientation:
    """Orient pairs whose weights changed, given by ascending numbers, again; `weight` (m,) is that of all rows.

    A pair whose iteration does not converge is solved from nothing; one of ``lost_before`` (p,), which marks those,
    keeps its elements instead.
    """
    pairs = replace(orientation.pairs, weight=weight)
    part = pairs.take(numbers)
    elements, converged, steps = solution.iterate_elements(orientation.elements[numbers], part)
    if lost_before is not None:
        kept = ~converged & lost_before[numbers]
        elements[kept], converged[kept] = orientation.elements[numbers[kept]], True
        lost_before[numbers[~converged]] = True
    if not converged.all():
        lost = np.flatnonzero(~converged)
        elements[lost], _, steps[lost] = solution.solve_elements(part.take(lost))
    fresh = assess_pairs(elements, part, orientation.iterations[numbers] + steps)
    return replace(orientation, pairs=pairs).with_pairs(numbers, fresh)


def assess_pairs(elements: Floats, pairs: Pairs, iterations: Numbers) -> Orientation:
    """Everything said about pairs of given elements: standard deviations, redundancy numbers, condition.

    With N = J^T W J, Q = inv(N): sigma_q^2 = q^T W q / (n - 5), r_i = 1 - w_i j_i^T Q j_i.
    """
    with np.errstate(all="ignore"):
        q, jacobian = solution.linearised_parallaxes(elements, pairs)
        normal = solution.normal_matrices(jacobian, pairs)
        condition = condition_numbers(normal)
        regular = condition < CONDITION_LIMIT
        normal[~regular] = np.eye(5)
        cofactors = np.asarray(np.linalg.inv(normal), float)
        cofactors[~regular] = np.nan
        freedom = pairs.sums((pairs.weight > 0).astype(float)) - MINIMUM_POINTS
        variance = pairs.sums(pairs.weight * q**2) / freedom  # of a y parallax: twice that of an image coordinate
        variance[freedom < 1] = np.nan
        spread = np.empty(len(q))
        for rows in pieces(len(q), ROWS):
            by = jacobian[:, rows]
            spread[rows] = np.einsum("im,mij,jm->m", by, cofactors[pairs.pair[rows]], by)
        return Orientation(
            pairs=pairs,
            elements=elements,
            sigmas=np.sqrt(variance[:, None] * cofactors[:, np.arange(5), np.arange(5)]),
            sigma0=np.sqrt(variance / 2),
            condition=condition,
            iterations=iterations,
            parallax=q,
            redundancy=np.where(pairs.weight > 0, 1 - pairs.weight * spread, np.nan),
            cofactors=cofactors,
        )


def condition_numbers(normal: Floats) -> Floats:
    """Condition numbers, shape (p,), of the column-normalised Jacobians behind normal matrices; infinite if singular.

    They are the roots of those of the normal matrices, scaled to unit diagonals.
    """
    diagonal = normal[:, np.arange(5), np.arange(5)]
    with np.errstate(all="ignore"):
        scale = 1 / np.sqrt(diagonal)
        normal = normal * scale[:, :, None] * scale[:, None, :]
    sound = np.isfinite(normal).all(axis=(1, 2))
    normal[~sound] = 0.0
    values = np.linalg.eigvalsh(normal)
    with np.errstate(all="ignore"):
        condition = np.sqrt(values[:, -1] / np.maximum(values[:, 0], 0.0))
    return np.where(sound & (values[:, 0] > 0), condition, np.inf)


def unusable_pairs(result: Orientation, converged: Flags) -> Flags:
    """Pairs that cannot be used as they are: degenerate, not converged, behind their cameras, or without a base."""
    pairs = result.pairs
    front = solution.rays_meet_in_front(*result.rays) & result.used
    share = pairs.sums(front.astype(float)) / np.maximum(result.points_used, 1)
    bad: Flags = ~converged | ~(result.condition <= CONDITION_LIMIT) | (share <= LEAST_IN_FRONT)
    return bad | (_mean_parallaxes(result) < SMALLEST_PARALLAX * pairs.focal)


def _mean_parallaxes(result: Orientation) -> Floats:
    """Mean x parallax of each pair in the base frame, mm; near zero for two photos taken from one place."""
    (lx, _, lz), (rx, _, rz) = result.rays
    with np.errstate(all="ignore"):
        size = np.where(result.used, np.abs(lx / lz - rx / rz), 0.0) * result.pairs.focal
    return np.nan_to_num(result.pairs.sums(size)) / np.maximum(result.points_used, 1)


def refuse_unusable(result: Orientation, converged: Flags, photos: Sequence[str]) -> None:
    """Raise a ``GeometryError`` for the first pair that cannot be used, with the reason a surveyor can act on."""
    for number in np.flatnonzero(unusable_pairs(result, converged)).tolist():
        names = (photos[number], photos[number + 1])
        reason, code = _reason(result.take(np.array([number])), converged=bool(converged[number]))
        msg = f"relative orientation of photos {names[0]} and {names[1]}: {reason}"
        raise GeometryError(msg, photos=names, code=code)


def _reason(pair: Orientation, *, converged: bool) -> tuple[str, str]:
    """Why one pair cannot be used, and the code of that."""
    xy = pair.pairs.left[pair.used]
    spread = np.linalg.svd(xy - xy.mean(axis=0), compute_uv=False)
    if spread[1] < 1e-3 * max(spread[0], 1e-9):
        return (
            "all common points lie on one line of the photo; points in at least the corners of the overlap are needed",
            "points-on-a-line",
        )
    parallax = float(_mean_parallaxes(pair)[0])
    if parallax < SMALLEST_PARALLAX * pair.pairs.focal:
        return (
            f"the x parallax is only {parallax:.3f} mm: the photos have no base; the same photo twice?",
            "no-base",
        )
    if converged and pair.condition[0] > CONDITION_LIMIT:
        text = f"its elements cannot be separated (condition number {pair.condition[0]:.0e}): "
        return (
            text + "the points form a narrow band or lie with both cameras on a critical surface",
            "degenerate-pair",
        )
    if not converged:
        return ("the iteration does not converge; wrong point ids or photos that do not overlap", "not-converged")
    return ("the points come out behind the cameras; are image coordinates negatives or mirrored?", "behind-cameras")
