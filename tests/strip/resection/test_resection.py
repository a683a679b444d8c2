"""Space resection: the truth from poor starts, residuals as large as the noise, photos that cannot be oriented."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from photostrip.strip import resection
from photostrip.strip.resection import KnownPhotos, Resection, project, resect
from tests.strips import MICROMETRE, attitude, photograph

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]

SEEDS = st.integers(0, 2**32 - 1)
FOCAL = 153.0
HEIGHT = 1530.0  # m above the ground


@dataclass(frozen=True, eq=False)
class Scene:
    """Photos and the points that each of them shows."""

    xy: Floats
    points: Floats
    photo: Numbers
    focal: Floats
    centers: Floats
    rotations: Floats

    @property
    def photos(self) -> KnownPhotos:
        return KnownPhotos(self.centers, self.rotations, self.focal)

    def start(self, rng: np.random.Generator, metres: float, degrees: float) -> KnownPhotos:
        """Orientations that are wrong by up to so much."""
        n = len(self.centers)
        turn = Rotation.from_rotvec(np.radians(rng.uniform(-degrees, degrees, (n, 3)))).as_matrix()
        return KnownPhotos(self.centers + rng.uniform(-metres, metres, (n, 3)), turn @ self.rotations, self.focal)

    def resect(self, start: KnownPhotos) -> Resection:
        return resect(self.xy, self.points, self.photo, start)


def scene(seed: int, counts: list[int], sigma: float = 0.0, *, relief: float = 100.0, tilt: float = 5.0) -> Scene:
    rng = np.random.default_rng(seed)
    n = len(counts)
    centers = np.column_stack([rng.uniform(-500, 500, (n, 2)) + 5e5, np.full(n, HEIGHT)])
    rotations = attitude(np.column_stack([rng.uniform(-tilt, tilt, (n, 2)), rng.uniform(-180, 180, n)]))
    focal: Floats = FOCAL + np.arange(n, dtype=np.float64)
    points, images = [], []
    for number, count in enumerate(counts):
        ground = np.column_stack([rng.uniform(-900, 900, (count, 2)), rng.uniform(-relief, relief, count)])
        ground[:, :2] += centers[number, :2]
        points.append(ground)
        images.append(photograph(ground, centers[number], rotations[number], focal[number]))
    xy = np.concatenate(images)
    xy = xy + rng.normal(0, sigma, xy.shape) if sigma else xy
    return Scene(xy, np.concatenate(points), np.repeat(np.arange(n), counts), focal, centers, rotations)


# ----------------------------------------------------------------------------------------- projection


@given(SEEDS)
def test_the_projection_is_central(seed: int) -> None:
    one = scene(seed, [5, 7])
    assert np.allclose(project(one.points, one.photos, one.photo), one.xy, rtol=0, atol=1e-9)
    along = one.centers[one.photo] + 2.5 * (one.points - one.centers[one.photo])
    again = project(along, one.photos, one.photo)
    assert np.allclose(again, one.xy, rtol=0, atol=1e-9)


# ------------------------------------------------------------------------------------ back to the truth


@given(SEEDS)
def test_the_truth_comes_back_from_poor_starts(seed: int) -> None:
    one = scene(seed, [6, 9, 30])
    found = one.resect(one.start(np.random.default_rng(seed), metres=0.1 * HEIGHT, degrees=8.0))
    assert found.solved.all()
    assert np.abs(found.centers - one.centers).max() < 1e-6  # metres
    assert np.abs(found.rotations - one.rotations).max() < 1e-9
    assert found.rms.max() < 1e-8
    assert np.allclose(found.rotations @ found.rotations.transpose(0, 2, 1), np.eye(3), rtol=0, atol=1e-12)


def test_most_starts_will_do() -> None:
    one = scene(1, [12] * 300)
    found = one.resect(one.start(np.random.default_rng(2), metres=0.3 * HEIGHT, degrees=15.0))
    right = np.linalg.norm(found.centers - one.centers, axis=1) < 1e-5
    assert right.mean() > 0.99
    assert found.solved[right].all()


def test_four_points_are_enough_with_a_good_start() -> None:
    one = scene(3, [4, 4, 4])
    found = one.resect(one.start(np.random.default_rng(3), metres=5.0, degrees=0.3))
    assert found.solved.all()
    assert np.abs(found.centers - one.centers).max() < 1e-5


def test_level_ground_is_no_special_case() -> None:
    one = scene(4, [10, 10], relief=0.0)
    found = one.resect(one.start(np.random.default_rng(3), metres=50.0, degrees=3.0))
    assert np.abs(found.centers - one.centers).max() < 1e-6


# --------------------------------------------------------------------------------------------- with noise


def test_residuals_are_as_large_as_the_noise() -> None:
    sigma, n = 5 * MICROMETRE, 25
    one = scene(5, [n] * 200, sigma)
    found = one.resect(one.photos)
    assert found.solved.all()
    variance = (found.rms**2).mean() * 2 * n / (2 * n - 6)
    assert variance / sigma**2 == pytest.approx(1, abs=0.05)  # of 200 photos with 44 degrees of freedom: 1.5 percent
    residuals = one.xy - project(one.points, KnownPhotos(found.centers, found.rotations, one.focal), one.photo)
    assert np.allclose(found.residuals, residuals, rtol=0, atol=1e-12)  # measured minus computed
    by_photo = np.sqrt((found.residuals**2).sum(axis=1).reshape(200, n).mean(axis=1) / 2)
    assert np.allclose(found.rms, by_photo, rtol=1e-9, atol=0)
    assert np.abs(found.centers - one.centers).max() > 1e-3  # the noise is really there


@pytest.mark.parametrize("seed", range(4))
def test_an_optimiser_finds_the_same(seed: int) -> None:
    one = scene(seed, [9], 10 * MICROMETRE)

    def misfit(unknowns: Floats) -> Floats:
        turn = Rotation.from_rotvec(unknowns[3:]).as_matrix() @ one.rotations[0]
        center = one.centers[0] + unknowns[:3] * HEIGHT
        return (one.xy - photograph(one.points, center, turn, one.focal[0])).ravel()

    theirs = least_squares(misfit, np.zeros(6), xtol=1e-15, ftol=1e-15, gtol=1e-15, x_scale="jac")
    found = one.resect(one.start(np.random.default_rng(seed), metres=20.0, degrees=1.0))
    assert np.allclose(found.centers[0], one.centers[0] + theirs.x[:3] * HEIGHT, rtol=0, atol=1e-4)
    assert (found.residuals**2).sum() == pytest.approx(2 * theirs.cost, rel=1e-9)
    gradient = np.concatenate([differences(one, found, axis) for axis in range(6)])
    assert np.abs(gradient).max() < 1e-8  # no orientation nearby has smaller residuals


@given(SEEDS)
def test_a_step_is_that_of_derivatives_taken_as_differences(seed: int) -> None:
    one = scene(seed, [7, 5], 50 * MICROMETRE)
    start = one.start(np.random.default_rng(seed), metres=30.0, degrees=2.0)
    centers, rotations, _ = start
    distance, segments = np.array([1500.0, 1400.0]), (np.array([0, 1]), np.array([0, 7]))
    found = resection._steps(one.xy, one.points, one.photo, start, distance, segments)
    for number in range(2):
        rows = one.photo == number

        def computed(change: Floats, number: int = number, rows: NDArray[np.bool_] = rows) -> Floats:
            turn = Rotation.from_rotvec(change[3:]).as_matrix() @ rotations[number]
            center = centers[number] + change[:3] * distance[number]
            return photograph(one.points[rows], center, turn, one.focal[number]).ravel()

        steps = np.eye(6) * 1e-5
        jacobian = np.column_stack([(computed(step) - computed(-step)) / 2e-5 for step in steps])
        theirs, *_ = np.linalg.lstsq(jacobian, one.xy[rows].ravel() - computed(np.zeros(6)), rcond=None)
        assert np.allclose(found[number], theirs, rtol=1e-4, atol=1e-7)


def differences(one: Scene, found: Resection, axis: int) -> Floats:
    """Slope of the sum of squares at the solution, for a shift in HEIGHTs or a turn in radians, relative."""
    values = []
    for step in (1e-6, -1e-6):
        change = np.zeros(6)
        change[axis] = step
        turn = Rotation.from_rotvec(change[3:]).as_matrix() @ found.rotations
        center = found.centers + change[:3] * HEIGHT
        values.append(((one.xy - project(one.points, KnownPhotos(center, turn, one.focal), one.photo)) ** 2).sum())
    return np.array([(values[0] - values[1]) / 2e-6 / (one.xy**2).sum()])


# ------------------------------------------------------------------------------------------- invariants


@pytest.mark.slow
@given(SEEDS)
def test_many_photos_at_once_are_what_each_is_alone(seed: int) -> None:
    one = scene(seed, [6, 11, 8], 5 * MICROMETRE)
    start = one.start(np.random.default_rng(seed), metres=30.0, degrees=1.0)
    together = one.resect(start)
    for number in range(3):
        rows = one.photo == number
        alone = resect(
            one.xy[rows],
            one.points[rows],
            np.zeros(rows.sum(), int),
            KnownPhotos(*(each[number : number + 1] for each in start)),
        )
        assert np.allclose(alone.centers[0], together.centers[number], rtol=0, atol=1e-6)
        assert np.allclose(alone.rotations[0], together.rotations[number], rtol=0, atol=1e-9)


@given(SEEDS)
def test_the_frame_of_the_points_does_not_matter(seed: int) -> None:
    one = scene(seed, [8], 5 * MICROMETRE)
    turn = Rotation.random(random_state=seed % 2**31).as_matrix()
    there = resect(one.xy, one.points, one.photo, one.photos)
    turned = KnownPhotos(one.centers @ turn.T, turn @ one.rotations, one.focal)
    moved = resect(one.xy, one.points @ turn.T, one.photo, turned)
    assert np.allclose(there.centers @ turn.T, moved.centers, rtol=0, atol=1e-5)
    assert np.allclose(turn @ there.rotations, moved.rotations, rtol=0, atol=1e-8)
    assert np.allclose(there.residuals, moved.residuals, rtol=0, atol=1e-8)


# ------------------------------------------------------------------------------- photos that keep their start


@pytest.mark.parametrize("few", [0, 1, 3])
def test_a_photo_with_three_points_or_fewer_keeps_its_start(few: int) -> None:
    one = scene(6, [8, few, 9])
    start = one.start(np.random.default_rng(6), metres=20.0, degrees=1.0)
    found = one.resect(start)
    assert found.solved.tolist() == [True, False, True]
    assert np.array_equal(found.centers[1], start[0][1])
    assert np.array_equal(found.rotations[1], start[1][1])
    assert np.abs((found.centers - one.centers)[[0, 2]]).max() < 1e-6
    theirs = one.xy - project(one.points, start, one.photo)
    rows = one.photo == 1
    assert np.allclose(found.residuals[rows], theirs[rows], rtol=0, atol=1e-12)


def test_points_in_one_direction_do_not_orient_a_photo() -> None:
    one = scene(7, [8, 8])
    points = one.points.copy()
    points[8:] = points[8]  # all points of the second photo are the same
    start = one.start(np.random.default_rng(6), metres=20.0, degrees=1.0)
    found = resect(one.xy, points, one.photo, start)
    assert found.solved.tolist() == [True, False]
    assert np.array_equal(found.centers[1], start[0][1])
    assert np.array_equal(found.rotations[1], start[1][1])


def test_starts_are_left_as_they_were() -> None:
    one = scene(8, [8])
    start = one.start(np.random.default_rng(6), metres=20.0, degrees=1.0)
    copies = start[0].copy(), start[1].copy()
    one.resect(start)
    assert np.array_equal(start[0], copies[0])
    assert np.array_equal(start[1], copies[1])
