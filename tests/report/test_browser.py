"""Pages of four projects and a batch in Chromium, where it is installed: nothing fails, tables sort and filter.

Chromium is driven over a pipe by its own protocol, with no package but Python.
"""

from __future__ import annotations

import base64
import json
import os
import shutil
import subprocess
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from photostrip.pipeline.inputs import Settings, Strip
from photostrip.report.html import batch_html, to_html
from photostrip.simulation import Flight, Models, Spec
from photostrip.simulation.simulation import simulate
from tests.loops import nonempty
from tests.report.test_html import outcome
from tests.reports import saved
from tests.results import by_rows, case, in_tables, solved, spec
from tests.simulated import inputs_of

if TYPE_CHECKING:
    from collections.abc import Iterator

PROGRAM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
OPTIONS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-dev-shm-usage",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--remote-debugging-pipe",
)  # fmt: skip
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
COVERED = """
[...document.querySelectorAll("figure svg")].flatMap((svg) => {
  const all = svg.getBoundingClientRect();
  const texts = [...svg.querySelectorAll("text")].map((text) => [text.textContent, text.getBoundingClientRect()]);
  const over = ([, a], [, b]) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1
    && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 3;
  return texts.filter((one, n) => one[1].left < all.left - 1 || one[1].right > all.right + 1
    || texts.slice(0, n).some((other) => over(one, other))).map(([words]) => words);
})
"""


class Browser:
    """One tab; what it says and asks for while a page loads is kept."""

    def __init__(self, write: int, read: int) -> None:
        self._write, self._read, self._waiting, self._number = write, read, b"", 0
        self.events: list[dict[str, Any]] = []
        self._session: dict[str, str] = {}
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = {"sessionId": self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]}
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.call(f"{domain}.enable")

    def _message(self) -> dict[str, Any]:
        while b"\0" not in self._waiting:
            some = os.read(self._read, 1 << 16)
            assert some, "Chromium has ended"
            self._waiting += some
        first, self._waiting = self._waiting.split(b"\0", 1)
        found: dict[str, Any] = json.loads(first)
        return found

    def call(self, method: str, **parameters: object) -> dict[str, Any]:
        """Call a method of the protocol and return its result."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters} | self._session
        waiting = json.dumps(message).encode() + b"\0"
        while waiting:
            waiting = waiting[os.write(self._write, waiting) :]
        while (answer := self._message()).get("id") != self._number:
            self.events.append(answer)
        assert "error" not in answer, answer
        result: dict[str, Any] = answer["result"]
        return result

    def open(self, page: Path) -> None:
        self.events.clear()
        self.call("Page.navigate", url=page.as_uri())
        while not any(event["method"] == "Page.loadEventFired" for event in self.events):
            self.events.append(self._message())

    def ask(self, expression: str) -> Any:  # noqa: ANN401 (what the page says)
        """Return what an expression of JavaScript gives."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def of(self, method: str) -> list[dict[str, Any]]:
        """Return the parameters of the events of a kind since the page was opened."""
        return [event["params"] for event in self.events if event["method"] == method]


@contextmanager
def opened(program: str, folder: Path) -> Iterator[Browser]:
    """Start Chromium with a profile of its own and end it."""
    there, write = os.pipe()
    read, back = os.pipe()
    command = f'exec "$0" "$@" 3<&{there} 4>&{back}'
    arguments = ["bash", "-c", command, program, *OPTIONS, f"--user-data-dir={folder}", "about:blank"]
    process = subprocess.Popen(arguments, pass_fds=(there, back), stderr=subprocess.DEVNULL)
    os.close(there)
    os.close(back)
    try:
        yield Browser(write, read)
    finally:
        process.kill()
        process.wait()
        os.close(write)
        os.close(read)


@cache
def document(kind: str) -> dict[str, Any]:
    """Give the result of a project of a kind."""
    if kind == "failed run":
        result = by_rows(saved())
        result["control"] = [row | {"id": f"{row['id']}.{n}"} for n in range(3) for row in result["control"]]
        return dict(in_tables(result))
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


def html(kind: str) -> str:
    if kind != "batch":
        return to_html(document(kind))
    side_by_side = ([[[15.0, 50.0 + n / 100], [15.3, 50.0 + n / 100]]] for n in range(200))
    return batch_html([outcome(f"strip-{n}", track=track) for n, track in enumerate(side_by_side)], "1")


@pytest.fixture(scope="module", params=["failed run", "strip", "single photos", "models", "batch"])
def page(request: pytest.FixtureRequest, browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Browser:
    file = tmp_path_factory.mktemp("page") / "report.html"
    file.write_text(html(request.param), encoding="utf-8")
    browser.open(file)
    return browser


def test_nothing_fails_and_nothing_is_asked_for(page: Browser) -> None:
    assert page.of("Runtime.consoleAPICalled") == page.of("Runtime.exceptionThrown") == page.of("Log.entryAdded") == []
    assert [each["request"]["url"].rpartition("/")[2] for each in page.of("Network.requestWillBeSent")] == [
        "report.html"
    ]


def test_tables_sort_and_come_back(page: Browser) -> None:
    found = page.ask(SORTED)
    assert len(found) > 8
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


def test_words_in_pictures_cover_no_others_and_are_whole(page: Browser) -> None:
    page.call("Emulation.setDeviceMetricsOverride", width=1120, height=800, deviceScaleFactor=1, mobile=False)
    assert page.ask(COVERED) == []
    assert page.ask('document.querySelectorAll("svg .id").length') > 8


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
