"""Twist and bending of the models of a run: seen where they are, and only there."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy import stats

from photostrip.pipeline.run import triangulate
from photostrip.report.sections.accuracy_report import sections_of
from photostrip.result.document import document_of
from photostrip.simulation import Control, Flight, Points, Spec, Terrain, simulate
from tests.loops import nonempty
from tests.simulated import inputs_of, settings_of

if TYPE_CHECKING:
    from photostrip.pipeline.results import Result

FOCAL = 153.0


def spec(seed: int = 1, count: int = 60, photos: int = 4) -> Spec:
    return Spec(
        seed=seed,
        flight=Flight(photos=photos),
        terrain=Terrain(relief=30.0),
        points=Points(rows=5, extra_per_model=20),
        control=Control(layout="random", count=count, check=10, sigma=(0.02, 0.02, 0.02)),
    )


@cache
def run(seed: int = 1, *, twist_arcsec: float = 0.0, **more: int) -> Result:
    """Adjust a strip; the right photo of the middle model may get an x error x y domega / f."""
    simulation = simulate(spec(seed, **more))
    inputs, settings = inputs_of(simulation), settings_of(simulation)
    observations = inputs.observations
    if twist_arcsec:
        xy = observations.xy.copy()
        # an x error that leaves no y parallax and bends heights as a turn domega would
        here = observations.photo == observations.photo_ids.index("1003")
        x, y = xy[here].T
        xy[here, 0] = x + np.radians(twist_arcsec / 3600) * x * y / FOCAL
        inputs = replace(inputs, observations=replace(observations, xy=xy))
    # gross errors would be searched for in what is put in here
    relative = replace(settings.relative, screening="none")
    return triangulate(inputs, replace(settings, adjustment="similarity", relative=relative))


def documents(result: Result) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = document_of(result).get("deformations", [])
    return found


@pytest.mark.slow
def test_a_twisted_photo_shows_in_its_models() -> None:
    rows = documents(run(twist_arcsec=400.0))
    assert [row["left"] for row in rows] == ["1001", "1002", "1003"]
    middle, last = rows[1], rows[2]
    assert middle["significant"]
    assert last["significant"]
    assert not rows[0]["significant"]
    assert abs(middle["twist_t"]) > middle["t_limit"]
    # eq. 10.9: -dp of the right photo is what omega2' does there; as a left photo it does the opposite
    assert abs(middle["omega2_arcsec"] - 400.0) < 60
    assert abs(last["omega2_arcsec"] + 400.0) < 60
    text = sections_of(document_of(run(twist_arcsec=400.0)))
    assert any("2 of them are deformed" in part.text for s in text for part in s.parts if hasattr(part, "text"))


@pytest.mark.slow
def test_check_points_take_no_part_and_thin_control_gives_none() -> None:
    result = run()
    used = {name for row in documents(result) for name in row["points"]}
    control = result.inputs.control
    assert not used & {name for name, check in zip(control.ids, control.check, strict=True) if check}
    assert documents(run(count=4)) == []
    assert "deformations" not in document_of(run(count=4))


def with_a_lens(seed: int, micrometres: float) -> dict[str, Any]:
    """Adjust a strip of ten photos through a lens with a radial distortion of so much at 100 mm."""
    simulation = simulate(spec(seed, count=160, photos=10))
    inputs, settings = inputs_of(simulation), replace(settings_of(simulation), adjustment="polynomial")
    xy = inputs.observations.xy
    xy = xy * (1 + micrometres / 1e3 / 100.0**3 * (xy**2).sum(axis=1, keepdims=True))
    inputs = replace(inputs, observations=replace(inputs.observations, xy=xy))
    return document_of(triangulate(inputs, settings))


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "micrometres"), [(4, 70.0), (1, 200.0)])
def test_what_all_models_have_in_common_is_in_the_verdict(seed: int, micrometres: float) -> None:
    document = with_a_lens(seed, micrometres)
    bending = document["common_deformation"]["bending"]
    assert bending["models"] == 9
    assert bending["p"] < 0.001
    (text,) = (text for text in document["verdict"]["look_at"] if "deformed alike" in text)
    size = f"{bending['at_corner_m']:+.3f} m at a corner"
    assert text.startswith(f"9 models are deformed alike (bending): {size}")
    assert document["status"] == "look"


@pytest.mark.slow
def test_the_mean_of_all_models_is_tested_by_their_scatter() -> None:
    """By scipy, from the coefficients that the result shows."""
    document = with_a_lens(2, 0.0)
    for name, common in nonempty(document["common_deformation"].items()):
        values = [row[f"{name}_coefficient_m_per_mm2"] for row in document["deformations"]]
        expected = stats.ttest_1samp(values, 0.0)
        assert common["t"] == pytest.approx(expected.statistic, abs=0.01)
        assert common["p"] == pytest.approx(expected.pvalue, abs=0.002)
    assert not any("deformed" in text for text in document["verdict"]["look_at"])


def test_a_deformed_model_is_in_the_verdict() -> None:
    document = document_of(run(twist_arcsec=400.0))
    texts = [text for text in document["verdict"]["look_at"] if "is deformed (twist)" in text]
    assert {text.split(" is ")[0] for text in texts} == {
        "the model of photos 1002 and 1003", "the model of photos 1003 and 1004"
    }  # fmt: skip
    assert document["status"] in {"look", "failed"}
