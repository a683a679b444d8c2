"""The folder that a batch writes into: one batch at a time, whole results, and what can be trusted of earlier ones.

A result is trusted when its record says that it was made by this very program with these settings from files with this
content, and when every file of the result has the content that the record gives. The record is written after all the
others; so a result that was interrupted, mixed with an older one, edited or damaged is computed again.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path

from photostrip import __version__
from photostrip.batch.evaluation import Answer
from photostrip.batch.selection import ChosenProject
from photostrip.errors import Fault, InputError
from photostrip.formats.batch import SCHEMA, parsed_record, record_text
from photostrip.formats.files import LARGEST_FILE, digest, from_disk, sweep, write_files
from photostrip.notes import Document

LOCK = ".batch.lock"
RECORD = "batch.json"
PAGE = "report.html"
SUMMARIES = ("summary.txt", "summary.csv", "summary.json", "summary.html", "junit.xml")
LIBRARIES = ("numpy", "scipy", "pyproj")  # whose version can change a number


@cache
def program() -> dict[str, str]:
    """Return what computes: the version, the digest of the program's own files, the versions of the libraries below it.

    Two programs for which it is the same give the same results.
    """
    from importlib.metadata import version

    package = Path(__file__).parents[1]
    files = sorted(file for ending in ("*.py", "*.yaml") for file in package.rglob(ending))
    account = "\n".join(f"{file.relative_to(package).as_posix()} {digest(file.read_bytes())}" for file in files)
    package_version = {"photostrip": __version__, "source": digest(account.encode())}
    return package_version | {name: version(name) for name in LIBRARIES}


class ResultFolder:
    """The folder of a batch; make it with ``opened``."""

    def __init__(self, path: Path, overrides: Sequence[str] = ()) -> None:
        self.path, self.overrides = path, list(overrides)

    def unchanged(self, chosen: ChosenProject, *, with_page: bool = False) -> Document | None:
        """Return the line of the summary of a result that can be trusted; None when the project must be computed.

        with_page: whether its report must be there as a page, too.
        """
        place = self.path / chosen.output
        sweep(place)
        record = self._record(place)
        if record is None or record["program"] != program() or record["set"] != self.overrides:
            return None
        folder = os.path.split(chosen.project)[0]
        inputs = {_back(name, folder): content for name, content in record["inputs"].items()}
        if chosen.project not in inputs or not all(_is(Path(name), content) for name, content in inputs.items()):
            return None
        outputs = record["outputs"]
        if with_page and PAGE not in outputs:
            return None
        if "result.json" not in outputs or not all(_is(place / name, content) for name, content in outputs.items()):
            return None
        outcome: Document = record["outcome"]
        return outcome

    def files_of(self, chosen: ChosenProject) -> list[str]:
        """Return the files that the result of a project was made from; none when there is no result."""
        record = self._record(self.path / chosen.output)
        if record is None or record["project"] != self._name(chosen):
            return []
        folder = os.path.split(chosen.project)[0]
        return [_back(name, folder) for name, content in record["inputs"].items() if content is not None]

    def refused(self, chosen: ChosenProject) -> Fault | None:
        """Say why a project must not be written where it would go: the result of another one stands there.

        A project that was moved, but not changed, is no other one.
        """
        record = self._record(self.path / chosen.output)
        if record is None or record["project"] == self._name(chosen):
            return None
        content = record["inputs"].get(os.path.split(chosen.project)[1])
        if content is not None and _is(Path(chosen.project), content):
            return None
        there = self.path / chosen.output
        message = f"its result would replace that of another project, {record['project']} (as a path from there)"
        return Fault(message, "output-taken", str(there), fix="choose another folder with -o, or use --force")

    def write(self, chosen: ChosenProject, answer: Answer) -> None:
        """Write a result, the record last; when that fails, what was there before is as it was."""
        folder = os.path.split(chosen.project)[0]
        place = self.path / chosen.output
        above = f"{folder}{os.sep}" if folder else ""
        inputs = {name.removeprefix(above): content for name, content in answer.inputs.items()}
        record: Document = {
            "photostrip_batch_record": SCHEMA,
            "program": program(),
            "project": self._name(chosen),
            "set": self.overrides,
            "inputs": dict(sorted(inputs.items())),
            "outputs": {name: digest(_bytes(content)) for name, content in sorted(answer.files.items())},
            "outcome": answer.outcome,
        }
        sweep(place)
        read = [name for name, content in answer.inputs.items() if content is not None]
        write_files(place, {**answer.files, RECORD: record_text(record)}, read)

    def forget_summaries(self) -> None:
        """Remove the summary of an earlier batch, which would not be true while this one runs, or if it is killed."""
        sweep(self.path)
        for name in SUMMARIES:
            (self.path / name).unlink(missing_ok=True)

    def _name(self, chosen: ChosenProject) -> str:
        """Path of a project relative to its result."""
        return os.path.relpath(chosen.project, self.path / chosen.output).replace(os.sep, "/")

    @staticmethod
    def _record(place: Path) -> Document | None:
        try:
            return parsed_record(from_disk(str(place / RECORD), LARGEST_FILE))
        except InputError:
            return None


def _bytes(content: str | bytes) -> bytes:
    return content if isinstance(content, bytes) else content.encode()


@contextmanager
def opened(path: Path, overrides: Sequence[str] = ()) -> Iterator[ResultFolder]:
    """Open a folder, made when it is missing, for one batch, and remove the summary of an earlier one.

    The lock is the system's: it is gone with the process that holds it, however that ends.
    """
    import fcntl

    write_files(path, {})  # makes it, or says what is in its way
    with (path / LOCK).open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            message = "another batch is writing into this folder"
            fix = "wait for its end, or choose another folder with -o"
            raise InputError(Fault(message, "batch-running", str(path), fix=fix)) from None
        folder = ResultFolder(path, overrides)
        folder.forget_summaries()
        yield folder


def _is(file: Path, content: str | None) -> bool:
    """Whether a file has the content with a digest; None: whether it is not there."""
    try:
        return digest(from_disk(str(file), LARGEST_FILE)) == content
    except InputError as refusal:
        return content is None and refusal.faults[0].code == "file-missing"


def _back(name: str, folder: str) -> str:
    return os.path.join(folder, name)  # noqa: PTH118 (`..` and `.` stay as they were)
