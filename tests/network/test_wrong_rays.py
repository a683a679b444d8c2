"""Wrong rays found by the whole strip, in strips whose truth is known."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.pipeline.inputs import Settings
from photostrip.pipeline.run import triangulate
from photostrip.rejection import WRONG_RAY
from tests.strips import MICROMETRE, control_points, fly, project

if TYPE_CHECKING:
    from photostrip.arrays import Numbers
    from photostrip.pipeline.results import Result
    from tests.strips import Flown


pytestmark = pytest.mark.usefixtures("_no_findings")

SIGMA = 5 * MICROMETRE
STATIONS = (0, 3, 6, 9, 12)


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


@pytest.mark.parametrize("photo", ["104", "105", "106"])  # the first, the middle and the last of the point
def test_the_wrong_ray_across_the_base_is_named_and_the_point_kept(photo: str) -> None:
    strip = spoiled(flown(), {(photo, "p4_1"): (0.0, 0.4)})
    result = adjusted(strip)
    assert found_in(strip, result) == {(photo, "p4_1"): WRONG_RAY}
    (wrong,) = result.strips[0].of_photos.wrong_rays
    assert wrong.axes == (1,)
    assert wrong.worst == pytest.approx(0.4, abs=0.05)
    assert "p4_1" not in result.not_determined
    row = list(result.points.number).index(strip.at["p4_1"])
    assert result.points.rays[row] == 2
    error = result.points.cartesian[row] - strip.xyz[strip.at["p4_1"]]
    assert 1e-4 < np.abs(error).max() < 1.5  # metres, 1:10000


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
@pytest.mark.parametrize("photo", [0, 6])
def test_a_photo_with_a_fifth_of_its_rays_wrong_is_oriented(photo: int) -> None:
    strip, rows = one_photo_spoiled(photo, photo, extra=200)
    assert len(rows) >= 5
    ratio = sound_error(strip, adjusted(strip), rows) / sound_error(strip, adjusted(flown(photo, extra=200)), rows)
    assert 0.8 < ratio < 1.2
