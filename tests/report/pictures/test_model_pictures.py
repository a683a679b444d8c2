"""Pictures of independent models, with perspective centres and without."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from itertools import pairwise
from xml.etree import ElementTree as ET

import pytest

from photostrip.pipeline.inputs import Settings
from photostrip.report.html import to_html
from photostrip.report.pictures.result.pictures import pictures_of
from photostrip.simulation import Models, simulate
from tests.loops import nonempty
from tests.results import Document, by_rows, in_tables, solved, spec
from tests.simulated import inputs_of


@cache
def document(*, centers: bool, strips: int = 2) -> Document:
    inputs = inputs_of(simulate(replace(spec(strips=strips), models=Models(centers=centers))))
    settings = Settings(adjustment="polynomial", polynomial=replace(Settings().polynomial, degree="2"))
    found: Document = solved(inputs, settings).document
    return found


@pytest.mark.slow
def test_models_without_centres_have_a_plan_of_their_points() -> None:
    found = document(centers=False)
    assert {photo["x"] for photo in found["photos"]} == {None}
    drawn = {each.name: each for each in pictures_of(found)}
    assert set(drawn) >= {"plan", "junctions"}
    assert "scale" not in drawn
    network = solved(inputs_of(simulate(replace(spec(strips=2), models=Models(centers=False)))), Settings()).document
    assert "check" in {each.name for each in pictures_of(network)}
    ids = [point["id"] for point in found["points"] if point["role"] == "check"]
    assert all(f"check point {name}," in drawn["plan"].svg for name in nonempty(ids))
    assert "</html>" in to_html(found)


def test_a_strip_in_which_one_centre_is_not_known_is_drawn_without_it() -> None:
    found = by_rows(document(centers=True))
    found["photos"] = [
        {**photo, "x": None, "y": None, "z": None} if n == 0 else photo for n, photo in enumerate(found["photos"])
    ]
    drawn = {each.name: each.svg for each in pictures_of(in_tables(found))}
    assert f"photo {found['photos'][1]['id']}" in drawn["plan"]
    assert f">photo {found['photos'][0]['id']}" not in drawn["plan"]


def test_the_scale_of_models_before_and_after_the_adjustment_is_drawn() -> None:
    found = document(centers=True, strips=1)
    places = [[photo[axis] for axis in "xyz"] for photo in found["photos"]]
    ratios = []
    for model, (left, right) in nonempty(zip(found["models"], list(pairwise(places)), strict=True)):
        assert model["base"] == pytest.approx(math.dist(left, right), rel=2e-3)  # scale of the map
        ratios.append(model["base"] / model["base_formed"] - 1.0)
    assert max(map(abs, ratios)) < 2e-3
    picture = next(each for each in pictures_of(found) if each.name == "scale")
    root = ET.fromstring(picture.svg)  # noqa: S314 (we wrote it)
    hints = [each.text or "" for each in root.iter("{http://www.w3.org/2000/svg}title")]
    shown = [float(hint.removesuffix(" ppm")) for hint in hints if hint.endswith(" ppm")]
    mean = sum(ratios) / len(ratios)
    assert shown == pytest.approx([1e6 * (ratio - mean) for ratio in ratios], abs=2)
    assert max(map(abs, shown)) > 15
