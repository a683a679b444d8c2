"""The page of a large block can be mailed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from photostrip.report.html import to_html
from photostrip.simulation.simulation import simulate
from photostrip.simulation.spec import Flight
from tests.loops import nonempty
from tests.results import by_rows, case, in_tables, solved, spec
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


@pytest.mark.slow
def test_the_page_of_fifty_thousand_points_is_thinned_and_says_so() -> None:
    document = by_rows(case().document)
    times = 50_000 // len(document["points"]) + 1
    move = np.random.default_rng(1).uniform(-400.0, 400.0, (times, 2))
    document["points"] = [
        row | {"id": f"{row['id']}.{n}", "role": "new", "x": row["x"] + x, "y": row["y"] + y}
        for n, (x, y) in enumerate(move.tolist())
        for row in document["points"]
    ]
    document["residuals"] = [
        row | {"point": f"{row['point']}.{n}"} for n in range(times) for row in document["residuals"]
    ]
    page = to_html(in_tables(document))
    assert len(page.encode("utf-8")) < 5_000_000
    assert f"Of {len(document['points'])} points one in " in page
    assert "Of each photo the 150 largest are drawn." in page
