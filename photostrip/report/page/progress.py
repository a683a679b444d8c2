"""A line on stderr while something takes long: what is being done, how far it is, for how many seconds.

Only a person who waits at a terminal sees it. It appears after a second, is wiped away when the work is done, and
never stands in a pipe, a file or the log of a job. A batch has a table instead, with a row for each process.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, TextIO

from photostrip.report.page.layout import cells, cut
from photostrip.visible import visible

if TYPE_CHECKING:
    from rich.live import Live
    from rich.table import Table

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


PROCESS_ROWS = 16  # processes shown in the table of a batch
BAR = 30  # characters


class BatchTable:
    """The table of a batch on a terminal: how far it is, what is being computed and for how long.

    Where there is no terminal it shows nothing, and what is said goes straight to the stream.
    """

    def __init__(self, stream: TextIO, total: int, *, live: bool) -> None:
        self.stream, self.total, self.live = stream, total, live
        self.done = self.failed = self.unchanged = 0
        self._begin = time.monotonic()
        self._running: dict[str, float] = {}
        self._lock = threading.Lock()
        self._live: Live | None = None

    def start(self) -> None:
        if self.live:
            from rich.console import Console
            from rich.live import Live

            console = Console(file=self.stream, highlight=False, markup=False)
            shown = Live(get_renderable=self.page, console=console, refresh_per_second=5, transient=True)
            self._live = shown
            shown.start()

    def stop(self) -> None:
        if self._live is not None:
            live, self._live = self._live, None
            live.stop()

    def begun(self, project: str) -> None:
        """Say that a project is being computed now."""
        with self._lock:
            self._running[project] = time.monotonic()

    def finished(self, project: str, *, failed: bool, unchanged: bool) -> None:
        with self._lock:
            self._running.pop(project, None)
            self.done += 1
            self.failed += failed
            self.unchanged += unchanged

    def say(self, text: str) -> None:
        """Say something, above the table where there is one."""
        if self._live is not None:
            self._live.console.print(visible(text), soft_wrap=True)
        else:
            self.stream.write(f"{visible(text)}\n")
            self.stream.flush()

    def head(self, seconds: float) -> str:
        """Return the first line after some seconds: how far the batch is, and how long it may still take."""
        filled = BAR * self.done // max(self.total, 1)
        parts = [f"{'#' * filled}{'.' * (BAR - filled)} {self.done} of {self.total}"]
        parts += [f"{self.failed} failed"] if self.failed else []
        parts += [f"{self.unchanged} unchanged"] if self.unchanged else []
        computed = self.done - self.unchanged
        if computed:
            left = seconds / computed * (self.total - self.done)
            parts.append(f"{clock(seconds)}, about {clock(left)} to go")
        else:
            parts.append(clock(seconds))
        return ", ".join(parts)

    def page(self) -> Table:
        from rich.table import Table

        now = time.monotonic()
        with self._lock:
            running = list(self._running.items())
        page = Table.grid(padding=(0, 2))
        page.title, page.title_justify, page.title_style = self.head(now - self._begin), "left", ""
        page.add_column(justify="right")
        page.add_column(no_wrap=True, overflow="ellipsis")
        for project, begin in running[:PROCESS_ROWS]:
            page.add_row(clock(now - begin), visible(project))
        if len(running) > PROCESS_ROWS:
            page.add_row("", f"and {len(running) - PROCESS_ROWS} more")
        return page


def clock(seconds: float) -> str:
    """Return a time as ``1:02:03``, without hours when there are none."""
    minutes, rest = divmod(int(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


@contextmanager
def batch_table(stream: TextIO, total: int, *, quiet: bool = False) -> Iterator[BatchTable]:
    """Show the table of a batch while a block runs, where the stream is a terminal."""
    table = BatchTable(stream, total, live=not quiet and wanted(stream, os.environ))
    table.start()
    try:
        yield table
    finally:
        table.stop()
