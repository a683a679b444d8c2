"""Values of the plan files at their limits."""

from __future__ import annotations

import pytest

from photostrip.project.plans import all_positive


@pytest.mark.parametrize("sigma", [(0.0, 0.0, 0.01), (0.01, 0.0, 0.0), (0.1, 0.2, 0.3)])
def test_some_standard_deviations_may_be_zero(sigma: tuple[float, float, float]) -> None:
    assert all_positive(sigma) == sigma


@pytest.mark.parametrize("sigma", [(0.0, 0.0, 0.0), (-0.01, 0.1, 0.1)])
def test_all_zero_or_negative_ones_are_refused(sigma: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match="negative or all zero"):
        all_positive(sigma)
