"""Pages of four projects in Chromium, where it is installed: nothing fails or is asked for, tables sort and filter."""

from __future__ import annotations

import base64
import os
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from photostrip.pipeline.inputs import Settings, Strip
from photostrip.report.html import to_html
from photostrip.simulation import Flight, Models, Spec
from photostrip.simulation.simulation import simulate
from tests.browser import Browser, chromium, opened
from tests.loops import nonempty
from tests.reports import saved
from tests.results import by_rows, case, in_tables, solved, spec
from tests.simulated import inputs_of

if TYPE_CHECKING:
    from collections.abc import Iterator

PROGRAM = chromium()
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(PROGRAM is None, reason="Chromium is not installed: apt install chromium"),
]

SORTED = """
[...document.querySelectorAll("main table")].flatMap((table) => [...table.tHead.rows[0].cells].flatMap((head, n) => {
  const button = head.querySelector("button");
  if (!button) return [];
  const order = () => [...table.tBodies[0].rows].map((row) => row.cells[n].firstChild?.textContent.trim() ?? "");
  const before = order();
  button.click();
  const found = order().filter((words) => !["", "–"].includes(words)), state = head.ariaSort;
  button.click(); button.click();
  return [{ found, state, same: String(before) === String(order()) }];
}))
"""
FILTERED = """
[...document.querySelectorAll(".filter")].map((line) => {
  const field = line.querySelector("input"), rows = [...line.nextElementSibling.querySelectorAll("tbody tr")];
  const wanted = rows.at(-1).cells[0].firstChild.textContent.trim();
  field.value = wanted;
  field.dispatchEvent(new Event("input"));
  const left = rows.filter((row) => row.checkVisibility()).map((row) => row.textContent);
  field.value = "";
  field.dispatchEvent(new Event("input"));
  return { wanted, left, rows: rows.length, all: rows.filter((row) => row.checkVisibility()).length };
})
"""


@cache
def document(kind: str) -> dict[str, Any]:
    """Give the result of a project of a kind."""
    if kind == "failed run":
        found = by_rows(saved())
        found["control"] = [row | {"id": f"{row['id']}.{n}"} for n in range(3) for row in found["control"]]
        shown: dict[str, Any] = in_tables(found)
        return shown
    if kind == "strip":  # long enough for a table that is filtered
        run = solved(inputs_of(simulate(Spec(flight=Flight(photos=24)))))
    elif kind == "models":
        run = solved(inputs_of(simulate(Spec(models=Models(), flight=spec().flight))))
    else:
        inputs = case("projected", 2).inputs
        alone = tuple(Strip(photo, each.camera, (photo,)) for each in inputs.strips for photo in each.photos)
        run = solved(replace(inputs, strips=alone), Settings(adjustment="bundle"))
    return run.document


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    assert PROGRAM is not None
    with opened(PROGRAM, tmp_path_factory.mktemp("browser") / "profile") as found:
        yield found


@pytest.fixture(scope="module", params=["failed run", "strip", "single photos", "models"])
def page(request: pytest.FixtureRequest, browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Browser:
    file = tmp_path_factory.mktemp("page") / "report.html"
    file.write_text(to_html(document(request.param)), encoding="utf-8")
    browser.open(file)
    return browser


def test_nothing_fails_and_nothing_is_asked_for(page: Browser) -> None:
    assert page.of("Runtime.consoleAPICalled") == page.of("Runtime.exceptionThrown") == page.of("Log.entryAdded") == []
    assert [each["request"]["url"].rpartition("/")[2] for each in page.of("Network.requestWillBeSent")] == [
        "report.html"
    ]


def test_tables_sort_and_come_back(page: Browser) -> None:
    found = page.ask(SORTED)
    assert len(found) > 20
    for each in nonempty(found):
        assert each["same"]
        assert each["state"] == "ascending"
        try:
            sizes = [float(words.removeprefix("<")) for words in each["found"]]
        except ValueError:
            continue  # words: the browser's own order
        assert sizes == sorted(sizes)


def test_tables_are_filtered(page: Browser) -> None:
    found = page.ask(FILTERED)
    for each in nonempty(found):
        assert 0 < len(each["left"]) < each["rows"] == each["all"]
        assert all(each["wanted"].lower() in row.lower() for row in each["left"])


def test_other_scripts_do_not_run(page: Browser) -> None:
    page.ask('document.body.append(Object.assign(document.createElement("script"), {textContent: "window.ran = 1"}))')
    assert page.ask("window.ran === undefined")


@pytest.mark.parametrize("width", [390, 1120], ids=["phone", "desk"])
def test_the_page_is_not_wider_than_the_screen(page: Browser, width: int) -> None:
    page.call("Emulation.setDeviceMetricsOverride", width=width, height=800, deviceScaleFactor=1, mobile=width < 500)
    assert page.ask("document.documentElement.scrollWidth") <= width


def test_dark_readers_get_a_dark_page(page: Browser) -> None:
    for scheme, dark in (("light", False), ("dark", True)):
        page.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        red = page.ask("parseInt(getComputedStyle(document.body).backgroundColor.match(/\\d+/)[0])")
        assert (red < 60) is dark


@pytest.mark.parametrize("page", ["strip"], indirect=True)
def test_it_prints(page: Browser) -> None:
    paper = base64.b64decode(page.call("Page.printToPDF")["data"])
    assert paper.startswith(b"%PDF")
    assert len(paper) > 100_000


@pytest.mark.skipif("PHOTOSTRIP_AXE" not in os.environ, reason="PHOTOSTRIP_AXE names no axe.min.js (npm axe-core)")
def test_axe_has_nothing_serious_to_say(page: Browser) -> None:
    page.ask(Path(os.environ["PHOTOSTRIP_AXE"]).read_text(encoding="utf-8"))
    found = page.ask("axe.run().then((all) => all.violations.map((one) => [one.impact, one.id]))")
    assert [each for each in found if each[0] in {"serious", "critical"}] == []
