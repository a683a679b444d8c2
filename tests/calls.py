"""Commands as they are typed, and what they print."""

from __future__ import annotations

from collections.abc import Callable

import pytest

Capture = pytest.CaptureFixture[str]
Call = Callable[..., tuple[int, str, str]]  # arguments to exit code, stdout, stderr
Answer = Callable[..., str]  # arguments to stdout, of a command that must succeed
