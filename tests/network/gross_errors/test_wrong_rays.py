"""Wrong rays found by the whole strip, in strips whose truth is known."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import strategies as st

from photostrip.network import strip_rays, testing
from photostrip.pipeline.inputs import Settings
from photostrip.pipeline.run import triangulate
from photostrip.rejection import SEVERAL_RAYS, TWO_RAYS, WRONG_RAY
from photostrip.result.document import document_of
from photostrip.strip import ray_intersection
from tests.strips import MICROMETRE, control_points, fly, project

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.network.reliability import Limit
    from photostrip.network.strip_rays import StripRays
    from photostrip.network.testing import Decisions, PointRays
    from photostrip.pipeline.results import Result
    from photostrip.strip.relative_orientation.orientation import Orientation
    from tests.strips import Flown

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]

pytestmark = pytest.mark.usefixtures("_no_findings")

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


def found_in(strip: Flown, result: Result) -> dict[tuple[str, str], str]:
    """What the strip says of which measurement."""
    o = strip.observations
    return {
        (o.photo_ids[o.photo[each.row]], o.point_ids[o.point[each.row]]): each.cause
        for each in result.strips[0].of_photos.wrong_rays
    }


def test_rays_meet_where_they_do() -> None:
    rng = np.random.default_rng(4)
    centers, xyz = rng.normal(0, 1, (20, 2, 3)), rng.normal(0, 1, (20, 3)) - [0, 0, 10]
    meet, sound = ray_intersection.meeting(centers, (xyz[:, None] - centers) * rng.uniform(0.1, 3, (20, 2, 1)))
    assert sound.all()
    assert meet == pytest.approx(xyz, abs=1e-6)
    _, behind = ray_intersection.meeting(centers, centers - xyz[:, None])
    assert not behind.any()


@pytest.mark.parametrize(("photo", "place"), [("104", "first"), ("105", "middle"), ("106", "last")])
def test_the_wrong_ray_across_the_base_is_named_and_the_point_kept(photo: str, place: str) -> None:
    strip = spoiled(flown(), {(photo, "p4_1"): (0.0, 0.4)})
    result = adjusted(strip)
    assert found_in(strip, result) == {(photo, "p4_1"): WRONG_RAY}, place
    (wrong,) = result.strips[0].of_photos.wrong_rays
    assert wrong.axes == (1,)
    assert wrong.worst == pytest.approx(0.4, abs=0.05)
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
    assert set(found_in(strip, result).values()) == {TWO_RAYS}
    assert result.not_determined == {name: "rays contradict each other"}


def test_an_error_along_the_base_takes_the_place_and_leaves_the_parallaxes() -> None:
    strip = spoiled(flown(), {("105", "p4_1"): (0.3, 0.0)})
    result = adjusted(strip)
    assert set(found_in(strip, result).values()) == {SEVERAL_RAYS}
    assert "p4_1" in result.not_determined
    oriented = result.strips[0].of_photos.orientation
    assert oriented.used[oriented.point == strip.at["p4_1"]].all()


@pytest.mark.slow
def test_a_point_within_rounding_of_the_limit_goes_with_a_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    """The test of the whole adjustment and that of the point alone may differ in the last digit."""

    decide = testing.decide

    def never(points: PointRays, limit: Limit) -> Decisions:
        decided = decide(points, limit)
        return replace(decided, out=np.zeros_like(decided.out), cause=np.zeros_like(decided.cause))

    monkeypatch.setattr(testing, "decide", never)
    strip = spoiled(flown(), {("105", "p4_1"): (0.0, 0.4)})
    result = adjusted(strip)
    assert set(found_in(strip, result).values()) == {SEVERAL_RAYS}
    assert {each["point"] for each in document_of(result)["rejected"] if each["reason"]} == {"p4_1"}


@pytest.mark.slow
def test_a_photo_that_is_measured_worse_is_told_from_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """Five times the standard deviation on one photo: the others keep theirs."""
    found: list[Floats] = []
    spread_of = strip_rays._spread_of_photos

    def kept(oriented: Orientation, rays: StripRays) -> Floats:
        found.append(spread_of(oriented, rays))
        return found[-1]

    monkeypatch.setattr(strip_rays, "_spread_of_photos", kept)
    strip = flown(extra=200)
    xy, at = strip.observations.xy.copy(), strip.observations.photo == 6
    xy[at] += np.random.default_rng(3).normal(0, np.sqrt(24) * SIGMA, (at.sum(), 2))
    adjusted(replace(strip, observations=replace(strip.observations, xy=xy)))
    assert found[0][6] == pytest.approx(5, rel=0.3)
    assert np.delete(found[0], 6) == pytest.approx(1)


def test_two_wrong_points_of_a_corner_do_not_cost_the_good_one() -> None:
    """A pair alone takes two equal errors among three points of a corner for one: theory 11.5."""
    strip = flown(extra=20)
    o = strip.observations
    # points abeam of photo 106 see photos 105 to 107; both rows on its left side get the same error on 106
    wrong = {("106", "p5_1"): (0.0, 0.15), ("106", "p4_1"): (0.0, 0.15)}
    result = adjusted(spoiled(strip, wrong))
    assert set(found_in(strip, result)) == set(wrong)
    used = np.zeros(len(o.point), bool)
    used[result.strips[0].of_photos.rows] = True
    assert sorted(np.flatnonzero(~used)) == sorted(row_of(strip, *each) for each in wrong)


def one_photo_spoiled(seed: int, photo: int, extra: int) -> tuple[Flown, Numbers]:
    """Give a strip with 0.5 to 50 mm in a fifth of the rays of one photo, and the rows of these."""
    strip, rng = flown(seed, extra), np.random.default_rng(seed)
    o, xy = strip.observations, strip.observations.xy.copy()
    rows = np.flatnonzero(o.photo == photo)
    rows = rng.choice(rows, len(rows) // 5, replace=False)
    size, way = np.exp(rng.uniform(np.log(0.5), np.log(50), len(rows))), rng.uniform(0, 2 * np.pi, len(rows))
    xy[rows] += np.column_stack([size * np.cos(way), size * np.sin(way)])
    return replace(strip, observations=replace(o, xy=xy)), rows


def sound_error(strip: Flown, result: Result, wrong: Numbers) -> float:
    """Rms error of the points without a wrong ray, metres."""
    sound = ~np.isin(result.points.number, strip.observations.point[wrong])
    error = result.points.cartesian[sound] - strip.xyz[result.points.number[sound]]
    return float(np.sqrt((error**2).mean()))


@pytest.mark.slow
def test_the_wrong_ray_of_a_pair_of_six_points_is_named_by_the_strip() -> None:
    """At first any of its rays may be the wrong one; when two of them are back, the third is known to be it."""
    strip, (wrong,) = one_photo_spoiled(13, 6, extra=0)
    result, o = adjusted(strip), strip.observations
    assert found_in(strip, result)[o.photo_ids[o.photo[wrong]], o.point_ids[o.point[wrong]]] == WRONG_RAY
    oriented = result.strips[0].of_photos.orientation
    assert not oriented.used[(oriented.rows == wrong).any(axis=1)].any()
    assert sound_error(strip, result, np.array([wrong])) < 0.1  # metres; 0.076 without errors, 16 with the wrong ray


@pytest.mark.slow
@pytest.mark.parametrize("photo", [0, 6])
def test_a_photo_with_a_fifth_of_its_rays_wrong_is_oriented(photo: int) -> None:
    strip, rows = one_photo_spoiled(photo, photo, extra=200)
    assert len(rows) >= 5
    ratio = sound_error(strip, adjusted(strip), rows) / sound_error(strip, adjusted(flown(photo, extra=200)), rows)
    assert 0.8 < ratio < 1.2


@pytest.mark.slow
def test_strips_without_errors_lose_nothing() -> None:
    lost = [len(adjusted(flown(seed, extra=100)).strips[0].of_photos.wrong_rays) for seed in range(10)]
    assert sum(each > 0 for each in lost) <= 1


@pytest.mark.slow
def test_the_users_measurement_stays() -> None:
    strip = spoiled(flown(), {("105", "p4_1"): (0.0, 0.4)})
    inputs = project(strip, control_points({n: strip.xyz[strip.at[n]] for n in strip.bands(*STATIONS)}, sigma=0.02))
    settings = Settings()
    kept = replace(settings, relative=replace(settings.relative, keep=["105/p4_1"]))
    assert triangulate(inputs, kept).strips[0].of_photos.wrong_rays == ()
    assert triangulate(inputs, settings).strips[0].of_photos.wrong_rays


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


@pytest.mark.slow
def test_a_pair_that_would_not_be_held_keeps_its_points_and_the_others_are_searched_all_the_same() -> None:
    """Six points a pair: without three of them, wrong along the base, the photos on either side hang free."""
    near = {("106", "p5_1"): (0.3, 0.0), ("107", "p6_-1"): (0.3, 0.0), ("107", "p6_0"): (-0.2, 0.0)}
    strip = spoiled(flown(extra=0), near | {("103", "p2_1"): (0.3, 0.0)})
    found = {point for _, point in found_in(strip, adjusted(strip))}
    assert "p2_1" in found
    assert found < {"p2_1", "p5_1", "p6_-1", "p6_0"}
