"""Wrong scale ratios and wrong control in whole strips whose truth is known."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.geodesy.tying import tie_frames
from photostrip.pipeline.formed_photos import form_strip
from photostrip.pipeline.inputs import Settings
from photostrip.pipeline.run import triangulate
from photostrip.pipeline.strip_method import adjust_formed
from tests.much_wrong_control import two_fifths_wrong
from tests.strips import LOCAL, MICROMETRE, control_points, fly, project

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.pipeline.results import Result
    from photostrip.points import ControlPoints
    from tests.strips import Flown

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]
    Flags = NDArray[np.bool_]

SIGMA = 5 * MICROMETRE
STATIONS = (0, 3, 6, 9, 12)


def flown(seed: int = 1, extra: int = 60) -> Flown:
    return fly(seed, 13, sigma=SIGMA, extra=extra)


def adjusted(strip: Flown, wrong: dict[str, tuple[float, float, float]] | None = None) -> Result:
    """Adjust a strip with control in five bands; errors of given coordinates by name of the point."""
    rng = np.random.default_rng(7)
    names = strip.bands(*STATIONS)
    given = {name: strip.xyz[strip.at[name]] + rng.normal(0, 0.02, 3) for name in names}
    for name, error in (wrong or {}).items():
        given[name] = given[name] + error
    return triangulate(project(strip, control_points(given, sigma=0.02)), Settings(adjustment="polynomial"))


# ----------------------------------------------------------------------------------------------------- control


@pytest.mark.slow
@pytest.mark.parametrize(
    ("error", "axes"),
    [((0.0, 0.0, 8.0), (2,)), ((-30.0, 0.0, 0.0), (0,)), ((0.0, 5000.0, 0.0), (1,))],
)
def test_a_wrong_coordinate_is_found_and_its_size_estimated(error: tuple[float, float, float], axes: object) -> None:
    result = adjusted(flown(), {"p6_1": error})
    (found,) = result.strips[0].wrong_control
    assert result.strips[0].control.ids[found.row] == "p6_1"
    assert found.axes == axes
    assert found.size == pytest.approx(error, abs=3.0)
    assert found.value > found.limit
    assert [note.points for note in result.notes if note.code == "control-rejected"] == [("p6_1",)]


@pytest.mark.slow
def test_exchanged_points_are_named_as_an_exchange() -> None:
    strip = flown()
    step = strip.xyz[strip.at["p9_-1"]] - strip.xyz[strip.at["p6_1"]]
    found = adjusted(strip, {"p6_1": tuple(step), "p9_-1": tuple(-step)}).strips[0]
    ids = found.control.ids
    assert {each.cause for each in found.wrong_control} == {"exchanged"}
    assert {ids[each.row]: ids[each.other] for each in found.wrong_control} == {"p6_1": "p9_-1", "p9_-1": "p6_1"}


# -------------------------------------------------------------------------------------------- much wrong control


def scattered(strip: Flown, seed: int, share: float) -> tuple[ControlPoints, Flags]:
    """Control anywhere in a strip, a fifth each in plan only and in height only; a share of it 5 to 100 m wrong."""
    rng = np.random.default_rng(seed)
    o = strip.observations
    several = np.flatnonzero(np.bincount(o.point, minlength=len(o.point_ids)) > 1)
    names = [o.point_ids[number] for number in rng.choice(several, int(rng.integers(14, 20)), replace=False)]
    kinds = rng.choice(["xy", "z", "xyz", "xyz", "xyz"], len(names)).tolist()
    given = {name: strip.xyz[strip.at[name]] + rng.normal(0, 0.02, 3) for name in names}
    wrong: dict[str, str] = {}
    for name, kind in zip(names, kinds, strict=True):
        part = "z" if kind == "z" else "xy" if kind == "xy" or rng.random() < 0.6 else "z"
        carrying = [kind for kind in kinds if part in kind]
        if list(wrong.values()).count(part) + 1 <= share * len(carrying):
            wrong[name] = part
            error = rng.normal(size=3) * ([1, 1, 0] if part == "xy" else [0, 0, 1])
            given[name] = given[name] + error / np.linalg.norm(error) * np.exp(rng.uniform(np.log(5), np.log(100)))
    control = control_points(given, dict(zip(names, kinds, strict=True)), sigma=0.02)
    parts = [wrong.get(name, "") for name in control.ids]
    return control, np.array([[axis in part for axis in "xyz"] for part in parts])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_two_fifths_of_wrong_control_come_out_and_nothing_else(seed: int) -> None:
    strip = flown(seed % 2)
    control, bad = scattered(strip, seed, 0.4)
    for columns, fewest in ((bad[:, 0], 4), (bad[:, 2], 3)):
        assert columns.sum() >= fewest
    inputs, (frames, _) = project(strip, control), tie_frames([LOCAL])
    formed = form_strip(inputs.strips[0], inputs.observations, Settings())
    kept = adjust_formed(formed, control, frames, Settings()).control
    row_of = {name: row for row, name in enumerate(control.ids)}
    rows = [row_of[name] for name in kept.ids]
    assert np.array_equal(kept.use, control.use[rows] & ~bad[rows])


@pytest.mark.slow
@pytest.mark.parametrize("seed", [21, 28, 41, 1560036])
def test_two_fifths_of_the_control_are_found_wrong(seed: int) -> None:
    """Suspected on the way: more than half, or a set that explains the misclosures not quite."""
    wrong, named, others = two_fifths_wrong(seed)
    assert (named, others) == (wrong, 0)
