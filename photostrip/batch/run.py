"""A whole batch: what is unchanged, what is computed by whom, what is written, and how it ends."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import Any

from photostrip.batch.evaluation import FAULTY, UNWRITTEN, Answer, Task, failure, not_run
from photostrip.batch.folder import ResultFolder
from photostrip.batch.pool import Executor, answers, do_nothing
from photostrip.batch.selection import ChosenProject
from photostrip.errors import Fault, InputError
from photostrip.notes import Document
from photostrip.result.verdict import VERDICTS, exit_code

LAST_REFUSALS = 3  # results in a row that cannot be written before the batch gives up
SIGNALS = (signal.SIGINT, signal.SIGTERM)

# hears of a project that is done; without an answer, its result was there already
Listener = Callable[[Document, Answer | None], None]


@dataclass
class Stop:
    """Why a batch is to end early."""

    signal: int = 0  # number of the signal that asked for it; 0: none did
    refusals: int = 0  # results in a row that could not be written

    def __call__(self) -> bool:
        return bool(self.signal) or self.refusals >= LAST_REFUSALS


@contextmanager
def on_signals(stop: Stop) -> Iterator[Stop]:
    """Let Ctrl-C and SIGTERM end a batch in good order; a second one ends it at once."""
    before: dict[int, Any] = {}

    def noticed(number: int, _: FrameType | None) -> None:
        stop.signal = number
        for each in SIGNALS:
            signal.signal(each, before[each])

    for each in SIGNALS:
        before[each] = signal.signal(each, noticed)
    try:
        yield stop
    finally:
        for each in SIGNALS:
            signal.signal(each, before[each])


class Run:
    """One batch: which projects must be computed, what is written, what became of each.

    Without a folder nothing is written; with ``force`` what is unchanged is computed, too, and results of other
    projects are replaced; with ``strict`` every verdict but good has an exit code.
    """

    def __init__(
        self,
        projects: Sequence[ChosenProject],
        overrides: Sequence[str] = (),
        folder: ResultFolder | None = None,
        *,
        force: bool,
        strict: bool = False,
        html: bool = False,
    ) -> None:
        self.projects, self.overrides, self.folder = projects, tuple(overrides), folder
        self.force, self.strict, self.html = force, strict, html
        # the line of the summary of each project, in the order in which the user named them
        self.outcomes = [named(not_run(), chosen, written=folder is not None) for chosen in projects]
        self.unchanged = 0

    @property
    def exit_code(self) -> int:
        """That of the worst project: the highest."""
        return max((outcome["exit_code"] for outcome in self.outcomes), default=0)

    def go(
        self, executor: Executor, listener: Listener, stop: Stop, begun: Callable[[Task], None] = do_nothing
    ) -> None:
        """Compute what must be computed."""
        for answer in answers(executor, self._tasks(listener, stop), stop, begun):
            self._write(answer, listener, stop)

    def files_read(self) -> list[str]:
        """Return every file that the results were made from, and the project files of those without a result."""
        files: dict[str, None] = {}
        for chosen in self.projects:
            read = self.folder.files_of(chosen) if self.folder is not None else []
            files.update(dict.fromkeys(read or [chosen.project]))
        return list(files)

    def _tasks(self, listener: Listener, stop: Callable[[], bool]) -> Iterator[Task | None]:
        """Return what must be computed, None in between for what need not."""
        for chosen in self.projects:
            if stop():
                return
            outcome = self._without_computing(chosen)
            if outcome is None:
                yield Task(number=chosen.number, project=chosen.project, overrides=self.overrides, html=self.html)
            else:
                self._note(chosen, outcome, None, listener)
                yield None

    def _without_computing(self, chosen: ChosenProject) -> Document | None:
        """Return the outcome of a project that need not, or must not, be computed; None: compute it."""
        if self.folder is None or self.force:
            return None
        outcome = self.folder.unchanged(chosen, with_page=self.html)
        if outcome is not None:
            self.unchanged += 1
            return outcome
        refused = self.folder.refused(chosen)
        return None if refused is None else failure(FAULTY, refused)

    def _write(self, answer: Answer, listener: Listener, stop: Stop) -> None:
        chosen = self.projects[answer.number]
        outcome = answer.outcome
        if answer.files and self.folder is not None:
            try:
                self.folder.write(chosen, answer)
                stop.refusals = 0
            except (InputError, OSError) as error:
                stop.refusals += 1
                place = str(self.folder.path / chosen.output)
                outcome = failure(UNWRITTEN, unwritten(error, place) if isinstance(error, OSError) else error)
        self._note(chosen, outcome, answer, listener)

    def _note(self, chosen: ChosenProject, outcome: Document, answer: Answer | None, listener: Listener) -> None:
        line = named(outcome, chosen, written=self.folder is not None)
        if outcome["status"] in VERDICTS:
            line["exit_code"] = exit_code(outcome["status"], strict=self.strict)
        self.outcomes[chosen.number] = line
        listener(line, answer)


def named(outcome: Document, chosen: ChosenProject, *, written: bool) -> Document:
    """Put the names of a project before its line of the summary; ``output`` is None where no result was written."""
    there = written and outcome["status"] in VERDICTS
    return {"project": chosen.project, "output": chosen.output if there else None, **outcome}


def unwritten(error: OSError, place: str) -> Fault:
    """Say why a result could not be written; not where exactly, which differs from run to run."""
    reason = (error.strerror or str(error)).lower()
    fix = "make room, or choose another place with -o"
    return Fault(f"the result cannot be written: {reason}", "system", place, fix=fix)
