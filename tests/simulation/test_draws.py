"""Random numbers: the bits of PCG64 and nothing else, well distributed, a stream for each purpose."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from photostrip.simulation.draws import Draws, Purpose

COUNT = 200_000
FIRST_UNIFORM = [0.8540335896190759, 0.4272927861607856, 0.8629217443697507]
FIRST_NORMAL = [-1.7606477915568635, 1.9928484588802229, 0.1449612161854251]


def test_uniform_numbers_are_those_of_numpys_generator_on_the_same_bits() -> None:
    bits = np.random.PCG64(np.random.SeedSequence(7, spawn_key=(int(Purpose.IMAGE), 0)))
    assert np.array_equal(Draws(7, Purpose.IMAGE).uniform(50), np.random.Generator(bits).random(50))


def test_the_first_numbers_never_change() -> None:
    assert Draws(1, Purpose.FLIGHT).uniform(3).tolist() == FIRST_UNIFORM
    assert Draws(1, Purpose.FLIGHT).normal(3) == pytest.approx(FIRST_NORMAL, rel=1e-14)


def test_normal_numbers_are_normal() -> None:
    drawn = Draws(3, Purpose.IMAGE).normal(COUNT)
    assert stats.kstest(drawn, "norm").pvalue > 0.01
    assert abs(np.corrcoef(drawn[:-1], drawn[1:])[0, 1]) < 4 / np.sqrt(COUNT)
