"""Error theory of a model: the published numbers, the exact intersection, a direct adjustment, a simulated chain."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from photostrip.errors import GeometryError
from photostrip.geometry.rotation import from_alpha_omega_kappa
from photostrip.planning.closed_form import ORDER, coefficients, control_sums
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
from tests.draws import orthogonal_normal
from tests.planning.formulas import intersected, orientation_parameters, six_point_variances
from tests.vectors import cases

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from tests.vectors import Vector

    Floats = NDArray[np.float64]

TURN = 1e-5  # step of differences, rad or photo scale mm
PRINTED_ORDER = [ELEMENTS.index(name) for name in ORDER]


def control_at(xy: ArrayLike, depth: float = 100.0, sd: tuple[float, float] = (0.0, 0.0)) -> ModelControl:
    """Full control points at one depth; standard deviations of all measured and of all given coordinates."""
    place = np.asarray(xy, float)
    count = len(place)
    one = np.broadcast_to(np.eye(3), (count, 3, 3))
    yes = np.ones(count, bool)
    return ModelControl(np.column_stack([place, np.full(count, depth)]), yes, yes, sd[0] ** 2 * one, sd[1] ** 2 * one)


def diagonal(sd: ArrayLike, count: int) -> Floats:
    return np.broadcast_to(np.diag(np.square(sd)), (count, 3, 3))


# --------------------------------------------------------------------------------------------- published numbers


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
    parameters = orientation_parameters(control, misclosures)
    assert parameters == pytest.approx(np.array(list(want["orientation_parameters"].values())), **tol)
    dx3 = parameter_rows(check, control) @ parameters
    assert dx3 == pytest.approx(np.array(want["dx3_check"]), **tol)
    operator = orientation_operator(check, control)
    assert np.einsum("qanb,nb->qa", operator, misclosures) == pytest.approx(dx3, **tol)

    delta1 = dx1_check - np.einsum("qanb,nb->qa", operator, dx1_control)
    delta2 = dx2_check - np.einsum("qanb,nb->qa", operator, dx2_control)
    delta3 = np.einsum("qanb,nb->qa", operator, geodetic)
    for name, found in (("delta1", delta1), ("delta2", delta2), ("delta3", delta3)):
        assert found == pytest.approx(np.array(want[name]), **tol)
    assert delta1 + delta2 + delta3 == pytest.approx(np.array(want["total"]), **tol)

    closed = coefficients(given_["check_xy"], given_["control_xy"], b, z)
    assert closed == pytest.approx(np.array(want["closed_form_coefficients_order_dbz_dkappa_dalpha_domega"]), **tol)
    assert closed @ elements[PRINTED_ORDER] == pytest.approx(delta2, **tol)


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


# ---------------------------------------------------------------------------------------- what needs no source


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
    assert orientation_parameters(control, misclosure) == pytest.approx(fitted, rel=1e-7, abs=1e-9)
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


# --------------------------------------------------------------------------------------------------- simulation


F, A, B = 100.0, 65.0, 70.0
CORNERS = np.array([[2.0, 58.0], [68.0, 61.0], [-3.0, -63.0], [72.0, -55.0], [33.0, 6.0]])
PLACES = np.array([[20.0, 30.0, F], [60.0, -30.0, F], [-8.0, 70.0, F]])


def oriented_errors(repetitions: int) -> tuple[Floats, Floats]:
    """Errors at control and other points of the exact chain: relative orientation, intersection, 4 + 3 parameters."""
    rng = np.random.default_rng(12)
    six = np.array([[x, y, F] for y in (0.0, A, -A) for x in (0.0, B)])
    every = np.vstack([np.column_stack([CORNERS, np.full(5, F)]), PLACES])
    errors = np.empty((repetitions, len(every), 3))
    control = control_at(CORNERS, F)
    operator = orientation_operator(every, control)
    for number, drawn in enumerate(orthogonal_normal(rng, repetitions, 6 + every.size + 15)):
        parallaxes, of_model, of_control = np.split(drawn, [6, 6 + every.size])
        elements = _oriented(six, 0.005 * parallaxes)
        model = intersected(every, B, elements)
        truth = np.column_stack([every[:, :2], -every[:, 2]])
        error = model - truth + of_model.reshape(-1, 3) * (0.003, 0.003, 0.006)
        given_error = of_control.reshape(-1, 3) * (0.002, 0.002, 0.004)
        misclosure = error[:5] - given_error
        errors[number] = error - np.einsum("qanb,nb->qa", operator, misclosure)
    return errors[:, :5], errors[:, 5:]


def _oriented(six: Floats, parallax: Floats) -> Floats:
    """Dependent elements by Gauss-Newton on the exact y parallaxes, which differences give the slopes of."""
    elements = np.zeros(5)
    for _ in range(3):
        value = _parallaxes(six, elements) + parallax
        slope = np.empty((6, 5))
        for column in range(5):
            step = np.zeros(5)
            step[column] = TURN
            slope[:, column] = (_parallaxes(six, elements + step) - _parallaxes(six, elements - step)) / (2 * TURN)
        elements -= np.linalg.lstsq(slope, value, rcond=None)[0]
    return elements


def _parallaxes(six: Floats, elements: Floats) -> Floats:
    """y parallaxes at the height of the intersection of left and right ray."""
    dby, dbz, dkappa, dalpha, domega = elements
    left = np.column_stack([six[:, 0], six[:, 1], -six[:, 2]])
    ray2 = (left - (B, 0.0, 0.0)) @ from_alpha_omega_kappa(dalpha, domega, dkappa).T
    scale1 = (dbz * ray2[:, 0] - B * ray2[:, 2]) / (left[:, 2] * ray2[:, 0] - left[:, 0] * ray2[:, 2])
    scale2 = (scale1 * left[:, 2] - dbz) / ray2[:, 2]
    parallax: Floats = (scale1 * left[:, 1] - dby - scale2 * ray2[:, 1]) / scale1
    return parallax


@pytest.mark.slow
def test_expected_errors_against_the_exact_chain() -> None:
    at_control, elsewhere = oriented_errors(270)
    level = control_at(CORNERS, F)
    control = ModelControl(
        level.points, level.plan, level.height, diagonal((0.003, 0.003, 0.006), 5), diagonal((0.002, 0.002, 0.004), 5)
    )
    elements = np.diag(six_point_variances(0.005, F, A, B))
    new = expected_errors(PLACES, diagonal((0.003, 0.003, 0.006), 3), control, B, elements)
    own = expected_errors(level.points, control.measured, control, B, elements, np.arange(5))
    ratio = np.concatenate([elsewhere.std(axis=0) / new.sigmas, at_control.std(axis=0) / own.sigmas])
    assert np.abs(ratio - 1).max() < 0.07  # 270 repetitions know each to 1.1 %
    assert ratio.mean() == pytest.approx(1.0, abs=0.015)
    assert np.all(np.linalg.eigvalsh(own.covariance) > 0)


# ------------------------------------------------------------------------------------------------------ refusals


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
        orientation_operator(PLACES, control_at(xy))
    assert caught.value.code == "plan-control"
