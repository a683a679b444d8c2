"""Gross errors of pairs: printed logs, the search for sets against direct solutions, known errors, robust weights."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from photostrip.arrays import Floats
from photostrip.rejection import Rejection
from photostrip.statistics import chi2_quantile, grubbs_limit, normal_quantile
from photostrip.strip import pair_screening
from photostrip.strip.pair_screening import GlobalTest
from photostrip.strip.relative_orientation import (
    Orientation,
    Pairs,
    RelativeSettings,
    collect_pairs,
    orient_pairs,
    orient_unchecked,
)
from photostrip.strip.robust import MEDIAN_SPREAD, falling_weights, medians, scales
from tests.loops import nonempty
from tests.strips import MICROMETRE, TruePairs, measured, true_pairs
from tests.vectors import Vector, cases

Log = tuple[Rejection, ...]


SIGMA = 5 * MICROMETRE
ZONES = (2, 2, 3, 3, 3, 3)  # points of the six zones in the published experiment


def screened(orientation: Orientation, settings: RelativeSettings, sigma: float) -> tuple[Orientation, Log]:
    """Reject points and give the pairs without them, and the log."""
    found = pair_screening.screen_pairs(orientation, settings, sigma)
    return found.orientation, found.rejections


def of_example(example: Vector) -> tuple[Orientation, list[str]]:
    points = example.input["points"]
    left = {p["id"]: [p["x1"], p["y1"]] for p in points}
    observations = measured({"1": left, "2": {p["id"]: [p["x2"], p["y2"]] for p in points}})
    pairs = collect_pairs(observations, ("1", "2"), example.input["f"])
    return orient_pairs(pairs, ("1", "2")), [observations.point_ids[number] for number in pairs.point]


def compare(found: Orientation, log: Log, names: list[str], expected: dict[str, Any], tol: dict[str, float]) -> None:
    assert [names[entry.row] for entry in log] == expected["rejected"]
    degrees = np.degrees(found.elements[0])
    assert np.allclose(degrees, expected["elements_deg"], rtol=0, atol=tol["elements_deg"])
    assert found.sigma0[0] * np.sqrt(2) == pytest.approx(expected["sigma0_mm"], rel=tol["values_rel"])


@pytest.mark.parametrize("example", cases("grubbs", "rejection"))
@pytest.mark.parametrize("second", ["grubbs", "studentised_tau"])
def test_the_logs_of_the_formula_book(example: Vector, second: str) -> None:
    expected, test = example.expected[f"parallax_then_{second}"], second.removeprefix("studentised_")
    oriented, names = of_example(example)
    rel = example.tol["values_rel"]
    after, log = pair_screening._stage(oriented, "parallax", example.input["T_mm"])
    found, rest = pair_screening._stage(after, test, example.input["alpha"])
    log = [*log, *rest]
    rejected = [line for line in expected["log"] if line.get("rejected", True)]
    assert [(entry.test, names[entry.row]) for entry in log] == [(line["stage"], line["id"]) for line in rejected]
    assert [entry.value for entry in log] == pytest.approx([line["value"] for line in rejected], rel=rel)
    assert [entry.limit for entry in log] == pytest.approx([line["limit"] for line in rejected], rel=rel)
    compare(found, tuple(log), names, expected, example.tol)
    last = expected["log"][-1]
    if not last.get("rejected", True):  # the largest value of the last round stays below its limit
        value, limit, _ = pair_screening.tested(found, test, example.input["alpha"])
        value[~found.used] = -np.inf
        assert names[int(value.argmax())] == last["id"]
        assert value.max() == pytest.approx(last["value"], rel=rel)
        assert limit[0] == pytest.approx(last["limit"], rel=rel)


@pytest.mark.parametrize("example", cases("grubbs", "rejection"))
def test_screening_as_a_project_asks_for_it(example: Vector) -> None:
    oriented, names = of_example(example)
    settings = RelativeSettings("parallax+grubbs", example.input["alpha"], example.input["T_mm"])
    found, log = screened(oriented, settings, example.input["sigma_q_apriori_mm"])
    compare(found, log, names, example.expected["parallax_then_grubbs"], example.tol)


def test_the_automatic_limit_is_four_sigma_of_a_parallax() -> None:
    oriented = spoiled(level(3, 1), {5: 0.4})
    _, log = screened(oriented, RelativeSettings("parallax+grubbs"), SIGMA)
    assert log[0].test == "parallax"
    assert log[0].limit == pytest.approx(4 * np.sqrt(2) * SIGMA)
    _, log = screened(oriented, RelativeSettings("parallax+grubbs", parallax_limit=0.015), SIGMA)
    assert log[0].limit == 0.015
    _, log = screened(oriented, RelativeSettings("parallax+grubbs", parallax_limit=10.0), SIGMA)
    assert log[0].test == "grubbs"
    assert log[0].limit == pytest.approx(grubbs_limit(16, 0.05))


@pytest.mark.parametrize("method", ["parallax+grubbs", "tau"])
def test_a_pair_keeps_six_points(method: str) -> None:
    truth = level(10, 1, (2, 1, 2, 1, 1, 1))
    errors = {row: 3.0 * (-1) ** row for row in range(0, 8, 2)}
    found, log = screened(spoiled(truth, errors), RelativeSettings(method, 0.2, 0.001), SIGMA)
    assert found.points_used[0] >= 6
    assert len(log) <= 2
    six = spoiled(level(10, 1, (1,) * 6), {0: 3.0})
    found, log = screened(six, RelativeSettings(method, 0.2, 0.001), SIGMA)
    assert log == ()


def with_errors(flown: TruePairs, errors: Floats) -> Pairs:
    """Add errors to y on the left photo; for photos turned by a few degrees they are y parallaxes."""
    left = flown.pairs.left.copy()
    left[:, 1] += errors.ravel()
    return replace(flown.pairs, left=left)


def spoiled(flown: TruePairs, errors: dict[int, float]) -> Orientation:
    """Orient pairs after adding errors in mm to the left y of some rows."""
    every = np.zeros(len(flown.pairs.left))
    every[list(errors)] = list(errors.values())
    return orient_unchecked(with_errors(flown, every))[0]


def examined(
    pairs: Pairs, settings: RelativeSettings | None = None, sigma: float = SIGMA
) -> pair_screening.ScreenedPairs:
    oriented, converged = orient_unchecked(pairs)
    return pair_screening.screen_pairs(oriented, settings or RelativeSettings(), sigma, converged)


def level(seed: int, pairs: int, counts: tuple[int, ...] = (2, 2, 3, 3, 3, 3), sigma: float = SIGMA) -> TruePairs:
    return true_pairs(np.random.default_rng(seed), pairs, counts=counts, kappa_deg=5.0, tilt_deg=2.0, sigma=sigma)


@given(seed=st.integers(0, 10**6), n=st.integers(9, 14), k=st.integers(1, 3))
def test_a_gain_is_what_an_adjustment_without_the_points_loses(seed: int, n: int, k: int) -> None:
    rng = np.random.default_rng(seed)
    design, values = rng.normal(size=(n, 5)), rng.normal(size=n)
    matrix = np.eye(n) - design @ np.linalg.pinv(design)
    residual = matrix @ values
    sets = pair_screening.subsets(n, k)
    found = pair_screening.gains(residual[None], matrix[None], sets)[0]
    for place in nonempty(rng.choice(len(sets), 5)):
        rest = np.setdiff1d(np.arange(n), sets[place])
        squares = np.linalg.lstsq(design[rest], values[rest], rcond=None)[1][0]
        assert residual @ residual - found[place] == pytest.approx(squares, rel=1e-6, abs=1e-9)


def adjusted(rng: np.random.Generator, n: int, wrong: int) -> tuple[Floats, Floats]:
    """Residuals of one adjustment of n observations with five unknowns, and orthonormal columns of its design."""
    basis = np.linalg.qr(rng.normal(size=(n, 5)))[0]
    error = rng.normal(size=n)
    error[rng.choice(n, wrong, replace=False)] += rng.normal(0, 15, wrong)
    return (error - basis @ (basis.T @ error))[None], basis[None]


@given(seed=st.integers(0, 10**6), n=st.integers(9, 24), wrong=st.integers(0, 4))
def test_the_search_finds_the_best_of_all_sets(seed: int, n: int, wrong: int) -> None:
    residual, basis = adjusted(np.random.default_rng(seed), n, wrong)
    target = np.array([chi2_quantile(0.9995, n - 5 - k) if n - k >= 6 else -np.inf for k in (1, 2, 3)])
    matrix = np.eye(n) - basis @ basis.transpose(0, 2, 1)
    (found,) = pair_screening.smallest_sets(residual, basis, target)
    total = float((residual**2).sum())
    for k in (1, 2, 3):
        sets = pair_screening.subsets(n, k)
        gain = pair_screening.gains(residual, matrix, sets)[0]
        if total - gain.max() <= target[k - 1]:
            assert found.tolist() == sets[gain.argmax()].tolist()
            return
    assert not len(found)


@pytest.mark.parametrize("vector", cases("grubbs", "rejection"))
def test_the_printed_pairs_lose_the_points_of_the_minimum_deletion(vector: Vector) -> None:
    oriented, names = of_example(vector)
    sigma, expected = vector.input["sigma_q_apriori_mm"] / np.sqrt(2), vector.expected["minimum_deletion_global_test"]
    found = pair_screening.screen_pairs(oriented, RelativeSettings(screening="auto"), sigma)
    assert [names[row] for row in np.flatnonzero(~found.orientation.used)] == sorted(expected["rejected"])
    if "elements_deg" in expected:
        assert np.degrees(found.orientation.elements[0]) == pytest.approx(expected["elements_deg"], abs=1e-6)
    assert found.zone.tolist() == [int(name[1]) for name in names]


@pytest.mark.slow
@pytest.mark.parametrize("size", [0.1, 1.0, 50.0])
def test_a_fifth_of_wrong_points_comes_out_and_nothing_else(size: float) -> None:
    flown = level(4, 40, (5,) * 6)
    rng = np.random.default_rng(5)
    wrong = rng.permuted(np.tile(np.arange(30) < 6, (40, 1)), axis=1)
    errors = np.where(wrong, size * rng.choice([-1.0, 1.0], wrong.shape), 0.0)
    found = examined(with_errors(flown, errors))
    out = ~found.orientation.used.reshape(40, 30)
    assert (out & wrong).sum() >= 0.995 * wrong.sum()
    assert (out & ~wrong).sum() <= 0.005 * (~wrong).sum()
    clean = flown.errors(flown.orient().elements)
    assert np.median(flown.errors(found.orientation.elements)) < 1.5 * np.median(clean)


@pytest.mark.parametrize("understated", [2.0, 5.0, 50.0])
def test_a_sigma_stated_far_too_small_costs_no_good_points(understated: float) -> None:
    found = examined(level(9, 60).pairs, sigma=SIGMA / understated)
    assert found.scatter.found == pytest.approx(np.sqrt(2) * SIGMA, rel=0.12)
    assert (~found.orientation.used).mean() < 0.002


@pytest.mark.slow
@pytest.mark.parametrize("wrong", [0.55, 1.0])
def test_what_no_search_can_put_right_is_given_up(wrong: float) -> None:
    rng = np.random.default_rng(16)
    flown = level(16, 3, (20,) * 6)
    rows = rng.random(len(flown.pairs.left)) < wrong
    left = np.where(rows[:, None], rng.uniform(-100.0, 100.0, flown.pairs.left.shape), flown.pairs.left)
    assert examined(replace(flown.pairs, left=left)).masked.all()


def test_redundancy_and_detectable_errors_of_standard_points_are_those_of_the_literature() -> None:
    # six points: 1/3 in the middle, 1/12 in the corners
    flown = true_pairs(
        np.random.default_rng(16), 200, counts=(1,) * 6, tilt_deg=0.0, kappa_deg=0.0, relief=0.0, sigma=SIGMA
    )
    found = examined(flown.pairs, RelativeSettings(screening="none"))
    redundancy = found.orientation.redundancy.reshape(200, 6).mean(axis=0)
    assert redundancy == pytest.approx([1 / 3, 1 / 3, 1 / 12, 1 / 12, 1 / 12, 1 / 12], abs=0.03)
    size = 4.13 * np.sqrt(2) * SIGMA / np.sqrt(found.orientation.redundancy)
    assert found.detectable == pytest.approx(size, rel=1e-3)


def test_the_level_of_a_strip_is_shared_out_among_its_pairs_and_their_two_tests() -> None:
    test = GlobalTest.of(np.ones(5))
    assert test.level == pytest.approx(0.001)
    assert test.limits(np.array([16, 5])) == pytest.approx([chi2_quantile(0.999, 11), np.inf])
    assert test.largest_limits(np.array([16])) == pytest.approx([normal_quantile(1 - 0.001 / 32)])
    assert test.take(np.array([1, 3])).level == test.level


def test_weights_fall_beyond_three_standard_deviations() -> None:
    found = falling_weights(np.array([0.0, 2.99, 3.0, 6.0, 1000.0, np.inf]))
    assert found == pytest.approx([1.0, 1.0, 1.0, np.exp(-3.0), 1e-5, 1e-5])


def test_medians_are_the_lower_weighted_ones() -> None:
    values = np.array([5.0, 1.0, 3.0, 2.0, 9.0, 7.0])
    group = np.array([0, 0, 0, 2, 2, 3])
    weight = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 0.0])
    assert medians(values, weight, group, 4) == pytest.approx([3.0, np.nan, 2.0, np.nan], nan_ok=True)
    assert medians(values[:3], np.array([5.0, 1.0, 1.0]), group[:3], 1) == pytest.approx([5.0])


@pytest.mark.slow
def test_the_scale_of_normal_residuals_and_its_spread() -> None:
    rng = np.random.default_rng(2)
    size = np.abs(rng.normal(0, 2.0, (3000, 201)))
    found = scales(size.ravel(), np.ones(size.size), np.repeat(np.arange(3000), 201), 3000) / 2.0
    assert found.mean() == pytest.approx(1.0, abs=0.01)
    assert found.std() * np.sqrt(201) == pytest.approx(MEDIAN_SPREAD, rel=0.05)
