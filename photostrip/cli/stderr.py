"""What the commands say on stderr while they work."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, field

from photostrip.visible import visible


@dataclass
class Messages:
    """What is said on stderr; failures are not in it, see ``failures``."""

    quiet: bool = False
    verbose: bool = False
    _begin: float = field(default_factory=time.perf_counter)

    def say(self, text: str) -> None:
        """Say something that everybody should know."""
        if not self.quiet:
            sys.stderr.write(f"{visible(text)}\n")

    def step(self, text: str) -> None:
        """Say what was done, and the seconds since the step before."""
        now = time.perf_counter()
        if self.verbose:
            self.say(f"{text} ({now - self._begin:.2f} s)")
        self._begin = now
