"""The plan: what findings name is to be seen."""

from __future__ import annotations

import copy
import re

from photostrip.report.pictures.ground.plan import plan_picture
from photostrip.report.pictures.ground.plan_view import plan_of
from tests.loops import nonempty
from tests.results import case


def test_points_that_findings_name_have_a_ring_around_their_mark() -> None:
    document = copy.deepcopy(case().document)
    plan = plan_of(document)
    bad = next(spot for spot in plan.spots if spot.role == "new").id
    assert '"ring"' not in plan_picture(document | {"findings": []}, plan).svg
    document["findings"] = [
        {"code": code, "points": points} for code, points in (("P1", [bad]), ("P2", [bad, "no such point"]), ("P3", []))
    ]
    drawn = plan_picture(document, plan).svg
    rings = re.findall(r'<circle cx="([^"]+)" cy="([^"]+)" r="9" class="ring"><title>([^<]+)</title>', drawn)
    assert [hint for *_, hint in rings] == [f"point {bad}: P1, P2"]
    for x, y, _ in nonempty(rings):
        assert re.search(rf'<circle cx="{x}" cy="{y}" [^>]*class="mark new"><title>new point {bad}', drawn)
    assert f">{bad}</text>" in drawn
