"""Blocks of photos that are strips of their own each: no pairs, no models, and yet every output."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from photostrip.comparison import compare_results
from photostrip.errors import GeometryError
from photostrip.pipeline.inputs import Inputs, Strip
from photostrip.points import PhotoPoints
from photostrip.report.html import to_html
from photostrip.report.sections.accuracy_report import sections_of
from photostrip.result.document import document_of
from photostrip.result.verdict import verdict_of
from photostrip.sheets.trace import trace_sheet
from photostrip.simulation import Control, Flight, Ground, Simulation, Spec
from tests.pipeline.blocks import adjusted, errors, exact, orientations, simulate
from tests.results import result_files
from tests.simulated import inputs_of

MICROMETRE = 1e-6  # metres
MANY = Control(noise=(0.0, 0.0, 0.0), layout="bands", bands=6, per_band=3)


def singles(simulation: Simulation, inputs: Inputs | None = None) -> Inputs:
    """Cut every strip into its photos."""
    inputs = inputs_of(simulation) if inputs is None else inputs
    strips = [Strip(photo, strip.camera, (photo,)) for strip in inputs.strips for photo in strip.photos]
    return replace(inputs, strips=tuple(strips))


@pytest.mark.parametrize("crs", ["EPSG:32633", "geocentric", "local"])
def test_single_photos_on_full_control_come_back_to_the_truth(crs: str) -> None:
    simulation = simulate(exact(flight=Flight(photos=6), control=MANY, ground=Ground(crs=crs)))
    result = adjusted(simulation, singles(simulation))
    assert np.abs(errors(simulation, result)).max() < MICROMETRE
    document = document_of(result)
    assert document["counts"]["strips"] == 6
    assert document["models"] == document["strips"] == []
    assert document["summary"]["photo_scale"] == pytest.approx(10_000, rel=0.02)
    assert document["summary"]["flying_height"] == pytest.approx(1530, rel=0.02)
    assert [row["strip"] for row in document["precision"]["basis"]] == [photo["id"] for photo in document["photos"]]


@pytest.mark.slow
def test_every_output_knows_single_photos() -> None:
    simulation = simulate(replace(Spec(), flight=Flight(photos=6), control=replace(MANY, noise=(0.05, 0.05, 0.08))))
    result = adjusted(simulation, singles(simulation))
    document = document_of(result)
    titles = [section.title for section in sections_of(document)]
    assert "Bundle adjustment" in titles
    assert "Relative orientation" not in titles
    assert to_html(document).count("<svg") >= 2
    assert set(result_files(document)) > {"points.csv", "photos.csv", "residuals.csv"}
    assert "absolute" not in trace_sheet(result).document()
    assert compare_results(document, document)["status"] == "same"


@pytest.mark.parametrize("given", ["observed", "approximate", "one short"])
def test_a_strip_with_a_pair_that_cannot_be_oriented_starts_from_given_orientations(given: str) -> None:
    """Half of a pair's points were taken for others; what the bundle rejects is just these."""
    simulation = simulate(Spec(flight=Flight(photos=6)))
    seen, noise = simulation.observations, np.random.default_rng(1)
    before = np.isin(seen.point, seen.point[seen.photo == 2])
    wrong = np.flatnonzero((seen.photo == 3) & before)[::2]
    xy = seen.xy.copy()
    xy[wrong] += noise.uniform(-50.0, 50.0, (len(wrong), 2))
    known = orientations(simulation, observed=given == "observed")
    if given == "one short":
        left = slice(0, 5)
        parts = {name: getattr(known, name)[left] for name in ("photos", "enu", "angles", "sigma", "sigma_turns")}
        known = replace(known, **parts)
    inputs = replace(inputs_of(simulation), observations=replace(seen, xy=xy), orientations=known)
    if given == "one short":
        with pytest.raises(GeometryError, match="relative orientation of photos 1003 and 1004"):
            adjusted(simulation, inputs)
        return
    result = adjusted(simulation, inputs)
    assert result.bundle is not None
    used = np.zeros(len(seen), bool)
    used[result.bundle.block.rows[result.bundle.screened.selection.images]] = True
    assert not used[wrong].any()
    assert np.count_nonzero(~used) <= len(wrong) + 3
    kept = np.ones(len(seen), bool)
    kept[wrong] = False
    cut = PhotoPoints(
        photo_ids=seen.photo_ids,
        point_ids=seen.point_ids,
        photo=seen.photo[kept],
        point=seen.point[kept],
        xy=seen.xy[kept],
        sigma=seen.sigma[kept],
    )
    without = adjusted(simulation, replace(inputs, observations=cut))
    error, least = (np.sqrt((errors(simulation, each) ** 2).sum(axis=1).mean()) for each in (result, without))
    assert error < 1.2 * least
    document = document_of(result)
    verdict = verdict_of(document)
    assert verdict["status"] == "look"
    assert any("start from their given orientations" in text for text in verdict["look_at"])
    assert [section.title for section in sections_of(document)]
