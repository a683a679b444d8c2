"""Python's garbage collector, quiet while a big project is computed."""

from __future__ import annotations

import gc
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator


@contextmanager
def without_garbage_collection() -> Iterator[None]:
    """Keep the cyclic garbage collector quiet for a while.

    A big project makes hundreds of thousands of small objects and hardly a cycle; looking at them again and again
    takes a tenth of the run.
    """
    was = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()
