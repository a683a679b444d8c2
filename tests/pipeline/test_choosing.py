"""`adjustment: auto`: which strips get their polynomial, which their covariance, and what is said of it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from photostrip.pipeline.choice import POLYNOMIAL, Witness, method_of
from photostrip.pipeline.inputs import AUTO, METHODS
from photostrip.pipeline.results import Result
from photostrip.pipeline.run import triangulate
from photostrip.pipeline.strips import choosing
from photostrip.report.page.text import to_text
from photostrip.report.sections.accuracy_report import sections_of
from photostrip.result.document import document_of
from photostrip.simulation import Control, Flight, Points, Spec, simulate
from photostrip.triangulation.covariance_adjustment.settings import BETTER
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
    assert strip.of_photos.covariance is None
    assert points_of(adjusted("dense")) == points_of(adjusted("dense", "polynomial"))


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
    predicted, left_out = Witness((1.0, 1.0), (0.5, 0.5), 100), Witness((1.0, 1.0), (covariance, covariance), 1)
    assert choosing.decide(predicted, left_out, excess, bands, models) == taken


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
    assert f"standard deviations of new points {first} with the polynomial, {second} with the covariance" in text
    assert "weighed and not taken: the strip was adjusted with its covariance" in text
    assert document_of(adjusted.__wrapped__("usual")) == document


def test_witnesses_that_tell_nothing_leave_the_polynomial() -> None:
    nothing = (float("nan"), float("nan"))
    assert np.isnan(Witness(nothing, nothing, 0).ratio)
    assert method_of(Witness(nothing, nothing, 0).ratio) == POLYNOMIAL
    assert Witness((2.0, float("nan")), (1.0, 3.0), 1).ratio == pytest.approx(0.5)


def test_a_variance_below_0_says_nothing() -> None:
    assert np.isnan(choosing._root(-1e-12))
    assert choosing._root(4.0) == 2.0
