"""A worker: a process that loads the libraries once, then computes one project after the other.

It is a fresh interpreter, not a copy of its parent: nothing of the parent's threads, locks or open files is in it. Its
only tie is one end of a socket. When the other end closes, whatever the reason, it ends itself at once, so that no
worker outlives a batch that was killed.
"""

from __future__ import annotations

import os
import queue
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from itertools import count
from multiprocessing.connection import Connection, Pipe
from pathlib import Path
from typing import Any

from photostrip.batch.tasks import Answer, Task
from photostrip.threads import THREAD_VARIABLES

WORK = "photostrip.batch.evaluation:evaluate"  # what a worker does with a task
READY = "ready"
MEGABYTE = 1_000_000
COLLECTED_EVERY = 20  # projects; a collection takes 3 % of a short strip
NO_MEMORY = 71  # exit code of a worker that has too little memory left even to say so
# What libraries in other languages say before they end the process: Rust, C++, OpenBLAS.
NO_MEMORY_WORDS = ("memory allocation of ", "bad_alloc", "Memory allocation still failed", "MemoryError")
# The interpreter of a worker finds the same modules as that of its parent, wherever the parent has them from.
START = (
    "import sys; sys.path[:] = sys.argv[1].split('\\n'); "
    "from photostrip.batch.worker_process import serve; serve(int(sys.argv[2]), float(sys.argv[3]), sys.argv[4])"
)


class WorkerProcess:
    """A worker as its parent sees it; ``work`` is what it does with a task, as ``module:function``."""

    def __init__(self, megabytes: float, work: str = WORK) -> None:
        self.task: Task | None = None
        self.ready = False
        self.number_done = 0
        self.begin = time.monotonic()
        self.last_words = ""  # the last line that it wrote on stderr, once it is dead
        self._stderr = tempfile.TemporaryFile()  # noqa: SIM115 (as long as the worker lives)
        self.connection, theirs = Pipe()
        handle = theirs.fileno()
        command = [sys.executable, "-c", START, "\n".join(sys.path), str(handle), str(megabytes), work]
        self.process = subprocess.Popen(  # noqa: S603 (our own interpreter and our own module)
            command,
            pass_fds=(handle,),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=self._stderr,
            env={**os.environ, **dict.fromkeys(THREAD_VARIABLES, "1")},
        )
        theirs.close()

    def give(self, task: Task) -> None:
        """Hand it a task; it counts as begun now."""
        self.task, self.begin = task, time.monotonic()
        with suppress(OSError):  # it is dead: the next look at the connection shows it
            self.connection.send(task)

    def hear(self) -> Any:  # noqa: ANN401 (an Answer or READY)
        """Return what it has sent; ``EOFError`` or ``OSError`` when it is dead."""
        return self.connection.recv()

    def end(self) -> int:
        """End it, if it still lives, and give its exit code; negative after a signal, NO_MEMORY for want of memory."""
        self.connection.close()
        self.process.kill()
        code = self.process.wait()
        with self._stderr:
            self._stderr.seek(0)
            written = self._stderr.read().decode(errors="replace")
        self.last_words = next((line.strip() for line in reversed(written.split("\n")) if line.strip()), "")
        return NO_MEMORY if code and any(words in written for words in NO_MEMORY_WORDS) else code

    def fate(self) -> int:
        """Return the exit code of a worker whose connection broke: it is dead, or about to be."""
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(timeout=1.0)
        return self.end()


def share_of_memory(workers: int) -> float:
    """Return an even share of the memory of the machine, or of its container, megabytes."""
    total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    for file in ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"):
        with suppress(OSError, ValueError):
            total = min(total, int(Path(file).read_text(encoding="ascii")))
    return total / MEGABYTE / workers


def serve(handle: int, megabytes: float, work: str) -> None:
    """Compute what comes through a connection until it closes."""
    try:
        _serve(Connection(handle), megabytes, work)
    except MemoryError:
        os._exit(NO_MEMORY)


def _serve(connection: Connection[Any, Any], megabytes: float, work: str) -> None:
    import gc

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches every process of the terminal; the parent decides
    tasks: queue.SimpleQueue[Task] = queue.SimpleQueue()
    threading.Thread(target=_receive, args=(connection, tasks), daemon=True).start()
    module, _, name = work.partition(":")
    evaluate: Callable[[Task], Answer] = getattr(import_module(module), name)
    _limit_memory(megabytes)
    gc.disable()  # as in every command: a project makes many small objects and hardly a cycle
    gc.freeze()
    connection.send(READY)
    for number in count(1):
        _send(connection, evaluate(tasks.get()))
        if number % COLLECTED_EVERY == 0:
            gc.collect()


def _receive(connection: Connection[Any, Any], tasks: queue.SimpleQueue[Task]) -> None:
    """Take in tasks beside the work, so that the end of the parent is noticed in the middle of it."""
    try:
        while True:
            tasks.put(connection.recv())
    except MemoryError:
        os._exit(NO_MEMORY)
    except (EOFError, OSError):
        os._exit(0)


def _send(connection: Connection[Any, Any], answer: Answer) -> None:
    from dataclasses import replace

    with suppress(OSError):  # the parent is gone; the other thread ends this process
        connection.send(replace(answer, megabytes=_resident()))


def _limit_memory(megabytes: float) -> None:
    """Let the system refuse more memory than this; a library that asks for it fails, and nobody else does."""
    import resource

    # Linux counts here what can be written to; the address space holds much that is reserved and never used.
    kind = resource.RLIMIT_DATA if sys.platform == "linux" else resource.RLIMIT_AS
    _, hard = resource.getrlimit(kind)
    wanted = int(megabytes * MEGABYTE)
    if hard != resource.RLIM_INFINITY:
        wanted = min(wanted, hard)
    with suppress(OSError, ValueError):  # not every system has this limit
        resource.setrlimit(kind, (wanted, hard))


def _resident() -> float:
    """Memory that this process has now, megabytes; its peak where the system does not tell."""
    import resource

    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    except OSError:
        scale = 1 if sys.platform == "darwin" else 1024
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * scale / MEGABYTE
    return pages * os.sysconf("SC_PAGE_SIZE") / MEGABYTE
