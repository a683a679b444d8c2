"""What is being done, on a terminal while something takes long: a spinner, or a bar where the number of steps is known.

Only a person who waits at a terminal sees it. It is wiped away when the work is done, and never stands in a pipe, a
file or the log of a job: there what is said goes straight to the stream.
"""

from __future__ import annotations

import os
import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, TextIO

from photostrip.notes import listed
from photostrip.report.page.layout import cut
from photostrip.visible import visible

if TYPE_CHECKING:
    from rich.progress import Progress as RichProgress

PATIENCE = 1.0  # seconds before anything is shown of a single job
BAR, COUNTS = 12, 24  # cells of the bar, and of what else stands beside the text


class _Steady:
    """A terminal: when it is gone, the work is not."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> None:
        with suppress(OSError, ValueError):
            self._stream.write(text)

    def flush(self) -> None:
        with suppress(OSError, ValueError):
            self._stream.flush()

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 (whatever a stream has)
        return getattr(self._stream, name)


class Progress:
    """How far the work is, on one terminal; the total, of steps to do, is 0 when it is not known."""

    def __init__(self, stream: TextIO, total: int, *, live: bool, patience: float) -> None:
        self.stream, self.total, self.live = stream, total, live
        self._running: dict[str, None] = {}
        self._done, self._text = 0, ""
        self._bar: RichProgress | None = None
        self._waiting = threading.Thread(target=self._show, args=[patience], daemon=True)
        self._stopped = threading.Event()
        if live and patience:
            self._waiting.start()
        elif live:
            self._show(patience)

    def _show(self, patience: float) -> None:
        if self._stopped.wait(patience):
            return
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, SpinnerColumn, TextColumn, TimeElapsedColumn
        from rich.progress import Progress as Bar

        begin = (BarColumn(BAR), MofNCompleteColumn()) if self.total else (SpinnerColumn("line"),)
        text = TextColumn("{task.description}", markup=False)
        console = Console(file=_Steady(self.stream), highlight=False, markup=False)  # type: ignore[arg-type]
        bar = Bar(*begin, TimeElapsedColumn(), text, console=console, transient=True)
        self._task = bar.add_task(self._text, total=self.total or None, completed=self._done)
        bar.start()
        self._bar = bar
        self._update(self._text, 0)  # what was said meanwhile

    def stop(self) -> None:
        """Take away what is shown."""
        self._stopped.set()
        if self._waiting.is_alive():
            self._waiting.join()
        if self._bar is not None:
            self._bar.stop()

    def at(self, text: str) -> None:
        """Say what is being done now; with a total, it is one more of the steps."""
        self._update(text, bool(self.total))

    def begun(self, project: str) -> None:
        """Say that one of several projects is being computed now."""
        self._running[project] = None
        self._update(listed(self._running), 0)

    def finished(self, project: str) -> None:
        self._running.pop(project, None)
        self._update(listed(self._running), 1)

    def _update(self, text: str, steps: int) -> None:
        room = shutil.get_terminal_size().columns - BAR - COUNTS
        self._text, self._done = cut(visible(text), max(room, COUNTS), "..."), self._done + steps
        if self._bar is not None:
            self._bar.update(self._task, completed=self._done, description=self._text)

    def say(self, text: str) -> None:
        """Say something, above the bar where there is one."""
        if self._bar is not None:
            self._bar.console.print(visible(text), soft_wrap=True)
        else:
            self.stream.write(f"{visible(text)}\n")
            self.stream.flush()


@contextmanager
def progress(stream: TextIO, total: int = 0, *, quiet: bool = False, patience: float = PATIENCE) -> Iterator[Progress]:
    """Show progress while a block runs, where somebody waits: at a terminal that can wipe a line."""
    live = not quiet and stream.isatty() and os.environ.get("TERM", "") not in {"dumb", "unknown"}
    shown = Progress(stream, total, live=live, patience=patience)
    try:
        yield shown
    finally:
        shown.stop()
