"""Estimates, cofactors and redundancy numbers against a dense adjustment that was written apart."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.geometry.rotation import from_vector
from photostrip.network.adjustment import solve
from photostrip.network.problem import AttitudeObservations, BundleProblem, ControlObservations, PositionObservations
from photostrip.network.reliability import cofactors_of
from photostrip.simulation import Control as SimulatedControl
from photostrip.simulation import Flight, Points, Spec, simulate
from tests.bundles import dense
from tests.simulated_bundle import problem_of, truth_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from photostrip.network.adjustment import BundleSolution, Cofactors
    from tests.bundles import Dense

    Floats = NDArray[np.float64]

SAME = 1e-8  # of the standard deviations
NO_STEP = 1e-5  # standard deviations: what a further step would still move

LENS = np.zeros((1, 10))
LENS[0, [0, 1, 2, 6, 7, 8, 9]] = np.inf
LENS[0, [3, 4]] = 1e-8, 1e-12
HELD_LENS = np.where(np.isinf(LENS), [[0.02, 0.02, 0.02, 0, 0, 0, 1e-6, 1e-6, 1e-4, 1e-4]], LENS)


@cache
def strip(photos: int = 6, strips: int = 1) -> BundleProblem:
    """Make a small strip or block on the real Earth, with noise."""
    spec = Spec(
        flight=Flight(photos=photos, strips=strips),
        points=Points(rows=3, extra_per_model=2),
        control=SimulatedControl(bands=2),
    )
    return problem_of(simulate(spec))


def with_everything() -> BundleProblem:
    """Give the strip camera positions with offset and drift, attitudes and a camera to be calibrated."""
    problem = strip()
    random = np.random.default_rng(1)
    m = problem.photos
    spec = Spec(flight=Flight(photos=6), points=Points(rows=3, extra_per_model=2), control=SimulatedControl(bands=2))
    truth = truth_of(simulate(spec))
    lever = np.tile([0.1, 0.2, 1.0], (m, 1))
    antenna = truth.centers + np.einsum("nij,nj->ni", truth.rotations, lever)
    positions = PositionObservations(
        photo=np.arange(m),
        xyz=antenna + random.normal(0.0, 0.1, (m, 3)) + [1.0, 2.0, 3.0],
        axes=np.tile(problem.control.axes[0], (m, 1, 1)),
        sigma=np.full((m, 3), 0.1),
        lever=lever,
        group=np.array([0, 0, 0, 1, 1, -1]),
        time=np.arange(m, dtype=float) - 2.5,
        offset_sigma=np.array([[np.inf, np.inf, np.inf], [0.0, np.inf, 2.0]]),
        drift_sigma=np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 1.0]]),
    )
    attitudes = AttitudeObservations(
        np.arange(1, m),
        (truth.rotations @ from_vector(random.normal(0.0, 1e-4, (m, 3))))[1:],
        np.tile([1e-4, 2e-4, np.inf], (m - 1, 1)),
    )
    return replace(problem, positions=positions, attitudes=attitudes, cameras=replace(problem.cameras, sigma=LENS))


def with_height_only() -> BundleProblem:
    """Let half of the control count in height only, the rest in plan only, one in all."""
    problem = strip()
    sigma = problem.control.sigma.copy()
    sigma[1::2, :2] = np.inf
    sigma[2::2, 2] = np.inf
    return replace(problem, control=replace(problem.control, sigma=sigma))


PROBLEMS: dict[str, Callable[[], BundleProblem]] = {
    "control": strip,
    "block": lambda: strip(4, 2),
    "plan and height apart": with_height_only,
    "free": lambda: replace(strip(), control=ControlObservations()),
    "free block, calibrated": lambda: replace(
        strip(4, 2), control=ControlObservations(), cameras=replace(strip(4, 2).cameras, sigma=HELD_LENS)
    ),
    "calibrated": lambda: replace(strip(), cameras=replace(strip().cameras, sigma=LENS)),
    "everything": with_everything,
}


@cache
def adjusted(name: str) -> tuple[BundleProblem, BundleSolution, Cofactors, Dense]:
    """Adjust a problem, and once more without any zero left out."""
    problem = PROBLEMS[name]()
    solution = solve(problem)
    return problem, solution, cofactors_of(solution), dense(problem, solution)


def against(found: Floats, expected: Floats) -> float:
    """Largest difference of covariances in units of the standard deviations."""
    deviation = np.sqrt(np.einsum("nii->ni", expected))
    return float(np.abs((found - expected) / (deviation[:, :, None] * deviation[:, None, :])).max())


@pytest.mark.slow
@pytest.mark.parametrize("name", PROBLEMS)
def test_estimate_and_cofactors_are_those_of_a_dense_adjustment(name: str) -> None:
    problem, solution, found, expected = adjusted(name)
    m, q, n, p = problem.photos, problem.points, len(problem.images), len(solution.common)
    cofactors = expected.cofactors
    deviations = np.sqrt(np.diag(cofactors))

    further = cofactors @ (expected.derivatives.T @ expected.misfit)
    assert np.abs(further / deviations).max() < NO_STEP
    assert solution.chi_square == pytest.approx(float(expected.misfit @ expected.misfit), rel=1e-9)
    images = solution.image_residuals / problem.images.sigma
    np.testing.assert_allclose(images.ravel(), expected.misfit[: 2 * n], atol=1e-9)

    own = cofactors[: 6 * m, : 6 * m].reshape(m, 6, m, 6)[range(m), :, range(m)]
    assert against(found.photos, own) < SAME
    of_points = cofactors[6 * m : 6 * m + 3 * q, 6 * m : 6 * m + 3 * q].reshape(q, 3, q, 3)
    assert against(found.points, of_points[range(q), :, range(q)]) < SAME
    if p:
        assert against(found.common[None], cofactors[None, -p:, -p:]) < SAME
        mixed = cofactors[: 6 * m, -p:] / np.outer(deviations[: 6 * m], deviations[-p:])
        scaled = found.photo_common.reshape(6 * m, p) / np.outer(deviations[: 6 * m], deviations[-p:])
        np.testing.assert_allclose(scaled, mixed, atol=SAME)


@pytest.mark.slow
@pytest.mark.parametrize("name", PROBLEMS)
def test_redundancy_numbers_are_those_of_a_dense_adjustment(name: str) -> None:
    problem, solution, found, whole = adjusted(name)
    expected, done = whole.of_misfits(), 0
    for cofactors, sigma in (
        (found.image_residuals, problem.images.sigma),
        (found.control_residuals, problem.control.sigma),
        (found.position_residuals, problem.positions.sigma),
        (found.attitude_residuals, problem.attitudes.sigma),
    ):
        rows, size = sigma.shape
        block = expected[done : done + rows * size, done : done + rows * size].reshape(rows, size, rows, size)
        scaled = cofactors / (sigma[:, :, None] * sigma[:, None, :])
        given = np.isfinite(sigma)
        both = given[:, :, None] & given[:, None, :]
        np.testing.assert_allclose(scaled[both], block[range(rows), :, range(rows)][both], atol=SAME)
        done += rows * size
    weighted = np.isfinite(solution.prepared.prior)
    parts = found.common_residuals[weighted] / solution.prepared.prior[weighted] ** 2
    np.testing.assert_allclose(parts, np.diag(expected)[done:][weighted], atol=SAME)
    every = [
        np.where(np.isfinite(sigma), np.einsum("nii->ni", cofactors) / sigma**2, 0.0).sum()
        for cofactors, sigma in (
            (found.image_residuals, problem.images.sigma),
            (found.control_residuals, problem.control.sigma),
            (found.position_residuals, problem.positions.sigma),
            (found.attitude_residuals, problem.attitudes.sigma),
        )
    ]
    assert sum(every) + parts.sum() == pytest.approx(solution.redundancy, abs=1e-5)


def test_thousands_of_photos_without_control_keep_their_redundancy_numbers() -> None:
    flight = Flight(photos=3000, scale=3000.0)
    simulation = simulate(Spec(flight=flight, control=SimulatedControl(every=1000, check=0)))
    solution = solve(replace(problem_of(simulation, shift=0.1, turn=1e-4), control=ControlObservations()), rough=True)
    images = solution.prepared.problem.images
    numbers = np.diagonal(cofactors_of(solution).image_residuals, axis1=1, axis2=2) / images.sigma**2
    assert numbers.sum() == pytest.approx(solution.redundancy, rel=2e-3)
