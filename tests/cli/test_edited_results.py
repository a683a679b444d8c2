"""``report`` and ``compare`` of results that were edited: faults with file and key, never a traceback."""

from __future__ import annotations

import contextlib
import io
import json
import warnings
from random import Random
from typing import TYPE_CHECKING, Any, NamedTuple

import pytest

from photostrip.cli.main import main
from photostrip.errors import InputError
from photostrip.formats.result_json import read_result, to_json
from photostrip.result.table import plain_of
from tests.reports import RESULT, saved

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from tests.calls import Answer, Call

ESCAPE = "\x1b[2J\x1b]0;title\x07\x9b31m\u202egnp\x7f"
TOO_LONG = "@digits@"  # stands for a number that Python itself does not read
ODD: tuple[Any, ...] = (
    float("nan"), float("inf"), -float("inf"), 10**400, -(10**30), 1e308, 5e-324, TOO_LONG, "\ud800", "a\udfffb",
    ESCAPE,
    "", "text", " " * 300, "x" * 5000, "<b>&\"'", [], [[]], [1], [None], ["a", 2], {}, {"a": 1}, {"\ud800": 1}, [{}],
    None, True, False, 0, -1, 0.5, 10**6,
)  # fmt: skip
CODES = {0, 1, 2}
UNSEEN = {chr(code) for code in (*range(0x20), *range(0x7F, 0xA0), 0x202E) if chr(code) not in "\n\t"}


class Edited(NamedTuple):
    """An edited document as text, and what was done."""

    text: str
    done: list[str]


def edited(document: Any, random: Random) -> Edited:  # noqa: ANN401 (any JSON)
    """Do one to three things to a document."""
    document = json.loads(json.dumps(plain_of(document)))
    done = [_edit(document, random) for _ in range(random.randint(1, 3))]
    text = json.dumps(document).replace(f'"{TOO_LONG}"', "9" * 5000)
    if random.random() < 0.05:
        text, done = "[" * 200 + text + "]" * 200, [*done, "nested"]
    return Edited(text, done)


def _edit(document: Any, random: Random) -> str:  # noqa: ANN401
    place, path = document, ""
    while True:
        keys: Sequence[Any] = list(place) if isinstance(place, dict) else range(len(place))
        if not keys:
            return "nothing"
        key = random.choice(keys)
        path += f".{key}"
        if not isinstance(place[key], dict | list) or not place[key] or random.random() < 0.25:
            break
        place = place[key]
    match random.randrange(6):
        case 0:
            del place[key]
            return f"{path} deleted"
        case 1 if isinstance(place, list):
            place.insert(key, place[key])
            return f"{path} doubled"
        case 2 if isinstance(place[key], str):
            place[key] += ESCAPE
            return f"{path} with escapes"
        case 3 if isinstance(place[key], dict):
            place[key][random.choice(("id", "new", "\ud800", ESCAPE))] = random.choice(ODD)
            return f"{path} with a key more"
        case _:
            place[key] = random.choice(ODD)
            return f"{path} = {place[key]!a:.30}"


def faults_of(edit: Edited, right: Path, folder: Path, command: Sequence[str]) -> list[str]:
    """Run a command on an edited result; ``EDITED`` and ``RIGHT`` in it stand for the files."""
    (file := folder / "result.json").write_text(edit.text, encoding="utf-8")
    names = {"EDITED": str(file), "RIGHT": str(right), "PAGE": str(folder / "page.html"), "OUT": str(folder / "out")}
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), warnings.catch_warnings():
        warnings.simplefilter("error")
        code = main([names.get(word, word) for word in command])
    said = out.getvalue() + err.getvalue()
    found = [] if code in CODES else [f"exit code {code}: {err.getvalue().strip()[-200:]}"]
    if code == 2 and "result.json" not in said and str(right) not in said:
        found.append(f"no file is named: {said[:200]!a}")
    if sent := sorted(UNSEEN & set(said)):
        found.append(f"control characters sent: {sent!a}")
    return [f"{' '.join(command)}; {', '.join(edit.done)}: {each}" for each in found]


COMMANDS = (
    ("report", "EDITED"),
    ("report", "EDITED", "--verbose", "--format", "md"),
    *(("report", "EDITED", "--format", form) for form in ("json", "github")),
    ("report", "EDITED", "--output", "PAGE"),
    ("compare", "EDITED", "RIGHT"),
    ("compare", "RIGHT", "EDITED"),
    *(("compare", "EDITED", "RIGHT", "--format", form) for form in ("junit", "json", "github")),
    *(("convert", "EDITED", "OUT", "--to", program) for program in ("geopackage", "orthority", "cameras")),
    ("convert", "EDITED", "OUT", "--to", "colmap", "--force"),
)


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
    (file := tmp_path / "result.json").write_text(json.dumps(document).replace('"@"', text), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_result(str(file))
    (fault,) = caught.value.faults
    assert (fault.code, fault.file) == ("result-value", str(file))
    assert fault.key == ("settings.relative[0]" if key == "settings.relative" else key)
    assert words in str(fault)


@pytest.mark.parametrize("more", [["report"], ["compare", str(RESULT)]])
def test_a_missing_key_is_told_with_all_that_lead_to_it(more: list[str], tmp_path: Path, call: Call) -> None:
    document = json.loads(RESULT.read_text(encoding="utf-8"))
    del document["models"]["left"]
    (file := tmp_path / "result.json").write_text(to_json(document), encoding="utf-8")
    code, _, err = call(more[0], file, *more[1:])
    assert (code, "models.left: is missing" in err) == (2, True)


def test_a_result_without_one_correlation_has_no_ellipses(tmp_path: Path, call: Call) -> None:
    document = json.loads(RESULT.read_text(encoding="utf-8"))
    del document["points"]["correlation_xy"]
    (file := tmp_path / "result.json").write_text(to_json(document), encoding="utf-8")
    code, out, _ = call("report", file, "--section", "precision")
    assert (code, "ellipse a" in out) == (0, True)


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


def test_control_characters_are_shown_and_never_sent(tmp_path: Path, answer: Answer) -> None:
    document = json.loads(RESULT.read_text(encoding="utf-8"))
    document["name"] += ESCAPE
    document["control"]["id"][0] = ESCAPE
    (file := tmp_path / "result.json").write_text(to_json(document), encoding="utf-8")
    assert read_result(str(file))["control"][0]["id"] == ESCAPE
    for form in ("text", "md", "github", "json"):
        out = answer("report", file, "--format", form)
        assert not {"\x1b", "\x07", "\x9b", "\x7f", "\u202e"} & set(out)
        assert form == "github" or ("\\u001b[2J" if form == "json" else "x1b") in out


def test_what_the_user_types_is_shown_too(call: Call) -> None:
    code, _, err = call("run", "no\x1b[31m.yaml")
    assert (code, "\x1b" in err, "no\\x1b[31m.yaml" in err) == (2, False, True)
