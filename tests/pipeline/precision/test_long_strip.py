"""A strip too long for the standard deviations of a polynomial says so, and what has them."""

from __future__ import annotations

import pytest

from photostrip.pipeline.inputs import Settings
from photostrip.pipeline.run import triangulate
from photostrip.result.document import document_of
from photostrip.simulation import Control, Flight, Points, Spec, simulate
from tests.simulated import inputs_of

pytestmark = pytest.mark.usefixtures("_no_findings")


def test_beyond_400_photos_a_polynomial_asks_for_the_bundle() -> None:
    spec = Spec(flight=Flight(photos=401), points=Points(extra_per_model=1), control=Control(every=20, check=5))
    result = triangulate(inputs_of(simulate(spec)), Settings(adjustment="polynomial"))
    (note,) = [each for each in result.notes if each.code == "no-precision"]
    assert "strip A has 401 photos" in note.message
    assert "`processing.adjustment: bundle`" in note.message
    document = document_of(result)
    assert "precision" not in document
    assert {point["sigma_z"] for point in document["points"]} == {None}
