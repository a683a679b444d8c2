"""The limits of y parallaxes in a result are those that the search for gross errors applied."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.pipeline.inputs import Settings
from photostrip.report.pictures.result import pictures_of
from photostrip.simulation.simulation import simulate
from photostrip.simulation.spec import GrossError
from tests.loops import nonempty
from tests.results import Case, case, solved, spec
from tests.simulated import inputs_of

if TYPE_CHECKING:
    from tests.results import Document


@cache
def run(screening: str, parallax_limit: float | None = None) -> Case:
    inputs = inputs_of(simulate(spec("projected", 1, 5.0, GrossError("image", size_um=300.0, axis="y"))))
    relative = replace(Settings().relative, screening=screening, parallax_limit=parallax_limit)
    return solved(inputs, Settings(adjustment="polynomial", relative=relative))


def limits(document: Document) -> list[float | None]:
    return [row["limit_um"] for row in document["models"]]


def test_a_parallax_limit_holds_where_grubbs_allows_more() -> None:
    found = run("parallax+grubbs", 0.004).document
    logged = [row for row in found["rejected"] if row["test"] == "parallax"]
    assert all(row["limit"] == 4.0 for row in nonempty(logged))
    assert max(each for each in limits(found) if each is not None) == 4.0


@pytest.mark.parametrize("screening", ["auto", "deletion", "robust", "tau", "parallax+grubbs"])
def test_what_was_used_lies_within_the_limits_and_what_was_rejected_beyond(screening: str) -> None:
    document = run(screening).document
    for model in nonempty(document["models"]):
        used = document["residuals"].where(photo=model["left"])["q_um"]
        assert 5.0 < model["limit_um"] < 60.0
        assert np.nanmedian(np.abs(used)) < model["limit_um"]
    size = {(row["left"], row["right"]): row["limit_um"] for row in document["models"]}
    wrong = [row for row in document["rejected"] if row["stage"] == "relative" and not row["readmitted"]]
    for row in nonempty(wrong):
        assert abs(row["parallax_um"]) > size[row["photo"], row["other_photo"]]


def test_without_a_search_there_is_no_limit() -> None:
    found = run("none").document
    assert set(limits(found)) == {None}
    drawn = next(each for each in pictures_of(found) if each.name == "histogram")
    assert "limit" not in drawn.svg


def test_the_histogram_has_the_limits() -> None:
    document = case().document
    drawn = next(each for each in pictures_of(document) if each.name == "histogram")
    known = sorted(each for each in limits(document) if each is not None)
    middle = float(np.median(known))
    assert f"median limit ±{middle:.1f} µm" in drawn.svg
    assert f"{known[0]:.1f} to {known[-1]:.1f} µm" in drawn.caption
    assert drawn.svg.count('class="line failed dashed"') == 3  # two in the panel of the y parallaxes, one in the legend
    bundle = solved(case().inputs, Settings(adjustment="bundle")).document
    of_bundle = next(each for each in pictures_of(bundle) if each.name == "histogram")
    assert f"±{bundle['bundle']['screening']['limit']:.2f}" in of_bundle.svg
    assert "y parallaxes" not in of_bundle.svg
