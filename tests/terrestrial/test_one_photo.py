"""One photo: directions of its points, their accuracy, its orientation by directions with every kind of error."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from photostrip.arrays import Floats
from photostrip.errors import GeometryError
from photostrip.simulation.draws import Draws, Purpose
from photostrip.terrestrial.accuracy import EXAMPLES, Example, as_printed, required, worked
from photostrip.terrestrial.normal_case import (
    direction_gradient,
    directions_from_photo,
    directions_of,
    ground_from_photo,
    partials,
    photo_from_directions,
)
from photostrip.terrestrial.orientation import OrientationSettings, Sightings, orient
from tests.draws import orthogonal_normal
from tests.loops import nonempty
from tests.terrestrial.simulated import ARCSECOND, attitude
from tests.vectors import Vector, cases

DIFFERENCE = 1e-6  # step of differences, mm or rad

azimuths = st.floats(-np.pi, np.pi)
tilts = st.floats(-1.4, 1.4)
distances = st.floats(50.0, 400.0)
places = st.tuples(st.floats(-90.0, 90.0), st.floats(-65.0, 65.0))


@given(azimuths, tilts, azimuths)
def test_the_rotation_is_roll_then_elevation_then_azimuth(alpha: float, omega: float, kappa: float) -> None:
    columns = attitude(alpha, omega, kappa)
    rotation = ground_from_photo(alpha, omega, kappa)
    np.testing.assert_allclose(rotation, np.column_stack([columns[:, 0], columns[:, 2], -columns[:, 1]]), atol=1e-14)
    assert np.linalg.det(rotation) == pytest.approx(1.0)


@given(st.tuples(*[st.floats(-5, 5)] * 3).filter(lambda v: np.hypot(v[0], v[1]) > 0.1))
def test_the_gradient_of_directions_is_that_of_differences(vector: tuple[float, float, float]) -> None:
    gradient = direction_gradient(vector)
    for axis in range(3):
        step = DIFFERENCE * np.eye(3)[axis]
        change = directions_of(vector + step) - directions_of(vector - step)
        change[0] = np.angle(np.exp(1j * change[0]))
        np.testing.assert_allclose(change / (2 * DIFFERENCE), gradient[:, axis], rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize("vector", cases("phototheodolite"))
def test_coordinates_directions_and_partials_of_the_vectors(vector: Vector) -> None:
    given_, expected, rel = vector.input, vector.expected, vector.tol["rel"]
    f, level = given_["f"], ground_from_photo(0.0)
    direction = np.radians([given_["lambda_deg"], given_["beta_deg"]])
    xz = photo_from_directions(direction, f, ground_from_photo(np.radians(given_["alpha_deg"])))
    np.testing.assert_allclose(xz, [expected["x_from_directions"], expected["z_from_directions"]], rtol=rel)
    point = [given_["x"], given_["z"]]
    found = np.degrees(directions_from_photo(point, f, level))
    np.testing.assert_allclose(found, [expected["lambda_prime_deg"], expected["beta_deg_corrected_eq3"]], rtol=rel)
    by = partials(point, f, level)
    want = expected["partials"]
    np.testing.assert_allclose(by.by_xz[0], [want["dlambda_dx"], 0.0], rtol=rel, atol=1e-18)
    np.testing.assert_allclose(by.by_xz[1], [want["dbeta_dx"], want["dbeta_dz"]], rtol=rel)
    np.testing.assert_allclose(by.by_f, [want["dlambda_df"], want["dbeta_df"]], rtol=rel)


@given(distances, places, azimuths)
def test_a_level_camera_follows_equations_2_and_3(f: float, place: tuple[float, float], alpha: float) -> None:
    x, z = place
    lam, beta = directions_from_photo(place, f, ground_from_photo(alpha))
    turned = np.angle(np.exp(1j * (lam - alpha)))
    assert turned == pytest.approx(np.arctan(x / f), abs=1e-12)
    assert beta == pytest.approx(np.arctan(z / f * np.cos(turned)), abs=1e-12)  # cos where sec is printed
    assert f * np.tan(beta) / np.cos(turned) == pytest.approx(z, abs=1e-9)


@pytest.mark.parametrize("beyond", [np.pi / 2, np.pi, -2.0])
def test_what_is_behind_the_camera_has_no_place_in_the_photo(beyond: float) -> None:
    xz = photo_from_directions([[0.3 + beyond, 0.1], [0.3, 0.1]], 100.0, ground_from_photo(0.3))
    assert np.isnan(xz[0]).all()
    assert np.isfinite(xz[1]).all()


RHO = 206265.0  # of the vectors and of the source
LEVEL = ground_from_photo(0.0)


@pytest.mark.parametrize("vector", cases("phototheodolite"))
def test_standard_errors_of_the_vectors(vector: Vector) -> None:
    f, x, z, m = (vector.input[name] for name in "fxzm")
    expected, rel = vector.expected, vector.tol["rel"]
    exact, printed = required([x, z], f, m, LEVEL), as_printed([x, z], f, m)
    found = {
        "m_lambda_prime_arcsec": exact.angle,
        "m_lambda_arcsec": exact.horizontal,
        "m_beta_arcsec_correct": exact.vertical,
        "m_beta_arcsec_eq6_as_printed": printed.vertical_eq6,
        "m_beta_arcsec_eq5_as_printed": printed.vertical_eq5,
    }
    for name, value in nonempty(found.items()):
        assert value * RHO == pytest.approx(expected[name], rel=rel), name
    assert printed.horizontal == pytest.approx(float(exact.horizontal), rel=1e-14)


@pytest.mark.parametrize(
    ("example", "rounded", "printed"),
    [
        (EXAMPLES[0], [3.54, 4.80, 5.13, 5.13, 5.64, 5.53], (3.5, 5.0)),
        (EXAMPLES[1], [5.69, 7.29, 8.64, 8.18, 11.08, 9.68], (6.0, 8.5)),
    ],
)
def test_the_worked_examples(example: Example, rounded: list[float], printed: tuple[float, float]) -> None:
    found = worked(example)
    assert (example.horizontal, example.vertical) == printed
    values = found.horizontal, found.vertical, found.printed_factor, found.eq6, found.eq4, found.eq5
    assert [round(value, 2) for value in values] == rounded
    assert abs(found.printed_factor - example.vertical) < 0.25  # the print rounds to half a second

    def beta(x: float, z: float, f: float) -> float:
        return math.atan(z / f * math.sqrt(1 + (x / f) ** 2))  # eq. 3 as printed: eq. 4 has terms that eq. 5 drops

    at, step = np.array([example.x, example.z, example.f]), 1e-4
    slopes = [(beta(*(at + step * unit)) - beta(*(at - step * unit))) / (2 * step) for unit in np.eye(3)]
    assert found.eq4 == pytest.approx(example.sigma * np.linalg.norm(slopes) * RHO, rel=1e-6)


def test_required_accuracy_is_that_of_simulated_measurements() -> None:
    rotation, f, place, m = ground_from_photo(0.4, 0.3, -0.2), 100.0, np.array([70.0, -50.0]), 0.005
    noise = m * Draws(1, Purpose.IMAGE).normal(40_000, 3)
    found = np.array([directions_from_photo(place + e[:2], f + e[2], rotation) for e in noise[:4000]])
    errors = required(place, f, m, rotation)
    spread = found.std(axis=0)
    assert spread[0] == pytest.approx(errors.angle, rel=0.04)
    assert spread[1] == pytest.approx(errors.vertical, rel=0.04)


F, CENTRE = 100.25, (0.12, -0.21)
SIGMA_XZ, SIGMA_DIRECTION = 0.005, 2 * ARCSECOND
EVERYTHING = ("principal-distance", "principal-point")
PLACES = np.array(
    [(-75, 50), (0, 55), (72, 48), (-70, -5), (5, 2), (74, 3), (-72, -52), (3, -55), (70, -50), (-35, 25), (38, -24)],
    float,
)


def directions(xz: Floats, angles: tuple[float, float, float], f: float = F) -> Floats:
    """Directions of image points, written apart from the program."""
    ray = np.column_stack([xz[:, 0] - CENTRE[0], np.full(len(xz), f), xz[:, 1] - CENTRE[1]]) @ attitude(*angles).T
    return np.column_stack([np.arctan2(ray[:, 0], ray[:, 1]), np.arctan2(ray[:, 2], np.hypot(ray[:, 0], ray[:, 1]))])


def sightings(
    angles: tuple[float, float, float], seed: int | None = None, places: Floats = PLACES, drawn: Floats | None = None
) -> Sightings:
    """Measure the points, without errors when there is no seed."""
    exact = directions(places, angles)
    noise = np.zeros((2, *places.shape)) if seed is None else Draws(seed, Purpose.IMAGE).normal(2, *places.shape)
    noise = noise if drawn is None else drawn.reshape(noise.shape)
    return Sightings(
        tuple(f"P{number}" for number in range(len(places))),
        places + SIGMA_XZ * noise[0],
        exact + SIGMA_DIRECTION * noise[1],
        np.full(places.shape, SIGMA_XZ),
        np.full(places.shape, SIGMA_DIRECTION),
        np.full(len(places), np.nan),
    )


def spoiled(given_: Sightings, point: int, image: tuple[float, float]) -> Sightings:
    xz = given_.xz.copy()
    xz[point] += image
    return replace(given_, xz=xz)


def without(given_: Sightings, *cells: tuple[int, int]) -> Sightings:
    measured = given_.directions.copy()
    for cell in cells:
        measured[cell] = np.nan
    return replace(given_, directions=measured)


@pytest.mark.slow
@given(st.floats(-np.pi, np.pi), st.floats(-1.2, 1.2), st.floats(-np.pi, np.pi))
def test_any_orientation_comes_back_from_points_without_errors(alpha: float, omega: float, kappa: float) -> None:
    found = orient(sightings((alpha, omega, kappa)), 100.0, settings=OrientationSettings(EVERYTHING))
    np.testing.assert_allclose(found.rotation, ground_from_photo(alpha, omega, kappa), atol=1e-11)
    np.testing.assert_allclose(found.values[3:], [F, *CENTRE], atol=1e-8)
    assert (found.principal_distance, found.principal_point) == (found.values[3], tuple(found.values[4:]))
    assert found.weighted_sum < 1e-10
    assert not found.rejected


@pytest.mark.parametrize("free", [(), ("principal-distance",), EVERYTHING])
def test_the_estimate_is_that_of_a_full_adjustment(free: tuple[str, ...]) -> None:
    """An optimiser moves true image points as well as the unknowns: nothing of the covariance algebra is used."""
    from scipy.optimize import least_squares

    angles = (0.9, 0.2, -0.1)
    given_ = sightings(angles, seed=11)
    found = orient(given_, F, CENTRE, OrientationSettings(free, screening="none"))
    count = len(found.names)

    def misfit(unknown: Floats) -> Floats:
        values = dict(zip(found.names, unknown[:count] * ([1] * 3 + [F] * (count - 3)), strict=True))
        true = unknown[count:].reshape(-1, 2)
        shifted = true - [values.get("x0", CENTRE[0]), values.get("z0", CENTRE[1])] + np.array(CENTRE)
        turn = (values["alpha"], values["omega"], values["kappa"])
        computed = directions(shifted, turn, values.get("f", F))
        image = (given_.xz - true) / SIGMA_XZ
        angle = np.angle(np.exp(1j * (given_.directions - computed))) / SIGMA_DIRECTION
        return np.concatenate([image.ravel(), angle.ravel()])

    start = np.concatenate([[*angles, 1.0, *(np.array(CENTRE) / F)][:count], given_.xz.ravel()])
    solved = least_squares(misfit, start, xtol=1e-15, ftol=1e-15, gtol=1e-15, x_scale="jac")
    scale = np.array([1] * 3 + [F] * (count - 3))
    jac = np.asarray(solved.jac, float)
    covariance = np.linalg.inv(jac.T @ jac)[:count, :count] * np.outer(scale, scale)
    np.testing.assert_allclose((solved.x[:count] * scale - found.values) / found.sigma, 0.0, atol=1e-3)
    correlation = covariance / np.outer(found.sigma, found.sigma)  # second-order terms of the noise make 1e-4
    np.testing.assert_allclose(found.cofactors / np.outer(found.sigma, found.sigma), correlation, atol=1e-3)
    assert 2 * solved.cost == pytest.approx(found.weighted_sum, rel=1e-3)


@pytest.mark.slow
def test_stated_precision_is_the_scatter_of_repeated_measurements() -> None:
    angles, settings = (1.2, 0.25, -0.15), OrientationSettings(EVERYTHING)
    truth = np.array([*angles, F, *CENTRE])
    rows = orthogonal_normal(np.random.default_rng(1), 10 * PLACES.size, 2 * PLACES.size)  # five blocks
    found = [orient(sightings(angles, drawn=row), 100.0, settings=settings) for row in rows]
    errors = np.array([(each.values - truth) / each.sigma for each in found])
    assert np.abs(errors.mean(axis=0)).max() < 0.23
    spread = errors.std(axis=0)
    assert spread.min() > 0.88
    assert spread.max() < 1.12
    assert np.mean([each.weighted_sum / each.dof for each in found]) == pytest.approx(1.0, abs=0.05)
    inside = [each.sigma0_range(0.1)[0] < each.sigma0 < each.sigma0_range(0.1)[1] for each in found]
    assert 0.85 < np.mean(inside) < 0.95


@pytest.mark.slow
@pytest.mark.parametrize("method", ["deletion", "stated"])
def test_clean_photos_lose_points_as_rarely_as_stated(method: str) -> None:
    settings = OrientationSettings(("principal-distance",), method)
    lost = [bool(orient(sightings((0.3, 0.1, 0.0), seed), 100.0, CENTRE, settings).rejected) for seed in range(150)]
    assert 0.02 < np.mean(lost) < 0.08


@pytest.mark.parametrize("method", ["deletion", "stated"])
@pytest.mark.parametrize("point", [0, 4, 7])
@pytest.mark.parametrize("image", [(0.1, 0.0), (0.0, -0.1)])
def test_a_gross_error_is_found_and_named(method: str, point: int, image: tuple[float, float]) -> None:
    angles = (0.3, 0.1, 0.0)
    found = orient(spoiled(sightings(angles, 5), point, image), F, CENTRE, OrientationSettings(screening=method))
    (rejected,) = found.rejected
    assert (rejected.row, rejected.test) == (point, method)
    assert not found.used[point]
    size = np.linalg.norm(rejected.size)  # 0.1 mm at a distance of 100 mm and more, in radians
    assert 0.4 * 0.1 / F < size < 1.6 * 0.1 / F
    assert found.sigma0 < 1.6
    np.testing.assert_allclose(found.values, angles, atol=6 * found.sigma.max())


def test_too_few_directions_are_refused() -> None:
    with pytest.raises(GeometryError, match=r"1 point with 2 directions cannot determine alpha, omega, kappa"):
        orient(sightings((0.3, 0.1, 0.0), places=PLACES[:1]), F)
    with pytest.raises(GeometryError, match=r"2 points with 4 directions cannot determine .*, f, x0, z0"):
        orient(sightings((0.3, 0.1, 0.0), places=PLACES[[0, 8]]), F, settings=OrientationSettings(EVERYTHING))


def test_what_the_points_cannot_separate_is_named() -> None:
    close = np.array([(0.0, 0.0), (0.001, 0.001), (0.0, 0.001), (0.001, 0.0)])
    with pytest.raises(GeometryError, match=r"cannot separate .*(f|x0|z0)") as error:
        orient(sightings((0.3, 0.1, 0.0), places=close), F, settings=OrientationSettings(EVERYTHING))
    assert error.value.exit_code == 3
    assert error.value.points == ("P0", "P1", "P2", "P3")


DISTANCES = np.array([40.0, 65.0, 300.0, 1200.0, 55.0, 90.0, 35.0, 48.0, 150.0, 2500.0, 700.0])
RADIUS = 6_371_000.0


def from_the_theodolite(angles: tuple[float, float, float], eccentricity: float, refraction: float = 0.0) -> Sightings:
    """Directions from a theodolite to points that a camera with its node ahead of the axes has photographed.

    Every point is placed on the ray of the node, as far as makes its distance from the axes right.
    """
    turn = attitude(*angles)
    rays = np.column_stack([PLACES[:, 0] - CENTRE[0], np.full(len(PLACES), F), PLACES[:, 1] - CENTRE[1]]) @ turn.T
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    node = eccentricity * turn[:, 1]
    far = np.array([_farther(node, ray, distance) for ray, distance in zip(rays, DISTANCES, strict=True)])
    points = node + far[:, None] * rays
    seen = np.column_stack(
        [np.arctan2(points[:, 0], points[:, 1]), np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1]))]
    )
    seen[:, 1] -= refraction * DISTANCES / (2 * RADIUS)
    return replace(sightings(angles), directions=seen, distances=DISTANCES)


def _farther(node: Floats, ray: Floats, distance: float) -> float:
    """Find how far a ray goes from the node until it is so far from the axes, by halving."""
    near, far = 0.0, 2 * distance
    for _ in range(80):
        middle = (near + far) / 2
        near, far = (middle, far) if np.linalg.norm(node + middle * ray) < distance else (near, middle)
    return near


@pytest.mark.parametrize("eccentricity", [0.12, -0.08])
def test_a_node_ahead_of_the_axes_is_taken_into_account(eccentricity: float) -> None:
    angles = (0.4, 0.08, -0.02)
    given_ = from_the_theodolite(angles, eccentricity)
    found = orient(given_, F, CENTRE, OrientationSettings(eccentricity=eccentricity))
    assert found.values == pytest.approx(np.array(angles), abs=1e-11)
    assert np.abs(found.residuals).max() < 1e-11
    left_out = orient(given_, F, CENTRE, OrientationSettings(screening="none"))
    assert np.abs(left_out.residuals).max() > 30 * ARCSECOND
    everything = orient(given_, F - 0.4, settings=OrientationSettings(EVERYTHING, eccentricity=eccentricity))
    assert everything.values[3:] == pytest.approx(np.array([F, *CENTRE]), abs=1e-7)
