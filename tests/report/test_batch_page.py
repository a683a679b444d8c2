"""The page of a batch: every project with a link, a map for each body, the worst first; the same bytes again."""

from __future__ import annotations

import re
from itertools import combinations
from typing import Any

from photostrip.report.html import batch_html
from photostrip.report.pictures.commands import batch_maps
from tests.loops import nonempty

EARTH, MOON = 6378137.0, 1737400.0


def outcome(name: str, status: str = "good", **more: Any) -> dict[str, Any]:  # noqa: ANN401
    found = {
        "project": f"strips/{name}/project.yaml", "output": name, "status": status, "exit_code": 0, "photos": 5,
        "points": 40, "rejected": 1, "sigma0_um": 4.8, "rms_at": "check", "rms_plan_m": 0.1, "rms_height_m": 0.2,
        "messages": [], "findings": [], "body": EARTH, "track": [[[15.0, 50.0], [15.1, 50.01]]],
    }  # fmt: skip
    return found | more


FAULTY = {
    "output": None, "messages": ["observations.csv:3: is wrong"], "body": None, "track": None,
    **dict.fromkeys(("photos", "points", "rejected", "sigma0_um", "rms_at", "rms_plan_m", "rms_height_m")),
}  # fmt: skip
OUTCOMES = [
    outcome("a"),
    outcome("b & c", "look", messages=["photo 7 is odd"]),
    outcome("moon", body=MOON, track=[[[3.6, 26.1], [3.0, 26.1]]]),
    outcome("local", body=None, track=None),
    outcome("bad", "faulty", exit_code=2, **FAULTY),
]


def test_every_project_leads_to_its_report_and_a_faulty_one_to_none() -> None:
    page = batch_html(OUTCOMES, "1")
    assert re.findall(r'<a href="([^"#]+)"', page) == [
        "a/report.html", "b%20%26%20c/report.html", "moon/report.html", "local/report.html"
    ]  # fmt: skip
    assert all(f"strips/{name}/project.yaml" in page for name in ("a", "moon", "local", "bad"))
    assert page == batch_html(OUTCOMES, "1")


def test_the_worst_comes_first() -> None:
    page = batch_html(OUTCOMES, "1")
    texts = ("1 faulty, 1 look, 3 good", "The worst things</h2>", "is wrong", "photo 7 is odd")
    order = [page.index(text) for text in texts]
    assert order == sorted(order)


def test_each_body_has_a_map_of_its_own_with_all_its_strips() -> None:
    maps = batch_maps(OUTCOMES)
    assert [each.svg.count('class="line good') + each.svg.count('class="line look') for each in maps] == [2, 1]
    assert maps[0].title == "2 projects on a body of 6378 km radius"
    assert maps[1].title == "1 project on a body of 1737 km radius"
    assert "b &amp; c" in maps[0].svg
    assert batch_maps([outcome("local", body=None, track=None)]) == []


def test_a_map_keeps_lengths_and_north() -> None:
    """At 60 degrees a degree of longitude is half as long as one of latitude."""
    (drawn,) = batch_maps([outcome("a", track=[[[10.0, 60.0], [10.2, 60.0]], [[10.0, 59.95], [10.0, 60.05]]])])
    lines = re.findall(r'<path d="M([\d.]+) ([\d.]+)L([\d.]+) ([\d.]+)" class="line good', drawn.svg)
    (x1, y1, x2, y2), (u1, v1, u2, v2) = (map(float, each) for each in nonempty(lines))
    assert y1 == y2
    assert u1 == u2
    assert x2 > x1
    assert v2 < v1  # north is up
    assert abs((x2 - x1) - (v1 - v2)) < 0.5


def test_names_on_the_map_do_not_lie_on_each_other() -> None:
    side_by_side = [outcome(f"strip-{n}", track=[[[15.0, 50.0 + n / 100], [15.3, 50.0 + n / 100]]]) for n in range(200)]
    (picture,) = batch_maps(side_by_side)
    labels = re.findall(r'<text x="([\d.]+)" y="([\d.]+)" class="label id"[^>]*>(strip-\d+)<', picture.svg)
    places = [(float(x), float(y)) for x, y, _ in nonempty(labels)]
    assert len(labels) < len(side_by_side)
    for (x, y), (u, v) in nonempty(list(combinations(places, 2))):
        assert abs(x - u) > 40 or abs(y - v) > 10
