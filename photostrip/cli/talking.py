"""What the commands say on stderr while they work."""

from __future__ import annotations

import gc
import sys
import time
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator


@dataclass
class Talk:
    """Talk on stderr.

    Parameters
    ----------
    quiet : bool
        Whether to say nothing.
    verbose : bool
        Whether to name every step and its seconds.
    """

    quiet: bool = False
    verbose: bool = False
    _begin: float = field(default_factory=time.perf_counter)

    def say(self, text: str) -> None:
        """Say something that everybody should know."""
        if not self.quiet:
            sys.stderr.write(f"{text}\n")

    def step(self, text: str) -> None:
        """Say what was done, and the seconds since the step before."""
        now = time.perf_counter()
        if self.verbose:
            self.say(f"{text} ({now - self._begin:.2f} s)")
        self._begin = now


@contextmanager
def no_collector() -> Iterator[None]:
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
