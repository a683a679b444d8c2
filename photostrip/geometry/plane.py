"""Transformations of the plane, fitted by least squares: conformal, affine, bilinear, projective.

One form holds them all: the target coordinates are linear in (x, y, x y, 1) of the source, divided by a common
denominator that is linear too. Conformal and affine transformations have the denominator 1 and no product, bilinear
ones the product, projective ones the denominator. So transformations of different kinds stand in one array, one for
each photo, say: everything works on leading axes of any shape, points (..., n, 2).

A fit takes corresponding points, (..., n, 2), with one weight each, (..., n), for both coordinates, and makes the
weighted sum of squared residuals smallest (derived). A point of weight zero takes no part in a fit, whatever finite
coordinates stand in its place; photos with a missing mark fit into one array with the others. Coordinates are shifted
and scaled before a fit and the coefficients brought back afterwards, because pixel numbers of ten thousand and their
products would cost half of the digits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Floats
from photostrip.errors import GeometryError

SINGULAR = 1e-9  # smallest over largest singular value: below, rounding decides
ITERATIONS = 50
CONVERGED = 1e-12  # in units of the spread of the points
LINEAR = [0, 1, 3]  # columns of x, y and 1


@dataclass(frozen=True, eq=False)
class PlaneTransform:
    """Transformation of the plane: ``top = coefficients @ (x, y, x y, 1)``, target = the first two over the third."""

    coefficients: Floats  # (..., 3, 4): rows: target x, target y, denominator

    def __call__(self, points: ArrayLike) -> Floats:
        values = _terms(np.asarray(points, float)) @ self.coefficients.swapaxes(-1, -2)
        return values[..., :2] / values[..., 2:]

    def residuals(self, source: ArrayLike, target: ArrayLike) -> Floats:
        return np.asarray(self(source) - np.asarray(target, float), float)

    def jacobian(self, points: ArrayLike) -> Floats:
        """Differentiate the target by the source at points: (..., n, 2, 2), rows target x, y."""
        p = np.asarray(points, float)
        c = self.coefficients
        values = _terms(p) @ c.swapaxes(-1, -2)
        slopes = c[..., None, :, :2] + c[..., None, :, 2:3] * p[..., None, ::-1]
        top, bottom = values[..., :2, None], values[..., 2:, None]
        return np.asarray((slopes[..., :2, :] - top / bottom * slopes[..., 2:, :]) / bottom, float)

    def take(self, rows: ArrayLike) -> PlaneTransform:
        """Give some transformations of an array of them, by their numbers along the first axis."""
        return PlaneTransform(self.coefficients[np.asarray(rows)])


def conformal_from_points(source: ArrayLike, target: ArrayLike, weights: ArrayLike | None = None) -> PlaneTransform:
    """Conformal transformation (one scale, rotation, shift; never mirrored), in closed form.

    The complex slope is sum(conj(a) b) / sum(|a|^2) of centred coordinates. Two different points are enough; a
    ``GeometryError`` when all source points are in one place.
    """
    a, b, w = _arrays(source, target, weights)
    local, substitution = _local(a, w)
    weight = w[..., None]
    shift = (weight * b).sum(-2) / weight.sum(-2)
    norm = 2 * w.sum(-1)  # the local coordinates have unit spread
    along = (weight * local * b).sum((-2, -1)) / norm
    across = (w * (local[..., 0] * b[..., 1] - local[..., 1] * b[..., 0])).sum(-1) / norm
    rows = np.stack([along, -across, shift[..., 0], across, along, shift[..., 1]], -1)
    return PlaneTransform(_from_matrix(_with_last_row(rows)) @ substitution)


def linear_from_points(
    source: ArrayLike, target: ArrayLike, weights: ArrayLike | None = None, *, terms: list[int]
) -> PlaneTransform:
    """Affine or bilinear transformation: no denominator, and some of the terms x, y, x y, 1.

    A bilinear one keeps lines parallel to the axes of the source straight, so it depends on how these axes lie; four
    points in the middle of the sides of a square, on its axes, do not determine its term x y. A ``GeometryError`` when
    points do not determine all coefficients.
    """
    a, b, w = _arrays(source, target, weights)
    local, substitution = _local(a, w)
    coefficients = np.zeros((*w.shape[:-1], 3, 4))
    coefficients[..., :2, terms] = _solve(_terms(local)[..., terms], b, w).swapaxes(-1, -2)
    coefficients[..., 2, 3] = 1.0
    return PlaneTransform(coefficients @ substitution)


def projective_from_points(source: ArrayLike, target: ArrayLike, weights: ArrayLike | None = None) -> PlaneTransform:
    """Projective transformation.

    The equations multiplied by the denominator give the start, Gauss-Newton steps then reduce the residuals themselves.
    Needs four points of which no three are on one line.

    Raises GeometryError when the points do not determine all coefficients, lie on both sides of the line that goes to
        infinity, or when the iteration does not converge.
    """
    a, b, w = _arrays(source, target, weights)
    local_a, substitution = _local(a, w)
    local_b, _ = _local(b, w)
    twice = np.concatenate([w, w], -1)
    h = _solve(_projective_terms(local_a, local_b), _stacked(local_b)[..., None], twice)[..., 0]
    for _ in range(ITERATIONS):
        matrix = _with_last_row(h)
        values = _terms(local_a)[..., LINEAR] @ matrix.swapaxes(-1, -2)
        bottom = values[..., 2:]
        if not (bottom > 0).all():
            raise GeometryError("points lie on both sides of the line that goes to infinity", code="projective")
        value = values[..., :2] / bottom
        design = _projective_terms(local_a, value) / np.concatenate([bottom, bottom], -2)
        step = _solve(design, _stacked(local_b - value)[..., None], twice)[..., 0]
        h = h + step
        if (np.abs(step) <= CONVERGED).all():
            back = np.linalg.inv(_shift_and_scale(*_center_and_size(b, w)))
            return PlaneTransform(_from_matrix(back @ _with_last_row(h)) @ substitution)
    raise GeometryError("the projective fit did not converge", code="projective")


class TransformKind(NamedTuple):
    """One kind of transformation: its fit, how many unknowns it has and how many points it needs."""

    fit: Callable[..., PlaneTransform]
    unknowns: int
    least_points: int


KINDS = {
    "conformal": TransformKind(conformal_from_points, 4, 2),
    "affine": TransformKind(partial(linear_from_points, terms=LINEAR), 6, 3),
    "bilinear": TransformKind(partial(linear_from_points, terms=[0, 1, 2, 3]), 8, 4),
    "projective": TransformKind(projective_from_points, 8, 4),
}


def strength(kind: str, points: ArrayLike, weights: ArrayLike | None = None) -> Floats:
    """How well points determine a transformation of a kind, one of ``KINDS``, shape (...).

    Smallest over largest singular value of the equations in centred coordinates of unit spread. For an affine
    transformation 1 for the corners of a square, 0 for points on a line and for too few points; for a conformal one 1
    whenever two points differ.
    """
    a, _, w = _arrays(points, points, weights)
    center, size = _center_and_size(a, w)
    if kind == "conformal":
        return np.where(size > 0, 1.0, 0.0)
    local = _shifted_and_scaled(a, w, center, np.where(size > 0, size, 1.0))
    if kind == "projective":
        return _reciprocal_condition(_projective_terms(local, local), np.concatenate([w, w], -1))
    terms = _terms(local)
    return _reciprocal_condition(terms[..., LINEAR] if kind == "affine" else terms, w)


class _Corresponding(NamedTuple):
    """Points to fit, broadcast to one shape."""

    source: Floats
    target: Floats
    weights: Floats


def _arrays(source: ArrayLike, target: ArrayLike, weights: ArrayLike | None) -> _Corresponding:
    a, b = np.broadcast_arrays(np.asarray(source, float), np.asarray(target, float))
    w = np.ones(()) if weights is None else np.asarray(weights, float)
    return _Corresponding(a, b, np.broadcast_to(w, np.broadcast_shapes(w.shape, a.shape[:-1])))


def _center_and_size(points: Floats, weights: Floats) -> tuple[Floats, Floats]:
    """Weighted mean (..., 2) and root mean square coordinate about it (...), 0 when all are in one place."""
    total = weights.sum(-1)
    divisor = np.where(total > 0, total, 1.0)
    center = (weights[..., None] * points).sum(-2) / divisor[..., None]
    size = np.sqrt((weights[..., None] * (points - center[..., None, :]) ** 2).sum((-2, -1)) / (2 * divisor))
    return center, np.where(size > np.finfo(float).eps * np.abs(center).max(-1), size, 0.0)


def _local(points: Floats, weights: Floats) -> tuple[Floats, Floats]:
    """Centred points of unit spread, and the matrix (..., 4, 4) that takes the terms of the points to theirs."""
    center, size = _center_and_size(points, weights)
    if not (size > 0).all():
        raise GeometryError("all points are in one place", code="one-place")
    x, y = center[..., 0], center[..., 1]
    matrix = np.zeros((*size.shape, 4, 4))
    matrix[..., 0, 0] = matrix[..., 1, 1] = 1 / size
    matrix[..., 0, 3], matrix[..., 1, 3] = -x / size, -y / size
    matrix[..., 2, :] = np.stack([-y, -x, np.ones_like(x), x * y], -1) / size[..., None] ** 2
    matrix[..., 3, 3] = 1
    return _shifted_and_scaled(points, weights, center, size), matrix


def _shifted_and_scaled(points: Floats, weights: Floats, center: Floats, size: Floats) -> Floats:
    """Centre and scale points; those of weight zero come to the centre."""
    return np.where(weights[..., None] > 0, (points - center[..., None, :]) / size[..., None, None], 0.0)


def _shift_and_scale(center: Floats, size: Floats) -> Floats:
    matrix = np.zeros((*size.shape, 3, 3))
    matrix[..., 0, 0] = matrix[..., 1, 1] = 1 / size
    matrix[..., :2, 2] = -center / size[..., None]
    matrix[..., 2, 2] = 1
    return matrix


def _solve(design: Floats, values: Floats, weights: Floats) -> Floats:
    """Least squares (..., k, q) of equations (..., n, k) for q right sides, by singular values."""
    singular = GeometryError("the points do not determine all coefficients", code="weak-points")
    if design.shape[-2] < design.shape[-1]:
        raise singular
    root = np.sqrt(weights)[..., None]
    u, s, vt = np.linalg.svd(root * design, full_matrices=False)
    if not (s[..., -1] > SINGULAR * s[..., 0]).all():
        raise singular
    return np.asarray(vt.swapaxes(-1, -2) @ ((u.swapaxes(-1, -2) @ (root * values)) / s[..., None]), float)


def _reciprocal_condition(design: Floats, weights: Floats) -> Floats:
    if design.shape[-2] < design.shape[-1]:
        return np.zeros(design.shape[:-2])
    values = np.linalg.svd(np.sqrt(weights)[..., None] * design, compute_uv=False)
    largest = values[..., 0]
    return values[..., -1] / np.where(largest > 0, largest, 1.0)


def _terms(points: Floats) -> Floats:
    """Give x, y, x y, 1 of points: (..., n, 2) to (..., n, 4)."""
    terms = np.ones((*points.shape[:-1], 4))
    terms[..., :2] = points
    terms[..., 2] = points[..., 0] * points[..., 1]
    return terms


def _projective_terms(source: Floats, target: Floats) -> Floats:
    """Differentiate target times denominator by all coefficients but the last, which is 1: (..., 2 n, 8)."""
    terms = _terms(source)[..., LINEAR]
    none = np.zeros_like(terms)
    upper = np.concatenate([terms, none, -source * target[..., :1]], -1)
    lower = np.concatenate([none, terms, -source * target[..., 1:]], -1)
    return np.concatenate([upper, lower], -2)


def _stacked(points: Floats) -> Floats:
    """All x, then all y: (..., n, 2) to (..., 2 n)."""
    return np.concatenate([points[..., 0], points[..., 1]], -1)


def _with_last_row(values: Floats) -> Floats:
    """Matrices (..., 3, 3) of their first six or eight elements; the last row is else 0, 0, 1."""
    matrix = np.zeros((*values.shape[:-1], 9))
    matrix[..., : values.shape[-1]] = values
    matrix[..., 8] = 1
    return matrix.reshape(*values.shape[:-1], 3, 3)


def _from_matrix(matrix: Floats) -> Floats:
    """Coefficients (..., 3, 4) of a matrix (..., 3, 3) of x, y, 1."""
    coefficients = np.zeros((*matrix.shape[:-1], 4))
    coefficients[..., LINEAR] = matrix
    return coefficients
