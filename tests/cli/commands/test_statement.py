"""``photostrip statement`` as it is typed: forms, exit codes, what is refused."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest

from photostrip.cli.main import main
from photostrip.formats.result_json import to_json
from tests.loops import nonempty
from tests.result.test_statement import GOOD, block, certified
from tests.results import case

if TYPE_CHECKING:
    from pathlib import Path

    from tests.calls import Capture


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
    with open("result.json", "w", encoding="utf-8") as file:  # noqa: PTH123 (the working folder)
        file.write(to_json(certified(document)))


@pytest.mark.usefixtures("result")
def test_a_statement_is_printed_with_what_went_in(capsys: Capture) -> None:
    assert main(["statement", "result.json"]) == 0
    text = capsys.readouterr().out
    assert "TESTED as the standard asks." in text
    assert "ISO 19157, 44" in text
    assert "Signature" in text
    checks = [row["id"] for row in case().document["control"] if row["role"] == "check"]
    assert [name for name in nonempty(checks) if f"\n{name} " not in text] == []


@pytest.mark.usefixtures("result")
def test_every_form_says_the_same(capsys: Capture, tmp_path: Path) -> None:
    assert main(["statement", ".", "--format", "json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["status"] == "tested"
    for name in ("s.txt", "s.md", "s.html", "s.json"):
        assert main(["statement", "result.json", "-o", name]) == 0
    assert json.loads((tmp_path / "s.json").read_text())["sentences"] == found["sentences"]
    for name in ("s.txt", "s.md", "s.html"):
        text = " ".join((tmp_path / name).read_text(encoding="utf-8").replace("\\_", "_").split())
        assert found["sentences"][0] in text
    assert "http" not in (tmp_path / "s.html").read_text(encoding="utf-8").split("<main>")[1]
    assert capsys.readouterr().out == ""


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


def test_fewer_points_end_with_1(result: dict[str, Any], capsys: Capture) -> None:
    few = block(plan=GOOD | {"count": 12, "largest": 0.3}, height=result["statement"]["height"])
    written(result | {"statement": few})
    assert main(["statement", "result.json", "--quiet"]) == 1
    assert "DOES NOT MEET THE MINIMUM" in capsys.readouterr().out


def test_what_is_refused_says_why(result: dict[str, Any], capsys: Capture) -> None:
    written(case("local").document)
    assert main(["statement", "result.json"]) == 2
    assert "no accuracy can be stated: the frame is local" in capsys.readouterr().err
    assert main(["statement", "result.json", "--format", "json"]) == 2
    assert "statement-frame" in capsys.readouterr().out
    written(result | {"statement": {}})
    assert main(["statement", "result.json"]) == 2
    assert "statement.status: is missing" in capsys.readouterr().err
    with open("result.json", "w", encoding="utf-8") as file:  # noqa: PTH123 (the working folder)
        file.write(to_json(certified(result) | {"statement": result["statement"] | {"not_measured": 7}}))
    assert main(["statement", "result.json"]) == 2
    assert "it was edited" in capsys.readouterr().err
