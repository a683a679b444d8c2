"""A line on stderr while something takes long: what is being done, how far it is, for how many seconds.

Only a person who waits at a terminal sees it. It appears after a second, is wiped away when the work is done, and
never stands in a pipe, a file or the log of a job. A batch has a bar instead.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, TextIO

from photostrip.notes import listed
from photostrip.report.page.layout import cells, cut
from photostrip.visible import visible

if TYPE_CHECKING:
    from rich.progress import Progress as RichProgress

PATIENCE = 1.0  # seconds before anything is shown
LOOK_EVERY = 0.2  # seconds between two looks
WIPE = "\r\x1b[2K"
WHEEL = "|/-\\"


class Progress:
    """The line on one terminal; the total, of steps to do, is 0 when it is not known."""

    def __init__(self, stream: TextIO, total: int = 0) -> None:
        self.stream, self.total, self.done, self.text = stream, total, 0, ""
        self._begin = time.monotonic()
        self._stop = threading.Event()
        self._shown = False

    def at(self, text: str) -> None:
        """Say what is being done now; with a total, it is one more of the steps."""
        self.done += bool(self.total)
        self.text = text

    def line(self, seconds: float, width: int) -> str:
        """Return the line after some seconds, cut to a width."""
        turn = WHEEL[int(seconds / LOOK_EVERY) % len(WHEEL)]
        count = f" {self.done} of {self.total}" if self.total else ""
        head, tail = f"{turn}{count} ", f" {seconds:.0f} s"
        return head + cut(visible(self.text), max(width - cells(head + tail) - 1, 0), "...") + tail

    def run(self) -> None:
        """Show the line again and again until the work is done."""
        while not self._stop.wait(LOOK_EVERY):
            seconds = time.monotonic() - self._begin
            if seconds >= PATIENCE:
                self._shown = True
                self._write(WIPE + self.line(seconds, _columns(self.stream)))

    def stop(self, worker: threading.Thread) -> None:
        """Take the line away when the thread that shows it has drawn for the last time."""
        self._stop.set()
        worker.join()
        if self._shown:
            self._write(WIPE)

    def _write(self, text: str) -> None:
        try:
            self.stream.write(text)
            self.stream.flush()
        except (OSError, ValueError):  # the terminal is gone; the work is not
            self._stop.set()


def wanted(stream: TextIO, environment: Mapping[str, str]) -> bool:
    """Whether somebody waits there: a terminal that can wipe a line."""
    return stream.isatty() and environment.get("TERM", "") not in {"dumb", "unknown"}


def _columns(stream: TextIO) -> int:
    try:
        return os.get_terminal_size(stream.fileno()).columns or 80
    except (OSError, ValueError):
        return 80


@contextmanager
def progress(stream: TextIO, total: int = 0, *, quiet: bool = False) -> Iterator[Progress]:
    """Show progress while a block runs, where the stream is a terminal; ``Progress.at`` says what is being done."""
    line = Progress(stream, total)
    if quiet or not wanted(stream, os.environ):
        yield line
        return
    worker = threading.Thread(target=line.run, daemon=True)
    worker.start()
    try:
        yield line
    finally:
        line.stop(worker)


class BatchProgress:
    """How far a batch is, on a terminal; where there is none, what is said goes straight to the stream."""

    def __init__(self, stream: TextIO, total: int, *, live: bool) -> None:
        self.stream, self.total, self.live = stream, total, live
        self._running: dict[str, None] = {}
        self._bar: RichProgress | None = None
        if live:
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
            from rich.progress import Progress as Bar

            columns = BarColumn(30), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn()
            console = Console(file=stream, highlight=False, markup=False)
            names = TextColumn("{task.description}", markup=False)
            self._bar = Bar(*columns, names, console=console, transient=True)
            self._task = self._bar.add_task("", total=total)
            self._bar.start()

    def stop(self) -> None:
        if self._bar is not None:
            self._bar.stop()

    def begun(self, project: str) -> None:
        """Say that a project is being computed now."""
        self._running[project] = None
        self._update(0)

    def finished(self, project: str) -> None:
        self._running.pop(project, None)
        self._update(1)

    def _update(self, steps: int) -> None:
        if self._bar is not None:
            self._bar.update(self._task, advance=steps, description=visible(listed(self._running)))

    def say(self, text: str) -> None:
        """Say something, above the bar where there is one."""
        if self._bar is not None:
            self._bar.console.print(visible(text), soft_wrap=True)
        else:
            self.stream.write(f"{visible(text)}\n")
            self.stream.flush()


@contextmanager
def batch_progress(stream: TextIO, total: int, *, quiet: bool = False) -> Iterator[BatchProgress]:
    """Show how far a batch is while a block runs, where the stream is a terminal."""
    shown = BatchProgress(stream, total, live=not quiet and wanted(stream, os.environ))
    try:
        yield shown
    finally:
        shown.stop()
