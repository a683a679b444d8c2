"""Workers on this machine, one project each at a time, and what is done when one of them fails.

A worker that dies takes only its own project along. That project is tried once more, because the worker may have been
killed by somebody else; if it kills the second worker, too, it is named as the cause.
"""

from __future__ import annotations

import signal
import time
from collections import deque
from collections.abc import Callable, Iterator
from multiprocessing.connection import wait
from typing import Protocol, Self

from photostrip.batch.outcomes import BROKEN, TIMEOUT, failure, out_of_memory
from photostrip.batch.tasks import Answer, Limits, Task
from photostrip.batch.worker_process import NO_MEMORY, READY, WORK, WorkerProcess, share_of_memory
from photostrip.errors import Fault, InputError, PhotostripError

TICK_SECONDS = 0.1  # seconds between two looks at what else may have happened
TRIES = 2  # of a project whose worker dies
RECYCLED_AFTER = 1000  # projects
RECYCLED_ABOVE = 0.5  # of the memory that a worker may have
FALSE_STARTS = 3  # in a row, before the batch gives up


class Executor(Protocol):
    """Who computes: a pool on this machine, or a cluster."""

    def answers(self, tasks: Iterator[Task | None], stopped: Callable[[], bool]) -> Iterator[Answer]:
        """Compute tasks, taken as they are needed; a task that is None means: nothing yet, look again."""
        ...


def do_nothing(_: Task) -> None:
    """Take no notice of a task that begins."""


class LocalPool:
    """Workers on this machine."""

    def __init__(
        self,
        jobs: int = 1,
        limits: Limits | None = None,
        work: str = WORK,
        begun: Callable[[Task], None] = do_nothing,
    ) -> None:
        self.jobs, self.limits, self.work, self.begun = jobs, limits or Limits(), work, begun
        self.megabytes = self.limits.megabytes or share_of_memory(jobs)
        self.workers: list[WorkerProcess] = []
        self._again: deque[Task] = deque()
        self._tries: dict[int, int] = {}
        self._false_starts = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End all workers at once; they hold nothing that could be lost."""
        while self.workers:
            self.workers.pop().end()

    def answers(self, tasks: Iterator[Task | None], stopped: Callable[[], bool]) -> Iterator[Answer]:
        """Compute tasks; see ``Executor``."""
        queue: deque[Task] = deque()
        heard: deque[Answer] = deque()
        more = True
        while not stopped():
            looking = more and len(queue) < self.jobs - self._busy()
            if looking:
                try:
                    task = next(tasks)
                except StopIteration:
                    more = looking = False
                else:
                    queue.extend([task] if task is not None else [])
            self._hand_out(queue)
            if heard:  # only now: while an answer is written, its worker has the next task already
                yield heard.popleft()
            elif not more and not queue and not self._busy():
                return
            heard.extend(self._heard(0.0 if looking or heard else TICK_SECONDS))
            while self._again:
                queue.appendleft(self._again.pop())
        yield from heard

    def _busy(self) -> int:
        return sum(worker.task is not None for worker in self.workers)

    def _hand_out(self, queue: deque[Task]) -> None:
        """Give tasks to idle workers, and start workers for the others."""
        for worker in [each for each in self.workers if each.ready and each.task is None][: len(queue)]:
            task = queue.popleft()
            self._tries[task.number] = self._tries.get(task.number, 0) + 1
            worker.give(task)
            self.begun(task)
        starting = sum(not worker.ready for worker in self.workers)
        for _ in range(min(len(queue) - starting, self.jobs - len(self.workers))):
            self.workers.append(WorkerProcess(self.megabytes, self.work))

    def _heard(self, patience: float) -> Iterator[Answer]:
        """Take what the workers have sent, and end those that take too long."""
        by_connection = {worker.connection: worker for worker in self.workers}
        for connection in wait(list(by_connection), patience):
            worker = by_connection[connection]  # type: ignore[index]
            try:
                received = worker.hear()
            except (EOFError, OSError):
                yield from self._of_dead_worker(worker)
                continue
            if received == READY:
                worker.ready, self._false_starts = True, 0
                continue
            yield from self._finished(worker, received)
        yield from self._overdue()

    def _finished(self, worker: WorkerProcess, answer: Answer) -> Iterator[Answer]:
        """Take an answer; a worker that has grown is replaced."""
        worker.task = None
        worker.number_done += 1
        self._tries.pop(answer.number, None)
        grown = answer.megabytes > RECYCLED_ABOVE * self.megabytes or answer.outcome["status"] == "memory"
        if grown or worker.number_done >= RECYCLED_AFTER:
            self._dismiss(worker)
        yield answer

    def _overdue(self) -> Iterator[Answer]:
        limit = self.limits.seconds
        if limit is None:
            return
        now = time.monotonic()
        for worker in [each for each in self.workers if each.task is not None and now - each.begin > limit]:
            task = worker.task
            self._dismiss(worker)
            if task is not None:
                fault = Fault(f"took longer than {limit:g} s", "timeout", fix="give it more time with --timeout")
                yield self._gave_up(task, TIMEOUT, fault)

    def _of_dead_worker(self, worker: WorkerProcess) -> Iterator[Answer]:
        """Say what a worker died of, or let its project be tried once more."""
        code, task = worker.fate(), worker.task
        self.workers.remove(worker)
        if not worker.ready and code == NO_MEMORY:
            message = f"no process of the batch can start within {self.megabytes:.0f} MB of memory"
            raise InputError(Fault(message, "memory", "--memory", fix="give more, or use fewer processes (-j)"))
        if not worker.ready:
            self._false_starts += 1
            if self._false_starts >= FALSE_STARTS:
                raise PhotostripError(f"no worker process starts: {worker.last_words or cause_of(code)}")
        elif task is not None and code == NO_MEMORY:
            yield Answer(task.number, out_of_memory())
        elif task is not None and self._tries[task.number] < TRIES:
            self._again.append(task)
        elif task is not None:
            message = f"the process that computed it died, {TRIES} times in a row: {cause_of(code)}"
            fault = Fault(message, "worker-died", fix="`photostrip run PROJECT` shows whether it does so alone")
            yield self._gave_up(task, BROKEN, fault, trace=worker.last_words)

    def _gave_up(self, task: Task, status: str, fault: Fault, trace: str = "") -> Answer:
        self._tries.pop(task.number, None)
        return Answer(task.number, failure(status, fault), trace=trace)

    def _dismiss(self, worker: WorkerProcess) -> None:
        worker.end()
        self.workers.remove(worker)


def cause_of(code: int) -> str:
    """Say how a process with this exit code, negative after a signal, ended: ``killed by SIGSEGV``."""
    if code >= 0:
        return f"it ended with exit code {code}"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    return f"killed by {name}" + (": by somebody, or because memory ran out" if name == "SIGKILL" else "")
