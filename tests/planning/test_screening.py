"""The experiment with gross errors: published rates, effects in closed form, changes by orienting again."""

from __future__ import annotations

import numpy as np
import pytest

from photostrip.planning.screening import (
    PairLayout,
    ScreeningSpec,
    error_effects,
    experiment_errors,
    screening_experiment,
    spoiled,
    standard_pairs,
)
from photostrip.strip.relative_orientation.orientation import orient_unchecked
from tests.loops import nonempty

F, B, A = 100.0, 60.0, 70.0
SIX = PairLayout(focal=F, base=B, width=A, counts=(1,) * 6, scatter=0.0, tilt=0.0, relief=0.0, parallax_sigma=0.0)


@pytest.mark.slow
def test_the_published_rates() -> None:
    """An independent program with the same settings: 51.9, 41.7, 6.4 %; one repetition scatters by 3.5 errors of 44."""
    (found,) = screening_experiment(ScreeningSpec(methods=("parallax+grubbs",), repetitions=24)).methods
    rates = 100 * np.array([found.parallax, found.later, found.missed])
    assert rates == pytest.approx([51.9, 41.7, 6.4], abs=3.0)
    assert rates.sum() == pytest.approx(100.0)
    assert 44 * found.lost == pytest.approx(1.1, abs=0.7)


def test_effects_on_six_standard_points_are_those_of_the_closed_form() -> None:
    effects = error_effects(standard_pairs(np.random.default_rng(1), 2, SIX), SIX)
    omega = np.array([2, 2, 1, 1, 1, 1]) * F / (4 * A**2)
    signed = np.array([-2, -2, 1, 1, 1, 1]) * F / (4 * A**2) * (F + 2 * A**2 / (3 * F))  # omega2' (f + 2a²/3f)
    even, odd = np.array([0, 1, 0, 1, 0, 1]) / 3, np.array([1, 0, 1, 0, 1, 0]) / 3
    expected = [
        np.array([0, 0, 0, 1, 0, 1]) * F / (2 * A * B),
        (signed - even) / B,
        np.array([0, 0, 1, 0, 1, 0]) * F / (2 * A * B),
        omega,
        (signed - odd) / B,
    ]
    found = np.array([effect.elements for effect in effects]).T
    assert found == pytest.approx(np.abs(expected), rel=1e-9, abs=1e-15)
    assert [effect.largest for effect in effects] == pytest.approx(np.abs(expected).max(axis=0), rel=1e-9)


def test_effects_are_what_orienting_again_finds() -> None:
    layout = PairLayout()
    pairs = standard_pairs(np.random.default_rng(2), 60, layout)
    clean, size = orient_unchecked(pairs)[0].elements, 0.02
    for zone, effect in nonempty(zip(range(1, 7), error_effects(pairs, layout), strict=True)):
        changes = []
        for point in np.flatnonzero(layout.zone == zone).tolist():
            errors = np.where(np.arange(layout.points) == point, size, 0.0)
            moved, _ = orient_unchecked(spoiled(pairs, np.tile(errors, 60)))
            changes.append((moved.elements - clean) / size)
        rms = np.sqrt(np.mean(np.square(changes), axis=(0, 1)))
        assert effect.elements == pytest.approx(rms, rel=5e-3)
        largest = np.abs(changes).max(axis=2)
        assert effect.largest == pytest.approx(np.sqrt(np.mean(largest**2)), rel=5e-3)


def test_without_a_search_every_error_stays_and_turns_its_pair() -> None:
    spec = ScreeningSpec(methods=("none",), repetitions=1, seed=4)
    (found,) = screening_experiment(spec).methods
    assert (found.missed, found.lost) == (1.0, 0.0)
    rng = np.random.default_rng(4)
    pairs = standard_pairs(rng, spec.models, spec.layout)
    errors = experiment_errors(rng, spec)
    assert (errors != 0).sum() == 44
    turned = orient_unchecked(spoiled(pairs, errors))[0].elements - orient_unchecked(pairs)[0].elements
    change = np.abs(turned).max(axis=1)
    assert [found.mean_change, found.worst_change] == pytest.approx([change.mean(), change.max()])
