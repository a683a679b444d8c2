"""Which adjustment a strip gets with ``adjustment: auto``: its polynomial, or its own covariance.

Two witnesses are asked about both. The standard deviations of the new points follow from the covariance of the strip
and its control, through either estimate: so what a polynomial cannot describe counts. The errors at control left out in
turn, the same for both, tell what no standard deviation knows. They are few, and scatter by more than the methods
differ, so the standard deviations decide, as long as the left-out errors are such as these let expect. A lens that is
not what its calibration says makes them many times larger; then the errors decide.

Standard deviations that agree are those of many strips; in the one at hand the two results can be far apart all the
same. So the polynomial stays only where the results agree too.

Source: derived; docs/method.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from photostrip.arrays import Floats, Numbers, distinct
from photostrip.pipeline.choice import POLYNOMIAL, Choice, Witness, expected_of, method_of
from photostrip.pipeline.strips.absolute import OrientedStrip
from photostrip.triangulation.covariance_adjustment.adjust import CovarianceAdjustment
from photostrip.triangulation.covariance_adjustment.settings import BETTER
from photostrip.triangulation.error_propagation import control_errors
from photostrip.triangulation.error_propagation.fitted_strip import FittedStrip
from photostrip.triangulation.polynomial.correction import Polynomial
from photostrip.triangulation.polynomial.terms import bands

Oriented = OrientedStrip[Any]

# left-out errors over what the covariance lets expect, beyond which its standard deviations are not to be believed;
# where bands are farther apart, more in proportion to the root of the models between them: an error that all photos
# share bends a strip by the square of their number, random ones by its power 1.5. Table in docs/accuracy.md
MOST_EXCESS = 3.5
NEAR_BANDS = 14.0  # models from one to the next
TELLING = 3  # bands of control from which on left-out errors say how a strip bends between the others
MOST_GROUPS = 12  # bands or points that are left out in turn, spread over the strip
MOST_POINTS = 300  # new points whose standard deviations are compared, spread likewise


def choose(oriented: Oriented, polynomial: Polynomial, covariance: CovarianceAdjustment) -> Choice:
    """Decide between the polynomial of a strip and its adjustment with its own covariance."""
    points = _compared(oriented)
    predicted = _predicted(oriented, polynomial, covariance, points)
    difference = _difference(oriented, polynomial, covariance, points)
    by_both = method_of(predicted, expected_of(predicted, difference))
    groups, by = _groups(oriented, polynomial)
    left_out, excess = _left_out(oriented, polynomial, covariance, groups)
    return Choice(
        taken=decide(by_both, left_out, excess, len(distinct(_bands(oriented))), oriented.errors.models),
        predicted=predicted,
        difference=difference,
        left_out=left_out,
        left_out_by=by,
        excess=excess,
    )


def decide(
    by_both: str,
    left_out: Witness | None,
    excess: float,
    bands: int,
    models: int,
    most_excess: float = MOST_EXCESS,
) -> str:
    """Name the method that both witnesses speak for, in a strip of so many models with so many bands of control.

    by_both: the method that standard deviations and results speak for.
    """
    if left_out is not None and bands >= TELLING and left_out.ratio > 1 / BETTER:
        apart = models / (bands - 1)
        if excess > most_excess * np.sqrt(max(apart / NEAR_BANDS, 1.0)):
            return POLYNOMIAL
    return by_both


def _compared(oriented: Oriented) -> Numbers:
    """Take the new points at which the methods are compared; control where there are no others."""
    every = np.arange(len(oriented.stage.formed.point))
    new = np.delete(every, oriented.control_rows[oriented.misclosures.point])
    return _spread(new if len(new) else every, MOST_POINTS)


def _predicted(
    oriented: Oriented, polynomial: Polynomial, covariance: CovarianceAdjustment, points: Numbers
) -> Witness:
    """Compare the standard deviations of points."""
    errors, found = oriented.errors, oriented.misclosures
    fit = oriented.fit([axis.terms for axis in polynomial.axes])
    fitted = FittedStrip(errors=errors, control=found, fit=fit, xyz=oriented.xyz, factor=covariance.figures.factor)
    after = fitted.covariances_of_points(points)
    both = [np.diagonal(each, axis1=1, axis2=2).mean(axis=0) for each in (after, covariance.of_points(points))]
    first, second = ((_root(v[:2].mean()), _root(v[2])) for v in both)
    return Witness(first, second, len(points))


def _difference(
    oriented: Oriented, polynomial: Polynomial, covariance: CovarianceAdjustment, points: Numbers
) -> tuple[float, float]:
    """By how much both results differ at points: rms in plan (of one coordinate) and in height, metres."""
    squares = (polynomial(oriented.xyz[points]) - covariance.xyz[points]) ** 2
    return _root(squares[:, :2].mean()), _root(squares[:, 2].mean())


def _root(variance: float) -> float:
    """Give the standard deviation; NaN of a variance below 0, as a strip leaves it that hangs together by rounding."""
    return float(np.sqrt(variance)) if variance >= 0 else float("nan")


def _spread(rows: Numbers, most: int) -> Numbers:
    """Take at most so many of the rows, evenly spread."""
    some: Numbers = rows[np.linspace(0, len(rows) - 1, min(len(rows), most)).round().astype(int)]
    return some


def _groups(oriented: Oriented, polynomial: Polynomial) -> tuple[list[Numbers], str]:
    """Group control points to be left out in turn: inner bands that the polynomial can do without, or points."""
    if all(each.left_out_by == "band" for each in polynomial.evidence):
        number = _bands(oriented)
        inner = _spread(np.arange(1, int(number.max())), MOST_GROUPS)
        return [np.flatnonzero(number == band) for band in inner.tolist()], "band"
    along = np.argsort(oriented.at_control[:, 0], kind="stable")
    return [np.array([row]) for row in _spread(along, MOST_GROUPS).tolist()], "point"


def _bands(oriented: Oriented) -> Numbers:
    """Give the band of each control point, counted along the strip."""
    return bands(oriented.at_control[:, 0], oriented.extent[0])


def _left_out(
    oriented: Oriented, polynomial: Polynomial, covariance: CovarianceAdjustment, groups: Sequence[Numbers]
) -> tuple[Witness | None, float]:
    """Compare the errors at control that is left out in turn; the covariance needs no new elimination for it."""
    from photostrip.triangulation.covariance_adjustment.left_out import left_out_errors

    found = oriented.misclosures
    coordinates = [np.flatnonzero(np.isin(found.point, group)) for group in groups]
    coordinates = [rows for rows in coordinates if len(rows)]
    if not coordinates:
        return None, float("nan")
    by_covariance = left_out_errors(covariance.system, coordinates)
    pairs = [
        np.stack([_by_polynomial(oriented, polynomial, rows), each.errors])
        for rows, each in zip(coordinates, by_covariance, strict=True)
    ]
    known = [number for number, pair in enumerate(pairs) if np.isfinite(pair).all()]
    if not known:
        return None, float("nan")
    height = found.axis[np.concatenate([coordinates[number] for number in known])] == 2
    squares = np.concatenate([pairs[number] for number in known], axis=1) ** 2
    mean = np.array([[_mean(row[~height]), _mean(row[height])] for row in squares])
    first, second = ((float(plan), float(up)) for plan, up in np.sqrt(mean))
    expected = sum(len(by_covariance[number].errors) for number in known) * covariance.figures.factor
    excess = np.sqrt(sum(by_covariance[number].squares for number in known) / expected)
    return Witness(first, second, len(known)), float(excess)


def _mean(values: Floats) -> float:
    return float(values.mean()) if len(values) else float("nan")


def _by_polynomial(oriented: Oriented, polynomial: Polynomial, rows: Numbers) -> Floats:
    """Predict control coordinates by similarity and polynomial of all others: strip minus given, metres."""
    found = oriented.misclosures
    others = np.delete(np.arange(len(found.point)), rows)
    misclosures = oriented.absolute.misclosures[found.point, found.axis]
    try:
        fit = _fit(oriented, polynomial, others)
    except np.linalg.LinAlgError:
        return np.full(len(rows), np.inf)
    influence = fit.influence(oriented.at_control[found.point[rows]])
    by_parameters = np.einsum("wi,wit->wt", found.direction[rows], influence)
    return np.asarray(misclosures[rows] - by_parameters @ (fit.operator @ misclosures[others]), float)


def _fit(oriented: Oriented, polynomial: Polynomial, coordinates: Numbers) -> control_errors.FitOperator:
    """Operator of similarity and polynomial on some of the control coordinates."""
    terms = [axis.terms for axis in polynomial.axes]
    return control_errors.fit_operator(
        oriented.misclosures.take(coordinates), oriented.weights, oriented.at_control, terms, oriented.errors.origin
    )
