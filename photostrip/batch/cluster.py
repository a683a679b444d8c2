"""A cluster: the same work sent to other machines through Dask.

Every task carries the files of its project, and every answer the files of its result; no disk is shared. On a machine
of the cluster projects are computed by a pool as on this one: one that crashes, hangs or eats memory ends a process
below Dask's worker, and the cluster keeps that.
"""

from __future__ import annotations

import logging
import multiprocessing
import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from photostrip.batch.evaluation import BROKEN, Answer, Limits, Task, evaluate, failed, pack
from photostrip.batch.folder import program
from photostrip.batch.pool import LocalPool, Work
from photostrip.errors import Fault, InputError, PhotostripError

CONNECT_SECONDS = 5.0  # seconds for a scheduler to answer
CLOSING_SECONDS = 1.0  # seconds that an orderly end may take
PER_THREAD = 2  # tasks sent for each thread of the cluster
LEAST_TASKS = 4
COUNT_INTERVAL = 1.0  # seconds between two looks at how many workers there are


@lru_cache(maxsize=1)
def _pool(limits: Limits, work: Work) -> LocalPool:
    """Return the pool of a machine of the cluster, one for all threads of Dask's worker."""
    multiprocessing.current_process().daemon = False  # a daemon, as Dask starts its workers, may start no process
    return LocalPool(os.cpu_count() or 1, limits, work)


def compute(task: Task, limits: Limits, work: Work) -> tuple[Answer, dict[str, str]]:
    """Compute a project on a machine of the cluster; return with the answer which program computed it."""
    pool = _pool(limits, work)
    answer = pool.answer(pool.submit(task), task) or pool.answer(pool.submit(task), task)
    if answer is None:  # cannot be: a pool tries a project twice
        raise PhotostripError("a project was tried twice without an answer")
    return answer, program()


class Cluster:
    """The machines of a cluster, see ``pool.Executor``."""

    def __init__(self, client: object, limits: Limits, work: Work, say: Callable[[str], None]) -> None:
        self.client: Any = client
        self.limits, self.work, self.say = limits, work, say
        self._room, self._counted = LEAST_TASKS, -COUNT_INTERVAL
        self._heard_of = time.monotonic()

    def room(self) -> int:
        """Return the number of tasks that may be under way: machines come and go."""
        now = time.monotonic()
        if self.client.status == "running":
            self._heard_of = now
        elif now - self._heard_of > CONNECT_SECONDS:
            raise lost(self.client.status)
        if now - self._counted > COUNT_INTERVAL:
            workers = self.client.scheduler_info(n_workers=-1)["workers"].values()
            if not workers and self._counted < 0.0:
                self.say("the cluster has no workers yet; waiting for them")
            self._room, self._counted = max(PER_THREAD * sum(each["nthreads"] for each in workers), LEAST_TASKS), now
        return self._room

    def submit(self, task: Task) -> Future[Answer]:
        """Send a project; one whose files cannot be read is answered here, where the files are."""
        try:
            parcel = pack(Path(task.project), task.overrides)
        except InputError:
            refused: Future[Answer] = Future()
            refused.set_result((evaluate(task), program()))  # type: ignore[arg-type]
            return refused
        # pure=False: a key of its own for every task, so that nothing comes from an earlier batch
        sent: Future[Answer] = self.client.submit(
            compute, replace(task, parcel=parcel), self.limits, self.work, pure=False
        )
        return sent

    def answer(self, future: Future[Any], task: Task) -> Answer:
        """See ``pool.Executor``."""
        distributed = _dask()
        try:
            answer, theirs = future.result()
        except distributed.KilledWorker:
            return failed(task, BROKEN, "every machine that computed it was lost", "worker-died", "look at their logs")
        except (distributed.CancelledError, TimeoutError, OSError) as error:
            raise lost(str(error)) from None
        except ImportError as error:
            message = f"a worker of the cluster cannot load photostrip ({error})"
            raise executor_fault(message, "install the same version there") from None
        require_same(theirs)
        computed: Answer = answer
        return computed


def require_same(theirs: dict[str, str]) -> None:
    """Refuse answers of another program: results would depend on the machine that computed them."""
    local = program()
    different = [
        f"{name} {theirs.get(name, 'none')[:12]} there and {version[:12]} here"
        for name, version in local.items()
        if theirs.get(name) != version
    ]
    if different:
        message = f"a worker of the cluster has another program: {', '.join(different)}"
        raise executor_fault(message, "install the same versions there")


def executor_fault(message: str, fix: str) -> InputError:
    return InputError(Fault(message, "executor", "--executor", fix=fix))


def lost(reason: str) -> InputError:
    """Make the error about a cluster that has gone."""
    fix, message = "the same command goes on from where it was", f"the connection to the cluster is lost ({reason})"
    return InputError(Fault(message, "executor-lost", "--executor", fix=fix))


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


@contextmanager
def cluster(
    address: str, limits: Limits, say: Callable[[str], None] = lambda _: None, work: Work = evaluate
) -> Iterator[Cluster]:
    """Connect to a cluster at ``tcp://HOST:PORT`` or ``tls://HOST:PORT``."""
    distributed = _dask()
    logs = [logging.getLogger(name) for name in ("distributed", "distributed.client")]  # each has a level of its own
    before = [log.level for log in logs]
    for log in logs:  # the library prints tracebacks where a sentence says the same
        log.setLevel(logging.CRITICAL)
    try:
        client = distributed.Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
    except (OSError, TimeoutError, ValueError, TypeError) as error:
        reason = str(error).partition("\n")[0]
        message = f"no Dask scheduler answers at {address} ({reason})"
        raise executor_fault(message, "start it, or correct the address") from None
    try:
        yield Cluster(client, limits, work, say)
    finally:  # what is still under way is forgotten by the scheduler with its client, which may be gone
        with suppress(TimeoutError, OSError):
            client.close(timeout=CLOSING_SECONDS)
        for log, level in zip(logs, before, strict=True):
            log.setLevel(level)
