"""Documents of single steps: values with their units, and a table of points."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Floats
from photostrip.geometry.rotation import angles
from photostrip.library.step_arguments import sigma0_of
from photostrip.library.steps import Absolute, Bundle, Interior, Relative, Strip
from photostrip.notes import Document
from photostrip.strip.relative_orientation.solution import ELEMENTS
from photostrip.strip.resection import OrientedPhoto
from photostrip.strip.strip_formation.intersection import Intersection
from photostrip.units import MICROMETRES

Column = tuple[str, str, int, ArrayLike]  # name, unit, decimals; negative: digits of numbers of any size

MILLION = 1e6
DIGITS = 10  # of values: more than any measurement has
SYSTEM = "omega-phi-kappa"
XYZ = "xyz"
OF = {"interior": "mark", "chain": "photo"}  # what a row stands for; else a point


def interior(ids: Sequence[str], found: Interior) -> Document:
    """Return an interior orientation: the coefficients of both axes, and the residuals of the marks."""
    names = ("x", "y", "x y", "1")
    rows = zip(("x", "y", "denominator"), found.transform.coefficients, strict=True)
    values = [_coefficient(f"{axis}: {term}", c) for axis, row in rows for term, c in zip(names, row, strict=True) if c]
    values += _fit(found.sigma0 * MICROMETRES, "um", found.redundancy)
    return _document("interior", values, ids, _image_residuals(found.residuals))


def refine(ids: Sequence[str], measured: Floats, refined: Floats) -> Document:
    """Return ideal image coordinates, and what was corrected; the principal point is part of it."""
    shift = (refined - measured) * MICROMETRES
    return _document("refine", [], ids, [*columns("x y", "mm", 4, refined), *columns("dx dy", "um", 1, shift)])


def relative(ids: Sequence[str], found: Relative, base: float, unit: str) -> Document:
    """Return a relative orientation: relative to the base; base and right photo in the left one; the model."""
    degrees = zip(ELEMENTS, np.degrees(found.elements), np.degrees(found.sigmas), strict=True)
    values = [_value(name, value, "deg", sigma) for name, value, sigma in degrees]
    values += [_value(name, base * each, unit) for name, each in zip(("bx", "by", "bz"), found.base, strict=True)]
    values += _angles(found.rotation)
    values += _fit(found.sigma0 * MICROMETRES, "um", len(ids) - len(ELEMENTS))
    listed = [("q", "um", 2, found.parallax * MICROMETRES), *columns("x y z", unit, 4, found.model)]
    return _document("relative", [*values, _value("iterations", found.iterations)], ids, listed)


def intersection(ids: Sequence[str], found: Intersection, unit: str) -> Document:
    """Return intersected points, and the gap between the rays."""
    return _document("intersection", [], ids, [*columns("x y z", unit, 4, found.xyz), ("gap", unit, 4, found.gap)])


def strip(photos: Sequence[str], points: Sequence[str], found: Strip, unit: str) -> Document:
    """Return the photos of a strip, the scale factors of its models, and the points that have a place."""
    values = [
        _value(f"k {left}-{right}", factor)
        for (left, right), factor in zip(pairwise(photos), found.factors, strict=True)
    ]
    placed = np.flatnonzero(found.models)
    listed = [*columns("x y z", unit, 4, found.points[placed]), ("models", "", 0, found.models[placed])]
    document = _document("strip", values, [points[number] for number in placed.tolist()], listed)
    return {**document, "photos": _photos(photos, found, unit)}


def bundle(photos: Sequence[str], points: Sequence[str], found: Bundle, ground: Floats | None, unit: str) -> Document:
    """Return adjusted photos, and points with their precision and what they differ from given coordinates."""
    values = [*_fit(found.sigma0, "", found.redundancy), _value("iterations", found.iterations)]
    placed = np.flatnonzero(np.isfinite(found.points[:, 0]))
    listed = columns("x y z", unit, 4, found.points[placed])
    listed += columns("sigma_x sigma_y sigma_z", unit, 4, found.sigmas[placed])
    if ground is not None:
        listed += columns("dx dy dz", unit, 4, (found.points - ground)[placed])
    document = _document("bundle", values, [points[number] for number in placed.tolist()], listed)
    return {**document, "photos": _photos(photos, found, unit)}


def absolute(ids: Sequence[str], found: Absolute, unit: str) -> Document:
    """Return an absolute orientation: seven parameters, and the residuals of the points."""
    similarity = found.similarity
    values = [_value("scale", similarity.scale)]
    values += [_value(f"shift {axis}", each, unit) for axis, each in zip(XYZ, similarity.shift, strict=True)]
    values += _angles(similarity.rotation)
    values += _fit(found.sigma0, unit, found.redundancy)
    return _document("absolute", values, ids, columns("vx vy vz", unit, 4, found.residuals))


def chain(ids: Sequence[str], rotations: Floats) -> Document:
    """Return the angles of the photos in the strip."""
    return _document("chain", [], ids, _turns(rotations))


def scale(ids: Sequence[str], factor: float, departures: Floats) -> Document:
    """Return the factor of the second model, and what each point departs from it, in parts of a million."""
    rms = float(np.sqrt((departures**2).mean()))
    values = [_value("k", factor), _value("rms departure", rms * MILLION, "ppm")]
    return _document("scale", values, ids, [("departure", "ppm", 1, departures * MILLION)])


def polynomial(
    ids: Sequence[str], terms: Sequence[str], coefficients: Floats, residuals: Floats, unit: str
) -> Document:
    """Return the coefficients of a polynomial, and what it leaves."""
    values = [_coefficient(term, coefficient) for term, coefficient in zip(terms, coefficients, strict=True)]
    redundancy = len(ids) - len(values)
    values += _fit(sigma0_of(residuals, redundancy), unit, redundancy)
    return _document("polynomial", values, ids, [("v", unit, 4, residuals)])


def resection(ids: Sequence[str], found: OrientedPhoto, unit: str) -> Document:
    """Return the orientation of a photo with its precision, and the image residuals."""
    sigma = np.sqrt(np.diag(found.covariance))
    values = [_value(axis, found.center[k], unit, sigma[k]) for k, axis in enumerate(XYZ)]
    values += _angles(found.rotation)
    values += _fit(found.sigma0, "", found.redundancy)
    return _document("resection", values, ids, _image_residuals(found.residuals))


def _value(name: str, value: float, unit: str = "", sigma: float | None = None) -> Document:
    return {"name": name, "value": _number(value), "unit": unit, "sigma": None if sigma is None else _number(sigma)}


def _coefficient(name: str, value: float) -> Document:
    """Return a value that is shown as it stands: what it multiplies is larger than what the result is good for."""
    return _value(name, value) | {"digits": DIGITS}


def _fit(sigma0: float, unit: str, redundancy: int) -> list[Document]:
    return [_value("sigma0", sigma0, unit), _value("redundancy", redundancy)]


def _angles(rotation: Floats) -> list[Document]:
    turned = np.degrees(angles(rotation, SYSTEM))
    return [_value(name, value, "deg") for name, value in zip(SYSTEM.split("-"), turned, strict=True)]


def _image_residuals(residuals: Floats) -> list[Column]:
    return columns("vx vy", "um", 2, residuals * MICROMETRES)


def _turns(rotations: Floats) -> list[Column]:
    turned = np.degrees(np.array([angles(each, SYSTEM) for each in rotations]))
    return columns(SYSTEM.replace("-", " "), "deg", 6, turned)


def _photos(photos: Sequence[str], found: Strip | Bundle, unit: str) -> list[list[Any]]:
    placed = [*columns("x y z", unit, 4, found.centers), *_turns(found.rotations)]
    rows: list[list[Any]] = _document("", [], photos, placed)["points"]
    return rows


def _number(value: float) -> float | None:
    if isinstance(value, int):
        return value
    return float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None


def columns(names: str, unit: str, decimals: int, values: Floats) -> list[Column]:
    """Return the columns of an array, named one after the other."""
    return [(name, unit, decimals, values[:, k]) for k, name in enumerate(names.split())]


def table(ids: Sequence[str], listed: Sequence[Column]) -> Document:
    """Put columns together; the rows are lists in the order of the columns, the id first."""
    numbers = [[each if np.isfinite(each) else None for each in np.asarray(one, float).tolist()] for *_, one in listed]
    return {
        "columns": [{"name": name, "unit": unit, "decimals": decimals} for name, unit, decimals, _ in listed],
        "rows": [list(row) for row in zip(ids, *numbers, strict=True)],
    }


def _document(step: str, values: list[Document], ids: Sequence[str], listed: Sequence[Column]) -> Document:
    """Put values and columns, rounded, together."""
    points = table(
        ids, [(name, unit, digits, np.round(np.asarray(each), digits)) for name, unit, digits, each in listed]
    )
    return {
        "photostrip_step": 1,
        "step": step,
        "values": values,
        "of": OF.get(step, "point"),
        "columns": points["columns"],
        "points": points["rows"],
    }
