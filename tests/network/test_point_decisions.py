"""Decisions on single points: the algebra of points taken out, how often good ones go, which ray is blamed."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from photostrip.geometry.rotation import from_vector
from photostrip.network import testing
from photostrip.network.reliability import Limit
from photostrip.network.testing import PointRays
from photostrip.statistics import normal_quantile
from photostrip.strip.resection import KnownPhotos, derivatives
from tests.loops import nonempty

SIGMA = 0.005  # mm
ALPHA = 0.01


def a_point(seed: int, rays: int = 3) -> PointRays:
    """A point that a row of photos sees, one base apart, with random measurements; photos known exactly."""
    rng = np.random.default_rng(seed)
    centers = np.column_stack([np.arange(rays, dtype=float), rng.normal(0, 0.02, (rays, 2))])
    rotations = from_vector(rng.normal(0, 0.03, (rays, 3)))
    xyz = np.array([rng.uniform(0, rays - 1), rng.uniform(-1, 1), -1.7])
    place = np.broadcast_to(xyz, (rays, 3))
    _, by_point = derivatives(place, KnownPhotos(centers, rotations, np.full(rays, 153.0)), np.arange(rays))
    return PointRays(
        rays=rays,
        coordinates=2,
        misfit=rng.normal(0, 1, 2 * rays),
        by_point=(by_point / SIGMA).reshape(-1, 3),
        of_photos=np.zeros((2 * rays, 2 * rays)),
        inside=np.zeros(2 * rays, bool),
    )


@pytest.mark.parametrize("count", [1, 2, 3])
def test_sets_of_many_points_are_taken_out_as_one_by_one(count: int) -> None:
    random = np.random.default_rng(count)
    root, pulled, total = random.normal(size=(5, 12, 15)), random.normal(size=(5, 12)), random.normal(size=5)
    normal, sets = root @ root.swapaxes(1, 2), testing.ray_sets(6, count).rays
    left, errors = testing._without(total, pulled, normal, sets, 2)
    for point, (row, rays) in nonempty(itertools.product(range(5), enumerate(sets))):
        at = (2 * rays[:, None] + np.arange(2)).ravel()
        error = np.linalg.solve(normal[point][np.ix_(at, at)], pulled[point, at])
        assert errors[point, row].ravel() == pytest.approx(error, rel=1e-6)
        assert left[point, row] == pytest.approx(total[point] - pulled[point, at] @ error, rel=1e-6)


@pytest.mark.parametrize(("rays", "gone"), [(2, ()), (3, ()), (4, ()), (4, (1,)), (5, (0, 3))])
def test_a_point_that_took_part_is_predicted_as_if_it_had_not(rays: int, gone: tuple[int, ...]) -> None:
    """Against least squares with photos known beforehand and the point as an unknown, all at once."""
    point = a_point(7, rays)
    rng = np.random.default_rng(8)
    by_photos = np.zeros((2 * rays, 6 * rays))
    for ray in range(rays):
        by_photos[2 * ray : 2 * ray + 2, 6 * ray : 6 * ray + 6] = rng.normal(0, 3e4, (2, 6))
    root = rng.normal(0, 1e-5, (6 * rays, 6 * rays))
    before = np.asarray(root @ root.T, float)
    rows = ~np.isin(np.arange(2 * rays) // 2, gone)
    # photos after an adjustment with the point's rays, and what that leaves of its misclosures
    design = np.column_stack([by_photos[rows], point.by_point[rows]])
    weight = np.zeros((6 * rays + 3, 6 * rays + 3))
    weight[: 6 * rays, : 6 * rays] = np.linalg.inv(before)
    cofactors = np.linalg.inv(design.T @ design + weight)
    shift = cofactors @ design.T @ point.misfit[rows]
    after = replace(
        point,
        of_photos=np.asarray(by_photos @ cofactors[: 6 * rays, : 6 * rays] @ by_photos.T, float),
        inside=rows,
        misfit=point.misfit - by_photos @ shift[: 6 * rays] - point.by_point @ shift[6 * rays :],
    )
    expected = testing._misclosures(replace(point, of_photos=by_photos @ before @ by_photos.T))
    found = testing._misclosures(after)
    assert found.gap == pytest.approx(expected.gap, rel=1e-5, abs=1e-5)
    assert found.weight == pytest.approx(expected.weight, rel=1e-5, abs=1e-7)


def test_sums_of_squares_without_rays_are_those_of_adjustments_without_them() -> None:
    point = a_point(3, 5)
    gap, weight, basis = testing._misclosures(point)
    total, pulled, normal = gap @ weight @ gap, basis @ weight @ gap, basis @ weight @ basis.T
    rays = [0, 3, 4]
    found = testing._without(np.array([total]), pulled[None], normal[None], np.array(rays)[:, None], 2)
    for value, ray, (error,) in nonempty(zip(found.left[0], rays, found.errors[0], strict=True)):
        rows = np.arange(10) // 2 != ray
        design, misfit = point.by_point[rows], point.misfit[rows]
        xyz = np.linalg.lstsq(design, misfit, rcond=None)[0]
        assert value == pytest.approx(float(((misfit - design @ xyz) ** 2).sum()), rel=1e-6)
        assert error == pytest.approx((point.misfit - point.by_point @ xyz)[~rows], rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rays", "points", "fewest", "most"), [(2, 4000, 0.35, 0.7), (3, 1000, 0.5, 6.0), (4, 1000, 0.5, 8.0)]
)
def test_good_points_are_called_wrong_as_often_as_the_level_says(
    rays: int, points: int, fewest: float, most: float
) -> None:
    """One test for each coordinate: together at most the level times their number; two rays have half of one test."""
    value, both = (normal_quantile(1 - level / 2) for level in (ALPHA, ALPHA / 2))
    limit = Limit(value=value, both=both, given=value, alpha=ALPHA, alpha_of_given=ALPHA, unit=1.0)
    every = [a_point(seed, rays) for seed in range(points)]
    columns = {
        name: np.array([getattr(each, name) for each in every])
        for name in ("misfit", "by_point", "of_photos", "inside")
    }
    alarms = testing.decide(replace(every[0], **columns), limit).out.any(axis=1)
    assert fewest * ALPHA < np.mean(alarms) < most * ALPHA
