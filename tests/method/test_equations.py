"""The table from equations to commands: every function named runs in the command beside it."""

from __future__ import annotations

import contextlib
import inspect
import io
import shlex
import shutil
import sys
import threading
from functools import reduce
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

import pytest

from photostrip.cli.main import main
from photostrip.sheets.sources import read
from tests.loops import nonempty
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from pathlib import Path
    from types import CodeType, FrameType


class Row(NamedTuple):
    """A row of the table."""

    equation: str
    command: str
    function: str


def rows() -> list[Row]:
    return [Row(row["equation"], row["command"], row["function"]) for row in nonempty(read("equations"))]


def code_of(name: str) -> CodeType:
    """Give the code of a function or of a method of a class."""
    parts = name.split(".")
    for length in range(len(parts), 0, -1):
        with contextlib.suppress(ModuleNotFoundError):
            module = import_module(f"photostrip.{'.'.join(parts[:length])}")
            found = reduce(getattr, parts[length:], module)
            return inspect.unwrap(found).__code__  # type: ignore[arg-type]
    raise LookupError(name)


def executed(arguments: list[str]) -> tuple[int, set[CodeType]]:
    """Run a command; give its exit code, and the code of every function of Python that was called."""
    seen: set[CodeType] = set()

    def record(frame: FrameType, event: str, _: Any) -> None:  # noqa: ANN401 (of the interpreter)
        if event == "call":
            seen.add(frame.f_code)

    threading.setprofile(record)
    sys.setprofile(record)
    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            code = main(arguments)
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
    return code, seen


def test_every_source_is_in_the_table() -> None:
    found = rows()
    assert {row.equation.partition("]")[0] for row in found} == {
        "[000", "[001", "[002", "[003", "[004a", "[004b", "[004c",
    }  # fmt: skip
    for row in nonempty(found):
        assert code_of(row.function).co_name == row.function.rpartition(".")[2]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a folder with what the commands of the table read."""
    found = tmp_path_factory.mktemp("equations")
    shutil.copytree(ROOT / "configs", found / "configs")
    shutil.copytree(ROOT / "sample_data/apollo15-metric-strip", found / "sample_data/apollo15-metric-strip")
    for name, more in (("lesson", ()), ("plane", ("--set", "ground.crs=local"))):
        made = ["simulate", str(found / "configs/simulate/film-strip.yaml"), "-o", str(found / name), "--quiet", *more]
        assert main(made) == 0
    with (found / "lesson/project.yaml").open("a", encoding="utf-8") as file:
        file.write("extends: ../configs/teaching.yaml\n")
    return found


@pytest.mark.slow
@pytest.mark.parametrize("command", sorted({row.command for row in rows()}))
def test_the_functions_of_a_command_run_in_it(command: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    named = [row.function for row in rows() if row.command == command]
    for name in nonempty(named):
        _forget(name)
    code, seen = executed(shlex.split(command)[1:])
    assert code == 0
    assert [name for name in named if code_of(name) not in seen] == []


def _forget(name: str) -> None:
    """Empty the memory of a function that remembers its results, so that it runs again."""
    parts = name.split(".")
    with contextlib.suppress(ModuleNotFoundError, AttributeError):
        reduce(getattr, parts[-1:], import_module(f"photostrip.{'.'.join(parts[:-1])}")).cache_clear()
