"""Single photos and single points from what is known: exact without noise, and as precise as said with it."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from photostrip.errors import GeometryError
from photostrip.geometry.rotation import from_alpha_omega_kappa, from_vector
from photostrip.strip.resection import KnownPhotos, intersect_points, project, space_resection
from tests.draws import orthogonal_normal
from tests.source_tree import ROOT

FOCAL = 153.0


def scene(seed: int, points: int = 8, tilt: float = 0.1, flat: float = 0.1) -> tuple[np.ndarray, ...]:
    """A photo of random points 1500 m below it: image points, points, centre, rotation."""
    random = np.random.default_rng(seed)
    xyz = np.column_stack([random.uniform(-1000, 1000, (points, 2)), random.uniform(-1, 1, points) * flat * 1500])
    turn = from_vector(random.normal(size=3) * tilt) @ from_vector(np.array([0, 0, random.uniform(-3, 3)]))
    center = np.array([0.0, 0.0, 1500.0]) + random.normal(size=3) * 50
    spin = from_vector(random.normal(size=3))  # the whole scene at any attitude
    xyz, center, turn = xyz @ spin.T, spin @ center, spin @ turn
    xy = project(xyz, KnownPhotos(center[None], turn[None], np.array([FOCAL])), np.zeros(points, np.intp))
    return xy, xyz, center, turn


@pytest.mark.slow
@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10**6), st.integers(4, 12), st.sampled_from([0.0, 0.05, 0.4]), st.sampled_from([0.0, 0.02, 0.3]))
def test_a_photo_comes_back_from_its_points(seed: int, points: int, tilt: float, flat: float) -> None:
    xy, xyz, center, turn = scene(seed, points, tilt, flat)
    try:
        found = space_resection(xy, np.full(xy.shape, 0.005), xyz, FOCAL)
    except GeometryError:
        assert points == 4  # four points can lie on one line by chance, or nearly on the circle that fixes no photo
        return
    size = np.sqrt(np.diag(found.covariance)) / 0.005  # metres and radians per millimetre of image
    assert np.abs(found.center - center).max() < 1e-9 * max(size[:3].max(), 1e3)
    assert np.abs(found.rotation - turn).max() < 1e-9 * max(size[3:].max(), 1.0)


@pytest.mark.slow
def test_the_covariance_is_that_of_many_noisy_photos() -> None:
    xy, xyz, center, turn = scene(5, 10)
    drawn = orthogonal_normal(np.random.default_rng(1), 100, xy.size).reshape(-1, *xy.shape)
    found = [space_resection(xy + 0.005 * each, np.full(xy.shape, 0.005), xyz, FOCAL) for each in drawn]
    centers = np.array([each.center for each in found]) - center
    turns = np.array([each.rotation for each in found]) @ turn.T
    vectors = np.column_stack([turns[:, 2, 1], turns[:, 0, 2], turns[:, 1, 0]])
    scatter = np.column_stack([centers, vectors]).std(axis=0)
    stated = np.sqrt(np.diag(found[0].covariance))
    assert scatter / stated == pytest.approx(np.ones(6), abs=0.1)
    assert np.mean([each.sigma0**2 for each in found]) == pytest.approx(1, abs=0.1)


def test_what_does_not_determine_a_photo_is_refused() -> None:
    xy, xyz, _, _ = scene(2)
    with pytest.raises(GeometryError, match="3 known points cannot orient a photo"):
        space_resection(xy[:3], np.ones((3, 2)), xyz[:3], FOCAL)
    line = xyz[0] + np.arange(8)[:, None] * (xyz[1] - xyz[0])
    with pytest.raises(GeometryError, match="on one line"):
        space_resection(xy, np.ones((8, 2)), line, FOCAL)


def two_photos(seed: int) -> tuple[np.ndarray, ...]:
    random = np.random.default_rng(seed)
    points = np.column_stack([random.uniform(-600, 600, (20, 2)), random.uniform(-50, 50, 20)])
    centers = np.array([[-450.0, 0, 1500], [450, 10, 1510], [0, 700, 1490]])
    rotations = from_vector(random.normal(size=(3, 3)) * 0.05)
    photo, point = np.repeat(np.arange(3), 20), np.tile(np.arange(20), 3)
    kept = ~((photo == 2) & (point % 3 == 0))
    photo, point = photo[kept], point[kept]
    xy = project(points[point], KnownPhotos(centers, rotations, np.full(3, FOCAL)), photo)
    return xy, photo, point, centers, rotations, points


@settings(deadline=None, max_examples=10)
@given(st.integers(0, 10**6))
def test_points_come_back_from_their_photos(seed: int) -> None:
    xy, photo, point, centers, rotations, points = two_photos(seed)
    found = intersect_points(
        xy, np.full(xy.shape, 0.005), (photo, point), KnownPhotos(centers, rotations, np.full(3, FOCAL)), 20
    )
    assert np.abs(found.xyz - points).max() < 1e-8
    assert found.rays.tolist() == [2 + (n % 3 != 0) for n in range(20)]


def published_pair() -> tuple[np.ndarray, ...]:
    """The published pair of variant 56: image points, ground points, stations and rotations, published angles."""
    folder = ROOT / "tests" / "data" / "authorities" / "pair-variant-56"
    tables = []
    for name in ("image_points", "ground_points", "exterior_orientation"):
        with (folder / f"{name}.csv").open(encoding="utf-8", newline="") as file:
            tables.append(list(csv.DictReader(file)))
    images, ground, photos = tables
    x1 = np.array([[float(row["x1_mm"]), float(row["y1_mm"])] for row in images])
    x2 = x1 - np.array([[float(row["p_mm"]), float(row["q_mm"])] for row in images])
    points = np.array([[float(row["X_m"]), float(row["Y_m"]), float(row["Z_m"])] for row in ground])
    stations = np.array([[float(row[f"{axis}s_m"]) for axis in "XYZ"] for row in photos])

    def radians(text: str) -> float:
        sign = -1.0 if text.startswith("-") else 1.0
        degrees, minutes, seconds = (float(part) for part in text.lstrip("+-").split())
        return float(np.radians(sign * (degrees + minutes / 60 + seconds / 3600)))

    angles = np.array([[radians(row[f"{name}_dms"]) for name in ("alpha", "omega", "kappa")] for row in photos])
    return x1, x2, points, stations, angles


def test_a_published_pair_comes_back_from_its_points_and_its_points_from_the_pair() -> None:
    x1, x2, points, stations, angles = published_pair()
    rotations = from_alpha_omega_kappa(*angles.T)
    for number, xy in enumerate((x1, x2)):
        found = space_resection(xy, np.full(xy.shape, 0.0005), points, 75.0)
        assert np.abs(found.center - stations[number]).max() < 0.02  # image coordinates have three decimals
        assert np.abs(found.rotation - rotations[number]).max() < 3e-5
    count = len(points)
    rows = np.repeat([0, 1], count), np.tile(np.arange(count), 2)
    known = KnownPhotos(stations, rotations, np.full(2, 75.0))
    met = intersect_points(np.concatenate([x1, x2]), np.full((2 * count, 2), 0.0005), rows, known, count)
    assert np.abs(met.xyz - points).max() < 0.006
