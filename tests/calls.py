"""Commands as they are typed, and what they print."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable

import pytest

Capture = pytest.CaptureFixture[str]
Call = Callable[..., tuple[int, str, str]]  # arguments to exit code, stdout, stderr
Answer = Callable[..., str]  # arguments to stdout, of a command that must succeed


def rows(text: str) -> list[dict[str, str]]:
    """Give the rows of a CSV table."""
    return list(csv.DictReader(io.StringIO(text, newline="")))


def words(text: str) -> str:
    """Give a text on one line, without the breaks of the page."""
    return " ".join(text.split())
