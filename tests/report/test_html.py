"""The report as HTML, and that of a batch: everything the text report says, whole, safe, reachable, small."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from html.parser import HTMLParser
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from photostrip.report.html import batch_html, to_html
from photostrip.report.page.parts import Facts, Table, Words
from photostrip.report.pictures.commands import batch_maps
from photostrip.report.pictures.result import pictures_of
from photostrip.report.sections.accuracy_report import sections_of
from photostrip.simulation.simulation import simulate
from photostrip.simulation.spec import Flight
from tests.loops import nonempty
from tests.reports import saved
from tests.results import a_finding, a_note, by_rows, case, in_tables, solved, spec
from tests.simulated import inputs_of
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from collections.abc import Iterator

    Document = dict[str, Any]

VOID = {"meta", "link", "br", "hr", "img", "input"}
CSS = (ROOT / "photostrip/report/templates/report.css").read_text(encoding="utf-8")


class Page(HTMLParser):
    """A page, taken apart: its elements, its words; every element must be closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.words: list[str] = []
        self._open: list[str] = []
        self.feed(text)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))
        if tag not in VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self._open and self._open[-1] not in {"style", "script", "title", "desc"}:
            self.words.append(" ".join(data.split()))

    def of(self, tag: str) -> list[dict[str, str]]:
        return [attributes for name, attributes in self.elements if name == tag]


@cache
def page() -> Page:
    return Page(to_html(saved()))


def texts(document: Document) -> Iterator[str]:
    """Give everything that the sections say."""
    for section in sections_of(document):
        yield section.title
        for part in section.parts:
            if isinstance(part, Words):
                yield part.text
            elif isinstance(part, Facts):
                yield from (word for row in part.rows for word in row)
            elif isinstance(part, Table):
                yield part.note
                yield from (word for column in part.columns for word in (column.name, column.unit))
                yield from (cell for row in (*part.rows, *part.foot) for cell in row)


def test_the_page_says_everything_that_the_sections_say() -> None:
    html = to_html(saved())
    assert "`" not in html[html.index("<main>") : html.index("</main>")]
    assert "<code>processing.adjustment: bundle</code>" in html
    words = set(Page(html.replace("<code>", "`").replace("</code>", "`")).words)
    assert [text for text in texts(saved()) if " ".join(text.split()) not in words and text] == []


def test_nothing_is_loaded_from_elsewhere() -> None:
    assert {tag for tag, _ in page().elements} & {"link", "img", "iframe", "object"} == set()
    assert page().of("script") == [{}]  # our own, in the page
    (policy,) = (each["content"] for each in page().of("meta") if "http-equiv" in each)
    assert policy.startswith("default-src 'none'; style-src 'unsafe-inline'; script-src 'sha256-")
    for tag, attributes in nonempty(page().elements):
        assert not {"src", "srcset", "onclick"} & attributes.keys()
        for name, value in attributes.items():
            assert "//" not in value or (tag, name) == ("svg", "xmlns")
    assert "url(" not in CSS
    assert "@import" not in CSS
    assert [words for words in page().words if re.search(r"result\.json|--\w|\.csv", words)] == []


def test_ids_are_there_once_links_lead_to_them_and_there_are_words_for_readers_that_do_not_see() -> None:
    ids = [attributes["id"] for _, attributes in page().elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    assert [link["href"] for link in page().of("a") if link["href"].removeprefix("#") not in ids] == []
    for attributes in nonempty((each for _, each in page().elements if "aria-labelledby" in each)):
        assert set(attributes["aria-labelledby"].split()) <= set(ids)
    found = page()
    assert found.of("html") == [{"lang": "en"}]
    assert len(found.of("h1")) == len(found.of("main")) == 1
    assert all(each["scope"] in {"col", "row"} for each in nonempty(found.of("th")))
    assert all(each["role"] == "img" for each in nonempty(found.of("svg")))
    assert len(found.of("svg")) == len(pictures_of(saved())) >= 12
    scrolled = [each for each in found.of("div") if each.get("role") == "region"]
    assert all(each["tabindex"] == "0" and each["aria-label"] for each in nonempty(scrolled))


def luminance(colour: str) -> float:
    """Relative luminance of a colour as WCAG 2 defines it; one that is not opaque is seen on its paper."""
    *top, red, green, blue = (int(digits, 16) / 255 for digits in re.findall("[0-9a-f]{2}", colour))
    alpha = top[3] if len(top) > 3 else 1.0
    parts = [alpha * one + (1.0 - alpha) * other for one, other in zip(top, (red, green, blue), strict=False)]
    red, green, blue = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


@pytest.mark.parametrize("scheme", range(3), ids=["light", "dark", "paper"])
def test_letters_and_marks_stand_out(scheme: int) -> None:
    block = re.findall(r":root \{(.*?)\}", CSS, re.DOTALL)[scheme]
    colours = dict(re.findall(r"--(\w+): (#[0-9a-f]{6,8});", block))
    assert len(colours) == 19

    def contrast(one: str, other: str) -> float:
        high, low = sorted((luminance(f"{colours[name]} on {colours['paper']}") for name in (one, other)), reverse=True)
        return (high + 0.05) / (low + 0.05)

    for name in ("ink", "soft", "link", "good", "look", "failed"):
        assert contrast(name, "paper") >= 4.5
        assert name == "link" or contrast(name, "band") >= 4.5
    for name in ("control", "check", "new", "photo", "ellipse", "c1", "c2", "c3", "c4"):
        assert contrast(name, "paper") >= 3.0


def test_ids_cannot_become_elements() -> None:
    document = by_rows(case().document)
    name = "<b>&\"'</script>"
    for block in ("points", "control"):
        for row in document[block]:
            row["id"] = name if row["id"] == "K01" else row["id"]
    document["name"] = "<i>strip</i>"
    text = to_html(in_tables(document))
    assert "<b>" not in text
    assert "<i>" not in text
    assert "&lt;i&gt;strip" in text
    assert name in " ".join(Page(text).words)


def test_findings_lead_to_rows_and_pictures_and_back() -> None:
    document = by_rows(saved())
    point, pair = document["control"][0]["id"], document["models"][0]
    document["findings"] = [a_finding("X", "m", points=[point]), a_finding("X", "m", photos=[pair["left"]])]
    text = to_html(in_tables(document))
    for number, start in ((1, point), (2, f"{pair['left']} – ")):
        finding = re.search(rf'<li id="finding-{number}">(.*?)</li>', text, re.DOTALL)
        assert finding is not None
        rows = re.findall(r'href="#([^"]+-row-\d+)"', finding[1])
        for row in nonempty(rows):
            head = re.search(rf'<tr id="{row}"><th[^>]*>([^<]*)(.*?)</th>', text)
            assert head is not None
            assert head[1].startswith(start.split(" – ")[0]) or start.split(" – ")[0] in head[1]
            assert f'href="#finding-{number}"' in head[2]
        assert 'href="#picture-plan"' in finding[1]
    assert 'href="#picture-deformation"' in text


def test_what_to_look_at_leads_to_the_rows_of_its_points() -> None:
    document = by_rows(saved())
    noted, odd = (row["id"] for row in document["control"][:2])
    document["control"][1]["stands_out"] = ["plan"]
    document["notes"].append(a_note("control-doubtful", f"control point {noted} is wrong", points=[noted]))
    look = [f"control point {noted} is wrong", f"control point {odd} (9 m in plan) stands out", "something else"]
    document["verdict"]["look_at"] = look
    text = to_html(in_tables(document))
    found = re.findall(r'<li id="finding-(\d)">(.*?)</li>', text, re.DOTALL)
    assert [number for number, _ in found] == ["1", "2"]
    for (number, item), name in nonempty(list(zip(found, (noted, odd), strict=True))):
        assert f">{name} in Control points<" in item
        assert re.search(rf'<tr id="[^"]+"><th[^>]*>{name} <a class="back" href="#finding-{number}"', text)
    assert f"point {noted}: control-doubtful" in text


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
    assert re.search(r"Of each photo the \d+ largest are drawn\.", page)


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


def test_every_project_leads_to_its_report_a_faulty_one_to_none_and_the_worst_comes_first() -> None:
    page = batch_html(OUTCOMES, "1")
    assert re.findall(r'<a href="([^"#]+)"', page) == [
        "a/report.html", "b%20%26%20c/report.html", "moon/report.html", "local/report.html"
    ]  # fmt: skip
    assert all(f"strips/{name}/project.yaml" in page for name in ("a", "moon", "local", "bad"))
    assert page == batch_html(OUTCOMES, "1")
    texts = ("1 faulty, 1 look, 3 good", "What is wrong</h2>", ":3: is wrong", "photo 7 is odd")
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
