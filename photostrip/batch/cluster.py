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
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from photostrip.batch.cluster_worker import compute
from photostrip.batch.evaluation import evaluate
from photostrip.batch.local_pool import TICK, ignored
from photostrip.batch.parcel import pack
from photostrip.batch.result_folder import program
from photostrip.batch.tasks import BROKEN, Answer, failure
from photostrip.batch.worker_process import WORK
from photostrip.errors import Fault, InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from photostrip.batch.tasks import Limits, Task

LOCAL = "local"
PATIENCE = 5.0  # seconds for a scheduler to answer
AHEAD = 2  # tasks sent for each thread of the cluster
LEAST_AHEAD = 4
PARTING = 1.0  # seconds that an orderly end may take
COUNTED_EVERY = 1.0  # seconds between two looks at how many workers there are


def unsaid(_: str) -> None:
    """Say nothing."""


def _dask() -> Any:  # noqa: ANN401 (a module without types)
    """Load Dask at first need."""
    try:
        import dask
        from dask import distributed
    except ImportError:
        raise executor_fault("Dask is not installed", "pip install 'photostrip[dask]'") from None
    # a worker that cannot be reached is not worth the half minute that is the default
    dask.config.set({"distributed.comm.timeouts.connect": PATIENCE})
    return distributed


class Cluster:
    """A cluster that is connected."""

    def __init__(
        self,
        client: object,
        limits: Limits,
        work: str = WORK,
        begun: Callable[[Task], None] = ignored,
        say: Callable[[str], None] = unsaid,
    ) -> None:
        self.client: Any = client
        self.limits, self.work, self.begun, self.say = limits, work, begun, say
        self._sent: dict[str, tuple[Any, Task]] = {}
        self._room, self._counted = LEAST_AHEAD, -COUNTED_EVERY
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
                yield from self._heard(0.0 if looking else TICK)
                self._require_connection()
        finally:
            for future, _ in self._sent.values():
                with suppress(Exception):  # the scheduler may be gone
                    future.cancel()

    def _ahead(self) -> int:
        """Return the number of tasks that may be under way: workers come and go."""
        now = time.monotonic()
        if now - self._counted > COUNTED_EVERY:
            workers = self.client.scheduler_info(n_workers=-1)["workers"].values()
            if not workers and self._counted < 0.0:
                self.say("the cluster has no workers yet; waiting for them")
            self._room, self._counted = max(AHEAD * sum(each["nthreads"] for each in workers), LEAST_AHEAD), now
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
        """Take the next answer, if there is one."""
        try:
            key = self._done.get(timeout=patience) if patience else self._done.get_nowait()
        except queue.Empty:
            return
        if key in self._sent:
            future, task = self._sent.pop(key)
            yield self._taken(future, task)

    def _taken(self, future: Any, task: Task) -> Answer:  # noqa: ANN401 (without types)
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
        elif now - self._heard_of > PATIENCE:
            raise lost(self.client.status)


def require_same(theirs: dict[str, str]) -> None:
    """Refuse answers of another program: results would depend on which machine computed them.

    Raises
    ------
    InputError
        When it is not what is installed here.
    """
    own = program()
    different = [name for name in own if theirs.get(name) != own[name]]
    if different:
        told = ", ".join(
            f"{name} {theirs.get(name, 'none')[:12]} there and {own[name][:12]} here" for name in different
        )
        raise executor_fault(f"a worker of the cluster has another program: {told}", "install the same versions there")


def executor_fault(message: str, fix: str) -> InputError:
    """Make an error about the cluster."""
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
    begun: Callable[[Task], None] = ignored,
    work: str = WORK,
    say: Callable[[str], None] = unsaid,
) -> Iterator[Cluster]:
    """Connect to a cluster, or start one on this machine.

    Parameters
    ----------
    address : str
        ``tcp://HOST:PORT`` of a scheduler, or ``local``.

    Raises
    ------
    InputError
        When Dask is not installed, or there is no scheduler at this address.
    """
    distributed = _dask()
    with ExitStack() as stack:
        stack.enter_context(_quiet())
        where: Any = address
        if address == LOCAL:
            with _deaf_children():
                where = distributed.LocalCluster(
                    n_workers=jobs, threads_per_worker=1, dashboard_address=None, silence_logs="CRITICAL"
                )
            stack.callback(_end, where)
        else:
            _require_scheduler(address)
        try:
            client = distributed.Client(where, timeout=PATIENCE, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            reason = str(error).partition("\n")[0]
            raise _unreachable(address, reason) from None
        stack.callback(_part, client)
        yield Cluster(client, limits, work, begun, say)


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep the library from telling with a traceback what is told here in a sentence."""
    logs = [logging.getLogger(name) for name in ("distributed", "distributed.client")]  # each has a level of its own
    before = [log.level for log in logs]
    for log in logs:
        log.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for log, level in zip(logs, before, strict=True):
            log.setLevel(level)


def _part(client: Any) -> None:  # noqa: ANN401 (without types)
    """Take leave of a scheduler, which may be gone."""
    with suppress(TimeoutError, OSError):
        client.close(timeout=PARTING)


def _end(local: Any) -> None:  # noqa: ANN401 (without types)
    """End a cluster of this machine at once: nothing that its workers still compute is wanted."""
    for nanny in local.workers.values():
        nanny.auto_restart = False
        with suppress(OSError, TypeError):  # it is gone already
            os.kill(nanny.pid, signal.SIGKILL)
    with suppress(TimeoutError):
        local.close(timeout=PARTING)


@contextmanager
def _deaf_children() -> Iterator[None]:
    """Start processes that do not hear Ctrl-C, which reaches every process of the terminal: this one ends them."""
    if threading.current_thread() is not threading.main_thread():  # only there can it be said
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # what a process starts with, its children start with
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _require_scheduler(address: str) -> None:
    """Knock at the door, because the library itself goes on knocking for a long time."""
    try:
        parts = urlsplit(address)
        host, port = parts.hostname, parts.port
    except ValueError as error:
        raise _unreachable(address, str(error)) from None
    if not parts.scheme or not host or not port:
        message = f"`dask:{address}` is no address of a scheduler"
        raise InputError(Fault(message, "executor", "--executor", expected="dask:tcp://HOST:PORT or dask:local"))
    try:
        socket.create_connection((host, port), timeout=PATIENCE).close()
    except OSError as error:
        raise _unreachable(address, (error.strerror or str(error)).lower()) from None


def _unreachable(address: str, reason: str) -> InputError:
    return executor_fault(f"no Dask scheduler answers at {address} ({reason})", "start it, or correct the address")
