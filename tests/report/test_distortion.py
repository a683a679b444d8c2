"""The picture of a lens: what is given, and what the self-calibration makes of it, against the lens that was flown."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import photostrip
from photostrip.report.pictures import residuals
from photostrip.report.pictures.chart import chart

if TYPE_CHECKING:
    from photostrip.report.pictures.chart import Panel

K1 = 4e-8  # mm^-2, of the lens that is flown: image to ideal
SPEC: dict[str, Any] = {
    "flight": {"photos": 8, "strips": 2},
    "camera": {"preset": "film", "distortion": {"model": "brown", "k": [K1, 0, 0], "direction": "image_to_ideal"}},
}


@pytest.mark.slow
@pytest.mark.parametrize(("stated", "direction"), [(0.0, "image_to_ideal"), (-K1 / 2, "ideal_to_image")])
def test_the_adjusted_curve_is_that_of_the_lens(stated: float, direction: str, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[Panel] = []
    monkeypatch.setattr(residuals, "chart", lambda *of, **look: drawn.extend(of[2]) or chart(*of, **look))
    simulation = photostrip.simulate(SPEC, seed=2)
    lens = {"model": "brown", "k": [stated, 0, 0], "direction": direction}
    result = simulation.project.overridden(
        cameras={"film": {"distortion": lens}}, processing={"self_calibration": ["k1"]}
    )
    residuals.distortion_pictures(result.run().document)
    (panel,) = drawn
    lines = {layer.words: layer.at for layer in panel.layers}
    assert ("given" in lines) is (stated != 0.0)
    if stated:
        radius, given = lines["given"].T
        assert given == pytest.approx(1000 * K1 / 2 * radius**3)  # to first order
    radius, adjusted = lines["adjusted"].T
    upper = lines["its standard deviation"][:, 1]
    assert radius[-1] == pytest.approx(np.hypot(230, 230) / 2)
    assert np.abs(adjusted - 1000 * K1 * radius**3).max() < 4 * (upper - adjusted).max()
    assert (upper - adjusted).max() < 0.2 * adjusted.max()


def test_a_lens_without_distortion_has_no_picture() -> None:
    document = photostrip.simulate({}, flight={"photos": 4}).project.run().document
    assert residuals.distortion_pictures(document) == []
