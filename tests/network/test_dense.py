"""Bundle adjustments against a dense one that was written apart, and against Ceres; bands against dense algebra."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass, replace
from functools import cache
from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from photostrip.camera import Camera
from photostrip.geometry.rotation import from_vector
from photostrip.network.adjustment import solve
from photostrip.network.normal_equations import Band
from photostrip.network.observations import corrections
from photostrip.network.problem import (
    ASKED,
    CALIBRATION,
    AttitudeObservations,
    BundleProblem,
    ControlObservations,
    PositionObservations,
)
from photostrip.network.reliability import cofactors_of
from photostrip.simulation import Control as SimulatedControl
from photostrip.simulation import Flight, Points, Spec, simulate
from tests.peer import FILE, SHAPES, problem
from tests.simulated_bundle import problem_of, truth_of
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from photostrip.arrays import Floats
    from photostrip.network.adjustment import BundleSolution, Cofactors
    from photostrip.simulation import Simulation


# Steps of the differences by parameter.
STEPS = {"k1": 1e-9, "k2": 1e-13, "k3": 1e-17, "p1": 1e-7, "p2": 1e-7, "affinity": 1e-5, "shear": 1e-5}  # else 1e-2
SUBSTITUTIONS = 12  # each leaves a hundredth of what was left, or less
METRES, RADIANS = 0.1, 1e-5


@dataclass(frozen=True, eq=False)
class Dense:
    """Misfits in units of sigma, their derivatives by all parameters, and the inverse normal matrix."""

    misfit: Floats
    derivatives: Floats
    cofactors: Floats


def misfits(problem: BundleProblem, centers: Floats, rotations: Floats, points: Floats, common: Floats) -> Floats:
    """Measured minus computed, of everything, in units of sigma."""
    images, control, attitudes = problem.images, problem.control, problem.attitudes
    names = problem.common_names()
    camera = problem.cameras.of_photo[images.photo]
    ray = np.einsum("mi,mij->mj", points[images.point] - centers[images.photo], rotations[images.photo])
    found = images.xy
    for _ in range(SUBSTITUTIONS if common.any() else 1):  # the image point whose corrected one is computed
        focal, bend = _bent(problem, found, common, camera)
        found = -focal[:, None] * ray[:, :2] / ray[:, 2:] - bend
    image = (images.xy - found) / images.sigma
    ground = np.einsum("nij,nj->ni", control.axes, points[control.point] - control.xyz) / control.sigma
    drifts = common[sum(name.startswith("camera") for name in names) :]
    places = _place_misfits(problem.positions, centers, rotations, drifts)
    turn = Rotation.from_matrix(np.swapaxes(attitudes.rotations, 1, 2) @ rotations[attitudes.photo]).as_rotvec()
    sigmas = (problem.cameras.sigma, problem.positions.offset_sigma, problem.positions.drift_sigma)
    prior = np.concatenate([each[each > 0.0] for each in sigmas if each is not None])
    parts = (image, -ground, -places, -turn / attitudes.sigma, -common / prior)
    return np.concatenate([each.ravel() for each in parts])


def _bent(problem: BundleProblem, xy: Floats, common: Floats, camera: NDArray[np.intp]) -> tuple[Floats, Floats]:
    """Principal distances of the rays and corrections of image points; distortion is about the principal point."""
    center = np.zeros((len(camera), 2))
    for name, value in zip(problem.common_names(), common, strict=True):
        title, _, kind = name.partition(": ")
        if kind.startswith("principal point"):
            center[camera == int(title.rpartition(" ")[2]), "xy".index(kind[-1])] = value
    x, y = (xy - center).T
    r2 = x**2 + y**2
    zero = np.zeros_like(x)
    focal = problem.cameras.focal[camera].astype(float)
    bend = np.zeros((len(x), 2))
    kinds = {
        "principal point x": (zero - 1, zero),
        "principal point y": (zero, zero - 1),
        "k1": (x * r2, y * r2),
        "k2": (x * r2**2, y * r2**2),
        "k3": (x * r2**3, y * r2**3),
        "p1": (r2 + 2 * x**2, 2 * x * y),
        "p2": (2 * x * y, r2 + 2 * y**2),
        "affinity": (x, zero),
        "shear": (y, zero),
    }
    for name, value in zip(problem.common_names(), common, strict=True):
        if name.startswith("camera"):
            title, _, kind = name.partition(": ")
            own = camera == int(title.rpartition(" ")[2])
            if kind == "principal distance":
                focal += value * own
            else:
                bend += value * np.stack(kinds[kind], axis=1) * own[:, None]
    return focal, bend


def _place_misfits(positions: PositionObservations, centers: Floats, rotations: Floats, drifts: Floats) -> Floats:
    if not len(positions):
        return np.zeros((0, 3))
    values = iter(drifts)
    none = [0.0] * 3
    offset = np.array([*([next(values) if s > 0 else 0.0 for s in row] for row in positions.offset_sigma), none])
    drift = np.array([*([next(values) if s > 0 else 0.0 for s in row] for row in positions.drift_sigma), none])
    antenna = centers[positions.photo] + np.einsum("nij,nj->ni", rotations[positions.photo], positions.lever)
    residual = np.einsum("nij,nj->ni", positions.axes, antenna - positions.xyz)
    residual -= offset[positions.group] + drift[positions.group] * positions.time[:, None]
    found: Floats = residual / positions.sigma
    return found


def dense(problem: BundleProblem, solution: BundleSolution) -> Dense:
    """Linearise at a solution by differences, and invert; a free network under inner constraints on the points."""
    photos, points, common = problem.photos, problem.points, len(solution.common)

    def at(step: Floats) -> Floats:
        own = step[: 6 * photos].reshape(photos, 6)
        return misfits(
            problem,
            solution.centers + own[:, :3],
            Rotation.from_rotvec(own[:, 3:]).as_matrix() @ solution.rotations,
            solution.points + step[6 * photos : 6 * photos + 3 * points].reshape(points, 3),
            solution.common + step[6 * photos + 3 * points :],
        )

    lengths = np.concatenate(
        [
            np.tile([METRES] * 3 + [RADIANS] * 3, photos),
            np.full(3 * points, METRES),
            [STEPS.get(name.partition(": ")[2], 1e-2) for name in problem.common_names()],
        ]
    )
    size = 6 * photos + 3 * points + common
    columns = []
    for n in range(size):  # minus the derivatives by four values: exact to the fourth order
        step = np.eye(1, size, n)[0] * lengths[n]
        near, far = at(step) - at(-step), at(2 * step) - at(-2 * step)
        columns.append(-(8 * near - far) / (12 * lengths[n]))
    derivatives = np.stack(columns, axis=1)
    scale = 1.0 / np.sqrt((derivatives**2).sum(axis=0))
    normal = (derivatives * scale).T @ (derivatives * scale)
    if solution.free:
        conditions = _similarities(solution) * scale[:, None]
        conditions /= np.sqrt((conditions**2).sum(axis=0))
        normal = np.block([[normal, conditions], [conditions.T, np.zeros((7, 7))]])
    inverse = np.linalg.inv(normal)[:size, :size]
    return Dense(at(np.zeros(size)), derivatives, inverse * np.outer(scale, scale))


def _similarities(solution: BundleSolution) -> Floats:
    """Movements of the points by shift, rotation and scale about their mean; rows of all parameters."""
    places = solution.points - solution.points.mean(axis=0)
    moves = np.zeros((len(places), 3, 7))
    moves[:, range(3), range(3)] = 1.0
    for axis in range(3):
        moves[:, :, 3 + axis] = np.cross(np.eye(3)[axis], places)
    moves[:, :, 6] = places
    photos, common = np.zeros((6 * len(solution.centers), 7)), np.zeros((len(solution.common), 7))
    return np.concatenate([photos, moves.reshape(-1, 7), common])


SAME = 1e-8  # of the standard deviations
NO_STEP = 1e-5  # standard deviations: what a further step would still move

LENS = np.zeros((1, 10))
LENS[0, [0, 1, 2, 6, 7, 8, 9]] = np.inf
LENS[0, [3, 4]] = 1e-8, 1e-12
HELD_LENS = np.where(np.isinf(LENS), [[0.02, 0.02, 0.02, 0, 0, 0, 1e-6, 1e-6, 1e-4, 1e-4]], LENS)


@cache
def flown(photos: int, strips: int) -> Simulation:
    flight, points = Flight(photos=photos, strips=strips), Points(rows=3, extra_per_model=2)
    return simulate(Spec(flight=flight, points=points, control=SimulatedControl(bands=2)))


@cache
def strip(photos: int = 6, strips: int = 1) -> BundleProblem:
    """Make a small strip or block on the real Earth, with noise."""
    return problem_of(flown(photos, strips))


def with_everything() -> BundleProblem:
    """Give the strip camera positions with offset and drift, attitudes and a camera to be calibrated."""
    problem = strip()
    random = np.random.default_rng(1)
    m = problem.photos
    truth = truth_of(flown(6, 1))
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
    expected, done, every = (
        np.eye(len(whole.misfit)) - whole.derivatives @ whole.cofactors @ whole.derivatives.T,
        0,
        0.0,
    )
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
        every += np.einsum("nii->ni", scaled)[given].sum()
    weighted = np.isfinite(solution.prepared.prior)
    parts = found.common_residuals[weighted] / solution.prepared.prior[weighted] ** 2
    np.testing.assert_allclose(parts, np.diag(expected)[done:][weighted], atol=SAME)
    assert every + parts.sum() == pytest.approx(solution.redundancy, abs=1e-5)


def test_thousands_of_photos_without_control_keep_their_redundancy_numbers() -> None:
    flight = Flight(photos=3000, scale=3000.0)
    simulation = simulate(Spec(flight=flight, control=SimulatedControl(every=1000, check=0)))
    solution = solve(replace(problem_of(simulation, shift=0.1, turn=1e-4), control=ControlObservations()), rough=True)
    images = solution.prepared.problem.images
    numbers = np.diagonal(cofactors_of(solution).image_residuals, axis1=1, axis2=2) / images.sigma**2
    assert numbers.sum() == pytest.approx(solution.redundancy, rel=2e-3)


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 27), st.integers(0, 12), st.integers(0, 1000))
def test_a_band_is_factored_solved_and_inverted(photos: int, near: int, seed: int) -> None:
    size, near = 6 * photos, min(near, photos - 1)
    width = 6 * (near + 1) - 1
    random = np.random.default_rng(seed)
    root = np.triu(np.tril(random.normal(size=(size, size))), -width) + (width + 2.0) * np.eye(size)
    matrix = root @ root.T
    row, column = np.tril_indices(size)
    within = row - column <= width
    row, column = row[within], column[within]
    band = Band(size, width, 6)
    band.flat[band.place(row, column)] = matrix[row, column]
    assert band.factor()
    right = np.random.default_rng(seed).normal(size=(size, 3))
    np.testing.assert_allclose(band.solve(right), np.linalg.solve(matrix, right), rtol=1e-8, atol=1e-12)
    inverse = np.linalg.inv(matrix).reshape(photos, 6, photos, 6).swapaxes(1, 2)
    one, other = np.indices((photos, photos))
    held = band.holds(one, other)
    assert (held == (np.abs(one - other) <= near)).all()
    np.testing.assert_allclose(band.inverse().blocks(one[held], other[held]), inverse[held], rtol=1e-8, atol=1e-12)


def test_what_is_not_positive_definite_is_told() -> None:
    band = Band(3, 1, 1)
    band.flat[band.place(np.arange(3), np.arange(3))] = [1.0, -1.0, 1.0]
    assert not band.factor()


SAME_AS_CERES = 1e-6  # of the standard deviations


def compare(name: str, expected: dict[str, list[list[float]]]) -> None:
    """Compare one problem with a solution by Ceres."""
    solution = solve(problem(name))
    cofactors = cofactors_of(solution)
    seen = ~np.isnan(cofactors.points[:, 0, 0])
    of_points = np.sqrt(np.einsum("nii->ni", cofactors.points[seen]))
    of_photos = np.sqrt(np.einsum("nii->ni", cofactors.photos[:, :3, :3]))
    points, centers = np.array(expected["points"]), np.array(expected["centers"])
    assert np.abs((solution.points - points)[seen] / of_points).max() < SAME_AS_CERES
    assert np.abs((solution.centers - centers) / of_photos).max() < SAME_AS_CERES


@pytest.mark.parametrize("name", SHAPES)
def test_the_estimate_is_that_of_ceres(name: str) -> None:
    compare(name, json.loads(FILE.read_text(encoding="utf-8"))[name])


@pytest.mark.slow
@pytest.mark.skipif(find_spec("pyceres") is None or find_spec("pycolmap") is None, reason="the extra peer is missing")
def test_ceres_still_finds_what_is_kept() -> None:
    command = [sys.executable, "-m", "tests.peer", "--print"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True, timeout=120)
    for name, expected in json.loads(done.stdout).items():
        compare(name, expected)


def test_corrections_grow_with_the_distance_by_the_powers_of_the_table() -> None:
    xy = np.array([30.0, -50.0])
    powers = [each.power for each in CALIBRATION.values()]
    assert corrections(2 * xy) == pytest.approx(2.0 ** np.array(powers)[:, None] * corrections(xy))


def test_units_make_millimetres_of_what_a_user_asks_for() -> None:
    assert ASKED == ("principal_distance", "principal_point", "k1", "k2", "k3", "p1", "p2", "affinity", "shear")
    units = {name: (each.title, each.unit) for name, each in CALIBRATION.items()}
    assert [units[name] for name in ("c", "y0", "k2", "p1", "b2")] == [
        ("principal_distance", "mm"), ("principal_point y", "mm"), ("k2", "mm^-4"), ("p1", "mm^-1"), ("shear", "1"),
    ]  # fmt: skip


@pytest.mark.parametrize("kind", ["k1", "b1"])
def test_measuring_errors_make_no_distortion(kind: str) -> None:
    """Of the same errors with both signs: what the mean keeps is what their squares have made."""
    wide = Camera("wide", principal_distance=8.8, format=(13.2, 8.8))
    flight = Flight(photos=10, strips=3, end_lap_percent=80.0, side_lap_percent=70.0, flying_height=90.0)
    simulation = simulate(Spec(camera=wide, flight=flight))
    problem, truth = problem_of(simulation, shift=0.01, turn=1e-5), simulation.truth
    free = np.where(np.array(list(CALIBRATION)) == kind, np.inf, 0.0)
    exact = (truth.points.xyz - truth.points.xyz.mean(axis=0))[problem.control.point]
    problem = replace(problem, cameras=replace(problem.cameras, sigma=free[None]))
    problem = replace(problem, control=replace(problem.control, xyz=exact))
    rays = np.bincount(simulation.observations.point)[simulation.observations.point] > 1
    errors = problem.images.sigma * np.random.default_rng(1).normal(size=problem.images.xy.shape)
    both = [
        solve(replace(problem, images=replace(problem.images, xy=truth.image[rays] + sign * errors)))
        for sign in (1.0, -1.0)
    ]
    sigma = np.sqrt(cofactors_of(both[0]).common[0, 0])
    assert np.mean([each.common[0] for each in both]) == pytest.approx(0.0, abs=0.05 * sigma)
