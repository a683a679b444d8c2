"""A cluster: the same work sent to other machines through Dask.

Every task carries the files of its project, and every answer the files of its result; no disk is shared. This process
packs the one and writes the other, some tasks ahead of the cluster and no more, however many there are.
"""

from __future__ import annotations

import logging
import os
import queue
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from photostrip.batch.cluster_worker import compute
from photostrip.batch.evaluation import evaluate
from photostrip.batch.local_pool import TICK_SECONDS, do_nothing
from photostrip.batch.outcomes import BROKEN, failure
from photostrip.batch.parcel import pack
from photostrip.batch.result_folder import program
from photostrip.batch.tasks import Answer, Limits, Task
from photostrip.batch.worker_process import WORK
from photostrip.errors import Fault, InputError

LOCAL = "local"
CONNECT_SECONDS = 5.0  # seconds for a scheduler to answer
PER_THREAD = 2  # tasks sent for each thread of the cluster
LEAST_TASKS = 4
CLOSING_SECONDS = 1.0  # seconds that an orderly end may take
COUNT_INTERVAL = 1.0  # seconds between two looks at how many workers there are


def say_nothing(_: str) -> None:
    """Say nothing."""


def _dask() -> Any:  # noqa: ANN401 (a module without types)
    """Load Dask at first need."""
    try:
        import dask
        from dask import distributed
    except ImportError:
        raise executor_fault("Dask is not installed", "pip install 'photostrip[dask]'") from None
    # a worker that cannot be reached is not worth the half minute that is the default
    dask.config.set({"distributed.comm.timeouts.connect": CONNECT_SECONDS})
    return distributed


class Cluster:
    def __init__(
        self,
        client: object,
        limits: Limits,
        work: str = WORK,
        begun: Callable[[Task], None] = do_nothing,
        say: Callable[[str], None] = say_nothing,
    ) -> None:
        self.client: Any = client
        self.limits, self.work, self.begun, self.say = limits, work, begun, say
        self._sent: dict[str, tuple[Any, Task]] = {}
        self._room, self._counted = LEAST_TASKS, -COUNT_INTERVAL
        self._heard_of = time.monotonic()
        self._done: queue.SimpleQueue[str] = queue.SimpleQueue()

    def answers(self, tasks: Iterator[Task | None], stopped: Callable[[], bool]) -> Iterator[Answer]:
        """Compute tasks; see ``local_pool.Executor``."""
        more, looking = True, False
        try:
            while not stopped():
                if more and len(self._sent) < self._ahead():
                    task = next(tasks, self)
                    looking = not isinstance(task, Cluster)
                    more = looking
                    if not isinstance(task, Cluster) and task is not None:
                        yield from self._send(task)
                else:
                    looking = False
                if not more and not self._sent:
                    return
                yield from self._heard(0.0 if looking else TICK_SECONDS)
                self._require_connection()
        finally:
            for future, _ in self._sent.values():
                with suppress(Exception):  # the scheduler may be gone
                    future.cancel()

    def _ahead(self) -> int:
        """Return the number of tasks that may be under way: workers come and go."""
        now = time.monotonic()
        if now - self._counted > COUNT_INTERVAL:
            workers = self.client.scheduler_info(n_workers=-1)["workers"].values()
            if not workers and self._counted < 0.0:
                self.say("the cluster has no workers yet; waiting for them")
            self._room, self._counted = max(PER_THREAD * sum(each["nthreads"] for each in workers), LEAST_TASKS), now
        return self._room

    def _send(self, task: Task) -> Iterator[Answer]:
        """Send a project; one whose files cannot be read is answered here, where the files are."""
        try:
            parcel = pack(Path(task.project), task.overrides)
        except InputError:
            yield evaluate(task)
            return
        self.begun(task)
        # pure=False: a key of its own for every task, so that nothing comes from an earlier batch
        future = self.client.submit(compute, replace(task, parcel=parcel), self.limits, self.work, pure=False)
        self._sent[future.key] = future, task
        future.add_done_callback(lambda each: self._done.put(each.key))

    def _heard(self, patience: float) -> Iterator[Answer]:
        """Return the next answer, if there is one within the seconds of patience."""
        try:
            key = self._done.get(timeout=patience) if patience else self._done.get_nowait()
        except queue.Empty:
            return
        if key in self._sent:
            future, task = self._sent.pop(key)
            yield self._answer_of(future, task)

    def _answer_of(self, future: Any, task: Task) -> Answer:  # noqa: ANN401 (without types)
        distributed = _dask()
        try:
            answer, theirs = future.result()
        except distributed.KilledWorker:
            message = "every machine that computed it was lost"
            return Answer(task.number, failure(BROKEN, Fault(message, "worker-died", fix="look at their logs")))
        except (distributed.CancelledError, TimeoutError, OSError) as error:
            raise lost(str(error)) from None
        except ImportError as error:
            message = f"a worker of the cluster cannot load photostrip ({error})"
            raise executor_fault(message, "install the same version there") from None
        require_same(theirs)
        result: Answer = answer
        return result

    def _require_connection(self) -> None:
        now = time.monotonic()
        if self.client.status == "running":
            self._heard_of = now
        elif now - self._heard_of > CONNECT_SECONDS:
            raise lost(self.client.status)


def require_same(theirs: dict[str, str]) -> None:
    """Refuse answers of another program: results would depend on the machine that computed them."""
    local = program()
    different = [name for name in local if theirs.get(name) != local[name]]
    if different:
        names = ", ".join(
            f"{name} {theirs.get(name, 'none')[:12]} there and {local[name][:12]} here" for name in different
        )
        raise executor_fault(f"a worker of the cluster has another program: {names}", "install the same versions there")


def executor_fault(message: str, fix: str) -> InputError:
    return InputError(Fault(message, "executor", "--executor", fix=fix))


def lost(reason: str) -> InputError:
    """Make the error about a cluster that has gone."""
    fix = "the same command goes on from where it was"
    return InputError(
        Fault(f"the connection to the cluster is lost ({reason})", "executor-lost", "--executor", fix=fix)
    )


@contextmanager
def cluster(
    address: str,
    jobs: int,
    limits: Limits,
    begun: Callable[[Task], None] = do_nothing,
    work: str = WORK,
    say: Callable[[str], None] = say_nothing,
) -> Iterator[Cluster]:
    """Connect to a cluster at ``tcp://HOST:PORT``, or start one on this machine, at ``local``."""
    distributed = _dask()
    with ExitStack() as stack:
        stack.enter_context(_quiet())
        where: Any = address
        if address == LOCAL:
            with _children_ignore_interrupts():
                where = distributed.LocalCluster(
                    n_workers=jobs, threads_per_worker=1, dashboard_address=None, silence_logs="CRITICAL"
                )
            stack.callback(_end_local, where)
        else:
            _require_scheduler(address)
        try:
            client = distributed.Client(where, timeout=CONNECT_SECONDS, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            reason = str(error).partition("\n")[0]
            raise _unreachable(address, reason) from None
        stack.callback(_close_client, client)
        yield Cluster(client, limits, work, begun, say)


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep the library from printing a traceback where a sentence says the same."""
    logs = [logging.getLogger(name) for name in ("distributed", "distributed.client")]  # each has a level of its own
    before = [log.level for log in logs]
    for log in logs:
        log.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for log, level in zip(logs, before, strict=True):
            log.setLevel(level)


def _close_client(client: Any) -> None:  # noqa: ANN401 (without types)
    """Close the connection to a scheduler, which may be gone."""
    with suppress(TimeoutError, OSError):
        client.close(timeout=CLOSING_SECONDS)


def _end_local(local: Any) -> None:  # noqa: ANN401 (without types)
    """End a cluster of this machine at once: nothing that its workers still compute is wanted."""
    for nanny in local.workers.values():
        nanny.auto_restart = False
        with suppress(OSError, TypeError):  # it is gone already
            os.kill(nanny.pid, signal.SIGKILL)
    with suppress(TimeoutError):
        local.close(timeout=CLOSING_SECONDS)


@contextmanager
def _children_ignore_interrupts() -> Iterator[None]:
    """Start processes that ignore Ctrl-C, which reaches every process of the terminal: this one ends them."""
    if threading.current_thread() is not threading.main_thread():  # signals can be set there only
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # what a process starts with, its children start with
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _require_scheduler(address: str) -> None:
    """Try the address once: the library itself goes on trying for a long time."""
    try:
        parts = urlsplit(address)
        host, port = parts.hostname, parts.port
    except ValueError as error:
        raise _unreachable(address, str(error)) from None
    if not parts.scheme or not host or not port:
        message = f"`dask:{address}` is not the address of a scheduler"
        raise InputError(Fault(message, "executor", "--executor", expected="dask:tcp://HOST:PORT or dask:local"))
    try:
        socket.create_connection((host, port), timeout=CONNECT_SECONDS).close()
    except OSError as error:
        raise _unreachable(address, (error.strerror or str(error)).lower()) from None


def _unreachable(address: str, reason: str) -> InputError:
    return executor_fault(f"no Dask scheduler answers at {address} ({reason})", "start it, or correct the address")
