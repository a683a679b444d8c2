"""The summary on paper, and what a person at a terminal sees meanwhile."""

from __future__ import annotations

import io
import json
import os
import pty
import re
import xml.etree.ElementTree as ET
from typing import TYPE_CHECKING, Any

import pytest

from photostrip.batch.evaluation import EXIT_CODES, failure, not_run
from photostrip.batch.run import named
from photostrip.batch.selection import ChosenProject
from photostrip.errors import Fault, InputError
from photostrip.formats.batch import parsed_record, summary_csv, summary_json
from photostrip.report.commands.batch import MOST_ROWS, ORDER, batch_junit, batch_sections, outcome_line
from photostrip.report.page.layout import to_text
from photostrip.report.page.progress import progress
from tests.batch.projects import started, write_projects

if TYPE_CHECKING:
    from pathlib import Path


def good(**changes: Any) -> dict[str, Any]:  # noqa: ANN401 (any value of a line)
    return {
        "status": "good", "exit_code": 0, "adjustment": "polynomial", "strips": 1, "photos": 20, "points": 174,
        "rejected": 2, "sigma0_um": 4.8, "rms_at": "check", "rms_plan_m": 0.163, "rms_height_m": None,
        "messages": [], "findings": [],
    } | changes  # fmt: skip


def lines(*outcomes: dict[str, Any]) -> list[dict[str, Any]]:
    return [
        named(each, ChosenProject(n, f"strip {n}.yaml", f"strip {n}"), written=True) for n, each in enumerate(outcomes)
    ]


FAULTY = failure("faulty", InputError([Fault("no <such> photo & \x01", "photo", "a.csv", 3), Fault("empty", "key")]))


def test_every_status_has_an_exit_code_and_a_place_in_the_order() -> None:
    assert set(ORDER) == set(EXIT_CODES)
    assert [EXIT_CODES[status] for status in ORDER] == [70, 70, 70, 3, 2, 2, 1, 0, 0, 0, 0]


def test_of_too_many_projects_the_worst_are_shown() -> None:
    many = lines(*[good() for _ in range(MOST_ROWS + 20)], *[FAULTY] * 3)
    text = to_text("", batch_sections(many))
    assert text.count(".yaml  good") + text.count(".yaml   good") == MOST_ROWS - 3
    assert "23 more projects not shown, none of them worse" in text
    assert len(to_text("", batch_sections(many, everything=True)).splitlines()) > MOST_ROWS + 23
    assert "strip 0.yaml" not in to_text("", batch_sections(many, quiet=True))


def test_a_line_of_the_log() -> None:
    first, second, third = lines(good(), FAULTY, good(status="failed", exit_code=1, messages=["sigma0 is 3"]))
    assert outcome_line(first) == "strip 0.yaml: good, rms 0.163 m in plan at check points"
    assert outcome_line(second) == "strip 1.yaml: faulty: a.csv:3: no <such> photo & \\x01 (and 1 more)"
    assert outcome_line(third) == "strip 2.yaml: failed: sigma0 is 3"


def test_the_summary_is_true_xml_and_json() -> None:
    told = lines(good(), FAULTY, not_run())
    suite = ET.fromstring(batch_junit(told))[0]  # noqa: S314 (our own)
    assert [(case.get("name"), [inner.tag for inner in case]) for case in suite] == [
        ("strip 0.yaml", []),
        ("strip 1.yaml", ["error"]),
        ("strip 2.yaml", ["skipped"]),
    ]
    assert suite[1][0].text == "a.csv:3: no <such> photo & \\x01\nempty"
    summary = json.loads(summary_json(told, 2))
    assert summary["projects"] == told
    assert (summary["finished"], summary["counts"]) == (False, {"faulty": 1, "good": 1, "not run": 1})
    rows = summary_csv(told).splitlines()
    assert rows[1] == "strip 0.yaml,strip 0,good,0,polynomial,1,20,174,2,4.8,check,0.163,,"
    assert rows[3] == "strip 2.yaml,,not run,0,,,,,,,,,,"


@pytest.mark.parametrize(
    "content", [b"", b"{", b"[]", b"\xff", b'{"photostrip_batch_record": 2}', b'{"photostrip_batch_record": 1}']
)
def test_what_is_no_record_is_not_taken_for_one(content: bytes) -> None:
    assert parsed_record(content) is None


def test_without_a_terminal_what_is_said_goes_straight_out() -> None:
    stream = io.StringIO()
    with progress(stream, 2, patience=0.0) as shown:
        shown.say("one")
        assert stream.getvalue() == "one\n"


@pytest.mark.slow
@pytest.mark.usefixtures("_quick_start")
def test_a_person_at_a_terminal_sees_a_bar(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Stderr is a terminal: a bar is there and goes away, failures stay above it; stdout is the summary alone."""
    write_projects(tmp_path / "strips", 12)
    (tmp_path / "strips" / "s3" / "control.csv").unlink()
    monkeypatch.setenv("TERM", "xterm")
    ours, theirs = pty.openpty()
    with started(tmp_path, "strips", "-j", "1", "--format", "csv", stderr=theirs) as process:
        os.close(theirs)
        seen = b""
        while True:
            try:
                seen += os.read(ours, 4096)
            except OSError:  # the other end is closed
                break
        out, _ = process.communicate()
    os.close(ours)
    assert process.returncode == 2
    assert len(out.splitlines()) == 13
    text = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", seen.decode())
    assert re.search(r"\d+/12 \d:\d\d:\d\d .*strips/s", text)
    assert " of 12  strips/s3/project.yaml: faulty: strips/s3/project.yaml" in text
    assert "strips/s4/project.yaml: good" not in text  # the bar says enough
