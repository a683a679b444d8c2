"""The page of a large block can be mailed."""

from __future__ import annotations

from dataclasses import replace

import pytest

from photostrip.report.html import to_html
from photostrip.simulation.simulation import simulate
from photostrip.simulation.spec import Flight
from tests.loops import nonempty
from tests.results import solved, spec
from tests.simulated import inputs_of

MOST = 3000  # bytes for each photo


@pytest.mark.slow
@pytest.mark.parametrize(("photos", "strips"), [(500, 1), (20, 20)])
def test_pages_grow_by_at_most_three_megabytes_for_a_thousand_photos(photos: int, strips: int) -> None:
    flight = Flight(photos=photos, strips=strips, heading_deg=70.0)
    document = solved(inputs_of(simulate(replace(spec(strips=strips), flight=flight)))).document
    assert len(document["photos"]) == photos * strips
    page = to_html(document)
    assert all(f"photo {photo}" in page for photo in nonempty(sorted({each["id"] for each in document["photos"]})))
    assert len(page.encode("utf-8")) <= MOST * photos * strips
