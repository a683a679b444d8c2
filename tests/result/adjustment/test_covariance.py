"""The adjustment with the strip's own covariance in result.json and in the report."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from photostrip.pipeline.inputs import Settings
from photostrip.report.page.text import to_text
from photostrip.report.sections.accuracy_report import sections_of, title_of
from photostrip.simulation.simulation import simulate
from photostrip.simulation.spec import GrossError
from photostrip.statistics import gamma_cdf
from tests.loops import nonempty
from tests.results import Case, case, solved, spec
from tests.simulated import inputs_of


@cache
def adjusted(strips: int = 1) -> Case:
    return solved(inputs_of(simulate(spec("projected", strips))), Settings(adjustment="covariance"))


@pytest.mark.parametrize("strips", [1, 2])
def test_the_block_holds_the_tests(strips: int) -> None:
    known = adjusted(strips)
    assert known.document["adjustment"] == "covariance"
    assert "polynomial" not in known.document
    blocks = known.document["covariance"]
    assert [block["strip"] for block in blocks] == [strip.strip.id for strip in known.result.strips]
    for block, strip in nonempty(zip(blocks, known.result.strips, strict=True)):
        assert block["redundancy"] == block["control_coordinates"] - 7 + block["distances"]
        assert block["control_coordinates"] == int(strip.control.use.sum())
        assert block["sigma0"] == pytest.approx(np.sqrt(block["squares"] / block["redundancy"]), rel=1e-3)
        assert block["p"] == pytest.approx(1 - gamma_cdf(block["squares"] / 2, block["redundancy"] / 2), rel=1e-2)
        assert [row["id"] for row in block["control"][::3]] == sorted(strip.control.ids, key=lambda n: int(n[1:]))
        joints = len(strip.of_photos.formed.junctions.factor)
        assert block["distances"] == int(strip.of_photos.formed.junctions.used.sum()) - joints


def test_points_are_better_than_with_a_polynomial() -> None:
    """The stated standard deviations of the new points are smaller: least squares leaves nothing better."""
    for name in ("plan", "height"):
        own, other = (known.document["precision"]["points"][name]["rms"] for known in (adjusted(), case("projected")))
        assert own <= other


def test_photos_and_points_belong_together() -> None:
    """Image residuals are of the size of the errors of the image coordinates, 5 micrometres, or below."""
    assert 2.0 < adjusted().document["summary"]["image_rms_um"] < 5.5


def test_the_report_shows_the_tests() -> None:
    text = to_text(title_of(adjusted().document), sections_of(adjusted().document), 100)
    text = " ".join(text.split())
    assert "Adjustment with the covariance of the strip" in text
    assert "probability of a larger one by chance" in text
    assert "Polynomial adjustment" not in text


def test_a_polynomial_is_told_of_the_alternative() -> None:
    """Three bands of control are few for a polynomial, whatever its degree; covariance and `auto` propose nothing."""
    for known in (solved(case("projected").inputs, Settings(adjustment="polynomial")), adjusted(), case("projected")):
        asked = known.result.settings.adjustment == "polynomial"
        told = [note["message"] for note in known.document["notes"] if note["code"] == "covariance-proposed"]
        assert len(told) == asked
        text = " ".join(to_text(title_of(known.document), sections_of(known.document), 100).split())
        assert ("`processing.adjustment: covariance` comes within" in text) == asked


def test_exchanged_image_points_do_not_stop_it() -> None:
    """Gross errors are found before, as with every adjustment."""
    inputs = inputs_of(simulate(spec("projected", 1, 5.0, GrossError("image", count=3, size_um=500.0))))
    known = solved(inputs, Settings(adjustment="covariance"))
    assert known.document["summary"]["check"]["plan"]["rms"] < 0.3
