"""The test of the standard deviation of unit weight."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest
from scipy.stats import chi2

from photostrip.network.reliability import SIGMA0_LEVEL, sigma0_test

if TYPE_CHECKING:
    from photostrip.network.adjustment import BundleSolution


def solution(redundancy: int) -> BundleSolution:
    return cast("BundleSolution", SimpleNamespace(sigma0=1.2, redundancy=redundancy))


@pytest.mark.parametrize("redundancy", [1, 2, 40])
def test_the_limits_are_those_of_chi_square(redundancy: int) -> None:
    found = sigma0_test(solution(redundancy))
    ends = chi2.ppf([SIGMA0_LEVEL / 2, 1 - SIGMA0_LEVEL / 2], redundancy)
    assert [found.lower, found.upper] == pytest.approx(np.sqrt(ends / redundancy), rel=1e-9)
    assert found.passed


def test_nothing_is_tested_without_redundancy() -> None:
    assert np.isnan(sigma0_test(solution(0)).lower)
