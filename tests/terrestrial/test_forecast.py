"""Planned displacements: the formulas of the normal case, drawn errors, and how often the test finds what is stated."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.statistics import chi2_quantile
from photostrip.terrestrial.accuracy import DisplacementSpec, plan_displacements
from photostrip.terrestrial.normal_case import Phototheodolite
from tests.loops import nonempty

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.terrestrial.accuracy import PlannedDisplacement

    Floats = NDArray[np.float64]

F, B, M = 100.0, 30.0, 0.005
UMK = Phototheodolite("UMK", F, format=(160.0, 120.0))
SPEC = DisplacementSpec(UMK, distances=(50.0, 200.0), sigma=M, base=B)


def by_place(spec: DisplacementSpec) -> dict[str, PlannedDisplacement]:
    """Give what is planned at the first distance."""
    return {each.place: each for each in plan_displacements(spec)[:3]}


def test_standard_deviations_are_those_of_the_normal_case() -> None:
    found = plan_displacements(SPEC)
    assert [each.place for each in found] == ["middle", "side", "top"] * 2
    for each in nonempty(found):
        x, y, _ = each.at
        p, image = B * F / y, x * F / y
        # m_dY = Y²/(B f) m sqrt(2), m_dX = (Y/f) m sqrt((1 - x/p)² + (x/p)²)
        assert each.sigma[1] == pytest.approx(y**2 / (B * F) * M * np.sqrt(2), rel=1e-9)
        assert each.sigma[0] == pytest.approx(y / F * M * np.hypot(1 - image / p, image / p), rel=1e-9)


def drawn(each: PlannedDisplacement, moved: Floats, count: int) -> Floats:
    """Displacements of a point that has moved, from drawn errors, intersected apart from the program."""
    rng = np.random.default_rng(11)
    found = []
    for point, sigma in ((each.at, M / np.sqrt(2)), (each.at + moved, M / np.sqrt(2))):
        left = F * point[[0, 2]] / point[1] + sigma * rng.normal(size=(count, 2))
        right = F * (point[[0, 2]] - (B, 0)) / point[1] + sigma * rng.normal(size=(count, 2))
        depth = B * F / (left[:, 0] - right[:, 0])
        height = (left[:, 1] + right[:, 1]) / 2
        found.append(np.column_stack([depth * left[:, 0] / F, depth, depth * height / F]))
    shift: Floats = found[1] - found[0]
    return shift


@pytest.mark.parametrize("place", ["middle", "side", "top"])
def test_drawn_displacements_scatter_so_and_are_found_so_often(place: str) -> None:
    each = by_place(SPEC)[place]
    still = drawn(each, np.zeros(3), 20_000)
    assert still.std(axis=0) / each.sigma == pytest.approx(np.ones(3), abs=0.02)
    weight = np.linalg.inv(np.cov(still.T))
    limit = chi2_quantile(0.95, 3)
    for axis in range(3):
        moved = drawn(each, each.found[axis] * np.eye(3)[axis], 20_000)
        seen = np.einsum("ni,ij,nj->n", moved, weight, moved) > limit
        assert seen.mean() == pytest.approx(0.8, abs=0.02)
    assert each.worst >= each.found.max() * (1 - 1e-9)
