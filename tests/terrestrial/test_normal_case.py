"""Convergent photos brought to the normal case: collinearity, an independent intersection, differences."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from photostrip.errors import GeometryError
from photostrip.simulation.draws import Draws, Purpose
from photostrip.terrestrial.normal_case import (
    StereoPair,
    ground_from_photo,
    intersect,
    meeting_z,
    small_turn,
    to_normal,
)
from tests.terrestrial.simulated import CENTERS, FOCAL, SIGMA, attitude, photo, world

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

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


# ---------------------------------------------------------------------------------------------------- degenerate


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
