"""Writing files so that there is never a half one: to a temporary file beside the target, which is then renamed.

An interrupted run, a full disk or a number that cannot be written leaves an earlier result as it was. Nothing is
forced onto the disk (fsync): that guards against power cuts, costs more than the whole run and is no business
of a program whose results can be computed again.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path

from photostrip.errors import Fault, InputError

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
