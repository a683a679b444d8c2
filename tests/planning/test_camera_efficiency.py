"""The efficiency coefficient of cameras: the table of the source, and what is misprinted in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.planning.camera_efficiency import (
    PRINTED_BASE,
    PRINTED_TABLE,
    ComparedCamera,
    compare,
    sigma_from_mean_distortion,
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


def flown(camera: ComparedCamera, m_h: float) -> float:
    """Ground area of a model, flown as high as a standard deviation of heights allows: m_h = H m_p / b."""
    scale = m_h * camera.base / camera.sigma / camera.focal
    return camera.base * scale * camera.width * scale


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


# --------------------------------------------------------------------------------- distortion, ground and what it costs


def test_a_parallax_from_measuring_and_mean_distortion_scatters_so() -> None:
    rng = np.random.default_rng(7)
    count, measuring, spread = 200_000, 0.004, 0.006
    radial = spread * rng.normal(size=(count, 2))
    turned = np.cos(rng.uniform(0, 2 * np.pi, size=(count, 2)))
    x = measuring * rng.normal(size=(count, 2)) + radial * turned
    found = sigma_from_mean_distortion(measuring, float(np.abs(radial).mean()))
    assert (x[:, 0] - x[:, 1]).std() == pytest.approx(found, rel=0.01)
    assert sigma_from_mean_distortion(measuring, 0.0) == pytest.approx(np.sqrt(2) * measuring)
