"""What a result has to show before its accuracy is stated; the worked examples of the norms, and their factors."""

from __future__ import annotations

from dataclasses import replace
from math import sqrt
from typing import Any

import numpy as np
import pytest
from scipy import stats

from photostrip.errors import InputError
from photostrip.result import statement
from photostrip.result.certificate import result_hash
from photostrip.result.given import differences
from photostrip.result.statement import class_of, exit_code, figures_of, stated, statement_document, statement_of
from photostrip.result.table import Table
from tests.results import Case, by_rows, case, in_tables

GOOD = {"count": 30, "rmse": 0.106, "survey": 0.0424, "accuracy": 0.1141, "class_cm": 12, "mean": 0.09, "p90": 0.16}


def block(**parts: Any) -> dict[str, Any]:  # noqa: ANN401
    """Give a block of a result with 30 check points, with other values of some keys."""
    axis = {"rmse": 0.08, "mean": 0.001}
    found = {
        "status": "", "not_measured": 0, "sentences": [], "remarks": [],
        "reasons": Table.of_rows("statement.reasons", ()),
        "plan": GOOD, "height": {**GOOD, "rmse": 0.138, "survey": 0.05, "accuracy": 0.1471, "class_cm": 15},
        "axes": {"east": axis, "north": axis, "up": axis}, "space": {"accuracy": 0.1862, "class_cm": 19},
        "circle": {"ratio": 0.82, "ce90": 0.16, "ce95": 0.1825, "radial95": 0.1834},
        "line": {"le90": 0.2276, "le95": 0.2712},
    }  # fmt: skip
    return found | parts


def statement_on(given: Case, **changed: Any) -> dict[str, Any]:  # noqa: ANN401
    document = in_tables(given.document | changed)
    found: dict[str, Any] = statement_of(given.result, differences(given.result), document)
    return found


def reasons(found: dict[str, Any]) -> set[str]:
    return {each["code"] for each in found["reasons"]}


def test_thirty_points_are_tested_in_the_words_of_the_standard() -> None:
    found = stated(block())
    plan, height, space, *nssda = found["sentences"]
    assert found["status"] == "tested"
    assert plan.endswith(
        "Edition 2, Version 2 (2024) for a 12 cm RMSE_H Horizontal Positional Accuracy Class. "
        "The tested horizontal positional accuracy was found to be RMSE_H = 11.4 cm."
    )
    assert height.endswith("The Non-Vegetated Vertical Accuracy (NVA) was found to be RMSE_V = 14.7 cm.")
    assert "19 cm RMSE_3D Three-Dimensional Positional Accuracy Class" in space
    assert nssda == [
        "NSSDA: Tested 0.183 meters horizontal accuracy at 95% confidence level.",
        "NSSDA: Tested 0.157 meters vertical accuracy at 95% confidence level.",
    ]


def test_fewer_points_are_said_to_be_fewer_and_the_nssda_asks_for_twenty() -> None:
    said = [sum("NSSDA" in text for text in stated(block(plan={**GOOD, "count": n}))["sentences"]) for n in (19, 20)]
    assert said == [1, 2]
    found = stated(block(plan={**GOOD, "count": 29}))
    assert found["status"] == "reduced"
    assert found["sentences"][0].startswith("The test does not meet the minimum of 30 check points in plan.")
    assert "using ONLY 29 checkpoints" in found["sentences"][0]
    assert not any("3D" in text for text in found["sentences"])
    assert exit_code(found["status"]) == 1
    nothing = dict.fromkeys(GOOD) | {"count": 0}
    found = stated(block(height=nothing, space={"accuracy": None, "class_cm": None}))
    assert "Nothing is stated in height: no check point tests it." in found["sentences"]
    assert found["status"] == "reduced"


@pytest.mark.parametrize(
    ("size", "status"),
    [(8.47, "refused"), (8.48, "not met"), (11.4, "not met"), (11.41, "tested"), (20, "tested")],
)
def test_a_class_that_is_asked_for_is_met_or_not(size: float, status: str) -> None:
    """Check points are twice as good as what they test."""
    found = stated(block(), {"plan": size})
    assert found["status"] == status
    assert any("does not meet" in text for text in found["sentences"]) == (status == "not met")
    assert ("statement-survey" in reasons(found)) == (status == "refused")


def test_a_mean_that_is_not_by_chance_is_remarked() -> None:
    axes = block()["axes"]
    assert stated(block())["remarks"] == []
    (remark,) = stated(block(axes=axes | {"up": {"rmse": 0.138, "mean": -0.081}}))["remarks"]
    assert "in height is -0.081 m, 59 % of the rms error" in remark


def test_a_result_without_check_points_is_refused() -> None:
    given = case()
    control = given.result.inputs.control
    without = replace(control, check=np.zeros(len(control), bool))
    result = replace(given.result, inputs=replace(given.result.inputs, control=without))
    rows = [row | {"role": "control"} for row in given.document["control"]]
    found = statement_of(result, differences(given.result), in_tables(given.document | {"control": rows}))
    assert reasons(found) == {"statement-no-check-points"}
    assert found["sentences"] == []
    assert found["plan"]["accuracy"] is None


def test_a_local_frame_and_a_failed_result_are_refused() -> None:
    assert "statement-frame" in reasons(statement_on(case("local")))
    sound = case()
    assert "statement-frame" not in reasons(statement_on(sound))
    for status, forbidden in (("failed", True), ("unverified", True), ("look", False), ("good", False)):
        assert ("statement-verdict" in reasons(statement_on(sound, status=status))) == forbidden


def test_check_points_that_stand_out_or_are_blamed_are_refused() -> None:
    sound = case()
    control = [dict(row) for row in sound.document["control"]]
    odd = next(row for row in control if row["role"] == "check")
    odd["stands_out"] = ["plan"]
    found = statement_on(sound, control=control)
    (reason,) = [each for each in found["reasons"] if each["code"] == "statement-odd-points"]
    assert reason["points"] == [odd["id"]]
    blame = {"accepted": False, "points": [odd["id"]]}
    assert "statement-odd-points" in reasons(statement_on(sound, findings=[blame]))
    assert "statement-odd-points" not in reasons(statement_on(sound, findings=[blame | {"accepted": True}]))


@pytest.mark.parametrize("frame", ["geographic", "geocentric", "north first"])
def test_the_same_points_give_the_same_figures_in_every_frame(frame: str) -> None:
    """The frames have their control of their own draws; plan and height come from the same definition in all."""
    given = case(frame)
    found, control = statement_on(given), given.document["control"]
    for part in ("plan", "height"):
        sizes = [row[part] for row in control if row["role"] == "check" and row[part] is not None]
        assert found[part]["rmse"] == pytest.approx((sum(s**2 for s in sizes) / len(sizes)) ** 0.5, abs=2e-4)
        assert found[part]["largest"] == pytest.approx(max(map(abs, sizes)), abs=1e-4)
    sigma = given.result.inputs.control.sigma[given.result.inputs.control.check]
    if frame != "geocentric":
        assert found["height"]["survey"] == pytest.approx(sigma[:, 2].mean(), rel=1e-3)
    total = (sigma**2).sum(axis=1).mean()
    assert found["plan"]["survey"] ** 2 + found["height"]["survey"] ** 2 == pytest.approx(total, rel=2e-2)


def certified(document: dict[str, Any]) -> dict[str, Any]:
    """Give a document as it is read again, with the hash of its numbers."""
    found: dict[str, Any] = in_tables(by_rows(document))
    empty = {"set": [], "resolved_sha256": "", "inputs": [], "grids": [], "epochs": [], "versions": {}}
    versions = dict.fromkeys(("photostrip", "python", "numpy", "scipy", "pyproj", "proj", "epsg"))
    certificate = {"result_sha256": result_hash(found), **empty, "versions": versions}
    whole: dict[str, Any] = in_tables(found | {"certificate": certificate})
    return whole


@pytest.mark.parametrize(("part", "key", "value"), [("plan", "accuracy", 0.01), ("height", "count", 31)])
def test_an_edited_result_is_refused(part: str, key: str, value: float) -> None:
    document = certified(case().document | {"statement": block()})
    assert statement_document(document, "result.json")["result_sha256"] == document["certificate"]["result_sha256"]
    document["statement"][part][key] = value
    with pytest.raises(InputError) as refused:
        statement_document(document, "result.json")
    assert [fault.code for fault in refused.value.faults] == ["result-edited"]
    del document["certificate"]
    with pytest.raises(InputError, match="no certificate"):
        statement_document(document, "result.json")


def test_the_document_names_every_reason() -> None:
    document = certified(case("local").document)
    with pytest.raises(InputError) as refused:
        statement_document(document, "result.json")
    codes = {fault.code for fault in refused.value.faults}
    assert codes == {each["code"] for each in document["statement"]["reasons"]}
    assert codes
    del document["statement"]
    with pytest.raises(InputError, match="run the project again"):
        statement_document(document, "result.json")


# ASPRS Positional Accuracy Standards, edition 1 (2014), annex D, table D.1: measured minus surveyed, metres.
ANNEX_D = [
    (-0.140, -0.070, -0.071),
    (-0.100, -0.100, 0.010),
    (0.017, -0.070, 0.102),
    (-0.070, 0.150, -0.100),
    (0.130, 0.120, 0.087),
]
# Photogrammetric Engineering & Remote Sensing 80 (2014) 5, p. 397, table 3, metres.
MAPPING_MATTERS = [
    (-0.060, 0.080, 0.055),
    (0.100, -0.045, -0.006),
    (-0.060, 0.080, -0.017),
    (-0.112, 0.007, 0.042),
    (-0.120, 0.150, -0.011),
    (-0.100, -0.045, 0.013),
    (-0.060, 0.080, 0.048),
]


def figures_at(rows: object, sigma: float = 0.0) -> dict[str, Any]:
    differences = np.array(rows, float)
    return figures_of(differences, np.full(differences.shape, sigma))


def test_the_example_of_the_asprs_standard_comes_out_to_the_printed_digit() -> None:
    found = figures_at(ANNEX_D)
    printed = {"east": ("-0.033", "0.102"), "north": ("0.006", "0.106"), "up": ("0.006", "0.081")}
    axes: dict[str, Any] = found["axes"]
    assert {axis: (f"{each['mean']:.3f}", f"{each['rmse']:.3f}") for axis, each in axes.items()} == printed
    assert f"{found['plan']['rmse']:.3f}" == "0.147"
    assert f"{found['circle']['radial95']:.3f}" == "0.255"
    assert f"{found['line']['le95']:.3f}" == "0.160"


def test_the_scatter_and_accuracy_of_published_surveys_follow() -> None:
    found = figures_at(MAPPING_MATTERS)["axes"]
    for axis, printed in {"east": "0.075", "north": "0.073", "up": "0.030"}.items():
        mean, rmse = found[axis]["mean"], found[axis]["rmse"]
        assert f"{sqrt(7 / 6 * (rmse**2 - mean**2)):.3f}" == printed
    # vertical accuracy report of the lidar survey of Barataria and Jean Lafitte (USGS, 2013): RMSEz and AccuracyZ
    heights = figures_at([(0.0, 0.0, 0.0574002119585), (0.0, 0.0, -0.0574002119585)])
    assert heights["line"]["le95"] == pytest.approx(0.112504415439, abs=1e-12)


def test_the_error_of_the_survey_is_counted() -> None:
    found = figures_at([(0.03, 0.04, 0.12), (-0.03, -0.04, -0.12)], sigma=0.05)
    assert found["plan"]["rmse"] == pytest.approx(0.05)
    assert found["plan"]["survey"] == pytest.approx(0.05 * sqrt(2))
    assert found["plan"]["accuracy"] == pytest.approx(0.05 * sqrt(3))
    assert found["height"]["accuracy"] == pytest.approx(0.13)
    assert found["space"]["accuracy"] == pytest.approx(sqrt(0.05**2 * 3 + 0.13**2))


def test_the_factors_are_those_of_normal_errors() -> None:
    assert f"{stats.norm.ppf(0.95):.4f}" == f"{statement.LINE_90:.4f}"
    assert f"{stats.norm.ppf(0.975):.4f}" == f"{statement.LINE_95:.4f}"
    assert f"{stats.rayleigh.ppf(0.90):.4f}" == f"{statement.CIRCLE_90:.4f}"
    assert f"{stats.rayleigh.ppf(0.95):.4f}" == f"{statement.CIRCLE_95:.4f}"
    assert f"{stats.rayleigh.ppf(0.95) / sqrt(2):.4f}" == f"{statement.RADIAL_95:.4f}"


def test_no_circle_is_stated_for_unequal_errors() -> None:
    found = figures_at([(1.0, 0.59, 0.1), (-1.0, -0.59, 0.1)])["circle"]
    assert found["ratio"] == pytest.approx(0.59)
    assert np.isnan([found["ce90"], found["ce95"], found["radial95"]]).all()


def test_at_most_one_difference_in_ten_is_larger_and_points_given_in_part_count_where_they_are() -> None:
    for count, beyond in ((9, 0), (10, 1), (19, 1), (30, 3)):
        heights = np.arange(1.0, count + 1)
        rows = np.column_stack([np.zeros(count), np.zeros(count), heights])
        found = figures_at(rows)["height"]["p90"]
        assert np.sum(heights > found) == beyond

    nothing = float("nan")
    found = figures_at([(0.1, 0.1, nothing), (nothing, nothing, 0.2), (0.3, nothing, nothing)])
    assert (found["plan"]["count"], found["height"]["count"]) == (1, 1)
    assert found["axes"]["east"]["rmse"] == pytest.approx(0.1)
    nobody = figures_at(np.zeros((0, 3)))
    assert nobody["plan"]["count"] == 0
    assert np.isnan(nobody["plan"]["accuracy"])
    assert nobody["plan"]["class_cm"] is None


@pytest.mark.parametrize(("metres", "class_cm"), [(0.12, 12), (0.1201, 13), (0.0, 1), (0.004, 1), (1.0, 100)])
def test_a_class_is_whole_centimetres(metres: float, class_cm: int) -> None:
    assert class_of(metres) == class_cm
