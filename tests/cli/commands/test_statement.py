"""``photostrip statement`` as it is typed: forms, exit codes, what is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from photostrip.cli.main import main
from photostrip.formats.result_json import to_json
from tests.calls import words
from tests.loops import nonempty
from tests.result.test_statement import GOOD, block, certified
from tests.results import case

if TYPE_CHECKING:
    from tests.calls import Answer, Call


@pytest.fixture
def result(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """A result with thirty check points in the working folder; what a test changes it writes again."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    given = GOOD | {"largest": 0.3}
    height = block()["height"] | {"largest": 0.3}
    document = case().document | {"statement": block(plan=given, height=height), "status": "good"}
    written(document)
    return document


def written(document: dict[str, Any]) -> None:
    Path("result.json").write_text(to_json(certified(document)), encoding="utf-8")


@pytest.mark.usefixtures("result")
def test_a_statement_is_printed_with_what_went_in(answer: Answer) -> None:
    text = answer("statement", "result.json")
    for told in ("TESTED as the standard asks.", "ISO 19157, 44", "Signature"):
        assert told in text
    checks = [row["id"] for row in case().document["control"] if row["role"] == "check"]
    assert [name for name in nonempty(checks) if f"\n{name} " not in text] == []


@pytest.mark.usefixtures("result")
def test_every_form_says_the_same(answer: Answer, tmp_path: Path) -> None:
    found = json.loads(answer("statement", ".", "--format", "json"))
    assert found["status"] == "tested"
    for name in ("s.txt", "s.md", "s.html", "s.json"):
        assert answer("statement", "result.json", "-o", name) == ""
    assert json.loads((tmp_path / "s.json").read_text())["sentences"] == found["sentences"]
    for name in ("s.txt", "s.md", "s.html"):
        assert found["sentences"][0] in words((tmp_path / name).read_text(encoding="utf-8").replace("\\_", "_"))
    assert "http" not in (tmp_path / "s.html").read_text(encoding="utf-8").split("<main>")[1]


@pytest.mark.usefixtures("result")
@pytest.mark.parametrize(
    ("options", "code"),
    [
        (["--class-plan", "15", "--class-height", "20"], 0),
        (["--class-plan", "11"], 1),
        (["--class-plan", "5"], 2),  # the check points are not good enough to say so
        (["--class-plan", "nan"], 2),
        (["--class-plan", "0"], 2),
        (["-o", "statement.pdf"], 2),
    ],
)
def test_the_exit_code_says_whether_it_is_met(options: list[str], code: int) -> None:
    assert main(["statement", "result.json", "--quiet", *options]) == code


def test_fewer_points_end_with_1(result: dict[str, Any], call: Call) -> None:
    few = block(plan=GOOD | {"count": 12, "largest": 0.3}, height=result["statement"]["height"])
    written(result | {"statement": few})
    code, out, _ = call("statement", "result.json", "--quiet")
    assert (code, "DOES NOT MEET THE MINIMUM" in out) == (1, True)


def test_what_is_refused_says_why(result: dict[str, Any], call: Call) -> None:
    edited = {"statement": result["statement"] | {"not_measured": 7}}
    for document, told in (
        (certified(case("local").document), "no accuracy can be stated: the frame is local"),
        (certified(result | {"statement": {}}), "statement.status: is missing"),
        (certified(result) | edited, "it was edited"),
    ):
        Path("result.json").write_text(to_json(document), encoding="utf-8")
        code, _, err = call("statement", "result.json")
        assert (code, told in err) == (2, True)
    written(case("local").document)
    code, out, _ = call("statement", "result.json", "--format", "json")
    assert (code, "statement-frame" in out) == (2, True)
