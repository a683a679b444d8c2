"""Bytes and text of a file: everything that can go wrong before its first line is read, in one form.

Every file that the user or a document names is read through ``read_bytes``, or through ``from_disk`` where it counts as
no input: a missing table, a missing project and a missing preset are reported in the same words, and nothing waits for
a pipe, reads a device or fills the memory.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Mapping
from io import FileIO
from pathlib import Path
from typing import BinaryIO, NoReturn

from photostrip.errors import Fault, InputError
from photostrip.formats.text.findings import suggestion
from photostrip.formats.text.source import current, digest

MEGABYTE = 1_000_000
LARGEST_FILE = 1000 * MEGABYTE  # of files that are compared or handed on only; a world of geoid heights has 930 MB
BOM = b"\xef\xbb\xbf"
BYTE_ORDER_MARK = "begins with a byte order mark; it was skipped"
GZIP = b"\x1f\x8b"
ZIP = b"PK\x03\x04"
UTF16 = (b"\xff\xfe", b"\xfe\xff")
CONTROL = dict.fromkeys([*range(9), 11, 12, *range(14, 32), 127])  # characters that no text file has


def refuse(file: str, code: str, message: str, *, expected: str = "", fix: str = "") -> NoReturn:
    """Refuse a whole file: raise an ``InputError`` of one fault."""
    raise InputError(Fault(message, code=code, file=file, expected=expected, fix=fix))


def read_bytes(file: str, limit: int) -> bytes:
    """Read a file that the user named.

    Raises InputError when it is missing, a folder, unreadable, too big, empty or changed while it was read.
    """
    source = current()
    if source is not None and source.given is not None:
        data = _travelled(file, source.given, limit)
    else:
        data = from_disk(file, limit)
    if source is not None:
        source.digests[file] = digest(data)
    return data


def _travelled(file: str, given: Mapping[str, bytes], limit: int) -> bytes:
    """Take a file from those that came along with the project."""
    if file not in given:
        refuse(file, "file-missing", "does not exist")
    data = given[file]
    _fits(file, len(data), limit)
    if not data:
        refuse(file, "file-empty", "is empty")
    return data


def _fits(file: str, size: int, limit: int) -> None:
    if size > limit:
        message = f"has {size / MEGABYTE:.0f} MB"
        refuse(file, "file-size", message, expected=f"at most {limit / MEGABYTE:.0f} MB; is it the right file?")


def from_disk(file: str, limit: int) -> bytes:
    """Read a file that a document names, and take no account of it; raises what ``read_bytes`` does."""
    try:
        # without O_NONBLOCK a pipe that nobody writes to would wait forever, before it can be seen to be one
        handle = os.open(file, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
        with os.fdopen(handle, "rb") as stream:
            return _content(file, stream, limit)
    except (OSError, ValueError) as error:
        _explain(file, error)


def _content(file: str, stream: BinaryIO | FileIO, limit: int) -> bytes:
    """Read an open file and make sure that it stood still."""
    before = os.fstat(stream.fileno())
    if stat.S_ISDIR(before.st_mode):
        raise IsADirectoryError(errno.EISDIR, "is a directory", file)
    if not stat.S_ISREG(before.st_mode):
        refuse(file, "file-kind", "is a device or a pipe", expected="a file")
    _fits(file, before.st_size, limit)
    data = stream.read(before.st_size + 1)
    after = os.fstat(stream.fileno())
    if (before.st_mtime_ns, before.st_size) != (after.st_mtime_ns, after.st_size) or len(data) != before.st_size:
        refuse(file, "file-changed", "changed while it was read", fix="run again when it is complete")
    if not data:
        refuse(file, "file-empty", "is empty")
    return data


def _explain(file: str, error: OSError | ValueError) -> NoReturn:
    """Say in words why a file cannot be read."""
    if isinstance(error, IsADirectoryError):
        inside = Path(file) / "project.yaml"
        fix = f"did you mean `{inside}`?" if inside.is_file() else ""
        refuse(file, "file-directory", "is a folder", expected="a file", fix=fix)
    if isinstance(error, FileNotFoundError | NotADirectoryError):
        folder, name = os.path.split(file)
        if folder and not Path(folder).is_dir():
            refuse(file, "file-missing", f"does not exist: there is no folder `{folder}`")
        refuse(file, "file-missing", "does not exist", fix=suggestion(name, _neighbours(folder)))
    if isinstance(error, PermissionError):
        refuse(file, "file-unreadable", "may not be read", fix="give yourself read permission")
    if isinstance(error, ValueError):  # a NUL character in the path
        refuse(file.replace("\0", "?"), "file-name", "is no file name")
    refuse(file, "file-unreadable", f"cannot be read ({(error.strerror or str(error)).lower()})")


def _neighbours(folder: str) -> list[str]:
    try:
        return sorted(each.name for each in Path(folder or ".").iterdir())
    except OSError:
        return []


def decode(file: str, data: bytes) -> tuple[str, bool]:
    """Turn the bytes of a text file into text, and say whether a byte order mark was skipped."""
    if data.startswith(UTF16):
        refuse(file, "encoding", "is UTF-16 text", expected="UTF-8", fix="save it as UTF-8")
    if data.startswith(ZIP):
        refuse(file, "binary", "is a zip archive or a spreadsheet", expected="text", fix="export it as CSV (UTF-8)")
    marked = data.startswith(BOM)
    body = data[len(BOM) :] if marked else data
    if b"\0" in body:
        refuse(file, "binary", "is not text: it has NUL bytes", expected="UTF-8 text")
    try:
        return body.decode(), marked
    except UnicodeDecodeError as error:
        head = body[: error.start]
        line = head.count(b"\n") + 1
        column = len(head[head.rfind(b"\n") + 1 :].decode()) + 1
        message = f"byte 0x{body[error.start]:02x} is not UTF-8 text"
        fault = Fault(
            message=message,
            code="encoding",
            file=file,
            line=line,
            column=column,
            expected="UTF-8",
            fix="save the file as UTF-8",
        )
        raise InputError(fault) from None
