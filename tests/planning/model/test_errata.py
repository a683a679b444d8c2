"""Eq. 9-11 of the source as they are printed: each misprint alone makes them disagree with the direct adjustment."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.planning.closed_form import ORDER, coefficients, control_sums, kernels
from photostrip.planning.single_model import ELEMENTS, ModelControl, influence, orientation_operator

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

BASE, DEPTH = 70.0, 100.0
XY = np.array([[2.0, 58.0], [68.0, 61.0], [-3.0, -63.0], [72.0, -55.0], [33.0, 6.0]])
POINT = np.array([20.0, 30.0])
ROUNDING = 1e-9
VISIBLE = 1e-4  # relative to the largest coefficient of its kind

X_PRINTED = ("b2 in x alpha", "sign in x omega", "symbols")
Y_PRINTED = ("c8 in y kappa", "b2 in y alpha", "squares in y omega", "symbols")


def control() -> ModelControl:
    every, none = np.ones(len(XY), bool), np.zeros((len(XY), 3, 3))
    return ModelControl(np.column_stack([XY, np.full(len(XY), DEPTH)]), every, every, none, none)


def direct() -> Floats:
    """Coefficients of x, y and height from the direct adjustment, in the order of `ORDER`."""
    point = np.array([[*POINT, DEPTH]])
    operator, given = orientation_operator(point, control()), control().points
    rows = influence(point, BASE) - np.einsum("qanb,nbk->qak", operator, influence(given, BASE))
    found: Floats = rows[0][:, [ELEMENTS.index(name) for name in ORDER]]
    return found


def as_printed(misprints: tuple[str, ...] = ()) -> Floats:
    """Eq. 9-10 term by term, after the source, with the misprints that are named; rows x, y in the order of `ORDER`."""
    b, z, n = BASE, DEPTH, len(XY)
    x, y = POINT
    u, v = XY.T
    X, Y = x - u.mean(), y - v.mean()
    c = dict(enumerate(control_sums(XY), 1))
    B = c[1] + c[2]

    def less_mean(at_point: float, at_control: Floats) -> float:
        return float(at_point - at_control.sum() / n)

    c8 = -c[8] if "c8 in y kappa" in misprints else c[8]
    b_squared = b if "b2 in x alpha" in misprints else b**2
    sign = 1 if "sign in x omega" in misprints else -1
    square = v if "squares in y omega" in misprints else v**2
    half = (b**2 + z**2) / 2 if "b2 in y alpha" in misprints else b**2 / 2 + z**2
    p2, q2 = b * c[1] + b / 2 * c[2] - c[4] - c[8], b / 2 * c[3] - c[6] + c[9]
    p3 = (b**2 + z**2) * c[1] + (b**2 / 2 + z**2) * c[2] - 2 * b * c[4] - 1.5 * b * c[8] + c[10] + c[14]
    q3 = b**2 / 2 * c[3] - 2 * b * c[6] + 1.5 * b * c[9] + c[11] - c[12]
    p4, q4 = b / 2 * c[5] + b * c[9] - c[12] - c[13], b / 2 * c[7] - b * c[8] + c[14] - c[15]
    p1, q1 = b / 2 * c[3] - c[5] - c[9], b / 2 * c[1] - c[7] + c[8]

    along = [
        less_mean(x**2, u**2) - b * X + X / B * p2 + Y / B * q2,
        -less_mean(x * y, u * v) - X / B * p1 + Y / B * q1,
        less_mean(x**3, u**3) - 2 * b * less_mean(x**2, u**2) + (b_squared + z**2) * X - X / B * p3 - Y / B * q3,
        less_mean(x**2 * y, u**2 * v) - b * less_mean(x * y, u * v) + X / B * p4 + sign * Y / B * q4,
    ]
    across = [
        less_mean(x * y, u * v) - b / 2 * Y + Y / B * p2 - X / B * q2,
        b / 2 * X - less_mean(y**2, v**2) - Y / B * p1 - X / B * (b / 2 * c[1] - c[7] + c8),
        less_mean(x**2 * y, u**2 * v) - 1.5 * b * less_mean(x * y, u * v) + half * Y - Y / B * p3 + X / B * q3,
        -b / 2 * less_mean(y**2, square) + less_mean(x * y**2, u * v**2) + Y / B * p4 + X / B * q4,
    ]
    over = np.array([b * z, b, b * z, b * z])
    found: Floats = np.array([along, across]) / over
    return found


def test_eq_9_and_10_with_all_corrections_are_the_direct_adjustment() -> None:
    assert as_printed() == pytest.approx(direct()[:2], rel=ROUNDING)


@pytest.mark.parametrize(
    ("misprint", "row", "column"),
    [
        ("b2 in x alpha", 0, "dalpha"),
        ("sign in x omega", 0, "domega"),
        ("c8 in y kappa", 1, "dkappa"),
        ("b2 in y alpha", 1, "dalpha"),
        ("squares in y omega", 1, "domega"),
    ],
)
def test_a_misprint_of_eq_9_or_10_shows(misprint: str, row: int, column: str) -> None:
    wrong, right = as_printed((misprint,)), direct()[:2]
    bad = np.abs(wrong - right) > VISIBLE * np.abs(right).max(axis=0)
    assert [(r, ORDER[k]) for r, k in np.argwhere(bad)] == [(row, column)]


def test_what_the_command_calls_printed_has_every_misprint_and_no_other() -> None:
    found = coefficients([POINT], XY, BASE, DEPTH, printed=True)[0]
    assert found[:2] == pytest.approx(as_printed((*X_PRINTED[:2], *Y_PRINTED[:3])), rel=ROUNDING)
    assert found[2] == pytest.approx(coefficients([POINT], XY, BASE, DEPTH)[0, 2])
    right, printed = kernels([POINT], XY), kernels([POINT], XY, printed=True)
    operator = orientation_operator([[*POINT, DEPTH]], control())[0]
    for values, row, column in (
        (right[0], 0, 0),
        (right[1], 0, 1),
        (right[2], 1, 0),
        (right[3], 1, 1),
        (right[4], 2, 2),
    ):
        assert values[0] == pytest.approx(operator[row, :, column])
    X, Y = (XY - XY.mean(axis=0)).T
    x, y = POINT - XY.mean(axis=0)
    c1, c2, c3 = control_sums(XY)[:3]
    B, A, n = c1 + c2, c1 * c2 - c3**2, len(XY)
    assert printed.across_across[0] == pytest.approx(1 / n + (y * X + x * Y) / B)
    assert printed.across_along[0] == pytest.approx((y * Y - x * X) / B)
    assert printed.up[0] == pytest.approx(1 / n + (-x * (c2 * X + c3 * Y) - y * (c3 * X - c1 * Y)) / A)
    assert printed.along_along[0] == pytest.approx(right.along_along[0])
