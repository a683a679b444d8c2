"""The search in a bundle: its level, and what comes back."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.errors import GeometryError
from photostrip.simulate import Flight, Points, Spec
from photostrip.statistics import normal_quantile
from photostrip.triangulation.bundle.quality.reliability import require_regular
from photostrip.triangulation.bundle.selection import Selection
from photostrip.triangulation.bundle.settings import BundleSettings
from photostrip.triangulation.gross_errors.rays import snooping
from photostrip.triangulation.gross_errors.rays.point_decisions import WRONG_RAY
from photostrip.triangulation.gross_errors.rays.strip_network import LEVEL
from tests.pipeline.blocks import adjusted, simulate

if TYPE_CHECKING:
    from photostrip.arrays import Numbers
    from photostrip.triangulation.bundle.observations.problem import BundleProblem

BLOCK = Spec(flight=Flight(photos=6), points=Points(extra_per_model=8))


@pytest.fixture(scope="module")
def problem() -> BundleProblem:
    result = adjusted(simulate(BLOCK))
    assert result.bundle is not None
    return result.bundle.block.problem


def rays_of(problem: BundleProblem, point: int) -> Numbers:
    return np.flatnonzero(problem.images.point == point)


def test_the_level_grows_with_the_errors_that_are_established(problem: BundleProblem) -> None:
    """Nothing established: all tests together have the level; then so many times as much [Gavrilov 2009]."""
    every = Selection.everything(problem)
    for known, point in ((0, 0), (5, 5)):
        images = problem.images.point >= point  # without the first points
        done = snooping.ScreenedBundle.of(problem, replace(every, images=images), BundleSettings(level=LEVEL))
        q, i, m = LEVEL, known + 1, done.solution.redundancy + known
        assert done.limit.alpha == pytest.approx(i * q / (m + 1 - i * (1 - q)))


def test_the_level_along_a_strip() -> None:
    """At a twentieth of the points wrong, as in the benchmark, errors of 3.3 standard deviations are found."""
    q, i, left = LEVEL, 18, 330
    assert normal_quantile(1 - i * q / (left + i * q) / 2) == pytest.approx(3.35, abs=0.08)


def test_the_single_ray_of_a_control_point_comes_back(problem: BundleProblem) -> None:
    at = int(problem.control.point[np.isfinite(problem.control.sigma).all(axis=1)][0])
    only = rays_of(problem, at)[0]
    images = problem.images
    left = (images.point != at) | (np.arange(len(images)) == only)
    alone = replace(
        problem, images=type(images)(images.photo[left], images.point[left], images.xy[left], images.sigma[left])
    )
    (row,) = rays_of(alone, at)
    begin = Selection.everything(alone)
    done = snooping.screen_bundle(
        alone, replace(begin, images=begin.images & (alone.images.point != at)), BundleSettings()
    )
    assert done.selection.images[row]
    assert done.selection.control[alone.control.point == at].all()


def test_control_that_began_outside_with_its_rays_tells_which_is_wrong(problem: BundleProblem) -> None:
    rays = np.bincount(problem.images.point, minlength=problem.points)
    given = problem.control.point[np.isfinite(problem.control.sigma).all(axis=1)]
    at = int(given[rays[given] == 2][0])
    good, wrong = rays_of(problem, at)
    xy = problem.images.xy.copy()
    xy[wrong, 0] += 0.3  # along the base: the two rays meet all the same
    spoiled = replace(problem, images=replace(problem.images, xy=xy))
    begin = Selection.everything(spoiled)
    done = snooping.screen_bundle(spoiled, replace(begin, images=problem.images.point != at), BundleSettings())
    assert done.selection.images[good]
    assert not done.selection.images[wrong]
    assert [each.cause for each in done.rejections if each.row == wrong and each.kind == "image"] == [WRONG_RAY]


def test_redundancy_numbers_beyond_their_range_are_no_adjustment(problem: BundleProblem) -> None:
    """A strip that hangs free at a photo was factored all the same: |r| of 254, and 141 points were taken for wrong."""
    done = snooping.ScreenedBundle.of(problem, Selection.everything(problem), BundleSettings())
    require_regular(done.problem, done.solution, done.precision)
    broken = replace(done.precision, image_residuals=done.precision.image_residuals * 4.0)
    with pytest.raises(GeometryError, match="singular but for rounding"):
        require_regular(done.problem, done.solution, broken)
