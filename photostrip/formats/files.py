"""Bytes and text of files: everything that can go wrong before the first line is read, and writing whole files or none.

Every file that the user or a document names is read through ``read_bytes``, or through ``from_disk`` where it counts as
no input: a missing table, a missing project and a missing preset are reported in the same words, and nothing waits for
a pipe, reads a device or fills the memory. Where a project travels to another machine, its files travel along as bytes,
and every reader takes them from there; either way an account says which bytes a result was made from.
"""

from __future__ import annotations

import errno
import os
import re
import stat
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field
from io import FileIO
from pathlib import Path
from typing import BinaryIO, NoReturn

from photostrip.errors import Fault, InputError
from photostrip.formats.faults import suggestion


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


Content = str | bytes | Iterable[str]  # the last: a text in pieces, each made when it is written

PIECE = 1_000_000  # characters that are encoded at a time
TEMPORARY = re.compile(r"\..+\.(\d{1,9})\.tmp")  # with the process that writes it


def write_text(path: Path, text: str | bytes, read: Iterable[str | Path] = ()) -> None:
    """Write one file, whole or not at all; missing folders are made, a device or a pipe is written to as it is.

    A text is written as UTF-8 with the line ends that it has. Errors are those of ``write_files``.
    """
    write_files(path.parent, {path.name: text}, read)


def write_files(folder: Path, files: Mapping[str, Content], read: Iterable[str | Path] = ()) -> None:
    """Write the files of one folder and those below it, all of them or none; a folder is made when it is missing.

    All contents are written first and renamed then, in the order given: put the file last that make or another program
    looks at.

    read: files that the contents were made from; none of them is replaced.
    Raises InputError when the folder is a file, one of the files a folder, or one that was read.
    Raises OSError when the disk is full or the folder must not be written to.
    """
    _make(folder)
    kept = {os.path.realpath(each) for each in read}
    for name in files:
        _make((folder / name).parent)
        if (folder / name).is_dir():
            _refuse(folder / name, "is a folder", "a file")
        if kept and os.path.realpath(folder / name) in kept:
            _refuse(folder / name, "was read, and what is written would replace it")
    waiting: list[tuple[Path, Path]] = []
    try:
        for name, content in files.items():
            target = folder / name
            if target.exists() and not target.is_file():  # a pipe or a device: renaming would replace it
                _write(target, content)
                continue
            target = Path(os.path.realpath(target))  # through a link, to where the file is
            waiting.append((target.with_name(f".{target.name}.{os.getpid()}.tmp"), target))
            try:
                _write(waiting[-1][0], content)
            except OSError as error:
                error.filename = str(target)  # the temporary file is nobody's business
                raise
        _rename(waiting)
    except BaseException:  # also when the user interrupts
        for temporary, _ in waiting:
            with suppress(OSError):
                temporary.unlink()
        raise


def sweep(folder: Path) -> None:
    """Remove the temporary files of processes that were killed while they wrote into a folder."""
    with suppress(OSError), os.scandir(folder) as entries:  # what cannot be removed does no harm
        for entry in entries:
            found = TEMPORARY.fullmatch(entry.name)
            if found and not _at_work(int(found[1])):
                Path(entry.path).unlink()


def _at_work(process: int) -> bool:
    """Whether another process, which may be writing just now, is there; where the system cannot be asked, it is."""
    if process == os.getpid():  # of an earlier one with the same number, as in a container
        return False
    if os.name == "posix":
        try:
            os.kill(process, 0)  # sends nothing
        except ProcessLookupError:
            return False
        except PermissionError:  # of another user
            return True
    return True


def _rename(waiting: Iterable[tuple[Path, Path]]) -> None:
    """Rename all files; an interrupt waits for the last, so that what stands in a folder belongs together."""
    try:
        for temporary, target in waiting:
            temporary.replace(target)
    except (KeyboardInterrupt, SystemExit):
        for temporary, target in waiting:
            with suppress(FileNotFoundError):  # it was renamed before
                temporary.replace(target)
        raise


def _write(path: Path, content: Content) -> None:
    with path.open("wb") as file:
        for piece in _encoded(content):
            file.write(piece)


def _encoded(content: Content) -> Iterator[bytes]:
    if isinstance(content, bytes):
        yield content
        return
    for text in (content,) if isinstance(content, str) else content:
        yield from (text[start : start + PIECE].encode() for start in range(0, len(text), PIECE))


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        blocking = next(place for place in (folder, *folder.parents) if place.exists())
        _refuse(blocking, "is a file", "a folder")


def _refuse(path: Path, what: str, expected: str = "") -> None:
    raise InputError(Fault(what, code="output-path", file=str(path), expected=expected, fix="choose another place"))


def make_rule(target: str | Path, sources: Iterable[str | Path]) -> str:
    """Say to make what a file was made from, as a rule for its ``include``.

    An empty rule for each source keeps make going when one is deleted.
    """
    names = [_for_make(name) for name in dict.fromkeys(map(str, sources))]
    rule = f"{_for_make(str(target))}: {' '.join(names)}\n"
    return rule + "".join(f"\n{name}:\n" for name in names)


def _for_make(name: str) -> str:
    return re.sub(r"([\s#:])", r"\\\1", name.replace("$", "$$"))
