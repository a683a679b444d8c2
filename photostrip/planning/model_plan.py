"""Expected errors all over one model: what is asked for, and the answer with the share of each error source.

Errors that are given, or misclosures that were found, go to the points of the model the same way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Floats
from photostrip.errors import Fault, InputError
from photostrip.planning import closed_form, deformation
from photostrip.planning.deformation import (
    BentModel,
    ControlErrors,
    Correction,
    ErrorParts,
    bend_model,
    correct_model,
    error_parts,
)
from photostrip.planning.single_model import (
    ELEMENTS,
    FREE,
    ExpectedErrors,
    ModelControl,
    adjust_model,
    element_covariance,
    expected_errors,
    free_covariance,
    influence,
    influence_after_orientation,
    measured_covariance,
)
from photostrip.units import MILLIMETRES

Place = tuple[float, float]
Three = tuple[float, float, float]
NO_ERROR = (0.0, 0.0, 0.0)
LAYOUTS = ("corners", "corners+centre", "six")


@dataclass(frozen=True)
class NamedPoint:
    """A point of the model whose errors are wanted."""

    at: Place  # x and y on the ground from the left nadir at photo scale, mm
    name: str = ""
    height: float = 0.0  # above the level to which the photo scale belongs, metres
    measured_error: Three = NO_ERROR  # of its model coordinates, metres


@dataclass(frozen=True)
class ControlPoint(NamedPoint):
    use: str = "xyz"  # ``xyz``, ``xy`` or ``z``
    misclosure: Three | None = None  # model minus given, metres, where the model has been measured
    given_error: Three = NO_ERROR


@dataclass(frozen=True)
class ModelSpec:
    focal: float  # principal distance, mm
    base: float  # photo base b, mm
    width: float  # distance a of the side points from the flight line, mm
    scale: float = 10_000.0
    image_sigma: float = 0.005  # standard deviation of an image coordinate, mm
    zone_points: int = 1  # points in each of the six standard zones that orient the pair; 1: the six standard points
    # points that orient the pair, x and y in mm, instead of the standard zones
    orientation_points: tuple[Place, ...] = ()
    control: tuple[ControlPoint, ...] = ()
    # standard deviations of given coordinates along, across and in height, metres
    control_sigma: tuple[float, float, float] = (0.05, 0.05, 0.08)
    grid: tuple[int, int] = (5, 7)  # points along and across at which errors are computed
    points: tuple[NamedPoint, ...] = ()  # further points, with names and heights
    # given errors of dby, dbz in mm at photo scale, of dkappa, dalpha, domega in radians
    element_errors: tuple[float, ...] = (0.0,) * len(ELEMENTS)

    @property
    def parallax_sigma(self) -> float:
        """Standard deviation of a y parallax, mm."""
        return float(np.sqrt(2.0)) * self.image_sigma

    @property
    def ground_unit(self) -> float:
        """Metres on the ground of a millimetre at photo scale."""
        return self.scale / MILLIMETRES


def standard_zones(base: float, width: float) -> tuple[Place, ...]:
    """Return the six standard points in their usual order: middle, upper and lower ones, each left and right."""
    return tuple((x, y) for y in (0.0, width, -width) for x in (0.0, base))


def control_layout(name: str, base: float, width: float) -> tuple[ControlPoint, ...]:
    six = standard_zones(base, width)
    places = {"corners": six[2:], "corners+centre": (*six[2:], (base / 2, 0.0)), "six": six}[name]
    return tuple(ControlPoint(place, name=f"C{number}") for number, place in enumerate(places, 1))


@dataclass(frozen=True, eq=False)
class Forecast:
    """Expected errors of one model."""

    spec: ModelSpec
    places: Floats  # (q, 2): points of the grid, mm at photo scale, rows across the flight after each other
    expected: ExpectedErrors  # their errors after the plain absolute orientation, mm at photo scale
    adjusted: Floats  # (q, 3, 3): their covariance when the elements are unknowns of the orientation
    at_control: Floats  # (n, 3): standard deviations of the adjusted control points, metres
    # standard deviations at the named points, metres, (p, 3): after the plain absolute orientation, and with the
    # elements as unknowns
    at_points: Floats
    at_points_adjusted: Floats
    elements: Floats  # (4,): standard deviations of `FREE`: radians, dbz in mm at photo scale

    @property
    def sigmas(self) -> Floats:
        """Standard deviations along, across and in height, metres, shape (q, 3)."""
        return self.expected.sigmas * self.spec.ground_unit

    @property
    def adjusted_sigmas(self) -> Floats:
        """The same with the elements as unknowns of the orientation."""
        return _sigmas(self.adjusted) * self.spec.ground_unit

    def shares(self) -> dict[str, Floats]:
        """Return the standard deviations (q, 3), metres, that each source alone would cause.

        The measurement of the point, each element, the relative orientation as a whole, control as measured and as
        given, all together, and all together with the elements as unknowns.
        """
        unit, sources = self.spec.ground_unit, self.expected.sources
        found = {"measuring of the point": _sigmas(sources["measuring"]) * unit}
        for number, name in enumerate(FREE):
            found[f"orientation: {name}"] = self.expected.elements[:, :, number] * unit
        found["orientation, together"] = _sigmas(sources["orientation"]) * unit
        found["control, measured"] = _sigmas(sources["control measured"]) * unit
        found["control, given"] = _sigmas(sources["control given"]) * unit
        return found | {"all": self.sigmas, "all, elements adjusted": self.adjusted_sigmas}


@dataclass(frozen=True)
class SimpleAccuracy:
    """What the simple formulas say of a place of the model, metres."""

    place: str  # which place
    at: Place  # x and y, mm
    # source, rigorous: plan (both coordinates together) and height: with the constants as printed, and with the
    # cofactors of six standard points
    source: deformation.Constants
    rigorous: deformation.Constants


def plan_model(spec: ModelSpec) -> Forecast:
    """Compute the expected errors of a model over its area and at its control.

    Raises GeometryError when the points of orientation or the control determine too little.
    """
    places = _grid(spec)
    control = _control(spec)
    elements = _elements(spec)
    points = _level(places, spec)
    measured = measured_covariance(points, spec.base, spec.focal, spec.image_sigma)
    expected = expected_errors(points, measured, control, spec.base, elements)
    adjusted = adjust_model(control, np.zeros((len(spec.control), 3)), spec.base, elements)
    named = _named(spec)
    own = measured_covariance(named, spec.base, spec.focal, spec.image_sigma)
    at_points = expected_errors(named, own, control, spec.base, elements)
    number = np.arange(len(spec.control))
    at_control = expected_errors(control.points, control.measured, control, spec.base, elements, number)
    return Forecast(
        spec,
        places=places,
        expected=expected,
        adjusted=adjusted.covariance(points, measured),
        at_control=at_control.sigmas * spec.ground_unit,
        at_points=at_points.sigmas * spec.ground_unit,
        at_points_adjusted=_sigmas(adjusted.covariance(named, own)) * spec.ground_unit,
        elements=np.sqrt(np.diag(elements)),
    )


def simple_accuracy(spec: ModelSpec) -> list[SimpleAccuracy]:
    """Apply the simple formulas to side and middle points of a model, left and right; control does not matter there."""
    b, a, f = spec.base, spec.width, spec.focal
    places = {
        "side, left": (0.0, a),
        "side, right": (b, a),
        "middle, left": (0.0, 0.0),
        "middle, right": (b, 0.0),
    }
    unit = spec.ground_unit * spec.parallax_sigma
    exact = deformation.rigorous_covariance(list(places.values()), f, a, b, spec.image_sigma)
    found = []
    for (name, at), (x, y, z) in zip(places.items(), _sigmas(exact) * spec.ground_unit, strict=True):
        printed = deformation.PRINTED[deformation.SIDE if name.startswith("side") else deformation.CENTRAL]
        source = deformation.Constants(printed.plan * unit, printed.height * f / b * unit)
        rigorous = deformation.Constants(float(np.hypot(x, y)), float(z))
        found.append(SimpleAccuracy(place=name, at=at, source=source, rigorous=rigorous))
    return found


@dataclass(frozen=True)
class ExampleRow:
    """A number of the worked example of the source, micrometres at photo scale, beside what it should be."""

    place: str  # ``side`` or ``central``
    quantity: str  # ``plan`` or ``height``
    printed: float  # in the text
    formula: float  # by the printed constants
    assumed: float  # before rounding, under the assumptions of the source
    # left, right: rigorous, at x = 0 and at x = b
    left: float
    right: float


def source_example() -> list[ExampleRow]:
    """Compute the example of the source again: m_q = 10 µm, f = b = a.

    Source: [003], text after eq. 10.11.
    """
    size, m_q = 100.0, deformation.EXAMPLE_SIGMA_UM  # with f = b = a nothing depends on the size
    assumed = deformation.assumed_constants()
    found = []
    for place, across in ((deformation.SIDE, size), (deformation.CENTRAL, 0.0)):
        both = deformation.rigorous_covariance([(0.0, across), (size, across)], size, size, size, m_q / np.sqrt(2.0))
        x, y, z = _sigmas(both).T
        exact = {"plan": np.hypot(x, y).tolist(), "height": z.tolist()}
        for quantity in deformation.Constants._fields:
            left, right = exact[quantity]
            found.append(
                ExampleRow(
                    place=place,
                    quantity=quantity,
                    printed=getattr(deformation.PRINTED_EXAMPLE[place], quantity),
                    formula=getattr(deformation.PRINTED[place], quantity) * m_q,
                    assumed=getattr(assumed[place], quantity) * m_q,
                    left=left,
                    right=right,
                )
            )
    return found


@dataclass(frozen=True, eq=False)
class GivenErrors:
    """What given errors, or misclosures, do to the named points and to the control; mm at photo scale."""

    names: tuple[str, ...]  # of the points, named ones first
    parts: ErrorParts | None  # where errors are given
    correction: Correction  # from the misclosures, given or following from given errors
    misclosures: Floats  # (n, 3)
    bent: BentModel | None  # the grid of the model bent by given errors of the elements


def given_errors(spec: ModelSpec) -> GivenErrors | None:
    """Carry given errors, or misclosures, to the points; None where a plan gives neither."""
    points = np.concatenate([_named(spec), _control(spec).points])
    every: tuple[NamedPoint, ...] = (*spec.points, *spec.control)
    names = tuple(point.name for point in every)
    control, unit = _control(spec), spec.ground_unit
    elements = np.array(spec.element_errors)
    parts = None
    if any(point.misclosure is not None for point in spec.control):
        misclosures = np.array([point.misclosure or NO_ERROR for point in spec.control]) / unit
    else:
        errors = ControlErrors(
            measured=np.array([point.measured_error for point in spec.control]) / unit,
            given=np.array([point.given_error for point in spec.control]) / unit,
        )
        own = np.array([point.measured_error for point in every]) / unit
        if not (elements.any() or own.any() or errors.given.any()):
            return None
        misclosures = errors.misclosures(control, spec.base, elements)
        parts = error_parts(points, own, control, errors, spec.base, elements)
    bent = None
    if elements.any():
        bent = bend_model(_level(_grid(spec), spec), control, spec.base, spec.focal, elements)
    return GivenErrors(
        names=names,
        parts=parts,
        correction=correct_model(points, control, misclosures, spec.base, _elements(spec)),
        misclosures=misclosures,
        bent=bent,
    )


@dataclass(frozen=True, eq=False)
class BothForms:
    """The errors of points per error of each element, and per misclosure, in both forms and as printed."""

    names: tuple[str, ...]
    sums: Floats  # (15,): c1 to c15 over the control, in powers of mm
    # (q, 3, 4): x, y, height per element in the order of ``closed_form.ORDER``, mm at photo scale
    operators: Floats
    closed: Floats
    printed: Floats
    # weights of the misclosures: by the operators (q, 3, n, 3), in closed form, as printed
    weights: Floats
    kernels: closed_form.Kernels
    printed_kernels: closed_form.Kernels


def both_forms(spec: ModelSpec) -> BothForms:
    """Compute the operators and the closed form side by side, at the named points or at a quarter of the model.

    Raises InputError where the closed form does not hold: with relief, or with control not given in full.
    """
    points = spec.points or (NamedPoint((spec.base / 4, spec.width / 2), "quarter"),)
    if any(point.use != "xyz" for point in spec.control):
        message = "the closed form is for control that is given in full, in plan and height"
        raise InputError(Fault(message, "plan-closed-form"))
    every: tuple[NamedPoint, ...] = (*points, *spec.control)
    raised = [point.name for point in every if point.height]
    if raised:
        message = f"the closed form is for level ground, and {', '.join(raised[:4])} lie above or below it"
        raise InputError(Fault(message, "plan-closed-form", points=tuple(raised)))
    control = _control(spec)
    where, given = np.array([point.at for point in points]), control.points[:, :2]
    columns = [ELEMENTS.index(name) for name in closed_form.ORDER]
    level = _level(where, spec)
    weights, through = influence_after_orientation(level, control, spec.base, influence)
    return BothForms(
        names=tuple(point.name for point in points),
        sums=closed_form.control_sums(given),
        operators=through[:, :, columns],
        closed=closed_form.coefficients(where, given, spec.base, spec.focal),
        printed=closed_form.coefficients(where, given, spec.base, spec.focal, printed=True),
        weights=weights,
        kernels=closed_form.kernels(where, given),
        printed_kernels=closed_form.kernels(where, given, printed=True),
    )


def _sigmas(covariance: Floats) -> Floats:
    return np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))


def _grid(spec: ModelSpec) -> Floats:
    along = np.linspace(0.0, spec.base, spec.grid[0])
    across = np.linspace(spec.width, -spec.width, spec.grid[1])
    return np.array([(x, y) for y in across for x in along])


def _level(places: ArrayLike, spec: ModelSpec, heights: ArrayLike = 0.0) -> Floats:
    """Give places their depth below the perspective centres, mm at photo scale."""
    flat = np.asarray(places, float).reshape(-1, 2)
    depth = spec.focal - np.broadcast_to(np.asarray(heights, float), len(flat)) / spec.ground_unit
    return np.column_stack([flat, depth])


def _named(spec: ModelSpec) -> Floats:
    return _level([point.at for point in spec.points], spec, [point.height for point in spec.points])


def _control(spec: ModelSpec) -> ModelControl:
    points = _level([point.at for point in spec.control], spec, [point.height for point in spec.control])
    given = np.diag(np.square(np.array(spec.control_sigma) / spec.ground_unit))
    return ModelControl(
        points,
        plan=np.array(["xy" in point.use for point in spec.control], bool),
        height=np.array(["z" in point.use for point in spec.control], bool),
        measured=measured_covariance(points, spec.base, spec.focal, spec.image_sigma),
        given=np.broadcast_to(given, (len(points), 3, 3)),
    )


def _elements(spec: ModelSpec) -> Floats:
    """Covariance of the elements from the standard zones, or from the points that are named."""
    places = spec.orientation_points or standard_zones(spec.base, spec.width)
    density = 1 if spec.orientation_points else spec.zone_points
    covariance = element_covariance(_level(places, spec), spec.base, spec.parallax_sigma)
    return free_covariance(covariance / density, spec.base)
