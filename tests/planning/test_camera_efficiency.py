"""The efficiency coefficient of cameras: the table of the source, and what is misprinted in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.planning.camera_efficiency import (
    PRINTED_BASE,
    PRINTED_TABLE,
    ComparedCamera,
    by_efficiency,
    compare,
    source_cameras,
)
from tests.vectors import cases

if TYPE_CHECKING:
    from tests.vectors import Vector


@pytest.mark.parametrize("vector", cases("camera_efficiency", "camera-efficiency-1"))
def test_numbers_computed_apart(vector: Vector) -> None:
    given, want = vector.input, vector.expected
    cameras = [ComparedCamera("", f, m_p, given["b_mm"], given["b_mm"]) for f, m_p in given["cameras_f_mp"]]
    beside = [compare(camera, cameras[-1]) for camera in cameras]
    assert [camera.coefficient for camera in cameras] == pytest.approx(want["K"], rel=1e-12)
    assert [each.scale for each in beside] == pytest.approx(want["ratio_of_scale_denominators"], rel=1e-12)
    assert [each.printed_area for each in beside] == pytest.approx(want["eta_S_as_printed"], rel=1e-12)
    assert [each.area for each in beside] == pytest.approx(want["eta_S_true_area_ratio"], rel=1e-12)
    assert [each.height_error for each in beside] == pytest.approx(want["eta_mh"], rel=1e-12)
    assert [camera.height_ratio for camera in cameras] == pytest.approx(want["H_over_mh"], rel=1e-12)


@pytest.mark.parametrize("vector", cases("camera_efficiency", "camera-efficiency-general"))
def test_other_formats(vector: Vector) -> None:
    x = vector.input
    first, second = (ComparedCamera("", x[f"f{k}"], x[f"mp{k}"], x[f"b{k}"], x[f"l{k}"]) for k in (1, 2))
    found = compare(first, second)
    assert found.printed_area == pytest.approx(vector.expected["as_printed"], rel=1e-12)
    assert found.area == pytest.approx(vector.expected["true_area_ratio"], rel=1e-12)


def flown(camera: ComparedCamera, m_h: float) -> float:
    """Ground area of a model, flown as high as a standard deviation of heights allows: m_h = H m_p / b."""
    scale = m_h * camera.base / camera.sigma / camera.focal
    return camera.base * scale * camera.width * scale


def test_the_area_needs_the_scale_squared() -> None:
    first, second = ComparedCamera("a", 70, 0.017, 60, 130), ComparedCamera("b", 200, 0.011, 75, 160)
    found = compare(first, second)
    assert flown(first, 0.2) / flown(second, 0.2) == pytest.approx(found.area)
    assert abs(found.printed_area / found.area - 1) > 0.3  # eq. 2 as printed is no ratio of areas
    assert found.photos * found.area == pytest.approx(1)


def test_height_errors_at_equal_area() -> None:
    first, second = ComparedCamera("a", 70, 0.017, 60, 130), ComparedCamera("b", 200, 0.011, 75, 160)
    # m_h in proportion to the scale; the area to its square
    m_h = [1.0 / np.sqrt(flown(camera, 1.0)) for camera in (first, second)]
    assert compare(first, second).height_error == pytest.approx(m_h[0] / m_h[1])


def test_the_printed_table_and_its_misprints() -> None:
    cameras = source_cameras()
    last = cameras[-1]
    beside = [compare(camera, last) for camera in cameras]
    assert [round(c.coefficient, 2) for c in cameras] == pytest.approx(
        [r.coefficient for r in PRINTED_TABLE], abs=0.011
    )
    # the last heading ("sqrt(m_h) = 1 / tau_S"): the column is 1 / eta_mh, a ratio of lengths
    column = [row.area for row in PRINTED_TABLE]
    assert [1 / each.height_error for each in beside] == pytest.approx(column, abs=0.05)
    assert max(abs(each.area - printed) for each, printed in zip(beside, column, strict=True)) > 1.5
    assert max(abs(each.height_error**0.5 - printed) for each, printed in zip(beside, column, strict=True)) > 1
    # 1/5000 does not belong to the base of the other rows
    ratios = [camera.height_ratio / row.height_ratio for camera, row in zip(cameras, PRINTED_TABLE, strict=True)]
    assert ratios[:3] == pytest.approx([1, 1, 1], abs=0.01)
    assert ratios[3] == pytest.approx(1.09, abs=0.002)
    assert 5000 * last.sigma == pytest.approx(55)  # mm: it would need this base
    assert PRINTED_BASE == 60


def test_eq_5_as_printed_contradicts_the_definition() -> None:
    # printed with garbled indices; H1 m_p1 b2 / (b1 H2 m_p2) is what m_h = H m_p / b says
    first, second, heights = (
        ComparedCamera("a", 70, 0.017, 60, 130),
        ComparedCamera("b", 200, 0.011, 75, 130),
        (900.0, 1500.0),
    )
    m_h = [h * c.sigma / c.base for h, c in zip(heights, (first, second), strict=True)]
    assert m_h[0] / m_h[1] == pytest.approx(
        heights[0] * first.sigma * second.base / (first.base * heights[1] * second.sigma)
    )


def test_the_best_camera_is_that_of_the_largest_area_at_equal_heights() -> None:
    cameras = [
        ComparedCamera("a", 70, 0.017, 60, 130),
        ComparedCamera("b", 200, 0.011, 75, 160),
        ComparedCamera("c", 150, 0.003, 92, 230),
    ]
    assert [c.name for c in by_efficiency(cameras)] == sorted(
        "abc", key=lambda name: -flown(next(c for c in cameras if c.name == name), 1.0)
    )
    assert [c.focal for c in by_efficiency(source_cameras())] == [70, 100, 140, 200]
