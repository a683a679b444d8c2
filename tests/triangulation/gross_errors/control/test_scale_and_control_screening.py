"""Wrong scale ratios and wrong control in whole strips whose truth is known."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.geodesy.tying import tie_frames
from photostrip.pipeline import Settings, triangulate
from photostrip.pipeline.strips.adjusting import adjust_formed
from photostrip.pipeline.strips.photos import form_strip
from photostrip.result.document import document_of
from photostrip.triangulation.relative_orientation.orientation import orient_again
from photostrip.triangulation.relative_orientation.solution import linearised_parallaxes
from photostrip.triangulation.strip_formation import scale_ratios
from photostrip.triangulation.strip_formation.scale_ratios import PassPoints
from photostrip.triangulation.strip_formation.scale_transfer import StripFormationSettings
from photostrip.triangulation.strip_formation.strip import form_from_pairs, model_points
from tests.strips import LOCAL, MICROMETRE, control_points, fly, project

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.pipeline import Result
    from photostrip.points import ControlPoints
    from photostrip.triangulation.relative_orientation.orientation import Orientation
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
    return triangulate(project(strip, control_points(given, sigma=0.02)), Settings())


# ---------------------------------------------------------------------------------------------- scale transfer


def test_scale_ratios_scatter_as_propagated() -> None:
    values = []
    for seed in range(12):
        strip = flown(seed)
        oriented = strip.oriented()
        sigma = np.full(oriented.pairs.size, np.sqrt(2) * SIGMA)
        joined = form_from_pairs(oriented, StripFormationSettings(), strip.photos, sigma).junctions
        vectors = model_points(oriented).vectors
        rows = PassPoints(joined.junction, joined.before, joined.after)
        single, model = scale_ratios.spreads(oriented, vectors, rows, sigma)
        values.append((joined.ratio / joined.factor[joined.junction] - 1) / np.hypot(single, model))
    # the mean of a joint takes its part away, the points take part in their own orientation
    assert 0.75 < np.concatenate(values).std() < 1.05


def distances(oriented: Orientation, rows: Numbers) -> tuple[Floats, Floats]:
    """Logarithms of the distances of points from both centres of their model."""
    vectors = model_points(oriented).vectors
    base, _ = oriented.relative
    right = vectors[rows] - base[oriented.pairs.pair[rows]]
    return np.log(np.linalg.norm(vectors[rows], axis=1)), np.log(np.linalg.norm(right, axis=1))


def test_the_spread_by_the_models_is_that_of_differences() -> None:
    strip = flown(3)
    oriented = strip.oriented()
    vectors = model_points(oriented).vectors
    joined = form_from_pairs(oriented, StripFormationSettings(), strip.photos).junctions
    rows = PassPoints(joined.junction, joined.before, joined.after)
    sigma = np.full(oriented.pairs.size, 0.007)
    slopes = []
    for side, row in ((1, joined.before), (0, joined.after)):
        columns = []
        for element in range(5):
            step = 1e-6 * np.eye(5)[element]
            up, down = (
                distances(replace(oriented, elements=oriented.elements + sign * step), row)[side] for sign in (1, -1)
            )
            columns.append((up - down) / 2e-6)
        slopes.append(np.column_stack(columns))
    variance = np.zeros(len(joined.junction))
    for joint in range(oriented.pairs.size - 1):
        here = joined.junction == joint
        for slope, model in zip(slopes, (joint, joint + 1), strict=True):
            own = slope[here] - slope[here].mean(axis=0)
            _, jacobian = linearised_parallaxes(oriented.elements, oriented.pairs)
            part = jacobian[:, oriented.pairs.pair == model]
            variance[here] += np.diag(own @ np.linalg.inv(part @ part.T) @ own.T) * sigma[model] ** 2
    _, model_spread = scale_ratios.spreads(oriented, vectors, rows, sigma)
    assert model_spread == pytest.approx(np.sqrt(variance), rel=1e-4)


def test_a_strip_formed_again_in_part_is_the_strip_formed_anew() -> None:
    strip = flown(4)
    oriented = strip.oriented()
    sigma = np.full(oriented.pairs.size, np.sqrt(2) * SIGMA)
    before = form_from_pairs(oriented, StripFormationSettings(), strip.photos, sigma)
    weight = oriented.pairs.weight.copy()
    weight[np.flatnonzero(oriented.pairs.pair == 5)[[1, 4]]] = 0.0
    changed = np.arange(oriented.pairs.size) == 5
    again = orient_again(oriented, weight, np.flatnonzero(changed))
    whole = form_from_pairs(again, StripFormationSettings(), strip.photos, sigma)
    part = form_from_pairs(again, StripFormationSettings(), strip.photos, sigma, earlier=(before, changed))
    for name in ("centers", "rotations", "scale", "model_xyz", "gap", "point", "xyz", "model_count"):
        assert np.array_equal(getattr(part, name), getattr(whole, name), equal_nan=True)
    for name in ("junction", "before", "after", "point", "ratio", "used", "limit", "factor", "spread", "weight"):
        assert np.array_equal(getattr(part.junctions, name), getattr(whole.junctions, name))
    assert not np.array_equal(whole.xyz, before.xyz)


def test_a_wrong_ratio_among_three_does_not_reach_the_scale() -> None:
    ratio = np.array([1.0002, 0.9999, 1.01, 1.0, 1.0001])
    joint = np.array([0, 0, 0, 1, 1])
    spread = (np.full(5, 2e-4), np.zeros(5))
    used, limit = scale_ratios.screen(ratio, np.ones(5), spread, joint, 2)
    assert used.tolist() == [True, True, False, True, True]
    assert (limit > 3 * 2e-4).all()
    assert (limit < 5 * 2e-4).all()


def test_of_two_ratios_none_is_rejected() -> None:
    ratio, joint = np.array([1.0, 1.1]), np.array([0, 0])
    used, _ = scale_ratios.screen(ratio, np.ones(2), (np.full(2, 1e-4), np.zeros(2)), joint, 1)
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


@pytest.mark.slow
def test_good_control_is_left_alone() -> None:
    alarms = [bool(adjusted(flown(seed)).strips[0].wrong_control) for seed in range(40)]
    assert sum(alarms) <= 3  # level 1 % a strip


# --------------------------------------------------------------------------------------------------------- the log


def test_rejected_control_stands_in_the_log() -> None:
    wrong = {"p3_1": (0.0, 8.0, 0.0), "p6_0": (0.0, 0.0, 4.0)}
    result = adjusted(flown(), wrong)
    rows = {row["point"]: row for row in document_of(result)["rejected"] if row["stage"] == "control"}
    assert set(rows) == set(wrong)
    for name, size in (("p3_1", 8.0), ("p6_0", 4.0)):
        row = rows[name]
        assert row["size"] == pytest.approx(size, abs=0.3)
        assert row["size_unit"] == "m"
        assert row["value"] > row["limit"] > 2
        assert not row["readmitted"]
    assert "north by about +" in rows["p3_1"]["reason"]
    assert "up by about +" in rows["p6_0"]["reason"]


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
@pytest.mark.parametrize("seed", range(6))
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
