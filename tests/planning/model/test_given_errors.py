"""Given errors carried to the points of a model, beside the exact intersection and a fit of its own."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.geometry.rotation import from_alpha_omega_kappa
from photostrip.planning.model_plan import ControlPoint, ModelSpec, NamedPoint, given_errors
from tests.planning.formulas import intersected

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

F, B, A, SCALE = 150.0, 90.0, 85.0, 10_000.0
UNIT = SCALE / 1e3  # metres of a millimetre at photo scale
ELEMENTS = (4e-3, -3e-3, 3e-5, -2e-5, 4e-5)
CONTROL = (
    ControlPoint((2.0, 80.0), "1", height=60.0, measured_error=(0.02, -0.03, 0.05), given_error=(0.01, 0.04, -0.03)),
    ControlPoint((88.0, 78.0), "2", height=-40.0, measured_error=(-0.04, 0.01, 0.02)),
    ControlPoint((-3.0, -82.0), "3", height=20.0, given_error=(0.02, 0.0, 0.05)),
    ControlPoint((91.0, -75.0), "4", height=90.0),
    ControlPoint((40.0, 5.0), "5", use="z", measured_error=(0.0, 0.0, -0.06)),
)
POINTS = (
    NamedPoint((20.0, 30.0), "A", height=120.0, measured_error=(0.01, 0.02, -0.04)),
    NamedPoint((70.0, -60.0), "B"),
)
SPEC = ModelSpec(F, base=B, width=A, scale=SCALE, control=CONTROL, points=POINTS, element_errors=ELEMENTS)


def xyz(points: tuple[NamedPoint, ...]) -> Floats:
    """Give x, y and depth, mm at photo scale."""
    found: Floats = np.array([[*point.at, F - point.height / UNIT] for point in points])
    return found


def errors_of_the_exact_model(points: tuple[NamedPoint, ...], elements: tuple[float, ...] = ELEMENTS) -> Floats:
    """Errors of measured points of the exact pair, metres."""
    where = xyz(points)
    truth = where * (1.0, 1.0, -1.0)
    moved = (intersected(where, B, np.array(elements), F) - truth) * UNIT
    found: Floats = moved + np.array([point.measured_error for point in points])
    return found


def fitted(errors: Floats, points: tuple[NamedPoint, ...]) -> Floats:
    """Errors that a similarity in space leaves, found from its exact form by differences and iteration."""
    truth = xyz(points) * (1, 1, -1)
    counts = np.array([["xy" in point.use, "xy" in point.use, "z" in point.use] for point in CONTROL])
    model = truth + errors / UNIT
    given = truth[: len(CONTROL)] + np.array([point.given_error for point in CONTROL]) / UNIT
    unknowns = np.zeros(7)

    def moved(unknowns: Floats, model: Floats) -> Floats:
        shift, scale, turn = unknowns[:3], 1 + unknowns[3], from_alpha_omega_kappa(*unknowns[4:])
        found: Floats = scale * model @ turn.T + shift
        return found

    for _ in range(3):
        value = (moved(unknowns, model[: len(CONTROL)]) - given)[counts]
        step = 1e-6 * np.eye(7)
        slope = [(moved(unknowns + u, model[: len(CONTROL)]) - given)[counts] - value for u in step]
        unknowns -= 1e-6 * np.linalg.lstsq(np.array(slope).T, value, rcond=None)[0]
    left: Floats = (moved(unknowns, model) - truth) * UNIT
    return left


def test_given_errors_are_those_of_the_exact_model_and_its_fit() -> None:
    found = given_errors(SPEC)
    assert found is not None
    assert found.parts is not None
    assert found.names == ("A", "B", "1", "2", "3", "4", "5")
    every = (*CONTROL, *POINTS)
    expected = np.roll(fitted(errors_of_the_exact_model(every), every), len(POINTS), axis=0)
    # of the first order: elements of 3e-5 leave 1e-4 of themselves
    assert found.parts.total * UNIT == pytest.approx(expected, abs=2e-4)
    assert np.abs(expected).max() > 0.05
    causes = found.parts.from_measuring + found.parts.from_elements + found.parts.from_control
    assert causes == pytest.approx(found.parts.total, abs=1e-12)
