"""Where the time goes: a plugin for pytest that prints the seconds of the processor that the tests of each folder take.

Counted is what a process of tests takes with all that it starts: ``python -m pytest -n 2 -p tests.processor_time``.
"""

from __future__ import annotations

import os
from collections import Counter, defaultdict
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from collections.abc import Generator

NAME = "processor"
COLLECTING = "collecting"
START = pytest.StashKey[float]()
seconds: defaultdict[str, float] = defaultdict(float)
tests: Counter[str] = Counter()


def used() -> float:
    """Give the seconds of the processor of this process, of those that it started and of what those started."""
    total = sum(os.times()[:4])
    for child in Path(f"/proc/self/task/{os.getpid()}/children").read_text(encoding="utf-8").split():
        with suppress(OSError):  # it has ended
            fields = Path(f"/proc/{child}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
            total += sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")
    return total


def pytest_collection_finish(session: pytest.Session) -> None:
    """Remember what reading the tests took: in the process that the others send their reports, or in one of them."""
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput[COLLECTING] = used()
    elif session.items:
        seconds[COLLECTING] += used()


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:  # noqa: ANN401 (of pytest-xdist)
    """Take over what reading took in another process."""
    seconds[COLLECTING] += node.workeroutput[COLLECTING]


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Begin to count."""
    item.stash[START] = used()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Send along with the last report of a test what it took."""
    report = yield
    if report.when == "teardown":
        report.user_properties.append((NAME, used() - item.stash[START]))
    return report


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Add up by the folder or module right below tests/."""
    for name, value in report.user_properties:
        if name == NAME and isinstance(value, float):
            place = "/".join(report.nodeid.partition("::")[0].split("/")[:2])
            seconds[place] += value
            tests[place] += 1


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print the table."""
    write = terminalreporter.write_line
    write("\n| tests of | tests | seconds of the processor |\n|---|---|---|")
    write(f"| all | {tests.total()} | {sum(seconds.values()):.0f} |")
    for place, value in sorted(seconds.items(), key=lambda each: -each[1]):
        write(f"| `{place}` | {tests[place]} | {value:.1f} |")
