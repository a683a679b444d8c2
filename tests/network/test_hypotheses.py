"""What each hypothesis is said to explain is what an adjustment with it gains."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.network import hypotheses
from photostrip.network.adjustment import solve
from photostrip.network.hypotheses import DISTANCE, DRIFT, LIST, OF_CAMERAS, OF_PHOTOS, OFFSET, Likely, most_likely
from photostrip.network.problem import PositionObservations
from photostrip.simulation import Control, Flight, Points, Spec, simulate
from tests.loops import nonempty
from tests.simulated_bundle import problem_of, truth_of

if TYPE_CHECKING:
    from photostrip.network.adjustment import BundleSolution
    from photostrip.network.hypotheses import Hypothesis
    from photostrip.network.problem import BundleProblem


def with_positions_and_lists() -> BundleProblem:
    """Two strips with positions of their own groups, every other control point in a second list."""
    flight, points = Flight(photos=6, strips=2), Points(rows=3, extra_per_model=2)
    simulation = simulate(Spec(flight=flight, points=points, control=Control(bands=3)))
    problem, truth = problem_of(simulation), truth_of(simulation)
    random, m = np.random.default_rng(3), problem.photos
    positions = PositionObservations(
        photo=np.arange(m),
        xyz=truth.centers + 0.1 * random.standard_normal((m, 3)),
        axes=np.broadcast_to(np.eye(3), (m, 3, 3)),
        sigma=np.full((m, 3), 0.1),
        lever=np.zeros((m, 3)),
        group=np.repeat([0, 1], m // 2),
        time=np.tile(np.linspace(-1.0, 1.0, m // 2), 2),
        offset_sigma=np.zeros((2, 3)),
        drift_sigma=np.zeros((2, 3)),
    )
    control = replace(problem.control, frame=np.arange(len(problem.control)) % 2)
    return replace(problem, positions=positions, control=control)


def asked(solution: BundleSolution) -> list[Hypothesis]:
    return [each for line in hypotheses.HYPOTHESES for each in line(solution)]


def test_every_hypothesis_gains_what_an_adjustment_with_it_does() -> None:
    problem = with_positions_and_lists()
    solution = solve(problem)
    every = asked(solution)
    assert {each.kind for each in every} == {OFFSET, DRIFT, LIST, *OF_CAMERAS, *OF_PHOTOS}
    assert (len(OF_CAMERAS), len(OF_PHOTOS)) == (6, 2)
    for each in nonempty(every):
        (found,) = hypotheses.likeliest(
            solution, 1.0, 1e-9, cameras=True, refused=[other for other in every if other is not each]
        )
        if each.kind == LIST:  # left out, it says nothing of its own shape
            assert found.squares == pytest.approx(moved(problem, each.number), rel=1e-3)
            continue
        after = solve(hypotheses.taken_up(problem, each))
        assert found.freedom == solution.redundancy - after.redundancy
        assert found.squares == pytest.approx(solution.chi_square - after.chi_square, rel=2e-3, abs=1e-3)


def test_a_hypothesis_whose_columns_others_have_taken_up_explains_nothing() -> None:
    """Two causes of a camera may both hold its distance: asked about again, the one within the other has no column."""
    problem = with_positions_and_lists()
    (distance,) = (each for each in asked(solve(problem)) if each.kind == DISTANCE)
    after = solve(hypotheses.taken_up(problem, distance))
    assert hypotheses.log_probability_again(after, distance, 1.0) == 0.0


def moved(problem: BundleProblem, number: int) -> float:
    """Fall of the sum of squares when a control list is moved to where it fits, found by a search."""
    control, solution = problem.control, solve(problem)
    shift = np.zeros(3)
    own = (control.frame == number)[:, None]
    for _ in range(4):
        steps = [[fitted(problem, own, shift + step) for step in (-each, each)] for each in 0.02 * np.eye(3)]
        here = fitted(problem, own, shift)
        for axis, (low, high) in enumerate(steps):
            shift[axis] -= 0.02 * (high - low) / (2.0 * (high + low - 2.0 * here))
    return solution.chi_square - fitted(problem, own, shift)


def fitted(problem: BundleProblem, own: np.ndarray, shift: np.ndarray) -> float:
    control = problem.control
    back = np.where(own, np.einsum("nai,a->ni", control.axes, shift), 0.0)
    return solve(replace(problem, control=replace(control, xyz=control.xyz - back))).chi_square


def test_of_hypotheses_that_explain_alike_the_first_is_taken_and_the_others_are_its_rivals() -> None:
    first, second, third = (hypotheses.Hypothesis(kind) for kind in (OFFSET, DISTANCE, hypotheses.LENS))
    found = [Likely.of(first, 500.0, 3, 3), Likely.of(second, 503.0, 1, 3), Likely.of(third, 100.0, 1, 3)]
    likely = most_likely(found, 0.01)
    assert (likely.hypothesis.kind, likely.hypothesis.rivals) == (OFFSET, (DISTANCE,))
    found[1] = Likely.of(second, 520.0, 1, 3)
    assert most_likely(found, 0.01).hypothesis == second
