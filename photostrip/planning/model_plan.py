"""Expected errors all over one model: what is asked for, and the answer with the share of each error source."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.planning import deformation
from photostrip.planning.element_errors import FREE, element_covariance, free_covariance, measured_covariance
from photostrip.planning.model_adjustment import adjust_model
from photostrip.planning.single_model import ExpectedErrors, ModelControl, expected_errors

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from photostrip.arrays import Floats

Place = tuple[float, float]
LAYOUTS = ("corners", "corners+centre", "six")
METRE = 1e3  # mm


@dataclass(frozen=True)
class ControlPoint:
    """A control point of a model."""

    at: Place  # x and y from the left nadir at photo scale, mm
    use: str = "xyz"  # ``xyz``, ``xy`` or ``z``


@dataclass(frozen=True)
class ModelSpec:
    """One model."""

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

    @property
    def parallax_sigma(self) -> float:
        """Standard deviation of a y parallax, mm."""
        return float(np.sqrt(2.0)) * self.image_sigma

    @property
    def ground_unit(self) -> float:
        """Metres on the ground of a millimetre at photo scale."""
        return self.scale / METRE


def standard_zones(base: float, width: float) -> tuple[Place, ...]:
    """Return the six standard points in their usual order: middle, upper and lower ones, each left and right."""
    return tuple((x, y) for y in (0.0, width, -width) for x in (0.0, base))


def control_layout(name: str, base: float, width: float) -> tuple[ControlPoint, ...]:
    """Return a named layout of control."""
    six = standard_zones(base, width)
    places = {"corners": six[2:], "corners+centre": (*six[2:], (base / 2, 0.0)), "six": six}[name]
    return tuple(ControlPoint(place) for place in places)


@dataclass(frozen=True, eq=False)
class Forecast:
    """Expected errors of one model."""

    spec: ModelSpec
    places: Floats  # (q, 2): points of the grid, mm at photo scale, rows across the flight after each other
    expected: ExpectedErrors  # their errors after the plain absolute orientation, mm at photo scale
    adjusted: Floats  # (q, 3, 3): their covariance when the elements are unknowns of the orientation
    at_control: Floats  # (n, 3): standard deviations of the adjusted control points, metres
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
    along = np.linspace(0.0, spec.base, spec.grid[0])
    across = np.linspace(spec.width, -spec.width, spec.grid[1])
    places = np.array([(x, y) for y in across for x in along])
    control = _control(spec)
    elements = _elements(spec)
    points = _level(places, spec.focal)
    measured = measured_covariance(points, spec.base, spec.focal, spec.image_sigma)
    expected = expected_errors(points, measured, control, spec.base, elements)
    adjusted = adjust_model(control, np.zeros((len(spec.control), 3)), spec.base, elements)
    number = np.arange(len(spec.control))
    at_control = expected_errors(control.points, control.measured, control, spec.base, elements, number)
    return Forecast(
        spec,
        places=places,
        expected=expected,
        adjusted=adjusted.covariance(points, measured),
        at_control=at_control.sigmas * spec.ground_unit,
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
    rigorous = deformation.rigorous_constants(list(places.values()), f, a, b)
    unit = spec.ground_unit * spec.parallax_sigma
    found = []
    for (name, at), exact in zip(places.items(), rigorous, strict=True):
        printed = deformation.PRINTED[deformation.SIDE if name.startswith("side") else deformation.CENTRAL]
        both = [deformation.Constants(c.plan * unit, c.height * f / b * unit) for c in (printed, exact)]
        found.append(SimpleAccuracy(place=name, at=at, source=both[0], rigorous=both[1]))
    return found


def _sigmas(covariance: Floats) -> Floats:
    return np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))


def _level(places: ArrayLike, focal: float) -> Floats:
    """Give places of level ground their depth."""
    flat = np.asarray(places, float)
    return np.column_stack([flat, np.full(len(flat), focal)])


def _control(spec: ModelSpec) -> ModelControl:
    points = _level([point.at for point in spec.control] or np.zeros((0, 2)), spec.focal)
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
    covariance = element_covariance(_level(places, spec.focal), spec.base, spec.parallax_sigma)
    return free_covariance(covariance / density, spec.base)
