"""What runs inside a worker of a cluster: a pool of one for each thread, with the limits and habits of a local batch.

The cluster's own process never computes. A project that crashes, hangs or eats memory ends a process below it, and the
cluster keeps its worker.
"""

from __future__ import annotations

import os
import threading

from photostrip.batch.local_pool import LocalPool
from photostrip.batch.result_folder import program
from photostrip.batch.tasks import Answer, Limits, Task
from photostrip.batch.worker_process import WORK, share_of_memory
from photostrip.errors import PhotostripError

_idle: dict[tuple[Limits, str], list[LocalPool]] = {}
_lock = threading.Lock()


def compute(task: Task, limits: Limits, work: str = WORK) -> tuple[Answer, dict[str, str]]:
    """Compute a project in a process below this one; return with the answer which program computed it.

    Without a limit of memory it may use this machine's memory shared among its cores.
    """
    key = limits, work
    with _lock:
        waiting = _idle.setdefault(key, [])
        if waiting:
            pool = waiting.pop()
        else:
            megabytes = limits.megabytes or share_of_memory(os.cpu_count() or 1)
            pool = LocalPool(1, Limits(limits.seconds, megabytes), work)
    try:
        answers = list(pool.answers(iter([task]), lambda: False))
    except BaseException:
        pool.close()
        raise
    with _lock:
        waiting.append(pool)
    if len(answers) != 1:  # cannot be: a pool answers every task once
        raise PhotostripError(f"{len(answers)} answers to one task")
    return answers[0], program()
