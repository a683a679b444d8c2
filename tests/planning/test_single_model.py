"""Error theory of a model: numbers computed apart, the exact intersection, a direct adjustment, eq. 9-11 as printed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from photostrip.arrays import Floats
from photostrip.errors import GeometryError
from photostrip.geometry.rotation import from_alpha_omega_kappa
from photostrip.planning.closed_form import ORDER, coefficients, control_sums, kernels
from photostrip.planning.model_plan import ControlPoint, ModelSpec, NamedPoint, given_errors
from photostrip.planning.single_model import (
    ELEMENTS,
    ModelControl,
    adjust_model,
    element_covariance,
    expected_errors,
    free_covariance,
    influence,
    orientation_operator,
    parameter_rows,
)
from photostrip.strip import relative_orientation
from tests.vectors import Vector, cases

TURN = 1e-5  # step of differences, rad or photo scale mm
PRINTED_ORDER = [ELEMENTS.index(name) for name in ORDER]


def six_point_variances(sigma: float, depth: float, width: float, base: float) -> Floats:
    """Variances of dkappa, dbz, dalpha2, domega, which are not correlated, from six standard points.

    sigma: of a y parallax; depth, width, base: Z, the distance a of the side points from the middle ones, and b.
    """
    z, a, b = depth, width, base
    shares = [2 / (3 * b**2), z**2 / (2 * a**2), z**2 / (2 * a**2 * b**2), 3 * z**2 / (4 * a**4)]
    return sigma**2 * np.array(shares)


def intersected(xyz: Floats, base: float, elements: Floats, focal: float = 120.0) -> Floats:
    """Model points from the images of an exact pair whose right photo has turned and moved; y from both rays."""
    dby, dbz, dkappa, dalpha, domega = elements
    left = np.column_stack([xyz[:, 0], xyz[:, 1], -xyz[:, 2]])
    right = left - (base, 0.0, 0.0)
    in_right = -focal * right / right[:, 2:]  # what is measured: the photo was level
    ray1 = -focal * left / left[:, 2:]
    ray2 = in_right @ from_alpha_omega_kappa(dalpha, domega, dkappa).T
    bx, by, bz = base, dby, dbz
    scale1 = (bz * ray2[:, 0] - bx * ray2[:, 2]) / (ray1[:, 2] * ray2[:, 0] - ray1[:, 0] * ray2[:, 2])
    scale2 = (scale1 * ray1[:, 2] - bz) / ray2[:, 2]
    y = (scale1 * ray1[:, 1] + by + scale2 * ray2[:, 1]) / 2
    return np.column_stack([scale1 * ray1[:, 0], y, scale1 * ray1[:, 2]])


def control_at(xy: ArrayLike, depth: float = 100.0, sd: tuple[float, float] = (0.0, 0.0)) -> ModelControl:
    """Full control points at one depth; standard deviations of all measured and of all given coordinates."""
    place = np.asarray(xy, float)
    count = len(place)
    one = np.broadcast_to(np.eye(3), (count, 3, 3))
    yes = np.ones(count, bool)
    return ModelControl(np.column_stack([place, np.full(count, depth)]), yes, yes, sd[0] ** 2 * one, sd[1] ** 2 * one)


def diagonal(sd: ArrayLike, count: int) -> Floats:
    return np.broadcast_to(np.diag(np.square(sd)), (count, 3, 3))


@pytest.mark.parametrize("vector", cases("pavlov_errors"))
def test_numbers_computed_apart(vector: Vector) -> None:
    given_, want = vector.input, vector.expected
    tol = {"rel": vector.tol["rel"], "abs": vector.tol["abs"]}
    b, z = given_["b"], given_["Z"]
    control = control_at(given_["control_xy"], z)
    check = np.column_stack([given_["check_xy"], np.full(len(given_["check_xy"]), z)])
    elements = np.array([given_["elements"][name] for name in ELEMENTS])
    dx1_control, dx1_check = np.array(given_["dx1_control"]), np.array(given_["dx1_check"])
    geodetic = np.array(given_["geodetic_errors_control"])

    assert influence(check, b) == pytest.approx(
        np.array(want["partials_check_order_dby_dbz_dkappa_dalpha_domega"]), **tol
    )
    dx2_control, dx2_check = influence(control.points, b) @ elements, influence(check, b) @ elements
    assert dx2_control == pytest.approx(np.array(want["dx2_control"]), **tol)
    assert dx2_check == pytest.approx(np.array(want["dx2_check"]), **tol)
    sums = control_sums(given_["control_xy"])
    assert sums == pytest.approx(np.array([want["c"][f"c{k}"] for k in range(1, 16)]), **tol)
    assert sums[0] + sums[1] == pytest.approx(want["B"])
    assert sums[0] * sums[1] - sums[2] ** 2 == pytest.approx(want["A"])

    misclosures = dx1_control + dx2_control - geodetic
    assert misclosures == pytest.approx(np.array(want["misclosures_W"]), **tol)
    dx3 = parameter_rows(check, control) @ list(want["orientation_parameters"].values())
    assert dx3 == pytest.approx(np.array(want["dx3_check"]), **tol)
    operator = orientation_operator(check, control)
    assert np.einsum("qanb,nb->qa", operator, misclosures) == pytest.approx(dx3, **tol)

    named = [
        ControlPoint(tuple(xy), f"{number}", measured_error=tuple(measured), given_error=tuple(error))
        for number, (xy, measured, error) in enumerate(zip(given_["control_xy"], dx1_control, geodetic, strict=True))
    ]
    places = zip(given_["check_xy"], dx1_check, strict=True)
    others = [NamedPoint(tuple(xy), f"p{number}", measured_error=tuple(own)) for number, (xy, own) in enumerate(places)]
    spec = ModelSpec(z, b, b, 1000.0, control=tuple(named), points=tuple(others), element_errors=tuple(elements))
    planned = given_errors(spec)
    assert planned is not None
    assert planned.parts is not None
    for name, found in (
        ("delta1", planned.parts.from_measuring),
        ("delta2", planned.parts.from_elements),
        ("delta3", planned.parts.from_control),
        ("total", planned.parts.total),
    ):
        assert found[: len(check)] == pytest.approx(np.array(want[name]), **tol)

    closed = coefficients(given_["check_xy"], given_["control_xy"], b, z)
    assert closed == pytest.approx(np.array(want["closed_form_coefficients_order_dbz_dkappa_dalpha_domega"]), **tol)
    assert closed @ elements[PRINTED_ORDER] == pytest.approx(np.array(want["delta2"]), **tol)


@pytest.mark.parametrize("vector", cases("pavlov_errors"))
def test_expected_errors_computed_apart(vector: Vector) -> None:
    given_, want = vector.input, vector.expected
    b, z, prior = given_["b"], given_["Z"], given_["apriori"]
    variances = six_point_variances(prior["m_q"], z, prior["a"], b)
    assert variances == pytest.approx(
        np.array([want["apriori_variances"][name] for name in ("dkappa", "dbz", "dalpha2p", "domega")])
    )
    count = len(given_["control_xy"])
    level = control_at(given_["control_xy"], z)
    control = ModelControl(
        level.points,
        level.plan,
        level.height,
        diagonal(prior["sd_model_xyz"], count),
        diagonal(prior["sd_geodetic_xyz"], count),
    )
    check = np.column_stack([given_["check_xy"], np.full(len(given_["check_xy"]), z)])
    own = diagonal(prior["sd_model_xyz"], len(check))
    found = expected_errors(check, own, control, b, np.diag(variances))
    assert found.covariance == pytest.approx(np.array(want["covariance_check"]), rel=1e-8, abs=1e-16)
    assert found.sigmas == pytest.approx(np.array(want["sd_check"]), rel=1e-8)
    assert sum(found.sources.values()) == pytest.approx(found.covariance)
    assert (found.elements**2).sum(axis=2) == pytest.approx(
        np.diagonal(found.sources["orientation"], axis1=1, axis2=2), rel=1e-9
    )

    extended = want["extended_adjustment"]
    adjusted = adjust_model(control, want["misclosures_W"], b, np.diag(variances))
    names = ("dX0", "dY0", "dZ0", "dlambda", "dtheta", "deta", "dxi", "dkappa", "dbz", "dalpha2p", "domega")
    assert tuple(extended["parameter_order"]) == names
    solution = np.concatenate([adjusted.parameters, adjusted.elements])
    assert solution == pytest.approx(np.array(extended["solution"]), rel=1e-7, abs=1e-12)
    correction = adjusted.correction(check)
    assert correction == pytest.approx(np.array(extended["predicted_correction_check"]), rel=1e-7, abs=1e-12)
    before = np.array(given_["dx1_check"]) + np.array(want["dx2_check"])
    assert before - correction == pytest.approx(np.array(extended["remaining_error_check"]), rel=1e-7, abs=1e-12)


places = st.tuples(st.floats(-20.0, 110.0), st.floats(-100.0, 100.0), st.floats(60.0, 300.0))


@given(st.lists(places, min_size=1, max_size=6), st.floats(40.0, 120.0))
def test_influence_is_the_derivative_of_the_exact_intersection(points: list[Any], base: float) -> None:
    xyz = np.array(points)
    exact = influence(xyz, base)
    for number in range(5):
        step = np.zeros(5)
        step[number] = TURN
        difference = (intersected(xyz, base, step) - intersected(xyz, base, -step)) / (2 * TURN)
        assert exact[:, :, number] == pytest.approx(difference, rel=1e-5, abs=1e-5)


layouts = st.lists(st.tuples(st.floats(-10.0, 90.0), st.floats(-80.0, 80.0)), min_size=4, max_size=9, unique=True)


def spread(xy: Floats) -> bool:
    values = np.linalg.svd(xy - xy.mean(axis=0), compute_uv=False)
    return bool(values[1] > 5.0)


@given(layouts, st.integers(0, 2**32 - 1))
def test_operators_are_the_direct_least_squares_fit(layout: list[Any], seed: int) -> None:
    xy = np.array(layout)
    if not spread(xy):
        return
    rng = np.random.default_rng(seed)
    full = control_at(xy)
    # any mixture of plan and height control that determines both
    height = rng.random(len(xy)) < 0.8
    plan = rng.random(len(xy)) < 0.8
    height[:4], plan[:2] = True, True
    if not spread(xy[height]):
        return
    control = ModelControl(full.points, plan, height, full.measured, full.given)
    misclosure = rng.normal(size=(len(xy), 3))
    rows = parameter_rows(full.points, control)
    counts = np.stack([plan, plan, height], axis=1)
    fitted, *_ = np.linalg.lstsq(rows[counts], misclosure[counts], rcond=None)
    through = np.einsum("qanb,nb->qa", orientation_operator(full.points, control), misclosure)
    assert through == pytest.approx(rows @ fitted, rel=1e-7, abs=1e-7)


def test_six_standard_points_have_the_printed_variances() -> None:
    f, a, b = 100.0, 65.0, 70.0
    points = np.array([[x, y, f] for y in (0.0, a, -a) for x in (0.0, b)])
    dependent = element_covariance(points, b, 0.01)
    turn = relative_orientation.dependent_from_base(b)
    assert dependent == pytest.approx(
        1e-4 * turn @ relative_orientation.cofactors(f, a, b) @ turn.T, rel=1e-9, abs=1e-16
    )
    free = free_covariance(dependent, b)
    assert np.diag(free) == pytest.approx(six_point_variances(0.01, f, a, b))
    sd = np.sqrt(np.diag(free))
    assert free / np.outer(sd, sd) == pytest.approx(np.eye(4), abs=1e-9)


@pytest.mark.parametrize(
    ("xy", "message"),
    [
        ([[0.0, 0.0]], "1 control point in plan"),
        ([[3.0, 4.0], [3.0, 4.0], [3.0, 4.0]], "lie at one place"),
        ([[0.0, 0.0], [50.0, 10.0]], "2 control points in height"),
        ([[0.0, 0.0], [50.0, 10.0], [100.0, 20.0]], "on one line"),
        ([[0.0, 5.0], [50.0, 5.0], [100.0, 5.0]], "on one line"),
    ],
)
def test_control_that_determines_nothing_is_refused(xy: list[list[float]], message: str) -> None:
    with pytest.raises(GeometryError, match=message) as caught:
        orientation_operator(np.array([[20.0, 30.0, 100.0]]), control_at(xy))
    assert caught.value.code == "plan-control"


BASE, DEPTH = 70.0, 100.0
XY = np.array([[2.0, 58.0], [68.0, 61.0], [-3.0, -63.0], [72.0, -55.0], [33.0, 6.0]])
POINT = np.array([20.0, 30.0])
ROUNDING = 1e-9


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


def as_printed(*, misprints: bool) -> Floats:
    """Eq. 9-10 term by term, after the source, with the misprints that are named; rows x, y in the order of `ORDER`."""
    b, z, n = BASE, DEPTH, len(XY)
    x, y = POINT
    u, v = XY.T
    X, Y = x - u.mean(), y - v.mean()
    c = dict(enumerate(control_sums(XY), 1))
    B = c[1] + c[2]

    def less_mean(at_point: float, at_control: Floats) -> float:
        return float(at_point - at_control.sum() / n)

    c8 = -c[8] if misprints else c[8]
    b_squared = b if misprints else b**2
    sign = 1 if misprints else -1
    square = v if misprints else v**2
    half = (b**2 + z**2) / 2 if misprints else b**2 / 2 + z**2
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
    assert as_printed(misprints=False) == pytest.approx(direct()[:2], rel=ROUNDING)


def test_what_the_command_calls_printed_has_every_misprint_and_no_other() -> None:
    found = coefficients([POINT], XY, BASE, DEPTH, printed=True)[0]
    assert found[:2] == pytest.approx(as_printed(misprints=True), rel=ROUNDING)
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
