"""Map coordinates taken as a plane: what bends the network is named, and not the lens alone."""

from __future__ import annotations

from typing import Any

import pytest

import photostrip
from tests.source_tree import ROOT

SAMPLE = ROOT / "sample_data/simulated-20/project.yaml"


def lens_of(**processing: str) -> list[dict[str, Any]]:
    """Give what is found of the lens where the map coordinates of a sample of 18 km are called local."""
    result = photostrip.run(SAMPLE, **{"control[0].crs": "local"}, processing=processing)
    return [dict(row) for row in result.findings.where(code="P110")]


def test_curvature_is_a_rival_of_the_lens() -> None:
    (found,) = lens_of()
    k1 = 1533.0 / (2 * 6_371_000.0 * 153.0**2)  # mm^-2: H / (2 R f^2)
    assert found["evidence"]["k1_of_curvature"] == pytest.approx(k1, rel=0.01)
    assert found["evidence"]["k1"] == pytest.approx(k1, abs=2 * found["evidence"]["k1_standard_deviation"])
    assert "The Earth's curvature, which local coordinates taken as they are leave out" in found["message"]
    assert found["fix"].startswith(
        "are these map coordinates: name their crs, or set `processing.earth_curvature: model`"
    )


def test_it_is_none_where_it_is_taken_into_account_or_said_not_to_be() -> None:
    assert lens_of(earth_curvature="model") == []
    (found,) = lens_of(earth_curvature="none")
    assert "k1_of_curvature" not in found["evidence"]


def test_another_lens_is_no_curvature() -> None:
    lens = {"model": "brown", "k": [3e-8, 0, 0], "direction": "image_to_ideal"}
    simulation = photostrip.simulate({}, flight={"photos": 12}, ground={"crs": "local"}, camera={"distortion": lens})
    result = simulation.project.overridden(cameras={"film": {"distortion": lens | {"k": [0, 0, 0]}}}).run()
    (found,) = result.findings.where(code="P110")
    assert "k1_of_curvature" not in found["evidence"]
