"""Weights that fall with the residual."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest

from photostrip.network import adjustment

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.network.problem import BundleProblem


@dataclass(frozen=True)
class Images:
    sigma: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.sigma)


@dataclass(frozen=True)
class Problem:
    images: Images


def test_rays_keep_their_weight_up_to_three_times_the_scale(monkeypatch: pytest.MonkeyPatch) -> None:
    """[Krarup 1980]: exp(1 - e^2) beyond; the scale is that of two normal residuals with the same median length."""
    sigma = np.full((9, 2), 0.005)
    median = np.sqrt(2 * np.log(2.0))  # of the length of two standard normal residuals
    size = median * np.array([0.5, 0.5, 0.6, 0.7, 1.0, 1.5, 2.5, 6.0 / median, 4.5 / median])
    residuals = np.column_stack([size, np.zeros(9)]) * sigma
    monkeypatch.setattr(adjustment, "solve", lambda _: SimpleNamespace(image_residuals=residuals))
    monkeypatch.setattr(adjustment, "restarted", lambda problem, _: problem)
    _, weight = adjustment.adjust_robustly(cast("BundleProblem", Problem(Images(sigma))))
    assert weight == pytest.approx([1.0] * 7 + [np.exp(-3.0), np.exp(1 - 1.5**2)], rel=1e-3)
