"""`adjustment: auto`: which strips get their polynomial, which their covariance, and what is said of it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from benchmarks.auto import Cell, errors_of
from photostrip.pipeline.choice import COVARIANCE, POLYNOMIAL, Witness, expected_of, method_of
from photostrip.pipeline.inputs import AUTO, METHODS
from photostrip.pipeline.results import Result
from photostrip.pipeline.run import triangulate
from photostrip.pipeline.strips import choosing
from photostrip.report.page.text import to_text
from photostrip.report.sections import decisions
from photostrip.report.sections.accuracy_report import sections_of
from photostrip.report.sections.decisions import choice_line, choices_in_short, decisions_section
from photostrip.result.document import document_of
from photostrip.simulation import Control, Flight, Points, Spec, simulate
from photostrip.triangulation.covariance_adjustment.settings import BETTER
from photostrip.triangulation.polynomial.correction import PolynomialSettings
from tests.loops import nonempty
from tests.simulated import inputs_of, settings_of

pytestmark = pytest.mark.usefixtures("_no_findings")
GOOD = (0.02, 0.02, 0.02)
DENSE = Spec(
    seed=1,
    flight=Flight(photos=3),
    points=Points(rows=5, extra_per_model=10),
    control=Control(bands=3, per_band=5, check=0, sigma=GOOD),
)
USUAL = Spec(
    seed=2,
    flight=Flight(photos=12),
    points=Points(rows=5, reach_percent=75.0),
    control=Control(bands=4, per_band=3, check=0, sigma=GOOD),
)
SPECS = {
    "dense": DENSE,
    "apart": replace(DENSE, seed=35),
    "usual": USUAL,
    "corners": replace(USUAL, control=replace(USUAL.control, bands=2, per_band=2)),
    "long": replace(USUAL, flight=Flight(photos=300), control=replace(USUAL.control, every=20)),
}


@cache
def adjusted(name: str, adjustment: str = AUTO, lens_um: float = 0.0) -> Result:
    simulation = simulate(SPECS[name])
    inputs = inputs_of(simulation)
    xy = inputs.observations.xy / 115.0
    lens = lens_um / 1000 * xy * (xy**2).sum(axis=1)[:, None] * [0.0, 1.0]  # a distortion in y alone bends the strip
    inputs = replace(inputs, observations=replace(inputs.observations, xy=inputs.observations.xy + lens))
    return triangulate(inputs, replace(settings_of(simulation), adjustment=adjustment, precision=False))


def points_of(result: Result) -> tuple[float, ...]:
    return tuple(result.points.cartesian.ravel().tolist())


def test_a_short_strip_with_dense_control_keeps_its_polynomial() -> None:
    (strip,) = adjusted("dense").strips
    assert strip.choice is not None
    assert strip.choice.taken == "polynomial"
    assert strip.choice.predicted.ratio > BETTER
    assert strip.choice.expected.ratio > BETTER
    assert strip.of_photos.covariance is None
    assert points_of(adjusted("dense")) == points_of(adjusted("dense", "polynomial"))


def test_most_short_strips_with_dense_control_keep_their_polynomial() -> None:
    taken = []
    for seed in nonempty(range(1, 21)):
        simulation = simulate(replace(DENSE, seed=seed))
        settings = replace(settings_of(simulation), precision=False)
        choice = triangulate(inputs_of(simulation), settings).strips[0].choice
        assert choice is not None
        assert choice.predicted.for_polynomial
        taken.append(choice.taken)
    assert 14 <= taken.count(POLYNOMIAL) < len(taken)  # 16


def test_a_strip_whose_results_are_apart_gets_its_covariance() -> None:
    """Control at both ends of 100 photos alone: 125 m by the polynomial, 96 m by the covariance."""
    errors, choice = errors_of(Cell(100, 60.0, 2, 3, "lens"), 77)
    assert choice is not None
    assert choice.predicted.ratio > BETTER > choice.expected.ratio
    assert (choice.taken, choice.apart, choice.contradicted) == (COVARIANCE, True, False)
    assert errors["auto"].tolist() == errors["covariance"].tolist()
    by_polynomial, by_covariance = (np.sqrt(errors[each].prod()) for each in ("polynomial", "covariance"))
    assert by_polynomial > 1.25 * by_covariance > 100.0


@pytest.mark.parametrize("name", ["usual", "corners", pytest.param("long", marks=pytest.mark.slow)])
def test_other_strips_get_their_covariance(name: str) -> None:
    result = adjusted(name)
    (strip,) = result.strips
    choice = strip.choice
    assert choice is not None
    assert (choice.taken, choice.contradicted) == ("covariance", False)
    assert choice.predicted.ratio < BETTER
    assert choice.left_out is not None
    assert choice.excess == pytest.approx(1.0, abs=0.7)
    assert strip.polynomial is not None  # shown all the same
    assert points_of(result) == points_of(adjusted(name, "covariance"))


@pytest.mark.slow
def test_a_lens_error_that_no_calibration_knows_brings_the_polynomial_back() -> None:
    (strip,) = adjusted("usual", AUTO, 60.0).strips
    choice = strip.choice
    assert choice is not None
    assert choice.left_out is not None
    assert (choice.taken, choice.contradicted) == ("polynomial", True)
    assert choice.predicted.ratio < BETTER < 1 / BETTER < choice.left_out.ratio
    assert choice.excess > choosing.MOST_EXCESS
    (note,) = [note for note in strip.notes if note.code == "strip-contradicted"]
    assert f"{choice.excess:.1f} times what the covariance of the strip lets expect" in note.message
    document = document_of(adjusted("usual", AUTO, 60.0))
    assert document["status"] == "look"  # its standard deviations do not hold
    assert any(note.message in text for text in document["verdict"]["look_at"])


@pytest.mark.parametrize(
    ("models", "bands", "excess", "covariance", "taken"),
    [
        (20, 3, 3.6, 1.2, "polynomial"),
        (20, 3, 3.4, 1.2, "covariance"),  # such errors are to be expected
        (20, 3, 3.6, 1.1, "covariance"),  # those of the polynomial are hardly smaller
        (20, 2, 9.0, 1.2, "covariance"),  # nothing between two bands tells how the strip bends
        (299, 3, 9.0, 1.2, "covariance"),  # 150 models: 3.5 times the root of 150 / 14, 11.4
        (299, 3, 11.5, 1.2, "polynomial"),
    ],
)
def test_left_out_errors_decide_where_they_exceed_what_is_to_be_expected_between_bands(
    models: int, bands: int, excess: float, covariance: float, taken: str
) -> None:
    left_out = Witness((1.0, 1.0), (covariance, covariance), 1)
    assert choosing.decide(COVARIANCE, left_out, excess, bands, models) == taken
    assert choosing.decide(POLYNOMIAL, left_out, excess, bands, models) == POLYNOMIAL


@pytest.mark.parametrize(
    ("predicted", "difference", "taken"),
    [
        (0.91, (0.0, 0.0), "polynomial"),
        (0.89, (0.0, 0.0), "covariance"),  # it does better, however near the results are
        (0.91, (0.48, 0.48), "polynomial"),  # 1 / hypot(1, 0.48) = 0.902
        (0.91, (0.49, 0.49), "covariance"),  # 0.898
        (0.91, (0.0, 0.70), "polynomial"),  # the geometric mean of plan and height counts: 0.905
        (0.91, (0.0, 0.75), "covariance"),  # 0.894
    ],
)
def test_the_polynomial_stays_where_predictions_and_results_agree(
    predicted: float, difference: tuple[float, float], taken: str
) -> None:
    before = Witness((1.0 / predicted, 1.0 / predicted), (1.0, 1.0), 100)
    assert method_of(before, expected_of(before, difference)) == taken


def test_the_error_of_the_covariance_and_the_difference_of_the_results_are_independent() -> None:
    """So their squares add: what the ratio with the results says is what the errors come to, in the mean of strips."""
    cell, ratios, realised = Cell(6, 60.0, 2, 3, "none"), [], []
    for seed in nonempty(range(1, 41)):
        errors, choice = errors_of(cell, seed)
        assert choice is not None
        ratios.append(choice.expected.ratio)
        realised.append(np.sqrt((errors["covariance"] / errors["polynomial"]).prod()))
    expected, found = np.exp(np.log([ratios, realised]).mean(axis=1))
    assert found == pytest.approx(expected, rel=0.1)
    assert np.corrcoef(np.log(ratios), np.log(realised))[0, 1] > 0.3  # standard deviations alone tell strips not apart


def test_standard_deviations_are_those_that_either_run_states() -> None:
    """Rms over all points that are not control: short strips compare all of them."""
    simulation = simulate(USUAL)
    choice = adjusted("usual").strips[0].choice
    assert choice is not None
    for method in nonempty(("polynomial", "covariance")):
        settings = replace(settings_of(simulation), adjustment=method)
        result = triangulate(inputs_of(simulation), settings)
        assert result.precision is not None
        new = np.setdiff1d(np.arange(len(result.points.number)), result.control_rows)
        axes = result.strips[0].intermediate.axes
        mean = np.diagonal(axes.T @ result.precision.points[new] @ axes, axis1=1, axis2=2).mean(axis=0)
        stated = np.sqrt([mean[:2].mean(), mean[2]])
        assert getattr(choice.predicted, method) == pytest.approx(tuple(stated), rel=1e-9)
    assert choice.predicted.count == len(new)


def test_the_difference_is_that_of_both_results() -> None:
    choice = adjusted("usual").strips[0].choice
    first, second = (adjusted("usual", method) for method in ("polynomial", "covariance"))
    assert choice is not None
    new = np.setdiff1d(np.arange(len(first.points.number)), first.control_rows)
    apart = (first.points.cartesian - second.points.cartesian)[new] @ first.strips[0].intermediate.axes
    mean = (apart**2).mean(axis=0)
    assert choice.difference == pytest.approx((np.sqrt(mean[:2].mean()), np.sqrt(mean[2])), rel=1e-6)
    of_covariance = np.array(choice.predicted.covariance)
    both = of_covariance / np.hypot(of_covariance, choice.difference)
    assert choice.expected.ratio == pytest.approx(np.sqrt(both.prod()))


@pytest.mark.parametrize("method", [each for each in METHODS if each != "bundle"])
def test_a_method_that_is_asked_for_is_made(method: str) -> None:
    result = adjusted("usual", method)
    (strip,) = result.strips
    assert strip.choice is None
    assert (strip.polynomial is not None) == (method == "polynomial")
    assert (strip.of_photos.covariance is not None) == (method == "covariance")
    document = document_of(result)
    assert document["adjustment"] == method
    assert "choices" not in document


def test_the_result_says_what_was_taken_and_why() -> None:
    document = document_of(adjusted("usual"))
    (choice,) = document["choices"]
    assert document["adjustment"] == choice["taken"] == "covariance"
    assert document["settings"]["adjustment"] == "auto"
    assert document["polynomials"][0]["degree"] > 0
    assert document["covariance"][0]["strip"] == choice["strip"]
    assert 0 < choice["predicted"]["ratio"] < BETTER
    assert choice["left_out"]["count"] <= 12
    text = " ".join(to_text("", sections_of(document), 100).split())
    figures = [choice["predicted"]["polynomial"], choice["predicted"]["covariance"]]
    first, second = (f"{each['plan']:.3f}/{each['height']:.3f} m" for each in figures)
    both = f"{first} with the polynomial, {second} with the covariance"
    assert f"standard deviations of new points, of one plan coordinate/of the height, {both}" in text
    assert "weighed and not taken: the strip was adjusted with its covariance" in text
    difference = choice["difference"]
    assert difference["ratio"] < 1
    apart = f"{difference['plan']:.3f}/{difference['height']:.3f} m (ratio with that {difference['ratio']:.2f})"
    assert f"; the results differ by {apart}; errors at" in text
    assert document_of(adjusted.__wrapped__("usual")) == document


def test_ratios_at_the_limit_show_on_which_side_they_are() -> None:
    assert (BETTER, f"{100 * (1 - BETTER):.0f} %") == (decisions.LIMIT, decisions.AGREEING)  # a report knows no methods
    (choice,) = document_of(adjusted("usual"))["choices"]
    for value, shown, percent in nonempty([(0.897, "0.897", "10.3"), (0.903, "0.903", "9.7"), (0.5, "0.50", "50")]):
        ratios = {name: {**choice[name], "ratio": value} for name in ("predicted", "difference")}
        line = choice_line({**choice, **ratios})
        assert f"(ratio {shown}); the results differ by" in line
        assert f"(ratio with that {shown})" in line
        assert line.startswith(f"covariance, which betters the polynomial by {percent} %: ")


def test_a_degree_that_was_asked_for_and_not_taken_is_told() -> None:
    simulation = simulate(USUAL)
    settings = replace(settings_of(simulation), polynomial=PolynomialSettings(degree="1"), precision=False)
    document = document_of(triangulate(inputs_of(simulation), settings))
    assert document["choices"][0]["taken"] == "covariance"
    text = " ".join(to_text("", [decisions_section(document)], 100).split())
    assert "degree 1 was asked for and weighed, and is not in the result" in text


def test_the_result_says_that_the_results_are_apart() -> None:
    document = document_of(adjusted("apart"))
    (choice,) = document["choices"]
    assert (choice["taken"], choice["apart"], choice["contradicted"]) == ("covariance", True, False)
    assert choice["predicted"]["ratio"] > BETTER > choice["difference"]["ratio"]
    text = " ".join(to_text("", sections_of(document), 100).split())
    assert "covariance, because the results differ by more than predictions that agree within 10 % let expect:" in text
    ratios = [f"{choice[each]['ratio']:.2f}" for each in ("predicted", "difference", "left_out")]
    ((_, line),) = choices_in_short(document)
    first, known, left_out = ratios
    assert line.endswith(f"polynomial: σ {first}, with the results {known}, left-out errors {left_out}")
    (near,) = document_of(adjusted("dense"))["choices"]
    assert (near["taken"], near["apart"]) == ("polynomial", False)


def test_witnesses_that_tell_nothing_leave_the_polynomial() -> None:
    nothing = (float("nan"), float("nan"))
    assert np.isnan(Witness(nothing, nothing, 0).ratio)
    silent = Witness(nothing, nothing, 0)
    assert method_of(silent, expected_of(silent, (1.0, 1.0))) == POLYNOMIAL
    assert Witness((2.0, float("nan")), (1.0, 3.0), 1).ratio == pytest.approx(0.5)


def test_a_variance_below_0_says_nothing() -> None:
    assert np.isnan(choosing._root(-1e-12))
    assert choosing._root(4.0) == 2.0
