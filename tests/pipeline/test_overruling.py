"""Measurements that the user keeps or drops, whatever the tests say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from photostrip.errors import InputError
from photostrip.pipeline.inputs import Settings
from photostrip.pipeline.results import Result
from photostrip.pipeline.run import triangulate
from photostrip.strip.relative_orientation import RelativeSettings as Relative
from tests.strips import Flown, control_points, fly, project

WRONG = ("105", "p4_1")

pytestmark = pytest.mark.usefixtures("_no_findings")


def spoiled() -> Flown:
    strip = fly(3, 7, sigma=0.005, extra=60)
    o = strip.observations
    row = np.flatnonzero((o.photo == o.photo_ids.index(WRONG[0])) & (o.point == o.point_ids.index(WRONG[1])))
    xy = o.xy.copy()
    xy[row, 1] += 0.4
    return replace(strip, observations=replace(o, xy=xy))


def adjusted(keep: tuple[str, ...] = (), drop: tuple[str, ...] = ()) -> Result:
    strip = spoiled()
    given = {name: strip.xyz[strip.at[name]] for name in strip.bands(0, 3, 6)}
    return triangulate(
        project(strip, control_points(given)), Settings(relative=Relative(keep=list(keep), drop=list(drop)))
    )


def in_use(result: Result, photo: str, point: str) -> bool:
    o, oriented = result.refined.observations, result.strips[0].of_photos.orientation
    (row,) = np.flatnonzero((o.photo == o.photo_ids.index(photo)) & (o.point == o.point_ids.index(point)))
    return bool((oriented.used & (oriented.rows == row).any(axis=1)).any())


@pytest.mark.slow
def test_a_measurement_that_is_kept_stays_in_use_and_is_reported() -> None:
    result = adjusted(keep=("105/p4_1",))
    assert in_use(result, *WRONG)
    (note,) = (note for note in result.notes if note.code == "user-keep")
    assert "105/p4_1" in note.message
    back = [r for r in result.strips[0].of_photos.rejections if r.readmitted]
    assert {int(result.strips[0].of_photos.orientation.point[r.row]) for r in back} == {
        result.refined.observations.point_ids.index("p4_1")
    }


@pytest.mark.slow
def test_a_measurement_that_is_dropped_takes_no_part_and_is_reported() -> None:
    assert in_use(adjusted(), "103", "p2_0")
    result = adjusted(drop=("103/p2_0",))
    assert not in_use(result, "103", "p2_0")
    assert [note.code for note in result.notes if note.code.startswith("user-")] == ["user-drop"]


@pytest.mark.parametrize(
    ("keep", "drop", "words"),
    [
        (("105/nobody",), (), "names no measurement"),
        ((), ("999/p4_1",), "names no measurement"),
        (("103/p2_0",), ("103/p2_0",), "kept and dropped"),
    ],
)
def test_entries_that_make_no_sense_are_refused(keep: tuple[str, ...], drop: tuple[str, ...], words: str) -> None:
    with pytest.raises(InputError, match=words):
        adjusted(keep, drop)
