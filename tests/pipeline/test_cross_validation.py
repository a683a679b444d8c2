"""Cross-validation: each point of the control is what it is to a run that has not seen it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.network import snooping
from photostrip.network.adjustment import solve
from photostrip.pipeline import precision
from photostrip.pipeline.cross_validation import FOLDS
from photostrip.pipeline.inputs import Inputs, Settings
from photostrip.pipeline.strips import method
from photostrip.pipeline.strips.photos import form_strip
from photostrip.report.sections.accuracy_report import sections_of
from photostrip.result.verdict import FAILED, GOOD, LOOK, UNVERIFIED
from photostrip.simulation.simulation import simulate
from photostrip.simulation.spec import Models
from photostrip.strip.gross_errors import control_screening
from tests.loops import nonempty
from tests.results import solved, spec
from tests.simulated import inputs_of

if TYPE_CHECKING:
    from photostrip.network.adjustment import BundleSolution
    from photostrip.network.problem import BundleProblem
    from photostrip.strip.gross_errors.control_search import Columns, JointAdjustment

ADJUSTMENTS = ("similarity", "polynomial", "bundle")
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
def test_the_strips_are_formed_once_and_the_adjustments_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    formed: list[object] = []

    def counted(*given: object) -> object:
        formed.append(given)
        return form_strip(*given)  # type: ignore[arg-type]

    monkeypatch.setattr(method, "form_strip", counted)
    document = solved(without_checks(bands=5), TURNED).document
    folds = document["cross_validation"]["folds"]
    assert len(formed) == 1
    assert len(folds) == FOLDS
    names = [name for fold in folds for name in fold["left_out"]]
    assert sorted(names) == sorted(row["id"] for row in document["control"])
    assert len(names) == 15
    # points of one fold stand far apart: no band loses two of its three points at once
    place = {row["id"]: row["x"] for row in document["points"]}
    pairs = [fold["left_out"] for fold in folds if len(fold["left_out"]) == 2]
    assert min(abs(place[first] - place[second]) for first, second in nonempty(pairs)) > 1000


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


@pytest.mark.slow
def test_control_that_contradicts_what_is_predicted_is_not_good() -> None:
    inputs = without_checks()
    # stated ten times better than it is: 0.5 m for 0.05 m
    rng = np.random.default_rng(5)
    control = replace(inputs.control, enu=inputs.control.enu + rng.normal(0, 1.0, inputs.control.enu.shape))
    settings = replace(TURNED, bundle=replace(TURNED.bundle, screening="none"))
    document = solved(replace(inputs, control=control), settings).document
    assert document["status"] == FAILED
    assert any(
        text.startswith("control points left out in turn are farther") for text in document["verdict"]["look_at"]
    )


def test_control_that_cannot_be_spared_verifies_nothing() -> None:
    inputs = without_checks()
    few = inputs.control.take(np.array([0, 2, 7]))
    document = solved(replace(inputs, control=few), replace(TURNED, adjustment="similarity")).document
    block = document["cross_validation"]
    assert [fold["left_out"] for fold in block["folds"]] == [[name] for name in few.ids]
    assert all(fold["reason"] for fold in nonempty(block["folds"]))
    assert (block["points"], block["p"], block["plan"]["count"]) == ([], None, None)
    assert document["verdict"]["verified"] is False
    assert "the control left out in turn cannot (" in document["verdict"]["verification"]


@pytest.mark.slow
def test_independent_models_too() -> None:
    wanted = spec("projected")
    inputs = inputs_of(simulate(replace(wanted, models=Models(), control=replace(wanted.control, check=0))))
    document = solved(inputs, TURNED).document
    assert document["cross_validation"]["plan"]["count"] == 9
    assert 0.4 < document["cross_validation"]["height"]["ratio"] < 2.0


@pytest.mark.slow
def test_without_standard_deviations_nothing_is_predicted_but_differences_are_there() -> None:
    document = solved(without_checks(), replace(TURNED, precision=False)).document
    block = document["cross_validation"]
    assert (block["p"], block["plan"]["count"], block["height"]["ratio"]) == (None, 9, None)
    assert 0.0 < block["plan"]["rms"] < 1.0
    assert document["verdict"]["verified"] is True
    assert any(each.title == "Cross-validation" for each in sections_of(document))


@pytest.mark.slow
@pytest.mark.parametrize("adjustment", ["polynomial", "bundle"])
def test_control_that_the_whole_rejected_is_not_searched_for_again(
    adjustment: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A fifth of the control 30 m off: after the whole, each fold is one adjustment."""
    inputs = without_checks(bands=5)
    enu, rng = inputs.control.enu.copy(), np.random.default_rng(2)
    wrong = rng.choice(len(enu), len(enu) // 5, replace=False)
    enu[wrong] += rng.choice([-30.0, 30.0], (len(wrong), 3))
    searched, of_variances = list[int](), control_screening.candidates
    adjusted, of_bundle = list[int](), solve

    def counted_search(whole: JointAdjustment) -> Columns:
        searched.append(1)
        return of_variances(whole)

    def counted_adjustment(problem: BundleProblem, *, rough: bool = False) -> BundleSolution:
        adjusted.append(1)
        return of_bundle(problem, rough=rough)

    monkeypatch.setattr(control_screening, "candidates", counted_search)
    monkeypatch.setattr(snooping, "solve", counted_adjustment)
    given = replace(inputs, control=replace(inputs.control, enu=enu))
    document = solved(given, Settings(adjustment=adjustment)).document
    alone = len(searched), len(adjusted)
    again = solved(given, replace(TURNED, adjustment=adjustment)).document
    rejected = {each["point"] for each in document["rejected"] if each["stage"] in {"control", "bundle"}}
    assert rejected >= {given.control.ids[row] for row in wrong}
    assert not rejected & {row["id"] for row in nonempty(again["cross_validation"]["points"])}
    assert len(searched) == 2 * alone[0]  # nothing more than in the whole of the second run
    assert len(adjusted) == 2 * alone[1] + (FOLDS if adjustment == "bundle" else 0)


@pytest.mark.slow
def test_points_that_are_too_many_to_be_tested_together_have_standard_deviations(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(precision, "MOST_TESTED", 1)
    document = solved(without_checks(bands=5), replace(TURNED, adjustment="polynomial")).document
    points = document["cross_validation"]["points"]
    assert len(points) > FOLDS
    assert all(row["sigma_z"] > 0.0 for row in nonempty(points))
