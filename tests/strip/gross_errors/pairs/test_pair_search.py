"""The search for sets of wrong points: against direct solutions, printed results and known errors."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from photostrip.statistics import chi2_quantile, normal_quantile
from photostrip.strip import pair_screening, relative_orientation
from photostrip.strip.pair_screening import GlobalTest
from photostrip.strip.relative_orientation import RelativeSettings, orient_again, orient_unchecked
from tests.loops import nonempty
from tests.strips import MICROMETRE, TruePairs, batch, true_pairs
from tests.vectors import Vector, cases

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.strip.relative_orientation import Orientation, Pairs

    Floats = NDArray[np.float64]

SIGMA = 5 * MICROMETRE  # of an image coordinate


def spoiled(flown: TruePairs, errors: Floats) -> Pairs:
    """Add errors to y on the left photo; for photos turned by a few degrees they are y parallaxes."""
    left = flown.pairs.left.copy()
    left[:, 1] += errors.ravel()
    return replace(flown.pairs, left=left)


def examined(
    pairs: Pairs, settings: RelativeSettings | None = None, sigma: float = SIGMA
) -> pair_screening.ScreenedPairs:
    oriented, converged = orient_unchecked(pairs)
    return pair_screening.screen_pairs(oriented, settings or RelativeSettings(), sigma, converged)


def level(seed: int, pairs: int, counts: tuple[int, ...] = (2, 2, 3, 3, 3, 3), sigma: float = SIGMA) -> TruePairs:
    return true_pairs(np.random.default_rng(seed), pairs, counts=counts, kappa_deg=5.0, tilt_deg=2.0, sigma=sigma)


# ------------------------------------------------------------------------------------------------ block formula


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


# -------------------------------------------------------------------------------------------- printed results


@pytest.mark.parametrize("vector", cases("grubbs", "rejection"))
def test_the_printed_pairs_lose_the_points_of_the_minimum_deletion(vector: Vector) -> None:
    points = vector.input["points"]
    left, right = (np.array([[p[f"x{k}"], p[f"y{k}"]] for p in points]) for k in (1, 2))
    pairs = batch(left[None], right[None], vector.input["f"])
    sigma = vector.input["sigma_q_apriori_mm"] / np.sqrt(2)
    expected = vector.expected["minimum_deletion_global_test"]
    found = examined(pairs, RelativeSettings(screening="auto"), sigma)
    names = [points[row]["id"] for row in np.flatnonzero(~found.orientation.used)]
    assert names == sorted(expected["rejected"])
    if "elements_deg" in expected:
        assert np.degrees(found.orientation.elements[0]) == pytest.approx(expected["elements_deg"], abs=1e-6)
    zones = [int(p["id"][1]) for p in points]
    assert found.zone.tolist() == zones


# ---------------------------------------------------------------------------------------------- known errors


@pytest.mark.slow
@pytest.mark.parametrize("size", [0.1, 1.0, 50.0])
def test_a_fifth_of_wrong_points_comes_out_and_nothing_else(size: float) -> None:
    flown = level(4, 40, (5,) * 6)
    rng = np.random.default_rng(5)
    wrong = rng.permuted(np.tile(np.arange(30) < 6, (40, 1)), axis=1)
    errors = np.where(wrong, size * rng.choice([-1.0, 1.0], wrong.shape), 0.0)
    found = examined(spoiled(flown, errors))
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
def test_what_no_search_can_put_right_is_given_up(wrong: float, monkeypatch: pytest.MonkeyPatch) -> None:
    from_nothing, again = list[int](), list[int]()
    solve, oriented = relative_orientation.solve_elements, orient_again

    def counted_solves(pairs: Pairs) -> relative_orientation.Solved:
        from_nothing.append(pairs.size)
        return solve(pairs)

    def counted_rounds(*arguments: Any) -> Orientation:  # noqa: ANN401 (as they are)
        again.append(1)
        return oriented(*arguments)

    monkeypatch.setattr(relative_orientation, "solve_elements", counted_solves)
    monkeypatch.setattr(pair_screening, "orient_again", counted_rounds)
    rng = np.random.default_rng(16)
    flown = level(16, 3, (20,) * 6)
    rows = rng.random(len(flown.pairs.left)) < wrong
    left = np.where(rows[:, None], rng.uniform(-100.0, 100.0, flown.pairs.left.shape), flown.pairs.left)
    found = examined(replace(flown.pairs, left=left))
    assert len(from_nothing) <= 8  # 76 times, one for every point that went, with 0.55
    assert len(again) <= 20
    assert found.masked.all()


# --------------------------------------------------------------------------------------------- what can be seen


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


# ------------------------------------------------------------------------------------------------- limits in force


def test_the_level_of_a_strip_is_shared_out_among_its_pairs_and_their_two_tests() -> None:
    test = GlobalTest.of(np.ones(5))
    assert test.level == pytest.approx(0.001)
    assert test.limits(np.array([16, 5])) == pytest.approx([chi2_quantile(0.999, 11), np.inf])
    assert test.largest_limits(np.array([16])) == pytest.approx([normal_quantile(1 - 0.001 / 32)])
    assert test.take(np.array([1, 3])).level == test.level
