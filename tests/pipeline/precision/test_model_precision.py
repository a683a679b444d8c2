"""The variance factor of linked models."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest
from scipy.stats import chi2

from photostrip.pipeline.precision.model_precision import variance_of_models
from photostrip.strip.error_propagation.image_variance import A_POSTERIORI, A_PRIORI, SIGMA_LEVEL

if TYPE_CHECKING:
    from photostrip.strip.independent_models.formation import FormedModels


@pytest.mark.parametrize("redundancy", [1, 2, 30])
def test_the_stated_precision_counts_until_chi_square_contradicts_it(redundancy: int) -> None:
    limit = chi2.ppf(1 - SIGMA_LEVEL / 2, redundancy)
    for squares, factor, basis in (
        (0.999 * limit, 1.0, A_PRIORI),
        (1.001 * limit, 1.001 * limit / redundancy, A_POSTERIORI),
    ):
        solved = SimpleNamespace(redundancy=np.array([redundancy, 0]), squares=np.array([squares, 0.0]))
        formed = cast("FormedModels", SimpleNamespace(links=SimpleNamespace(solved=solved)))
        found = variance_of_models(formed)
        assert found[0] == pytest.approx(factor)
        assert found[1] == basis


def test_without_redundancy_nothing_contradicts_it() -> None:
    solved = SimpleNamespace(redundancy=np.array([0]), squares=np.array([0.0]))
    formed = cast("FormedModels", SimpleNamespace(links=SimpleNamespace(solved=solved)))
    assert variance_of_models(formed) == (1.0, A_PRIORI)
