"""What is sound is called so however it was flown: corridors in the wind, oblique cameras, orbits, dense points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import photostrip
from tests.flown import Flown, corridor, orbit, project

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.flown import Project


def told(made: Project) -> tuple[list[str], list[str], list[str]]:
    """Codes that `check` and `run` tell, and what to look at."""
    document, tables = made
    checked = photostrip.check(document, tables=tables)
    result = photostrip.run(document, tables=tables).document
    codes = [each["code"] for each in result["findings"]]
    return [each.code for each in checked.findings], codes, result["verdict"]["look_at"]


@pytest.mark.parametrize(
    "fly",
    [
        lambda rng: corridor(rng, height=100.0, wind=0.03),
        lambda rng: corridor(rng, ahead=40.0),
        orbit,
    ],
    ids=["wind", "oblique", "orbit"],
)
def test_a_sound_flight_has_no_finding(fly: Callable[[np.random.Generator], Flown]) -> None:
    rng = np.random.default_rng(0)
    assert told(project(rng, fly(rng))) == ([], [], [])


@pytest.mark.parametrize("ahead", [0.0, 40.0])
def test_an_id_of_two_points_is_named_however_the_cameras_look(ahead: float) -> None:
    rng = np.random.default_rng(3)
    document, tables = project(rng, corridor(rng, ahead=ahead))
    point, photo = (np.array(tables["images.csv"][key]) for key in ("point", "photo"))
    shown = {name: set(photo[point == name]) for name in np.unique(point).tolist() if name.startswith("P")}
    one, other = (
        next(name for name, on in shown.items() if len(on) > 2 and {photo[0] for photo in on} == {strip})
        for strip in "13"
    )
    tables["images.csv"]["point"] = np.where(point == other, one, point).tolist()
    found = photostrip.run(document, tables=tables).document["findings"]
    assert [(each["code"], each["points"]) for each in found] == [("P301", [one])]
