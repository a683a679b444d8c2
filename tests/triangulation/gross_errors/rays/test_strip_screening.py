"""Wrong rays decided by the whole strip: algebra of windows, decisions on points, strips whose truth is known."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st

from photostrip.geometry.rotation import from_vector
from photostrip.pipeline import Settings, triangulate
from photostrip.triangulation.gross_errors.rays import ray_decisions, window_adjustment, window_points, windows
from photostrip.triangulation.gross_errors.rays.strip_screening import SEVERAL_RAYS, TWO_RAYS, WRONG_RAY
from photostrip.triangulation.strip_formation import non_neighbours
from tests.strips import MICROMETRE, control_points, fly, photograph, project

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.pipeline import Result
    from tests.strips import Flown

    Floats = NDArray[np.float64]

SIGMA = 5 * MICROMETRE
STATIONS = (0, 3, 6, 9, 12)
SEEDS = st.integers(0, 2**31)


def flown(seed: int = 1, extra: int = 60) -> Flown:
    return fly(seed, 13, sigma=SIGMA, extra=extra)


def row_of(strip: Flown, photo: str, point: str) -> int:
    o = strip.observations
    (row,) = np.flatnonzero((o.photo == o.photo_ids.index(photo)) & (o.point == o.point_ids.index(point)))
    return int(row)


def spoiled(strip: Flown, errors: dict[tuple[str, str], tuple[float, float]]) -> Flown:
    """Shift image points, named by photo and point, by millimetres."""
    xy = strip.observations.xy.copy()
    for (photo, point), error in errors.items():
        xy[row_of(strip, photo, point)] += error
    return replace(strip, observations=replace(strip.observations, xy=xy))


def adjusted(strip: Flown) -> Result:
    rng = np.random.default_rng(7)
    given_ = {name: strip.xyz[strip.at[name]] + rng.normal(0, 0.02, 3) for name in strip.bands(*STATIONS)}
    return triangulate(project(strip, control_points(given_, sigma=0.02)), Settings())


def told(strip: Flown, result: Result) -> dict[tuple[str, str], str]:
    """What the strip says of which measurement."""
    o, found = strip.observations, result.strips[0].of_photos.contradictions
    return {
        (o.photo_ids[o.photo[row]], o.point_ids[o.point[row]]): kind
        for row, kind in zip(found.wrong, found.kind, strict=True)
    }


# --------------------------------------------------------------------------------------------------- linear algebra


def some_rays(seed: int, photos: int = 3, points: int = 8) -> tuple[windows.WindowRays, tuple[Floats, Floats], Floats]:
    """Linearise rays of points that all photos see, ordered by point."""
    rng = np.random.default_rng(seed)
    centers = np.column_stack([np.arange(photos, dtype=float), rng.normal(0, 0.02, (photos, 2))])
    rotations = from_vector(rng.normal(0, 0.03, (photos, 3)))
    xyz = np.column_stack(
        [rng.uniform(0, photos - 1, points), rng.uniform(-1, 1, points), rng.normal(-1.7, 0.05, points)]
    )
    point, photo = (each.ravel() for each in np.meshgrid(np.arange(points), np.arange(photos), indexing="ij"))
    image = [photograph(xyz[[q]], centers[p], rotations[p], 153.0)[0] for p, q in zip(photo, point, strict=True)]
    measured = np.array(image) + rng.normal(0, SIGMA, (len(image), 2))
    place = np.arange(len(photo)), photo, point
    rays = windows.linearise(place, (measured, np.full(measured.shape, SIGMA), 153.0), (centers, rotations), xyz[point])
    return rays, (centers, rotations), xyz


@pytest.mark.slow
@given(SEEDS)
@examples(max_examples=20)
def test_derivatives_are_those_of_the_central_projection(seed: int) -> None:
    rays, (centers, rotations), xyz = some_rays(seed)
    step = 1e-6
    for number in range(6):
        shift = np.zeros(6)
        shift[number] = step
        moved = [
            photograph(xyz[[q]], centers[p] + shift[:3], rotations[p] @ from_vector(shift[3:]), 153.0)[0]
            - photograph(xyz[[q]], centers[p], rotations[p], 153.0)[0]
            for p, q in zip(rays.photo, rays.point, strict=True)
        ]
        slope = np.array(moved) / step / SIGMA
        assert rays.by_photo[:, :, number] == pytest.approx(slope, rel=1e-4, abs=1e-3 * np.abs(slope).max())
    for axis in range(3):
        there = xyz + step * np.eye(3)[axis]
        moved = [
            photograph(there[[q]], centers[p], rotations[p], 153.0)[0]
            - photograph(xyz[[q]], centers[p], rotations[p], 153.0)[0]
            for p, q in zip(rays.photo, rays.point, strict=True)
        ]
        slope = np.array(moved) / step / SIGMA
        assert rays.by_point[:, :, axis] == pytest.approx(slope, rel=1e-4, abs=1e-3 * np.abs(slope).max())


@pytest.mark.parametrize("photos", [2, 3, 4, 5])
def test_conditions_do_not_feel_the_point(photos: int) -> None:
    rays, _, _ = some_rays(3, photos)
    (group,) = window_points.groups(rays, np.zeros(1, np.intp), photos)
    basis = window_points.coplanarities(group)
    assert basis.shape[1:] == (2 * photos - 3, 2 * photos)
    assert basis @ group.by_point == pytest.approx(0.0, abs=1e-6 * np.abs(group.by_point).max())
    assert np.linalg.matrix_rank(basis, tol=1e-6).tolist() == [2 * photos - 3] * len(basis)
    # an error along the base hardly touches the conditions of neighbouring photos, that is what they are for
    along = np.abs(basis[:, : photos - 1, 0::2]).max()
    assert along < 0.15 < np.abs(basis[:, photos - 1 :, 0::2]).max(initial=1.0)


def test_windows_are_the_adjustment_of_all_rays_at_once() -> None:
    """Against least squares with the points as unknowns, by a library function, in which no one eliminates anything."""
    rays, _, _ = some_rays(5, photos=4, points=12)
    groups = window_points.groups(rays, np.zeros(1, np.intp), 4)
    (group,) = groups
    weight = np.ones(group.ray.shape)
    parts = [(group, *window_adjustment.projected(group, weight))]
    solved = window_adjustment.stacked(parts, 1, 4).solved(np.ones((1, 12 * 8)))
    design = np.zeros((len(rays.row), 2, 24 + 36))
    for n, (photo, point) in enumerate(zip(rays.photo, rays.point, strict=True)):
        design[n, :, 6 * photo : 6 * photo + 6] = rays.by_photo[n]
        design[n, :, 24 + 3 * point : 27 + 3 * point] = rays.by_point[n]
    flat = design.reshape(-1, 60)
    estimate = np.linalg.lstsq(flat, rays.misfit.ravel(), rcond=1e-10)[0]
    left = rays.misfit.ravel() - flat @ estimate
    ours = group.misfit - np.einsum("kij,kj->ki", group.by_photo, solved.of(group)[0])
    ours = np.einsum("kij,kj->ki", window_points.projectors(group, weight), ours)
    assert ours.ravel() == pytest.approx(left, abs=1e-4)
    # the same with as few conditions as there are
    independent = group.independent[:, :, :-1], group.independent[:, :, -1]
    fewer = window_adjustment.stacked([(group, *independent)], 1, 4)
    assert fewer.misfit.shape == (1, 12 * 5)
    every = window_adjustment.stacked(parts, 1, 4)
    weights = np.ones(fewer.misfit.shape)
    same = every.left(fewer.estimate(weights))
    assert same == pytest.approx(every.left(solved.estimate), abs=1e-4)
    quick = every.left(fewer.solved(weights).estimate)
    assert quick == pytest.approx(same, abs=1e-4)


def test_a_point_taken_out_by_formula_is_left_out() -> None:
    rays, _, _ = some_rays(6, photos=4, points=14)
    (group,) = window_points.groups(rays, np.zeros(1, np.intp), 4)

    def solved(weight: Floats) -> window_adjustment.AdjustedWindows:
        conditions = window_adjustment.stacked([(group, *window_adjustment.projected(group, weight))], 1, 4)
        return conditions.solved(np.ones(conditions.misfit.shape))

    weight = np.ones(group.ray.shape)
    weight[3, 1] = 0.0
    gap, variance = window_adjustment.without(group, weight, solved(weight))
    for point in (0, 3, 7):  # the second lacks a ray already
        fewer = weight.copy()
        fewer[point] = 0.0
        left, spread = window_adjustment.expected(group, solved(fewer))
        assert gap[point] == pytest.approx(left[point], abs=1e-3)
        assert variance[point] == pytest.approx(spread[point], rel=1e-3, abs=1e-3)


def test_every_photo_is_in_a_window_and_every_point_at_home_with_all_its_rays() -> None:
    for photos in (2, 5, 10, 11, 20, 33, 100):
        for reach in (2, 3, 5):
            first, (length, _) = windows.starts(photos, reach), windows.size_of(reach)
            assert first[0] == 0
            assert first[-1] + length >= photos
            begin = np.arange(photos - reach + 1) if photos >= reach else np.zeros(1, int)
            home = windows.homes(np.asarray(begin + (reach - 1) / 2, float), first, reach)
            assert (first[home] <= begin).all()
            assert (begin + reach <= first[home] + length).all()


def test_rays_meet_where_they_do() -> None:
    rng = np.random.default_rng(4)
    centers, xyz = rng.normal(0, 1, (20, 2, 3)), rng.normal(0, 1, (20, 3)) - [0, 0, 10]
    meet, sound = non_neighbours.meeting(centers, (xyz[:, None] - centers) * rng.uniform(0.1, 3, (20, 2, 1)))
    assert sound.all()
    assert meet == pytest.approx(xyz, abs=1e-6)
    _, behind = non_neighbours.meeting(centers, centers - xyz[:, None])
    assert not behind.any()


# ------------------------------------------------------------------------------------------------------- decisions


@pytest.mark.slow
def test_good_points_are_called_wrong_as_often_as_the_level_says() -> None:
    alarms = points = 0
    for seed in range(400):
        rays, _, _ = some_rays(seed, points=10)
        (group,) = window_points.groups(rays, np.zeros(1, np.intp), 3)
        found = ray_decisions.decide(
            group, (group.closing, group.gram), np.array([1])
        )  # exact photos; level 1 % a point
        alarms, points = alarms + int((found.kind != ray_decisions.GOOD).sum()), points + 10
    assert 0.006 < alarms / points < 0.014


@given(SEEDS, st.integers(0, 2), st.sampled_from([-1, 1]), st.floats(0.1, 5.0))
@examples(max_examples=40)
def test_of_three_rays_the_wrong_one_is_told_across_the_base_and_not_along(
    seed: int, place: int, sign: int, size: float
) -> None:
    rays, _, _ = some_rays(seed, points=1)
    for axis, kind in ((1, ray_decisions.RAY), (0, ray_decisions.RAYS)):
        misfit = rays.misfit * 0.2  # quiet measurements: the decision, not the luck of the draw
        misfit[place, axis] += sign * size / SIGMA
        (group,) = window_points.groups(replace(rays, misfit=misfit), np.zeros(1, np.intp), 3)
        found = ray_decisions.decide(group, (group.closing, group.gram), np.array([1]))
        # tilted photos: a large error along the photo's x is a little one across the base too
        assert found.kind[0] in ({kind} if axis else {kind, ray_decisions.RAY})
        if found.kind[0] == ray_decisions.RAY:
            assert found.weight[0].tolist() == [float(n != place) for n in range(3)]
            assert found.size[0, place, axis] == pytest.approx(sign * size / SIGMA, rel=0.2)


# ---------------------------------------------------------------------------------------------------------- strips


@pytest.mark.parametrize(("photo", "place"), [("104", "first"), ("105", "middle"), ("106", "last")])
def test_the_wrong_ray_across_the_base_is_named_and_the_point_kept(photo: str, place: str) -> None:
    strip = spoiled(flown(), {(photo, "p4_1"): (0.0, 0.4)})
    result = adjusted(strip)
    assert told(strip, result) == {(photo, "p4_1"): WRONG_RAY}, place
    size = result.strips[0].of_photos.contradictions.size[0]
    assert size[1] == pytest.approx(0.4, abs=0.05)
    assert "p4_1" not in result.not_determined
    row = list(result.points.number).index(strip.at["p4_1"])
    assert result.points.rays[row] == 2
    error = result.points.cartesian[row] - strip.xyz[strip.at["p4_1"]]
    assert 1e-4 < np.abs(error).max() < 1.5  # metres, 1:10000


def test_two_rays_that_contradict_each_other_are_both_left_out() -> None:
    strip = flown()
    counts = np.bincount(strip.observations.point)
    name = next(n for n in strip.observations.point_ids if n.startswith("e") and counts[strip.at[n]] == 2)
    rows = np.flatnonzero(strip.observations.point == strip.at[name])
    photo = strip.observations.photo_ids[strip.observations.photo[rows[0]]]
    strip = spoiled(strip, {(photo, name): (0.0, 0.3)})
    result = adjusted(strip)
    assert set(told(strip, result).values()) == {TWO_RAYS}
    assert result.not_determined == {name: "its rays contradict each other"}


def test_an_error_along_the_base_takes_the_place_and_leaves_the_parallaxes() -> None:
    strip = spoiled(flown(), {("105", "p4_1"): (0.3, 0.0)})
    result = adjusted(strip)
    assert set(told(strip, result).values()) == {SEVERAL_RAYS}
    assert "p4_1" in result.not_determined
    oriented = result.strips[0].of_photos.orientation
    assert oriented.used[oriented.point == strip.at["p4_1"]].all()


def test_two_wrong_points_of_a_corner_do_not_cost_the_good_one() -> None:
    """A pair alone takes two equal errors among three points of a corner for one: theory 11.5."""
    strip = flown(extra=20)
    o = strip.observations
    # points abeam of photo 106 see photos 105 to 107; both rows on its left side get the same error on 106
    wrong = {("106", "p5_1"): (0.0, 0.15), ("106", "p4_1"): (0.0, 0.15)}
    result = adjusted(spoiled(strip, wrong))
    assert set(told(strip, result)) == set(wrong)
    used = np.zeros(len(o.point), bool)
    used[result.strips[0].of_photos.rows] = True
    assert sorted(np.flatnonzero(~used)) == sorted(row_of(strip, *each) for each in wrong)


@pytest.mark.slow
def test_strips_without_errors_lose_nothing() -> None:
    lost = [len(adjusted(flown(seed, extra=100)).strips[0].of_photos.contradictions.wrong) for seed in range(20)]
    assert sum(each > 0 for each in lost) <= 2


@pytest.mark.slow
def test_the_users_measurement_stays() -> None:
    strip = spoiled(flown(), {("105", "p4_1"): (0.0, 0.4)})
    inputs = project(strip, control_points({n: strip.xyz[strip.at[n]] for n in strip.bands(*STATIONS)}, sigma=0.02))
    settings = Settings()
    kept = replace(settings, relative=replace(settings.relative, keep=["105/p4_1"]))
    assert triangulate(inputs, kept).strips[0].of_photos.contradictions.wrong.tolist() == []
    assert triangulate(inputs, settings).strips[0].of_photos.contradictions.wrong.tolist() != []


# ---------------------------------------------------------------------------------------------------- independence


def with_errors(seed: int) -> Flown:
    """Give a strip with errors of a few hundredths to tens of millimetres in a twentieth of its rays."""
    strip = flown(seed)
    rng = np.random.default_rng(seed)
    xy = strip.observations.xy.copy()
    rows = rng.choice(len(xy), len(xy) // 20, replace=False)
    xy[rows, rng.integers(0, 2, len(rows))] += rng.choice([-1, 1], len(rows)) * np.exp(
        rng.uniform(np.log(0.05), np.log(20.0), len(rows))
    )
    return replace(strip, observations=replace(strip.observations, xy=xy))


def outcome(strip: Flown, *, name: str = "") -> tuple[set[tuple[str, str]], dict[str, Floats]]:
    """Give the measurements that are not used, and the coordinates of all points; names without a prefix."""
    result = adjusted(strip)
    o = strip.observations
    unused = np.setdiff1d(np.arange(len(o.point)), result.strips[0].of_photos.rows)
    out = {(o.photo_ids[o.photo[row]].removeprefix(name), o.point_ids[o.point[row]]) for row in unused}
    return out, {o.point_ids[n]: xyz for n, xyz in zip(result.points.number, result.points.cartesian, strict=True)}


@pytest.mark.slow
@pytest.mark.parametrize("seed", [3, 8])
def test_neither_order_nor_names_decide(seed: int) -> None:
    strip = with_errors(seed)
    out, xyz = outcome(strip)
    assert len(out) > 10
    o = strip.observations
    order = np.random.default_rng(seed).permutation(len(o.point))
    points = np.random.default_rng(seed + 1).permutation(len(o.point_ids))
    shuffled = replace(
        o,
        photo_ids=tuple(f"q{photo}" for photo in o.photo_ids),
        point_ids=tuple(np.array(o.point_ids)[points].tolist()),
        photo=o.photo[order],
        point=np.argsort(points)[o.point[order]],
        xy=o.xy[order],
        sigma=o.sigma[order],
    )
    moved = replace(
        strip,
        observations=shuffled,
        xyz=strip.xyz[points],
        at={name: n for n, name in enumerate(shuffled.point_ids)},
    )
    again, there = outcome(moved, name="q")
    assert again == out
    assert set(there) == set(xyz)
    assert max(float(np.abs(there[name] - xyz[name]).max()) for name in xyz) < 1e-6
