"""What holds for all tests: one thread, no colours, a fixed width, random examples that are the same every time."""

from __future__ import annotations

import gc
import multiprocessing
import os
import sys
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings

from photostrip.cli.main import NEW_OBJECTS, main
from photostrip.threads import limit_threads
from tests.forked import Forks

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from photostrip.pipeline.results import Result
    from tests.calls import Answer, Call, Capture

limit_threads()  # before a test imports numpy
multiprocessing.set_executable(sys.executable)  # before a test puts a copy of an interpreter in its place

settings.register_profile("repeatable", derandomize=True, deadline=None, max_examples=20)
settings.register_profile("quick", derandomize=True, deadline=None, max_examples=12)  # make check
settings.register_profile("explore", derandomize=False, deadline=None, max_examples=1000)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))


@pytest.fixture(autouse=True)
def _plain_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setenv("NO_COLOR", "1")
    for forcing in ("FORCE_COLOR", "CLICOLOR_FORCE", "PY_COLORS"):
        monkeypatch.delenv(forcing, raising=False)


@pytest.fixture
def call(capsys: Capture) -> Call:
    """Give a function that runs a command as it is typed; what was printed before is not in what it gives."""

    def typed(*arguments: object) -> tuple[int, str, str]:
        capsys.readouterr()
        code = main([str(each) for each in arguments])
        printed = capsys.readouterr()
        return code, printed.out, printed.err

    return typed


@pytest.fixture
def answer(call: Call) -> Answer:
    """Give a function that gives what a command prints, which must succeed."""

    def typed(*arguments: object) -> str:
        code, out, _ = call(*arguments)
        assert code == 0
        return out

    return typed


@pytest.fixture(scope="session")
def forks() -> Iterator[Forks]:
    """Give a ``photostrip`` command and a ``python`` that need not load the libraries each time."""
    with Forks() as forks:
        yield forks


@pytest.fixture(scope="session")
def forked(forks: Forks) -> Path:
    """Give the ``photostrip`` command of ``forks``."""
    return forks.command


@pytest.fixture
def _quick_start(forks: Forks, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the processes that a test starts with ``sys.executable`` be copies of one that has loaded the libraries."""
    monkeypatch.setattr(sys, "executable", str(forks.python))


@pytest.fixture
def _adjusted_once(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Result]:
    """Let commands take over what the same data gave before, where a test looks at what is done with a result."""
    from photostrip.pipeline import run
    from tests.results import known

    triangulate = run.triangulate
    monkeypatch.setattr(run, "triangulate", known)
    return triangulate


@pytest.fixture
def _adjusted_each_time(_adjusted_once: Callable[..., Result], monkeypatch: pytest.MonkeyPatch) -> None:
    """Adjust anew among tests that do not: for what comes out again."""
    monkeypatch.setattr("photostrip.pipeline.run.triangulate", _adjusted_once)


@pytest.fixture
def _no_findings(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out what the data say against themselves, where many repetitions are adjusted for their numbers alone."""
    monkeypatch.setattr("photostrip.pipeline.gate.of_result", lambda *_: ())


gc.set_threshold(NEW_OBJECTS)  # as the command does: 5 s of the tests
gc.disable()  # until the tests are collected, which makes no cycles worth a search


def pytest_collection_finish() -> None:
    """Keep the thousands of tests out of each search for objects that are not needed any more: 6 % of the time."""
    gc.collect()
    gc.freeze()
    gc.enable()


def pytest_sessionfinish() -> None:
    """Look once for what was lost in the end: pytest looks five times through all that there is."""
    gc.collect()
    gc.freeze()
