"""Simple accuracy formulas and the deformation paraboloid: published numbers, and the exact intersection."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from photostrip.arrays import Floats
from photostrip.geometry.rotation import from_alpha_omega_kappa
from photostrip.planning.deformation import (
    CENTRAL,
    PRINTED,
    SIDE,
    assumed_constants,
    fit_paraboloid,
    paraboloid_rows,
    parallax_error,
    relative_errors,
    rigorous_covariance,
    surface_of_elements,
)
from photostrip.planning.model_plan import source_example
from photostrip.strip.relative_orientation import cofactors
from tests.draws import orthogonal_normal
from tests.vectors import Vector, cases

SIX = np.array([[x, y] for y in (0.0, 65.0, -65.0) for x in (0.0, 70.0)])
PLACES = (("lateral", SIDE), ("central", CENTRAL))


@pytest.mark.parametrize("vector", cases("model_deformation"))
def test_numbers_computed_apart(vector: Vector) -> None:
    given_, want = vector.input, vector.expected
    rel = vector.tol["rel"]
    m, f, b = given_["m"], given_["f"], given_["b"]
    xy, elements, m_q = np.array(given_["points_xy"]), np.array(given_["elements_rad"]), given_["m_q_micrometre"] / 1e6
    for printed_name, name in PLACES:
        for group, table in (("printed_constants_m", PRINTED), ("unrounded_m", assumed_constants())):
            # m_q in metres: m_D = plan m m_q, m_Z = height m (f / b) m_q
            assert table[name].plan * m * m_q == pytest.approx(want[group][f"mD_{printed_name}"], rel=rel)
            assert table[name].height * m * f / b * m_q == pytest.approx(want[group][f"mZ_{printed_name}"], rel=rel)
    for printed_name, name in PLACES:
        assert assumed_constants()[name].plan == pytest.approx(want["unrounded_constants"][f"mD_{printed_name}"])
        assert assumed_constants()[name].height == pytest.approx(want["unrounded_constants"][f"mZ_{printed_name}"])
    # from six points; the x parallax counts 2 in the vectors, as in the source
    rows = np.stack([parallax_error([[0, 0], [0, b], [b, b]], unit, f, b) for unit in np.eye(5)], axis=-1)
    factors = np.einsum("ni,ij,nj->n", rows, cofactors(f, b, b), rows) + 2
    wanted = want["rigorous_c_variance_factors"]
    assert factors == pytest.approx([wanted["central"], wanted["lateral_left"], wanted["lateral_right"]], rel=1e-9)

    c = parallax_error(xy, elements, f, b)
    assert c == pytest.approx(want["c_mm"], rel=rel, abs=1e-15)
    surface = surface_of_elements(elements, m, f, b)
    assert surface == pytest.approx([want[name] for name in ("E0", "A", "B", "C", "D")], rel=rel)
    assert paraboloid_rows(xy) @ surface == pytest.approx(want["dZ_mm"], rel=rel)


def test_relative_errors_are_differentials_of_the_normal_case() -> None:
    """Eq. 10.7: X = N x, Y = N y, Z = -N f with N = B / p, by differences."""

    def place(base: float, f: float, x: float, y: float, p: float) -> Floats:
        return base / p * np.array([x, y, -f])

    at, errors = np.array([900.0, 150.0, 40.0, 70.0, 85.0]), np.array([0.09, 0.02, 0.005, -0.004, 0.003])
    found = relative_errors(at[2:], at[1], errors[2:], base=errors[0] / at[0], principal_distance=errors[1])
    change = (place(*(at + errors / 2)) - place(*(at - errors / 2))) / place(*at)
    assert found == pytest.approx(change, rel=1e-6)


def test_the_printed_22_micrometres_are_21() -> None:
    # 10 um, f = b, a central point: the text of the source says 22
    assert PRINTED[CENTRAL].plan * 10 == pytest.approx(21)
    assert assumed_constants()[CENTRAL].plan * 10 == pytest.approx(21.2, abs=0.05)


F, A, B, SIGMA = 153.0, 92.0, 92.0, 0.005
CORNERS = np.array([[x, y] for y in (0.0, A, -A) for x in (0.0, B)])
WHERE = np.array([[0.0, A], [B, A], [0.0, 0.0], [B, 0.0], [30.0, -50.0]])


def rays(elements: Floats, left: Floats, right: Floats, focal: float = F) -> tuple[Floats, Floats]:
    """Rays of both photos in the base frame."""
    al1, ka1, al2, om2, ka2 = elements
    level = [np.column_stack([xy, np.full(len(xy), -focal)]) for xy in (left, right)]
    return level[0] @ from_alpha_omega_kappa(al1, 0.0, ka1).T, level[1] @ from_alpha_omega_kappa(al2, om2, ka2).T


def parallaxes(elements: Floats, left: Floats, right: Floats) -> Floats:
    one, two = rays(elements, left, right)
    found: Floats = -F * one[:, 1] / one[:, 2] + F * two[:, 1] / two[:, 2]
    return found


def measured_model(errors: Floats) -> Floats:
    """Errors of new points of a pair that six measured points orient, less shift and azimuth of the left photo, scale.

    Nothing is linear here: the exact condition, the exact rays, y from both of them.
    """
    of_six, of_points = np.split(SIGMA * errors, [24])
    moved, moved_points = of_six.reshape(2, 6, 2), of_points.reshape(2, len(WHERE), 2)
    left, right = CORNERS + moved[0], CORNERS - (B, 0.0) + moved[1]
    elements = np.zeros(5)
    for _ in range(3):
        step = 1e-6 * np.eye(5)
        slope = [(parallaxes(elements + u, left, right) - parallaxes(elements - u, left, right)) / 2e-6 for u in step]
        elements -= np.linalg.lstsq(np.array(slope).T, parallaxes(elements, left, right), rcond=None)[0]
    one, two = rays(elements, WHERE + moved_points[0], WHERE - (B, 0.0) + moved_points[1])
    first = -B * two[:, 2] / (one[:, 2] * two[:, 0] - one[:, 0] * two[:, 2])
    second = first * one[:, 2] / two[:, 2]
    model = np.column_stack([first * one[:, 0], (first * one[:, 1] + second * two[:, 1]) / 2, first * one[:, 2]])
    error: Floats = model - np.column_stack([WHERE, np.full(len(WHERE), -F)])
    al1, ka1, al2, *_ = elements
    stretch = F / B * (al2 - al1)
    error -= stretch * np.column_stack([WHERE, np.full(len(WHERE), -F)])
    error[:, 0] += ka1 * WHERE[:, 1] - F * al1  # the left photo turns about its centre and about the vertical
    error[:, 1] -= ka1 * WHERE[:, 0]
    return error


@pytest.mark.slow
def test_the_rigorous_formulas_are_the_scatter_of_exact_models() -> None:
    rng = np.random.default_rng(6)
    errors = np.array([measured_model(drawn) for drawn in orthogonal_normal(rng, 352, 24 + 4 * len(WHERE))])
    expected = np.sqrt(np.diagonal(rigorous_covariance(WHERE, F, A, B, SIGMA), axis1=1, axis2=2))
    ratio = errors.std(axis=0) / expected
    assert ratio == pytest.approx(np.ones_like(ratio), abs=0.08)
    assert ratio.mean() == pytest.approx(1.0, abs=0.01)
    # the scale: 5 µm at 1:10 000
    assert 10 * expected[0, 2] == pytest.approx(0.2008, abs=1e-4)


def heights(xy: Floats, elements: Floats, focal: float, base: float) -> Floats:
    """Heights of an exact pair at photo scale whose photos have turned by small elements against the base."""
    one, two = rays(elements, xy, xy - (base, 0.0), focal)
    return -base * two[:, 2] / (one[:, 2] * two[:, 0] - one[:, 0] * two[:, 2]) * one[:, 2]


small = st.floats(-2e-6, 2e-6)


@given(st.tuples(small, small, small, small, small), st.floats(60.0, 300.0))
def test_the_paraboloid_is_what_the_exact_intersection_does(elements: tuple[float, ...], focal: float) -> None:
    xy, base = np.vstack([SIX, [[35.0, 10.0], [20.0, -40.0]]]), 70.0
    found = heights(xy, np.array(elements), focal, base) + focal
    # eq. 10.9 leaves out a constant, which is scale and height datum only
    constant = -(focal**2) / base * (elements[2] - elements[0])
    surface = paraboloid_rows(xy) @ surface_of_elements(elements, 1.0, focal, base) + constant
    assert surface == pytest.approx(found, abs=1e-7)  # mm, of up to 3e-3: what is left is of second order


def test_the_printed_sign_of_kappa_in_eq_10_9_bends_heights_the_wrong_way() -> None:
    elements = np.array([0.0, 1e-6, 0.0, 0.0, 4e-6])
    focal, base = 100.0, 70.0
    exact = heights(SIX, elements, focal, base) + focal
    c = parallax_error(SIX, elements, focal, base)
    printed = SIX[:, 1] * (elements[4] - elements[1])  # + y (dkappa2 - dkappa1)
    assert -focal / base * c == pytest.approx(exact, abs=1e-8)
    wrong = -focal / base * printed - exact
    assert np.abs(wrong).max() > 1.9 * np.abs(exact).max() > 1e-4


FIVE = np.array([[0.0, 65.0], [70.0, 65.0], [0.0, -65.0], [70.0, -65.0], [35.0, 0.0]])


@pytest.mark.slow
def test_t_values_are_student_distributed_without_deformation_and_see_a_real_one() -> None:
    rng = np.random.default_rng(5)
    xy = np.vstack([SIX, FIVE[4:], [[20.0, 30.0], [55.0, -40.0]]])
    clean = [fit_paraboloid(xy, rng.normal(size=len(xy)), 1.0) for _ in range(1500)]
    false = np.mean([np.abs(fit.t_values) > fit.critical() for fit in clean], axis=0)
    assert false == pytest.approx([0.05, 0.05], abs=0.02)
    bent = paraboloid_rows(xy) @ [0, 0, 0, 2e-3, 0]
    found = [fit_paraboloid(xy, bent + rng.normal(size=len(xy)), 1.0) for _ in range(300)]
    seen = np.mean([np.abs(fit.t_values) > fit.critical() for fit in found], axis=0)
    assert seen[0] > 0.9
    assert seen[1] < 0.12


def test_the_worked_example_beside_what_six_points_give() -> None:
    rows = {(row.place, row.quantity): row for row in source_example()}
    assert [row.printed for row in rows.values()] == [35, 23, 22, 16]
    assert [row.formula for row in rows.values()] == pytest.approx([35, 23, 21, 16])
    assert [row.assumed for row in rows.values()] == pytest.approx([35.4, 22.9, 21.2, 15.8], abs=0.06)
    # var(c) from the orientation: 1/2 + 3/4 + 2/3 left, 1/2 + 2/3 right, 1/2 in the middle; an x parallax counts 1
    side, middle = rows[SIDE, "height"], rows[CENTRAL, "height"]
    assert (side.left, side.right) == pytest.approx((10 * np.sqrt(35 / 12), 10 * np.sqrt(13 / 6)))
    assert (middle.left, middle.right) == pytest.approx((10 * np.sqrt(1.5),) * 2)
    assert side.assumed > 1.3 * side.left
    assert rows[SIDE, "plan"].assumed > 1.8 * rows[SIDE, "plan"].left
