"""The four points of the textbooks: a similarity that turns by 135 degrees, with standard deviations on both sides."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.geometry.similarity import Similarity
from photostrip.strip.absolute_orientation import orient
from tests.strips import control_points, targets

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

DATA = Path(__file__).parents[1] / "data" / "authorities" / "similarity-ghilani"


def table(*names: str) -> Floats:
    with (DATA / "points.csv").open(encoding="utf-8", newline="") as file:
        return np.array([[float(row[name]) for name in names] for row in csv.DictReader(file)])


SOURCE, TARGET = table("x", "y", "z"), table("X", "Y", "Z")


def textbook_angles(rotation: Floats) -> list[float]:
    """Angles w, p, k in degrees of M = R3(k) R2(p) R1(w); the rotation is the transpose of M."""
    m = rotation.T
    return [
        float(np.degrees(np.arctan2(-m[2, 1], m[2, 2]))),
        float(np.degrees(np.arcsin(m[2, 0]))),
        float(np.degrees(np.arctan2(-m[1, 0], m[0, 0]))),
    ]


def test_equal_weights() -> None:
    found = Similarity.from_points(SOURCE, TARGET)
    assert found.scale == pytest.approx(0.9499569402, abs=1e-9)
    assert textbook_angles(found.rotation) == pytest.approx([2.284095, -0.550826, -135.462901], abs=1e-6)
    assert found.shift == pytest.approx([10233.8258, 6549.9683, 720.8789], abs=1e-4)
    sigma0 = np.sqrt((found.residuals(SOURCE, TARGET) ** 2).sum() / 5)
    assert sigma0 == pytest.approx(0.0612, abs=5e-5)


def test_standard_deviations_of_both_sides() -> None:
    """The published solution knows that turned source coordinates are correlated; without that it differs by 1 mm."""
    names = [f"{number}" for number in range(4)]
    sigma_source = table("sx_mm", "sy_mm", "sz_mm") / 1000
    sigma_target = table("sX_cm", "sY_cm", "sZ_cm") / 100
    start = Similarity.from_points(SOURCE, TARGET)
    variance = sigma_target**2 + start.scale**2 * sigma_source**2 @ (start.rotation**2).T
    middle = TARGET.mean(axis=0)
    control = control_points(dict(zip(names, TARGET, strict=True)))
    found = orient(SOURCE, targets(control, origin=middle), 1 / variance).similarity
    assert found.shift + middle == pytest.approx([10233.8542, 6549.9641, 720.8663], abs=0.001)  # metres
    assert found.scale == pytest.approx(0.9499549354, abs=3e-7)
    assert abs(found.scale - 0.9499549354) < abs(start.scale - 0.9499549354) / 5
