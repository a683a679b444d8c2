"""The table from places of the sources to commands: each prints the number beside it, by the function beside it."""

from __future__ import annotations

import contextlib
import inspect
import io
import shlex
import sys
import threading
from collections.abc import Sequence
from functools import reduce
from importlib import import_module
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import pytest

from photostrip.cli.main import main
from photostrip.sheets.sources import Shown, document_of, found_places, places, quantity_of
from tests.loops import nonempty


def code_of(name: str) -> CodeType:
    """Give the code of a function or of a method of a class."""
    parts = name.split(".")
    for length in range(len(parts), 0, -1):
        with contextlib.suppress(ModuleNotFoundError):
            module = import_module(f"photostrip.{'.'.join(parts[:length])}")
            found = reduce(getattr, parts[length:], module)
            return inspect.unwrap(found).__code__  # type: ignore[arg-type]
    raise LookupError(name)


def printed(arguments: Sequence[str]) -> tuple[int, str]:
    """Run a command; give its exit code and what it prints."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()):
        return main(list(arguments)), out.getvalue()


def executed(arguments: Sequence[str], wanted: set[CodeType]) -> tuple[int, str, set[CodeType]]:
    """Give which functions are called as well; looked at until all are, as that takes three times as long."""
    seen: set[CodeType] = set()

    def record(frame: FrameType, event: str, _: Any) -> None:  # noqa: ANN401 (of the interpreter)
        if event == "call" and frame.f_code in wanted:
            seen.add(frame.f_code)
            if seen == wanted:
                sys.setprofile(None)

    threading.setprofile(record)
    sys.setprofile(record)
    try:
        return *printed(arguments), seen
    finally:
        sys.setprofile(None)
        threading.setprofile(None)


def test_every_source_is_in_the_table() -> None:
    found = places()
    assert {row.place.partition("]")[0] for row in found} == {
        "[000", "[001", "[002", "[003", "[004a", "[004b", "[004c",
    }  # fmt: skip
    for row in nonempty(found):
        assert code_of(row.function).co_name == row.function.rpartition(".")[2]
    # every equation that has a number in a source, but 001 eq. 126, a notation, and 146, a definition
    numbered = {"000": range(1, 12), "001": range(125, 154), "002": range(1, 7), "004b": range(1, 9), "004c": (1, 2)}
    for source, numbers in nonempty(numbered.items()):
        for number in numbers:
            assert found_places(f"{source} eq. {number}"), (source, number)
    for number in nonempty(range(7, 13)):
        assert found_places(f"003 eq. 10.{number}"), number


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a folder with what the commands of the table read."""
    found = tmp_path_factory.mktemp("places")
    assert main(["sources", "-o", str(found)]) == 0
    return found


@pytest.mark.slow
@pytest.mark.parametrize("command", sorted({row.command for row in places()}))
def test_a_command_runs_its_functions_and_prints_the_number(
    command: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What stands in print is what is typed: the text has the number, JSON agrees with it to its last digit."""
    monkeypatch.chdir(folder)
    rows = [row for row in places() if row.command == command]
    for row in nonempty(rows):
        _forget(row.function)
    seen: set[CodeType] = set()
    for part in command.split(" && "):
        code, text, called = executed(shlex.split(part)[1:], {code_of(row.function) for row in rows})
        assert code in {0, 1}
        seen |= called
    traces = [each for each in shlex.split(command) if each.endswith(".txt")]
    text += "".join((folder / each).read_text(encoding="utf-8") for each in traces)
    document = document_of(command, folder, lambda arguments, _: printed(arguments)[1])
    for row in rows:
        assert code_of(row.function) in seen, row.function
        assert Shown(row, quantity_of(document, row.quantity)).agrees, row.place
        assert row.value in text, (row.place, row.value)


def _forget(name: str) -> None:
    """Empty the memory of a function that remembers its results, so that it runs again."""
    parts = name.split(".")
    with contextlib.suppress(ModuleNotFoundError, AttributeError):
        reduce(getattr, parts[-1:], import_module(f"photostrip.{'.'.join(parts[:-1])}")).cache_clear()
