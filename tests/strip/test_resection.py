"""Resection and intersection: the truth from poor starts and from none, noise, what cannot be oriented."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from photostrip.arrays import Floats, Numbers
from photostrip.errors import GeometryError
from photostrip.geometry.rotation import from_vector
from photostrip.strip.resection import KnownPhotos, Resection, intersect_points, project, resect, space_resection
from tests.draws import orthogonal_normal
from tests.strips import MICROMETRE, attitude, photograph

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


@given(SEEDS)
def test_the_truth_comes_back_from_poor_starts(seed: int) -> None:
    one = scene(seed, [6, 9, 30])
    found = one.resect(one.start(np.random.default_rng(seed), metres=0.1 * HEIGHT, degrees=8.0))
    assert found.solved.all()
    assert np.abs(found.centers - one.centers).max() < 1e-6  # metres
    assert np.abs(found.rotations - one.rotations).max() < 1e-9
    assert found.rms.max() < 1e-8
    assert np.allclose(found.rotations @ found.rotations.transpose(0, 2, 1), np.eye(3), rtol=0, atol=1e-12)


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


F = 153.0


def photographed(seed: int, points: int = 8, tilt: float = 0.1, flat: float = 0.1) -> tuple[np.ndarray, ...]:
    """A photo of random points 1500 m below it: image points, points, centre, rotation."""
    random = np.random.default_rng(seed)
    xyz = np.column_stack([random.uniform(-1000, 1000, (points, 2)), random.uniform(-1, 1, points) * flat * 1500])
    turn = from_vector(random.normal(size=3) * tilt) @ from_vector(np.array([0, 0, random.uniform(-3, 3)]))
    center = np.array([0.0, 0.0, 1500.0]) + random.normal(size=3) * 50
    spin = from_vector(random.normal(size=3))  # the whole scene at any attitude
    xyz, center, turn = xyz @ spin.T, spin @ center, spin @ turn
    xy = project(xyz, KnownPhotos(center[None], turn[None], np.array([F])), np.zeros(points, np.intp))
    return xy, xyz, center, turn


@pytest.mark.slow
@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10**6), st.integers(4, 12), st.sampled_from([0.0, 0.05, 0.4]), st.sampled_from([0.0, 0.02, 0.3]))
def test_a_photo_comes_back_from_its_points(seed: int, points: int, tilt: float, flat: float) -> None:
    xy, xyz, center, turn = photographed(seed, points, tilt, flat)
    try:
        found = space_resection(xy, np.full(xy.shape, 0.005), xyz, F)
    except GeometryError:
        assert points == 4  # four points can lie on one line by chance, or nearly on the circle that fixes no photo
        return
    size = np.sqrt(np.diag(found.covariance)) / 0.005  # metres and radians per millimetre of image
    assert np.abs(found.center - center).max() < 1e-9 * max(size[:3].max(), 1e3)
    assert np.abs(found.rotation - turn).max() < 1e-9 * max(size[3:].max(), 1.0)


@pytest.mark.slow
def test_the_covariance_is_that_of_many_noisy_photos() -> None:
    xy, xyz, center, turn = photographed(5, 10)
    drawn = orthogonal_normal(np.random.default_rng(1), 100, xy.size).reshape(-1, *xy.shape)
    found = [space_resection(xy + 0.005 * each, np.full(xy.shape, 0.005), xyz, F) for each in drawn]
    centers = np.array([each.center for each in found]) - center
    turns = np.array([each.rotation for each in found]) @ turn.T
    vectors = np.column_stack([turns[:, 2, 1], turns[:, 0, 2], turns[:, 1, 0]])
    scatter = np.column_stack([centers, vectors]).std(axis=0)
    stated = np.sqrt(np.diag(found[0].covariance))
    assert scatter / stated == pytest.approx(np.ones(6), abs=0.1)
    assert np.mean([each.sigma0**2 for each in found]) == pytest.approx(1, abs=0.1)


def test_what_does_not_determine_a_photo_is_refused() -> None:
    xy, xyz, _, _ = photographed(2)
    with pytest.raises(GeometryError, match="3 known points cannot orient a photo"):
        space_resection(xy[:3], np.ones((3, 2)), xyz[:3], F)
    line = xyz[0] + np.arange(8)[:, None] * (xyz[1] - xyz[0])
    with pytest.raises(GeometryError, match="on one line"):
        space_resection(xy, np.ones((8, 2)), line, F)


def two_photos(seed: int) -> tuple[np.ndarray, ...]:
    random = np.random.default_rng(seed)
    points = np.column_stack([random.uniform(-600, 600, (20, 2)), random.uniform(-50, 50, 20)])
    centers = np.array([[-450.0, 0, 1500], [450, 10, 1510], [0, 700, 1490]])
    rotations = from_vector(random.normal(size=(3, 3)) * 0.05)
    photo, point = np.repeat(np.arange(3), 20), np.tile(np.arange(20), 3)
    kept = ~((photo == 2) & (point % 3 == 0))
    photo, point = photo[kept], point[kept]
    xy = project(points[point], KnownPhotos(centers, rotations, np.full(3, F)), photo)
    return xy, photo, point, centers, rotations, points


@settings(deadline=None, max_examples=10)
@given(st.integers(0, 10**6))
def test_points_come_back_from_their_photos(seed: int) -> None:
    xy, photo, point, centers, rotations, points = two_photos(seed)
    found = intersect_points(
        xy, np.full(xy.shape, 0.005), (photo, point), KnownPhotos(centers, rotations, np.full(3, F)), 20
    )
    assert np.abs(found.xyz - points).max() < 1e-8
    assert found.rays.tolist() == [2 + (n % 3 != 0) for n in range(20)]
