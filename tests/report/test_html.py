"""The report as HTML: everything the text report says, whole, safe, reachable."""

from __future__ import annotations

import json
import re
from functools import cache
from html.parser import HTMLParser
from typing import TYPE_CHECKING, Any

import pytest

from photostrip.cli.main import main
from photostrip.formats.result_json import checked, to_json
from photostrip.report.html import to_html
from photostrip.report.page.parts import Facts, Table, Words
from photostrip.report.pictures.result import pictures_of
from photostrip.report.sections.accuracy_report import sections_of
from tests.loops import nonempty
from tests.reports import saved
from tests.results import by_rows, case, in_tables, spec, write_project
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

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


def test_the_reader_needs_no_other_file() -> None:
    assert [words for words in page().words if re.search(r"result\.json|--\w|\.csv", words)] == []


def test_ids_are_there_once_and_links_lead_to_them() -> None:
    ids = [attributes["id"] for _, attributes in page().elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    assert [link["href"] for link in page().of("a") if link["href"].removeprefix("#") not in ids] == []
    for attributes in nonempty((each for _, each in page().elements if "aria-labelledby" in each)):
        assert set(attributes["aria-labelledby"].split()) <= set(ids)


def test_readers_that_do_not_see_have_words_for_everything() -> None:
    found = page()
    assert found.of("html") == [{"lang": "en"}]
    assert len(found.of("h1")) == len(found.of("main")) == 1
    assert all(each["scope"] in {"col", "row"} for each in nonempty(found.of("th")))
    assert all(each["role"] == "img" for each in nonempty(found.of("svg")))
    assert len(found.of("svg")) == len(pictures_of(saved())) >= 12
    scrolled = [each for each in found.of("div") if each.get("role") == "region"]
    assert all(each["tabindex"] == "0" and each["aria-label"] for each in nonempty(scrolled))


def luminance(colour: str) -> float:
    """Relative luminance of a colour as WCAG 2 defines it."""
    parts = [int(colour[n : n + 2], 16) / 255 for n in (1, 3, 5)]
    red, green, blue = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


@pytest.mark.parametrize("scheme", range(3), ids=["light", "dark", "paper"])
def test_letters_and_marks_stand_out(scheme: int) -> None:
    block = re.findall(r":root \{(.*?)\}", CSS, re.DOTALL)[scheme]
    colours = dict(re.findall(r"--(\w+): (#[0-9a-f]{6});", block))
    assert len(colours) == 18

    def contrast(one: str, other: str) -> float:
        high, low = sorted((luminance(colours[one]), luminance(colours[other])), reverse=True)
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


def test_the_same_result_gives_the_same_page() -> None:
    document = case().document
    assert to_html(document) == to_html(checked(json.loads(to_json(document)), "result.json"))


# ----------------------------------------------------------------------------------------------------- commands


@pytest.mark.slow
def test_run_and_report_write_the_same_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    project = write_project(tmp_path, spec())
    assert main(["run", str(project), "-o", str(tmp_path / "out"), "--html", "--quiet"]) == 0
    assert main(["report", str(tmp_path / "out"), "-o", str(tmp_path / "again.html")]) == 0
    page = (tmp_path / "out/report.html").read_bytes()
    assert page == (tmp_path / "again.html").read_bytes()
    assert page.startswith(b"<!DOCTYPE html>")
    assert capsys.readouterr().err == ""


@pytest.mark.slow
def test_long_tables_are_whole() -> None:
    document = by_rows(saved())
    document["control"] = [row | {"id": f"{row['id']} {n}"} for n in range(9) for row in document["control"]]
    names = {f"{saved()['control'][0]['id']} {n}" for n in range(9)}
    assert names <= set(Page(to_html(in_tables(document))).words)


def test_the_menu_has_the_order_of_the_page() -> None:
    text = to_html(saved())
    menu = re.findall(r'href="#([^"]+)"', text[text.index("<nav") : text.index("</nav>")])
    assert menu == re.findall(r'<section id="([^"]+)" aria-labelledby', text)
    assert "pictures" in menu


def test_findings_lead_to_rows_and_pictures_and_back() -> None:
    document = by_rows(saved())
    point, pair = document["control"][0]["id"], document["models"][0]
    blank = {"code": "X", "title": "t", "severity": "warning", "accepted": False, "message": "m", "fix": "f"}
    where = {"evidence": {}, "strips": [], "file": "", "line": 0, "column": 0, "key": ""}
    document["findings"] = [
        blank | where | {"points": [point], "photos": []},
        blank | where | {"points": [], "photos": [pair["left"]]},
    ]
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
    where = {"strip": "", "photos": [], "file": "", "line": 0, "column": 0, "key": ""}
    note = where | {"code": "control-doubtful", "severity": "warning", "points": [noted]}
    document["notes"].append(note | {"message": f"control point {noted} is wrong"})
    look = [f"control point {noted} is wrong", f"control point {odd} (9 m in plan) stands out", "something else"]
    document["verdict"]["look_at"] = look
    text = to_html(in_tables(document))
    found = re.findall(r'<li id="finding-(\d)">(.*?)</li>', text, re.DOTALL)
    assert [number for number, _ in found] == ["1", "2"]
    for (number, item), name in nonempty(list(zip(found, (noted, odd), strict=True))):
        assert f">{name} in Control points<" in item
        assert re.search(rf'<tr id="[^"]+"><th[^>]*>{name} <a class="back" href="#finding-{number}"', text)
    assert f"point {noted}: control-doubtful" in text


def test_html_needs_a_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", str(write_project(tmp_path, spec())), "--html"]) == 2
    assert "--output" in capsys.readouterr().err
