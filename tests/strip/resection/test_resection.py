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
