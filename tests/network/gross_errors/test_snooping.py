"""The search in a bundle: its level, and what comes back."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.errors import GeometryError
from photostrip.network import snooping, strip_rays
from photostrip.network.adjustment import Selection
from photostrip.network.adjustment import solve as solve_once
from photostrip.network.defects import MOST_FAILED
from photostrip.network.reliability import CONTROL, groups_of, require_regular
from photostrip.network.settings import BundleSettings
from photostrip.network.testing import WRONG, WrongRays
from photostrip.rejection import UNCONTROLLED, WRONG_RAY, Rejection
from photostrip.simulation import Flight, Points, Spec
from photostrip.statistics import normal_quantile
from tests.pipeline.blocks import adjusted, simulate

if TYPE_CHECKING:
    from photostrip.arrays import Numbers
    from photostrip.network.adjustment import BundleSolution
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
    """Nothing established: all tests together have the level; then so many times as much [Gavrilov 2009]."""
    every = Selection.everything(problem)
    for known, point in ((0, 0), (5, 5)):
        images = problem.images.point >= point  # without the first points
        done = snooping.ScreenedBundle.of(problem, replace(every, images=images), BundleSettings())
        every_test = [
            each.redundancy >= UNCONTROLLED for each in groups_of(done.problem, done.solution, done.precision)
        ]
        q, i, m = 0.01, known + 1, int(sum(each.sum() for each in every_test)) + known
        assert m > 2 * done.solution.redundancy  # there are more tests than conditions
        assert done.limit.alpha == pytest.approx(i * q / (m + 1 - i * (1 - q)))


def test_the_level_along_a_strip() -> None:
    """At a twentieth of the points wrong, as in the benchmark, errors of 3.7 standard deviations are found."""
    q, i, left = strip_rays.STRIP_LEVEL, 18, 900
    assert normal_quantile(1 - i * q / (left + i * q) / 2) == pytest.approx(3.68, abs=0.08)


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


@pytest.mark.parametrize(("part", "back"), [(0.99, True), (1.01, False)])
def test_a_point_comes_back_once_the_limit_has_risen_above_it(
    problem: BundleProblem, part: float, *, back: bool
) -> None:
    """Also where no ray nearby has changed since it was decided on, at the limit of then."""
    point = int(np.bincount(problem.images.point).argmax())
    every = Selection.everything(problem)
    search = snooping._Search(problem, every, BundleSettings(), None, rough=False)
    done = search.adjust(replace(every, images=problem.images.point != point))
    search.decided = done.selection
    search.beyond[point] = part * done.limit.value
    more = search.fitting(done)
    assert (more is not None and more.images.all()) == back


@pytest.mark.parametrize("taken", [0, 1, 3])
def test_as_many_more_points_of_a_photo_go_at_a_time_as_tests_have_taken_from_it(
    problem: BundleProblem, taken: int
) -> None:
    """Rays that began outside do not count: a search along a strip began with several points, and lost good ones."""
    rows, every = np.flatnonzero(problem.images.photo == 2), Selection.everything(problem)
    begin, now = (np.isin(np.arange(len(problem.images)), rows[first:]) for first in (4, 4 + taken))
    search = snooping._Search(problem, replace(every, images=begin), BundleSettings(), None, rough=False)
    points = np.arange(problem.points)
    doubtful = np.where(np.isin(points, problem.images.point[now]), 1.0 + points, 0.0)
    found = search._worst_nearby(replace(every, images=now), doubtful)
    assert np.flatnonzero(found).tolist() == np.sort(problem.images.point[now])[-1 - taken :].tolist()


@pytest.mark.parametrize(
    ("extra", "rays", "more"),
    [
        (100, 121, 121 // 50),  # points on 13 photos are seldom the worst of each: 367 of them went three at a time
        (300, 351, 351 // 50 + (351 - 200) // 8),  # 200 orient a photo: what was wrong of 1000 took twenty rounds
    ],
)
def test_more_points_of_a_photo_go_at_a_time_for_the_rays_that_hold_it(extra: int, rays: int, more: int) -> None:
    """For every fifty one, and of those beyond two hundred an eighth, as if they were out."""
    result = adjusted(simulate(Spec(flight=Flight(photos=3), points=Points(extra_per_model=extra))))
    assert result.bundle is not None
    problem = result.bundle.block.problem
    every, points = Selection.everything(problem), np.arange(problem.points)
    held = problem.images.point[problem.images.photo == 0]
    assert min(np.bincount(problem.images.photo)) == rays
    search = snooping._Search(problem, every, BundleSettings(), None, rough=False)
    found = search._worst_nearby(every, np.where(np.isin(points, held), 1.0 + points, 0.0))
    assert np.flatnonzero(found).tolist() == np.sort(held)[-1 - more :].tolist()


@pytest.mark.parametrize(("changed", "again"), [(1, False), (2, True)])
def test_points_are_decided_on_again_where_more_than_one_ray_of_a_hundred_has_changed(
    changed: int, *, again: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    result = adjusted(simulate(Spec(flight=Flight(photos=3), points=Points(extra_per_model=100))))
    assert result.bundle is not None
    problem = result.bundle.block.problem
    every, images = Selection.everything(problem), problem.images
    rays = np.bincount(images.point)[images.point]
    of_first, *others = np.flatnonzero((images.photo == 0) & (rays == 2))[: 1 + changed].tolist()
    held = ~np.isin(images.point, images.point[of_first])
    search = snooping._Search(problem, every, BundleSettings(), None, rough=False)
    done = search.adjust(replace(every, images=held))
    search.beyond[images.point[of_first]] = 2.0 * done.limit.value  # as decided on before
    search.decided = replace(every, images=held & ~np.isin(np.arange(len(held)), others))
    asked: list[int] = []
    decide = search._decided
    monkeypatch.setattr(search, "_decided", lambda *given: asked.extend(given[1].tolist()) or decide(*given))
    search.fitting(done)
    assert (of_first in asked) == again


def test_a_point_that_nothing_was_decided_about_is_decided_on_wherever_it_is() -> None:
    """Rays of it alone, of a hundred on each photo, began outside: it stayed there without a word."""
    result = adjusted(simulate(Spec(flight=Flight(photos=3), points=Points(extra_per_model=100))))
    assert result.bundle is not None
    problem = result.bundle.block.problem
    every, point = Selection.everything(problem), int(np.bincount(problem.images.point).argmax())
    begin = replace(every, images=problem.images.point != point)
    assert snooping.screen_bundle(problem, begin, BundleSettings()).selection.images.all()


@pytest.mark.parametrize(("free", "goes"), [(3, True), (2, False)])
def test_a_point_goes_that_is_among_the_worst_on_three_of_its_photos(free: int, *, goes: bool) -> None:
    """On the photos after the first ones another point is worse."""
    result = adjusted(simulate(Spec(flight=Flight(photos=9, end_lap_percent=85.0))))
    assert result.bundle is not None
    problem = result.bundle.block.problem
    first, last = np.full(problem.points, problem.photos), np.zeros(problem.points, np.intp)
    np.minimum.at(first, problem.images.point, problem.images.photo)
    np.maximum.at(last, problem.images.point, problem.images.photo)
    at = int(np.argmax(last - first))
    assert last[at] - first[at] > free
    worse = int(np.flatnonzero((first == first[at] + free) & (last >= last[at]))[0])
    search = snooping._Search(problem, Selection.everything(problem), BundleSettings(), None, rough=False)
    doubtful = np.zeros(problem.points)
    doubtful[[at, worse]] = 4.0, 5.0
    found = search._worst_nearby(Selection.everything(problem), doubtful)
    assert found[worse]
    assert bool(found[at]) == goes


@pytest.mark.parametrize(("out", "more"), [(0, 0), (7, 0), (8, 1), (15, 1)])
def test_of_given_coordinates_one_more_goes_at_a_time_for_every_eight_that_went(
    problem: BundleProblem, out: int, more: int
) -> None:
    """None of them comes back: as many more as went would cost good ones."""
    xyz = problem.control.xyz + np.random.default_rng(3).normal(0.0, 5.0, problem.control.xyz.shape)
    spoiled = replace(problem, control=replace(problem.control, xyz=xyz))
    search = snooping._Search(spoiled, Selection.everything(spoiled), BundleSettings(), None, rough=False)
    done = search.adjust(Selection.everything(spoiled))
    gone = (Rejection(kind=CONTROL, row=row, test="tau", value=9.0, limit=3.0) for row in range(out))
    search.out = {(CONTROL, each.row, 0): each for each in gone}
    worst = search._worst(done)
    assert isinstance(worst, list)
    assert [each.kind for each in worst] == [CONTROL] * (1 + more)


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


def test_rays_that_hardly_move_a_photo_take_no_adjustment_of_their_own() -> None:
    """One ray of hundreds of a photo goes in the same adjustment as what was left outside comes back."""
    result = adjusted(simulate(Spec(seed=3, flight=Flight(photos=4, strips=2), points=Points(extra_per_model=150))))
    assert result.bundle is not None
    problem = result.bundle.block.problem
    on_four = np.flatnonzero(np.bincount(problem.images.point) >= 4)
    wrong, outside = rays_of(problem, int(on_four[0]))[0], rays_of(problem, int(on_four[-1]))
    xy = problem.images.xy.copy()
    xy[wrong] += 0.1
    spoiled = replace(problem, images=replace(problem.images, xy=xy))
    begin = Selection.everything(spoiled)
    begin.images[outside] = False
    done = snooping.screen_bundle(spoiled, begin, BundleSettings())
    assert np.flatnonzero(~done.selection.images).tolist() == [wrong]
    assert done.rounds == 2


def test_a_search_ends_where_eight_adjustments_fail(problem: BundleProblem, monkeypatch: pytest.MonkeyPatch) -> None:
    """A block of exchanged points was adjusted 132 times, 110 times in vain: a point was spared each time."""
    rows = [int(rays_of(problem, point)[0]) for point in range(20)]
    solved = 0

    def solve(chosen: BundleProblem, *, rough: bool = False) -> BundleSolution:
        nonlocal solved
        solved += 1
        if solved > 1:
            raise GeometryError("does not converge")
        return solve_once(chosen, rough=rough)

    def worst(search: snooping._Search, _: snooping.ScreenedBundle) -> WrongRays:
        left = np.array([row for row in rows if not search.spared[problem.images.point[row]]])
        n = len(left)
        return WrongRays(
            row=left, value=np.full(n, 9.0), limit=np.full(n, 4.0), size=np.zeros((n, 2)), cause=np.full(n, WRONG)
        )

    monkeypatch.setattr(snooping, "solve", solve)
    monkeypatch.setattr(snooping._Search, "_worst", worst)
    with pytest.raises(GeometryError, match="ended after 1 adjustment") as refused:
        snooping.screen_bundle(problem, Selection.everything(problem), BundleSettings())
    assert refused.value.code == "search-ended"
    assert solved == 1 + MOST_FAILED


def test_redundancy_numbers_beyond_their_range_are_no_adjustment(problem: BundleProblem) -> None:
    """A strip that hangs free at a photo was factored all the same: |r| of 254, and 141 points were taken for wrong."""
    done = snooping.ScreenedBundle.of(problem, Selection.everything(problem), BundleSettings())
    require_regular(done.problem, done.solution, done.precision)
    broken = replace(done.precision, image_residuals=done.precision.image_residuals * 4.0)
    with pytest.raises(GeometryError, match="singular but for rounding"):
        require_regular(done.problem, done.solution, broken)


def test_one_given_coordinate_more_goes_at_a_time_for_every_eight_that_are_out(problem: BundleProblem) -> None:
    xyz = problem.control.xyz.copy()
    xyz[:6, 2] += [30.0, -20.0, 25.0, -35.0, 28.0, -22.0]
    spoiled = replace(problem, control=replace(problem.control, xyz=xyz))
    search = snooping._Search(spoiled, Selection.everything(spoiled), BundleSettings(), None, rough=False)
    done = search.adjust(Selection.everything(spoiled))
    gone = Rejection(kind=CONTROL, row=0, test="tau", value=9.0, limit=4.0)
    for out, together in ((0, 1), (7, 1), (8, 2), (15, 2), (16, 3)):
        search.out = {(CONTROL, row, 0): gone for row in range(out)}
        worst = search._worst(done)
        assert isinstance(worst, list)
        assert [each.kind for each in worst] == [CONTROL] * together
        assert sorted(worst, key=lambda each: -each.value) == worst


def test_of_a_point_on_two_photos_both_rays_go_at_a_quarter_of_the_level(problem: BundleProblem) -> None:
    """In a strip; of a block the report says what is found at the level of a single observation."""
    every = Selection.everything(problem)
    of_block = snooping.ScreenedBundle.of(problem, every, BundleSettings()).limit
    assert of_block.of(2) == of_block.of(3)
    limit = snooping.ScreenedBundle.of(problem, every, BundleSettings(), rough=True).limit
    assert limit.of(3) == limit.of(4) == normal_quantile(1 - limit.alpha / 2)
    assert limit.of(2) == pytest.approx(normal_quantile(1 - limit.alpha / 8))
    rows = rays_of(problem, int(np.flatnonzero(np.bincount(problem.images.point) == 2)[0]))
    search = snooping._Search(problem, every, BundleSettings(), None, rough=False)
    point, value = problem.images.point[rows[0]], np.zeros(len(problem.images))
    for size, doubtful in ((0.5 * (limit.value + limit.both), False), (1.01 * limit.both, True)):
        value[rows] = size
        assert bool(search._doubtful(every, value, limit)[point]) == doubtful
