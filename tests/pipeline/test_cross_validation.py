"""Cross-validation: each point of the control is what it is to a run that has not seen it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from photostrip.pipeline.inputs import Inputs, Settings
from photostrip.result.verdict import GOOD, LOOK, UNVERIFIED
from photostrip.simulation.simulation import simulate
from tests.loops import nonempty
from tests.results import solved, spec
from tests.simulated import inputs_of

TURNED = Settings(cross_validation=True)


@cache
def without_checks(bands: int = 3, strips: int = 1) -> Inputs:
    wanted = spec("projected", strips, 5.0, bands=bands)
    return inputs_of(simulate(replace(wanted, seed=12, control=replace(wanted.control, check=0))))


@pytest.mark.slow
@pytest.mark.parametrize(("adjustment", "strips"), [("similarity", 1), ("bundle", 1), ("polynomial", 2)])
def test_a_fold_is_the_run_without_its_point(adjustment: str, strips: int) -> None:
    inputs, settings = without_checks(strips=strips), Settings(adjustment=adjustment)
    document = solved(inputs, replace(settings, cross_validation=True)).document
    rows = {row["id"]: row for row in document["cross_validation"]["points"]}
    assert set(rows) == {row["id"] for row in document["control"] if row["measured"]}
    for fold in nonempty(document["cross_validation"]["folds"][::4]):
        name = fold["left_out"][-1]
        check = np.isin(inputs.control.ids, fold["left_out"])
        alone = solved(replace(inputs, control=replace(inputs.control, check=check)), settings).document
        (given,) = (row for row in alone["control"] if row["id"] == name)
        (tested,) = (row for row in alone["precision"]["check"]["points"] if row["id"] == name)
        keys = ("dx", "dy", "dz", "plan", "height", "plan_um", "height_um")
        (point,) = (row for row in alone["points"] if row["id"] == name)
        expected = {key: given[key] for key in keys}
        expected |= {"z_plan": tested["plan"], "z_height": tested["height"]}
        expected |= {f"sigma_{axis}": point[f"sigma_{axis}"] for axis in "xyz"}
        found = {key: rows[name][key] for key in expected}
        assert found == expected


@pytest.mark.slow
def test_it_verifies_what_has_no_check_points() -> None:
    plain = solved(without_checks()).document
    assert plain["status"] == UNVERIFIED
    assert "cross_validation" not in plain
    document = solved(without_checks(), TURNED).document
    assert document["status"] == GOOD, document["verdict"]["look_at"]
    assert document["verdict"]["verification"] == "9 control points in plan and 9 in height, left out in turn"
    assert document["verdict"]["accuracy"].endswith("at control points left out in turn")
    # nothing else is another than without it
    del document["cross_validation"]
    by_verdict = {"status", "verdict", "statement"}
    assert {key: value for key, value in document.items() if key not in by_verdict} == {
        key: value for key, value in plain.items() if key not in by_verdict
    }


@pytest.mark.slow
@pytest.mark.parametrize(("metres", "status"), [(0.0, GOOD), (3.0, LOOK)])
def test_a_wrong_height_among_five_points_is_not_good(metres: float, status: str) -> None:
    """Corners and middle: what control cannot check itself is seen where it is left out."""
    inputs = without_checks()
    enu = inputs.control.enu.copy()
    enu[4, 2] += metres
    control = replace(inputs.control, enu=enu).take(np.array([0, 2, 4, 6, 8]))
    document = solved(replace(inputs, control=control), TURNED).document
    assert document["status"] == status, document["verdict"]
