"""The search in a bundle: its level, and what comes back."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.network import snooping
from photostrip.network.adjustment import Selection
from photostrip.network.problem import BundleSettings
from photostrip.network.reliability import groups_of
from photostrip.rejection import UNCONTROLLED
from photostrip.simulation import Flight, Points, Spec, simulate
from tests.pipeline.blocks import adjusted

if TYPE_CHECKING:
    from photostrip.arrays import Numbers
    from photostrip.network.problem import BundleProblem


BLOCK = Spec(flight=Flight(photos=6), points=Points(extra_per_model=8))


@pytest.fixture(scope="module")
def problem() -> BundleProblem:
    result = adjusted(simulate(BLOCK))
    assert result.bundle is not None
    return result.bundle.block.problem


def rays_of(problem: BundleProblem, point: int) -> Numbers:
    return np.flatnonzero(problem.images.point == point)


def test_the_level_grows_with_the_errors_that_are_established(problem: BundleProblem) -> None:
    """Nothing established: all tests together have the level; then so many times as much [Gavrilov 2009].

    Wrong rays do not sharpen the test of control, wrong control does.
    """
    every = Selection.everything(problem)
    for known, point in ((0, 0), (5, 5)):
        images = problem.images.point >= point  # without the first points
        done = snooping.ScreenedBundle.of(problem, replace(every, images=images), BundleSettings())
        groups = groups_of(done.problem, done.solution, done.precision)
        q, i, m = 0.01, known + 1, int(sum((each.redundancy >= UNCONTROLLED).sum() for each in groups)) + known
        assert m > 2 * done.solution.redundancy  # there are more tests than conditions
        assert done.limit.alpha == pytest.approx(i * q / (m + 1 - i * (1 - q)))
        assert done.limit.alpha_of_given == pytest.approx(q / (m - known + q))
    control = every.control.copy()
    control[tuple(np.argwhere(control)[0])] = False
    every_given, less = (
        snooping.ScreenedBundle.of(problem, replace(every, control=flags), BundleSettings()).limit
        for flags in (every.control, control)
    )
    assert less.alpha_of_given == pytest.approx(2.0 * every_given.alpha_of_given, rel=0.02)


def test_control_comes_back_with_the_rays_that_agree_with_it(problem: BundleProblem) -> None:
    """A strip may leave out a control point and its rays, for a wrong one that meets the other all the same."""
    rays = np.bincount(problem.images.point, minlength=problem.points)
    given = problem.control.point[np.isfinite(problem.control.sigma).all(axis=1)]
    at = int(given[rays[given] == 2][0])
    good, wrong = rays_of(problem, at)
    xy = problem.images.xy.copy()
    xy[wrong, 0] += 0.3  # mm, along the base
    spoiled, every = replace(problem, images=replace(problem.images, xy=xy)), Selection.everything(problem)
    begin = replace(every, images=problem.images.point != at, control=every.control.copy())
    begin.control[problem.control.point == at] = False
    done = snooping.screen_bundle(spoiled, begin, BundleSettings())
    assert done.selection.control[problem.control.point == at].all()
    assert done.selection.images[[good, wrong]].tolist() == [True, False]


@pytest.mark.slow
def test_a_tenth_of_the_rays_takes_few_adjustments() -> None:
    """91 adjustments with one point of a neighbourhood at a time, and the same rays go."""
    result = adjusted(simulate(Spec(flight=Flight(photos=4, strips=2), points=Points(extra_per_model=60))))
    assert result.bundle is not None
    problem, rng = result.bundle.block.problem, np.random.default_rng(5)
    wrong = rng.random(len(problem.images)) < 0.1
    xy = problem.images.xy + wrong[:, None] * rng.normal(0.0, 0.3, (len(wrong), 2))
    spoiled = replace(problem, images=replace(problem.images, xy=xy))
    done = snooping.screen_bundle(spoiled, Selection.everything(spoiled), BundleSettings())
    assert done.rounds < 30
    assert (wrong & done.selection.images).sum() <= 2
    assert (~wrong & ~done.selection.images).sum() < wrong.sum() / 2  # a wrong ray of two takes the other along
