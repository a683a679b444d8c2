"""A pair: brought to the normal case, intersected, displaced, and what a plan expects of it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from photostrip.arrays import Floats
from photostrip.errors import GeometryError
from photostrip.simulation.draws import Draws, Purpose
from photostrip.statistics import chi2_quantile
from photostrip.terrestrial.accuracy import DisplacementSpec, PlannedDisplacement, plan_displacements
from photostrip.terrestrial.normal_case import (
    Phototheodolite,
    StereoPair,
    displacements,
    ellipses,
    ground_from_photo,
    intersect,
    meeting_z,
    small_turn,
    to_normal,
)
from tests.loops import nonempty
from tests.terrestrial.simulated import CENTERS, FOCAL, SIGMA, attitude, photo, world
from tests.vectors import Vector, cases

NANOMETRE = 1e-9  # m

angle = st.floats(-0.35, 0.35)


def rotations(pair: StereoPair, count: int) -> Floats:
    return np.broadcast_to(pair.rotations, (count, 2, 3, 3))


def located(coordinates: Floats, pair: StereoPair) -> Floats:
    """Points on the ground from coordinates of the normal case."""
    xyz, _ = intersect(coordinates, pair.principal_distances[0], pair.base)
    return np.asarray(xyz @ pair.ground_from_normal().T + pair.centers[0], float)


@given(angle, angle, angle, angle, angle, angle, st.booleans())
def test_convergent_photos_give_back_the_points(
    al: float, ol: float, kl: float, ar: float, o_r: float, kr: float, with_right_z: bool
) -> None:
    truth = world()
    pair = StereoPair(FOCAL, CENTERS, np.array([ground_from_photo(al, ol, kl), ground_from_photo(ar, o_r, kr)]))
    measured = np.hstack(
        [
            photo(truth.points, CENTERS[0], attitude(al, ol, kl), FOCAL[0]),
            photo(truth.points, CENTERS[1], attitude(ar, o_r, kr), FOCAL[1]),
        ]
    )
    z = measured[:, 3].copy()
    if not with_right_z:
        measured[:, 3] = np.nan
        np.testing.assert_allclose(meeting_z(measured, pair, rotations(pair, len(z))), z, atol=1e-9)
    normal = to_normal(measured, np.ones_like(measured), pair, rotations(pair, len(measured)))
    np.testing.assert_allclose(located(normal.coordinates, pair), truth.points, atol=NANOMETRE)
    np.testing.assert_allclose(normal.coordinates[:, 1], normal.coordinates[:, 3], atol=1e-10)
    if with_right_z:
        np.testing.assert_allclose(normal.parallax, 0.0, atol=1e-10)
    else:
        assert np.isnan(normal.parallax).all()


def test_the_intersection_is_the_least_squares_one() -> None:
    """An optimiser that moves the point until its images fit knows nothing of the normal case."""
    from scipy.optimize import least_squares

    truth = world()
    measured = truth.exact(0) + SIGMA * Draws(7, Purpose.IMAGE).normal(len(truth.points), 4)
    variances = np.array([1.0, 2.0, 0.5, 1.5]) * SIGMA**2 * np.ones_like(measured)
    normal = to_normal(measured, variances, truth.pair, rotations(truth.pair, len(measured)))
    found = located(normal.coordinates, truth.pair)
    columns = [attitude(*each) for each in truth.attitudes]

    def misfit(point: Floats, row: int) -> Floats:
        images = [photo(point[None], CENTERS[side], columns[side], FOCAL[side])[0] for side in range(2)]
        residuals: Floats = (np.concatenate(images) - measured[row]) / np.sqrt(variances[row])
        return residuals

    for row in range(len(found)):
        solved = least_squares(misfit, found[row] + 0.1, args=(row,), xtol=1e-15, ftol=1e-15, gtol=1e-15)
        jac = np.asarray(solved.jac, float)
        covariance = np.linalg.inv(jac.T @ jac)
        np.testing.assert_allclose((solved.x - found[row]) / np.sqrt(np.diag(covariance)), 0.0, atol=2e-3)
        _, jacobian = intersect(normal.coordinates[[row]], FOCAL[0], truth.pair.base)
        by = truth.pair.ground_from_normal() @ jacobian[0] @ normal.by_measured[row]
        spread = (by * variances[row]) @ by.T
        scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
        np.testing.assert_allclose(spread / scale, covariance / scale, atol=2e-3)


@pytest.mark.parametrize("with_right_z", [True, False])
def test_derivatives_are_those_of_differences(with_right_z: bool) -> None:
    truth = world()
    pair, measured = truth.pair, truth.exact(0)
    if not with_right_z:
        measured[:, 3] = np.nan
    variances = np.ones_like(measured)
    turn = rotations(pair, len(measured))
    here = to_normal(measured, variances, pair, turn)
    for column in range(4 if with_right_z else 3):
        step = 1e-5 * np.eye(4)[column]
        ahead, behind = (to_normal(measured + s * step, variances, pair, turn) for s in (1, -1))
        change = (ahead.coordinates - behind.coordinates) / 2e-5
        np.testing.assert_allclose(change, here.by_measured[:, :, column], atol=1e-7)
        if with_right_z:
            parallax = (ahead.parallax - behind.parallax) / 2e-5
            np.testing.assert_allclose(parallax, here.parallax_by_measured[:, column], atol=1e-7)
    for column in range(6):
        step = 1e-6 * np.eye(6)[column].reshape(2, 3)
        ahead, behind = (to_normal(measured, variances, pair, turn @ small_turn(s * step)) for s in (1, -1))
        change = (ahead.coordinates - behind.coordinates) / 2e-6
        np.testing.assert_allclose(change, here.by_turn[:, :, column], rtol=1e-6, atol=1e-6)
        if with_right_z:
            parallax = (ahead.parallax - behind.parallax) / 2e-6
            np.testing.assert_allclose(parallax, here.parallax_by_turn[:, column], rtol=1e-6, atol=1e-6)


def test_stations_at_one_place_are_refused() -> None:
    pair = StereoPair(FOCAL, CENTERS[[0, 0]], world().pair.rotations)
    with pytest.raises(GeometryError, match="at the same place: there is no base") as error:
        pair.ground_from_normal()
    assert error.value.exit_code == 3


@pytest.mark.parametrize("alphas", [(np.pi / 2, np.pi / 2), (0.0, np.pi)])
def test_cameras_that_look_along_the_base_or_apart_are_refused(alphas: tuple[float, float]) -> None:
    centers = np.array([[0.0, 0.0, 0.0], [50.0, 0.0, 0.0]])
    pair = StereoPair(FOCAL, centers, np.array([ground_from_photo(each) for each in alphas]))
    with pytest.raises(GeometryError, match="look along the base, or away from each other"):
        pair.ground_from_normal()


def epochs(given_: dict[str, float]) -> tuple[Floats, Floats]:
    """Coordinates of both epochs from what the vectors give."""
    x, z, p = (given_[name] for name in ("x_left", "z_left", "p"))
    first = np.array([[x, z, x - p, z]])
    change = [given_["dx_left"], given_["dz_left"], given_["dx_right"], given_["dz_left"]]
    return first, first + change


@pytest.mark.parametrize("vector", cases("pseudo_parallax"))
def test_the_vectors(vector: Vector) -> None:
    given_, expected, rel = vector.input, vector.expected, vector.tol["rel"]
    f, base = given_["f"], given_["B"]
    first, second = epochs(given_)
    (point,), _ = intersect(first, f, base)
    np.testing.assert_allclose(point, [expected[name] for name in "XYZ"], rtol=rel)
    (moved,) = displacements(first, second, f, base)
    np.testing.assert_allclose(moved, [expected[name] for name in ("dX", "dY", "dZ")], rtol=rel)
    np.testing.assert_allclose(point + moved, [expected[f"{name}_new"] for name in "XYZ"], rtol=rel)
    assert second[0, 0] - second[0, 2] == pytest.approx(expected["p_new"], rel=rel)


coordinate = st.floats(-80.0, 80.0)
parallax = st.floats(5.0, 80.0)
change = st.floats(-2.0, 2.0)


@given(coordinate, coordinate, parallax, change, change, change)
def test_a_displacement_is_the_difference_of_two_points(
    x: float, z: float, p: float, dx: float, dz: float, dr: float
) -> None:
    first = np.array([[x, z, x - p, z]])
    second = first + np.array([dx, dz, dr, dz])
    f, base = 190.0, 50.0
    before, after = (
        f * base / (e[0, 0] - e[0, 2]) * np.array([e[0, 0] / f, 1.0, e[0, 1] / f]) for e in (first, second)
    )
    np.testing.assert_allclose(displacements(first, second, f, base)[0], after - before, rtol=1e-9, atol=1e-9)


def covariance(seed: int) -> Floats:
    root = Draws(seed, Purpose.POINTS).normal(3, 3)
    return np.asarray(root @ root.T)


@given(st.integers(0, 1000))
def test_ellipses_are_those_of_the_eigenvectors(seed: int) -> None:
    c = covariance(seed)[:2, :2]
    major, minor, azimuth = ellipses(c, 0.95)
    size, axes = np.linalg.eigh(c)
    np.testing.assert_allclose([minor, major], np.sqrt(5.991464547 * size), rtol=1e-6, atol=1e-6)
    direction = np.array([np.sin(azimuth), np.cos(azimuth)])
    assert abs(direction @ axes[:, 1]) == pytest.approx(1.0, abs=1e-6)
    assert 0 <= azimuth < np.pi


F, B, M = 100.0, 30.0, 0.005
UMK = Phototheodolite("UMK", F, format=(160.0, 120.0))
SPEC = DisplacementSpec(UMK, distances=(50.0, 200.0), sigma=M, base=B)


def by_place(spec: DisplacementSpec) -> dict[str, PlannedDisplacement]:
    """Give what is planned at the first distance."""
    return {each.place: each for each in plan_displacements(spec)[:3]}


def test_standard_deviations_are_those_of_the_normal_case() -> None:
    found = plan_displacements(SPEC)
    assert [each.place for each in found] == ["middle", "side", "top"] * 2
    for each in nonempty(found):
        x, y, _ = each.at
        p, image = B * F / y, x * F / y
        # m_dY = Y²/(B f) m sqrt(2), m_dX = (Y/f) m sqrt((1 - x/p)² + (x/p)²)
        assert each.sigma[1] == pytest.approx(y**2 / (B * F) * M * np.sqrt(2), rel=1e-9)
        assert each.sigma[0] == pytest.approx(y / F * M * np.hypot(1 - image / p, image / p), rel=1e-9)


def drawn(each: PlannedDisplacement, moved: Floats, count: int) -> Floats:
    """Displacements of a point that has moved, from drawn errors, intersected apart from the program."""
    rng = np.random.default_rng(11)
    found = []
    for point, sigma in ((each.at, M / np.sqrt(2)), (each.at + moved, M / np.sqrt(2))):
        left = F * point[[0, 2]] / point[1] + sigma * rng.normal(size=(count, 2))
        right = F * (point[[0, 2]] - (B, 0)) / point[1] + sigma * rng.normal(size=(count, 2))
        depth = B * F / (left[:, 0] - right[:, 0])
        height = (left[:, 1] + right[:, 1]) / 2
        found.append(np.column_stack([depth * left[:, 0] / F, depth, depth * height / F]))
    shift: Floats = found[1] - found[0]
    return shift


@pytest.mark.parametrize("place", ["middle", "side", "top"])
def test_drawn_displacements_scatter_so_and_are_found_so_often(place: str) -> None:
    each = by_place(SPEC)[place]
    still = drawn(each, np.zeros(3), 20_000)
    assert still.std(axis=0) / each.sigma == pytest.approx(np.ones(3), abs=0.02)
    weight = np.linalg.inv(np.cov(still.T))
    limit = chi2_quantile(0.95, 3)
    for axis in range(3):
        moved = drawn(each, each.found[axis] * np.eye(3)[axis], 20_000)
        seen = np.einsum("ni,ij,nj->n", moved, weight, moved) > limit
        assert seen.mean() == pytest.approx(0.8, abs=0.02)
    assert each.worst >= each.found.max() * (1 - 1e-9)
