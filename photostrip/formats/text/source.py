"""Where the bytes of files come from, and an account of what was read.

Usually files come from the disk. Where a project travels to another machine, its files travel along as bytes, and
every reader takes them from there instead. Either way the account says which bytes a result was made from.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path


@dataclass
class Source:
    """Where files come from while one project is read."""

    # content by path as the user typed it; None: the files are read from the disk
    given: Mapping[str, bytes] | None = None
    folder: str = ""  # working folder to which relative paths refer; empty: that of the process
    grids: Path | None = None  # folder that stands in for the project's folder where grid files are looked for
    digests: dict[str, str] = field(default_factory=dict)  # SHA-256 of every file read so far, by its path


_current: ContextVar[Source | None] = ContextVar("source", default=None)


def digest(data: bytes) -> str:
    """Return the SHA-256 of some bytes as 64 hexadecimal digits."""
    import hashlib

    return hashlib.sha256(data).hexdigest()


@contextmanager
def reading_from(source: Source) -> Iterator[Source]:
    """Let all readers take their files from a source, and keep its account."""
    token = _current.set(source)
    try:
        yield source
    finally:
        _current.reset(token)


def current() -> Source | None:
    """Return the source that readers take their files from; None: the disk, without an account."""
    return _current.get()


def seen_from(file: str, folder: str | Path) -> str:
    """Return a path relative to a folder, with slashes on every system, as seen from the current source's folder.

    Raises ValueError when there is no way, because they stand on different drives.
    """
    source = current()
    base = source.folder if source is not None else ""
    return os.path.relpath(os.path.join(base, file), os.path.join(base, folder)).replace(os.sep, "/")  # noqa: PTH118
