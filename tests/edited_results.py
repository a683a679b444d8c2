"""Results edited by a careless or a hostile hand: what ``report`` and ``compare`` must refuse in words, or print."""

from __future__ import annotations

import contextlib
import io
import json
import warnings
from typing import TYPE_CHECKING, Any, NamedTuple

from photostrip.cli.main import main
from photostrip.result.table import plain_of

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path
    from random import Random

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
    file = folder / "result.json"
    file.write_text(edit.text, encoding="utf-8")
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
    ("report", "EDITED", "--format", "json"),
    ("report", "EDITED", "--format", "github"),
    ("report", "EDITED", "--output", "PAGE"),
    ("compare", "EDITED", "RIGHT"),
    ("compare", "RIGHT", "EDITED"),
    ("compare", "EDITED", "RIGHT", "--format", "junit"),
    ("compare", "EDITED", "RIGHT", "--format", "json"),
    ("compare", "EDITED", "RIGHT", "--format", "github"),
    ("convert", "EDITED", "OUT", "--to", "geopackage"),
    ("convert", "EDITED", "OUT", "--to", "orthority"),
    ("convert", "EDITED", "OUT", "--to", "colmap", "--force"),
    ("convert", "EDITED", "OUT", "--to", "cameras"),
)
