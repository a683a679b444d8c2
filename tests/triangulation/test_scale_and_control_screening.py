"""Wrong scale ratios and wrong control in whole strips whose truth is known."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.pipeline import Settings, triangulate
from photostrip.triangulation import formation, scale_screening
from tests.strips import MICROMETRE, control_points, fly, project

if TYPE_CHECKING:
    from photostrip.pipeline import Result
    from tests.strips import Flown

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
    return triangulate(project(strip, control_points(given, sigma=0.02)), Settings())


# ---------------------------------------------------------------------------------------------- scale transfer


def test_scale_ratios_scatter_as_propagated() -> None:
    values = []
    for seed in range(12):
        strip = flown(seed)
        oriented = strip.oriented()
        sigma = np.full(oriented.pairs.size, np.sqrt(2) * SIGMA)
        joined = formation.form(oriented, formation.Settings(), strip.photos, sigma).junctions
        vectors, _, _ = formation.model_points(oriented)
        rows = (joined.joint, joined.before, joined.after)
        single, model = scale_screening.spreads(oriented, vectors, rows, sigma)
        values.append((joined.ratio / joined.factor[joined.joint] - 1) / np.hypot(single, model))
    # the mean of a joint takes its part away, the points take part in their own orientation
    assert 0.75 < np.concatenate(values).std() < 1.05


def test_a_wrong_ratio_among_three_does_not_reach_the_scale() -> None:
    ratio = np.array([1.0002, 0.9999, 1.01, 1.0, 1.0001])
    joint = np.array([0, 0, 0, 1, 1])
    spread = (np.full(5, 2e-4), np.zeros(5))
    used, limit = scale_screening.screen(ratio, np.ones(5), spread, joint, 2)
    assert used.tolist() == [True, True, False, True, True]
    assert (limit > 3 * 2e-4).all()
    assert (limit < 5 * 2e-4).all()


def test_of_two_ratios_none_is_rejected() -> None:
    ratio, joint = np.array([1.0, 1.1]), np.array([0, 0])
    used, _ = scale_screening.screen(ratio, np.ones(2), (np.full(2, 1e-4), np.zeros(2)), joint, 1)
    assert used.all()


# ----------------------------------------------------------------------------------------------------- control


@pytest.mark.parametrize(
    ("error", "axes"),
    [((0.0, 0.0, 8.0), ("up",)), ((-30.0, 0.0, 0.0), ("east",)), ((0.0, 5000.0, 0.0), ("north",))],
)
def test_a_wrong_coordinate_is_found_and_its_size_estimated(error: tuple[float, float, float], axes: object) -> None:
    result = adjusted(flown(), {"p6_1": error})
    (found,) = result.strips[0].wrong_control
    assert found.id == "p6_1"
    assert found.axes == axes
    assert found.size == pytest.approx(error, abs=3.0)
    assert found.value > found.limit
    assert [note.points for note in result.notes if note.code == "control-rejected"] == [("p6_1",)]


def test_a_wrong_height_leaves_the_plan_position_in_use() -> None:
    strip = adjusted(flown(), {"p6_1": (0.0, 0.0, 8.0)}).strips[0]
    row = strip.control.ids.index("p6_1")
    assert strip.control.use[row].tolist() == [True, True, False]


def test_exchanged_points_are_named_as_an_exchange() -> None:
    strip = flown()
    step = strip.xyz[strip.at["p9_-1"]] - strip.xyz[strip.at["p6_1"]]
    found = adjusted(strip, {"p6_1": tuple(step), "p9_-1": tuple(-step)}).strips[0].wrong_control
    assert {each.id: each.exchanged_with for each in found} == {"p6_1": "p9_-1", "p9_-1": "p6_1"}


def test_the_result_is_as_good_as_without_the_wrong_control() -> None:
    strip = flown()

    def rms(result: Result) -> float:
        errors = result.points.cartesian - strip.xyz[result.points.number]
        return float(np.sqrt((errors**2).mean()))

    wrong = rms(adjusted(strip, {"p6_1": (0.0, 0.0, 8.0)}))
    assert 0.01 < wrong < 1.15 * rms(adjusted(strip))


def test_good_control_is_left_alone() -> None:
    alarms = [bool(adjusted(flown(seed)).strips[0].wrong_control) for seed in range(40)]
    assert sum(alarms) <= 3  # level 1 % a strip
