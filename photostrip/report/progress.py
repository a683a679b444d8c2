"""A line on stderr while something takes long: what is being done, how far it is, for how many seconds.

Only a person who waits at a terminal sees it. It appears after a second, is wiped away when the work is done, and
never stands in a pipe, a file or the log of a job.
"""

from __future__ import annotations

import os
import threading
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

from photostrip.report.layout import cells, cut

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from typing import TextIO

PATIENCE = 1.0  # seconds before anything is shown
STEP = 0.2  # seconds between two looks
WIPE = "\r\x1b[2K"
TURNS = "|/-\\"


class Progress:
    """The line on one terminal.

    Parameters
    ----------
    stream : text stream
        Where to write.
    total : int
        Number of things to do; 0 when it is not known.
    """

    def __init__(self, stream: TextIO, total: int = 0) -> None:
        self.stream, self.total, self.done, self.text = stream, total, 0, ""
        self._begin = time.monotonic()
        self._stop = threading.Event()
        self._shown = False

    def at(self, text: str) -> None:
        """Say what is being done now; with a total, it is one more of the things to do."""
        self.done += bool(self.total)
        self.text = text

    def line(self, seconds: float, width: int) -> str:
        """Give the line after some seconds, cut to a width."""
        turn = TURNS[int(seconds / STEP) % len(TURNS)]
        count = f" {self.done} of {self.total}" if self.total else ""
        head, tail = f"{turn}{count} ", f" {seconds:.0f} s"
        return head + cut(self.text, max(width - cells(head + tail) - 1, 0), "...") + tail

    def run(self) -> None:
        """Show the line again and again until the work is done."""
        while not self._stop.wait(STEP):
            seconds = time.monotonic() - self._begin
            if seconds >= PATIENCE:
                self._shown = True
                self._write(WIPE + self.line(seconds, _columns(self.stream)))

    def stop(self) -> None:
        """Take the line away."""
        self._stop.set()
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
    """Show progress while a block runs.

    Parameters
    ----------
    stream : text stream
        Where to; nothing is written when it is no terminal.
    total : int
        Number of things to do; 0 when it is not known.
    quiet : bool
        Whether nothing is wanted.

    Yields
    ------
    Progress
        Tell it what is being done with :meth:`Progress.at`.
    """
    line = Progress(stream, total)
    if quiet or not wanted(stream, os.environ):
        yield line
        return
    worker = threading.Thread(target=line.run, daemon=True)
    worker.start()
    try:
        yield line
    finally:
        line.stop()
        worker.join()
