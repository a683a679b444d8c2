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
from photostrip.strip.relative_orientation import orient_unchecked
from tests.loops import nonempty


@pytest.mark.slow
def test_the_published_rates() -> None:
    """An independent program with the same settings: 51.9, 41.7, 6.4 %; one repetition scatters by 3.5 errors of 44."""
    (found,) = screening_experiment(ScreeningSpec(methods=("parallax+grubbs",), repetitions=24)).methods
    rates = 100 * np.array([found.parallax, found.later, found.missed])
    assert rates == pytest.approx([51.9, 41.7, 6.4], abs=3.0)
    assert rates.sum() == pytest.approx(100.0)
    assert 44 * (found.beside + found.instead) == pytest.approx(1.1, abs=0.7)


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
    assert (found.missed, found.beside, found.instead) == (1.0, 0.0, 0.0)
    rng = np.random.default_rng(4)
    pairs = standard_pairs(rng, spec.models, spec.layout)
    errors = experiment_errors(rng, spec)
    assert (errors != 0).sum() == 44
    turned = orient_unchecked(spoiled(pairs, errors))[0].elements - orient_unchecked(pairs)[0].elements
    change = np.abs(turned).max(axis=1)
    assert [found.mean_change, found.worst_change] == pytest.approx([change.mean(), change.max()])
