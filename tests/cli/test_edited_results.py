"""``report`` and ``compare`` of results that were edited: faults with file and key, never a traceback."""

from __future__ import annotations

import json
from random import Random
from typing import TYPE_CHECKING

import pytest

from photostrip.cli.main import main
from photostrip.errors import InputError
from photostrip.formats.result_json import read_result, to_json
from tests.edited_results import COMMANDS, ESCAPE, edited, faults_of
from tests.reports import RESULT, saved

if TYPE_CHECKING:
    from pathlib import Path

    from tests.calls import Call, Capture

pytestmark = pytest.mark.usefixtures("_adjusted_once")

CASES = 60


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_edited_results_are_printed_or_refused(command: tuple[str, ...], tmp_path: Path) -> None:
    right = tmp_path / "right.json"
    right.write_bytes(RESULT.read_bytes())
    wrong = []
    for number in range(CASES // len(COMMANDS)):
        edit = edited(saved(), Random(f"{command} {number}"))
        wrong += faults_of(edit, right, tmp_path, command)
    assert wrong == []


@pytest.mark.parametrize(
    ("key", "text", "words"),
    [
        ("summary.sigma0_um", "NaN", "holds nan; expected a number"),
        ("summary.sigma0_um", "-Infinity", "holds -inf; expected a number"),
        ("summary.sigma0_um", "1e999", "holds inf; expected a number"),
        ("summary.sigma0_um", "[1, 2]", "holds a list; expected a number"),
        ("counts.photos", "1" + "0" * 400, "holds a whole number that is too large; expected a whole number"),
        ("counts.photos", "true", "holds true; expected a whole number"),
        ("name", '"\\ud800"', "holds the text '\\ud800'; expected a text"),
        ("points.id[0]", "7", "holds 7; expected a text"),
        ("control.strips[1]", "0.5", "holds 0.5; expected a list"),
        ("residuals.vx_um[2]", '"3"', "holds the text '3'; expected a number"),
        ("control.measured[2]", '"yes"', "holds the text 'yes'; expected true or false"),
        ("strips", "3", "holds 3; expected a table: a block of columns, each a list"),
        ("strips.base", "[]", "holds 0 values; expected 2, as many as its first column"),
        ("frame", "3", "holds 3; expected a block of keys"),
        ("frame", "[{}]", "holds a list; expected a block of keys"),
        ("summary", "null", "holds null; expected a block of keys"),
        ("notes", "null", "holds null; expected a table: a block of columns, each a list"),
        ("points", "[{}]", "holds a list; expected a table: a block of columns, each a list"),
        ("precision.check", "[]", "holds a list; expected a block of keys"),
        ("settings.relative", "[NaN]", "holds nan; expected a number"),
    ],
)
def test_a_wrong_value_is_refused_with_file_and_key(key: str, text: str, words: str, tmp_path: Path) -> None:
    document = json.loads(RESULT.read_text(encoding="utf-8"))
    place = document
    *above, last = key.replace("[", ".[").split(".")
    for part in above:
        place = place[int(part[1:-1])] if part.startswith("[") else place[part]
    place[int(last[1:-1]) if last.startswith("[") else last] = "@"
    file = tmp_path / "result.json"
    file.write_text(json.dumps(document).replace('"@"', text), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_result(str(file))
    (fault,) = caught.value.faults
    assert (fault.code, fault.file) == ("result-value", str(file))
    assert fault.key == ("settings.relative[0]" if key == "settings.relative" else key)
    assert words in str(fault)


@pytest.mark.parametrize(("command", "key"), [("report", "models.left"), ("compare", "models.left")])
def test_a_missing_key_is_told_with_all_that_lead_to_it(
    command: str, key: str, tmp_path: Path, capsys: Capture
) -> None:
    document = json.loads(RESULT.read_text(encoding="utf-8"))
    block, column = key.split(".")
    del document[block][column]
    file = tmp_path / "result.json"
    file.write_text(to_json(document), encoding="utf-8")
    assert main([command, str(file), *([str(RESULT)] if command == "compare" else [])]) == 2
    assert f"{key}: is missing" in capsys.readouterr().err


@pytest.mark.parametrize("options", [["report"], ["statement"], ["compare", str(RESULT)], ["compare", "--again"]])
@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is empty"),
        (b"\x00\xff", "is not text"),
        (b"{", "is not JSON"),
        (b"[]", "expected"),
        (b"{}", "has no key `photostrip_result`"),
        (b'{"photostrip_result": 1}', "run the project again"),
        (b'{"photostrip_result": 2}', "is missing"),
        (b'{"photostrip_result": ' + b"1" * 5000 + b"}", "thousands of digits"),
    ],
)  # fmt: skip
def test_what_is_no_result_is_refused(
    options: list[str], content: bytes, words: str, tmp_path: Path, call: Call
) -> None:
    file = tmp_path / "bad.json"
    file.write_bytes(content)
    code, out, err = call(options[0], file, *options[1:])
    assert (code, out) == (2, "")
    assert err.startswith(f"error: {file}:")
    assert words in err


def test_control_characters_are_shown_and_never_sent(tmp_path: Path, capsys: Capture) -> None:
    document = json.loads(RESULT.read_text(encoding="utf-8"))
    document["name"] += ESCAPE
    document["control"]["id"][0] = ESCAPE
    file = tmp_path / "result.json"
    file.write_text(to_json(document), encoding="utf-8")
    assert read_result(str(file))["control"][0]["id"] == ESCAPE
    for form in ("text", "md", "github", "json"):
        assert main(["report", str(file), "--format", form]) == 0
        out = capsys.readouterr().out
        assert not {"\x1b", "\x07", "\x9b", "\x7f", "\u202e"} & set(out)
        assert form == "github" or ("\\u001b[2J" if form == "json" else "x1b") in out


def test_what_the_user_types_is_shown_too(capsys: Capture) -> None:
    assert main(["run", "no\x1b[31m.yaml"]) == 2
    err = capsys.readouterr().err
    assert "\x1b" not in err
    assert "no\\x1b[31m.yaml" in err
