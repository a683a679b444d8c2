"""One thread per process for the linear algebra libraries below numpy and scipy.

The matrices of a strip are small and many. A pool of threads makes them slower, competes with ``batch``, which
already runs one process per core, and lets the order of a sum depend on the machine.
"""

from __future__ import annotations

import os
from collections.abc import MutableMapping

THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
)


def limit_threads(environment: MutableMapping[str, str] = os.environ) -> None:
    """Ask for one thread wherever the user has not asked for another number.

    environment: the variables to complete; those already set stay as they are.
    """
    for variable in THREAD_VARIABLES:
        environment.setdefault(variable, "1")
