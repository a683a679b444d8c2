"""Workers on this machine: one project each at a time, and what is done when one of them fails.

A worker that dies takes only its own project along. That project is tried once more, because the worker may have been
killed by somebody else; if it kills the second worker, too, it is named as the cause. Workers are copies of one process
that has loaded the libraries and nothing of this one; they end with this one, however it ends.
"""

from __future__ import annotations

import gc
import multiprocessing
import os
import queue
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import suppress
from multiprocessing.connection import wait
from pathlib import Path
from typing import Protocol, Self

from pebble import ProcessExpired, ProcessPool

from photostrip.batch.evaluation import BROKEN, MEMORY, TIMEOUT, Answer, Limits, Task, evaluate, failed, out_of_memory
from photostrip.threads import THREAD_VARIABLES

TICK_SECONDS = 0.1  # seconds between two looks at what else may have happened
RECYCLED_AFTER = 20  # projects: what a worker loses track of is given back before it counts
# what a project needs, loaded once: every worker has it at once, and before its memory is limited
LOADED = [
    "photostrip.batch.pool",
    "photostrip.pipeline.run",
    "photostrip.result.document",
    "pyproj.network",
    "pyproj.transformer",
    "scipy.interpolate",
    "scipy.sparse.csgraph",
    "scipy.sparse.linalg",
]
NO_MEMORY = 71  # exit code of a worker whose memory was not enough
MEGABYTE = 1_000_000
LEAST_MEMORY = 50 * MEGABYTE  # for a project, beside what is loaded

Work = Callable[[Task], Answer]


class Executor(Protocol):
    """Who computes: a pool on this machine, or a cluster."""

    def room(self) -> int:
        """Return how many projects may be under way."""
        ...

    def submit(self, task: Task) -> Future[Answer]: ...

    def answer(self, future: Future[Answer], task: Task) -> Answer | None:
        """Return what became of a project that is done; None: it must be tried again."""
        ...


def do_nothing(_: Task) -> None:
    """Take no notice of a task that begins."""


def answers(
    executor: Executor,
    tasks: Iterator[Task | None],
    stopped: Callable[[], bool],
    begun: Callable[[Task], None] = do_nothing,
) -> Iterator[Answer]:
    """Compute tasks, taken as they are needed; a task that is None means: nothing yet, look again."""
    running: dict[Future[Answer], Task] = {}
    done: queue.SimpleQueue[Future[Answer]] = queue.SimpleQueue()
    heard: list[Answer] = []
    more = True

    def start(task: Task) -> None:
        future = executor.submit(task)
        running[future] = task
        future.add_done_callback(done.put)

    while not stopped():
        room = executor.room()
        looking = more and len(running) < room
        if looking:
            task = next(tasks, Ellipsis)
            more = looking = task is not Ellipsis
            if isinstance(task, Task):
                begun(task)
                start(task)
        if heard and not (looking and len(running) < room):  # while one is written, its worker has the next already
            yield heard.pop(0)
            continue
        if not more and not running and not heard:
            return
        with suppress(queue.Empty):
            future = done.get(timeout=TICK_SECONDS) if not looking and not heard else done.get_nowait()
            task = running.pop(future)
            answer = executor.answer(future, task)
            if answer is None:
                start(task)
            else:
                heard.append(answer)
    yield from heard


class LocalPool:
    """Workers on this machine; ``work`` is what they do with a task."""

    def __init__(self, jobs: int = 1, limits: Limits | None = None, work: Work = evaluate) -> None:
        self.jobs, self.limits, self.work = jobs, limits or Limits(), work
        self.megabytes = self.limits.megabytes or share_of_memory(jobs)
        self._died: set[int] = set()  # numbers of tasks whose worker died
        os.environ |= dict.fromkeys(THREAD_VARIABLES, "1")
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload(LOADED)
        self._pool = ProcessPool(jobs, RECYCLED_AFTER, begin, (self.megabytes,), context)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """End all workers at once; they hold nothing that could be lost."""
        self._pool.stop()  # type: ignore[no-untyped-call]
        self._pool.join()

    def room(self) -> int:
        return self.jobs

    def submit(self, task: Task) -> Future[Answer]:
        future: Future[Answer] = self._pool.schedule(within_memory, (self.work, task), timeout=self.limits.seconds)
        return future

    def answer(self, future: Future[Answer], task: Task) -> Answer | None:
        """See ``Executor``."""
        try:
            return future.result()
        except TimeoutError:
            message = f"took longer than {self.limits.seconds:g} s"
            return failed(task, TIMEOUT, message, "timeout", "give it more with --timeout")
        except ProcessExpired as death:
            if death.exitcode == NO_MEMORY:
                return out_of_memory(task)
            if task.number not in self._died:
                self._died.add(task.number)
                return None
            message = f"the process that computed it died, twice in a row: {cause_of(death.exitcode)}"
            return failed(
                task, BROKEN, message, "worker-died", "`photostrip run PROJECT` shows whether it does so alone"
            )


def begin(megabytes: float) -> None:
    """Prepare a worker."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    silence = os.open(os.devnull, os.O_WRONLY)  # what libraries in other languages say before they end the process
    os.dup2(silence, sys.__stdout__.fileno() if sys.__stdout__ else 1)
    os.dup2(silence, sys.__stderr__.fileno() if sys.__stderr__ else 2)
    gc.disable()  # as in every command: a project makes many small objects and hardly a cycle
    gc.freeze()
    _limit_memory(megabytes)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(0)


def _limit_memory(megabytes: float) -> None:
    """Let the system refuse more memory than this; a library that asks for it fails, and nobody else does."""
    import resource

    # Linux counts here what can be written to; the address space holds much that is reserved and never used.
    kind = resource.RLIMIT_DATA if sys.platform == "linux" else resource.RLIMIT_AS
    _, hard = resource.getrlimit(kind)
    most = int(megabytes * MEGABYTE)
    with suppress(OSError, ValueError):  # not every system has this limit
        resource.setrlimit(kind, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))


def within_memory(work: Work, task: Task) -> Answer:
    """Compute a project in a worker, which ends when its memory was not enough: what it holds is given back."""
    try:
        bytearray(LEAST_MEMORY)  # or else libraries fail in ways that do not name the cause
        answer = work(task)
    except MemoryError:
        os._exit(NO_MEMORY)
    if answer.outcome["status"] == MEMORY:
        os._exit(NO_MEMORY)
    return answer


def cores() -> int:
    """Count the cores that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        return os.cpu_count() or 1


def share_of_memory(workers: int) -> float:
    """Return an even share of the memory of the machine, or of its container, megabytes."""
    total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    for file in ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"):
        with suppress(OSError, ValueError):
            total = min(total, int(Path(file).read_text(encoding="ascii")))
    return total / MEGABYTE / workers


def cause_of(code: int) -> str:
    """Say how a process with this exit code, negative after a signal, ended: ``killed by SIGSEGV``."""
    if code >= 0:
        return f"it ended with exit code {code}"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    return f"killed by {name}" + (": by somebody, or because memory ran out" if name in {"SIGKILL", "SIGABRT"} else "")
