"""Everything that can go wrong with a file before its first line."""

from __future__ import annotations

import io
import os
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from photostrip.errors import Fault, InputError
from photostrip.formats import files
from photostrip.formats.files import decode, read_bytes

if TYPE_CHECKING:
    from collections.abc import Callable


def fault_of(function: Callable[[], object]) -> Fault:
    with pytest.raises(InputError) as caught:
        function()
    assert len(caught.value.faults) == 1
    return caught.value.faults[0]


def test_content(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(b"abc\r\n\xff")
    assert read_bytes(str(path), 6) == b"abc\r\n\xff"


def test_too_big(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(b"abcd")
    fault = fault_of(lambda: read_bytes(str(path), 3))
    assert (fault.code, fault.file) == ("file-size", str(path))


@pytest.mark.parametrize(
    ("name", "code", "fix"),
    [
        ("control.cvs", "file-missing", "did you mean `control.csv`?"),
        ("CONTROL.CSV", "file-missing", "did you mean `control.csv`?"),
        ("quite-another", "file-missing", ""),
        ("control.csv/more", "file-missing", ""),
        ("no/control.csv", "file-missing", ""),
        ("sub", "file-directory", "project.yaml"),
        ("", "file-directory", ""),
        ("empty.csv", "file-empty", ""),
        ("pipe", "file-kind", ""),
        ("a\0b", "file-name", ""),
        ("loop", "file-unreadable", ""),
        ("x" * 400, "file-unreadable", ""),
    ],
)
def test_what_cannot_be_read(tmp_path: Path, name: str, code: str, fix: str) -> None:
    (tmp_path / "control.csv").write_text("x", encoding="utf-8")
    (tmp_path / "empty.csv").touch()
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "project.yaml").touch()
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    os.mkfifo(tmp_path / "pipe")
    fault = fault_of(lambda: read_bytes(f"{tmp_path}/{name}", 100))
    assert fault.code == code
    assert fix in fault.fix
    assert "\0" not in str(fault)


@pytest.mark.parametrize("error", [PermissionError(13, "Permission denied"), OSError(5, "Input/output error")])
def test_what_the_system_refuses(monkeypatch: pytest.MonkeyPatch, error: OSError) -> None:
    def refuse(*_: object) -> int:
        raise error

    monkeypatch.setattr(os, "open", refuse)
    assert fault_of(lambda: read_bytes("a.csv", 100)).code == "file-unreadable"


class Busy(io.FileIO):
    """A file that another program writes to while it is read."""

    written = b""

    def read(self, size: int | None = -1, /) -> bytes:
        data = super().read(-1 if size is None else size)
        Path(str(self.name)).write_bytes(self.written)
        return data


@pytest.mark.parametrize("written", [b"abcd", b"a", b""])
def test_a_file_that_changes_while_it_is_read(tmp_path: Path, written: bytes) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(b"abc")
    with Busy(path) as stream:
        stream.written = written
        fault = fault_of(lambda: files._content(str(path), stream, 100))
    assert fault.code == "file-changed"


@pytest.mark.parametrize(
    ("data", "code", "line", "column"),
    [
        ("photo".encode("utf-16"), "encoding", 0, 0),
        (b"PK\x03\x04...", "binary", 0, 0),
        (b"a\0b", "binary", 0, 0),
        (b"a,b\nc,\xff\n", "encoding", 2, 3),
        ("é,".encode() + b"\xe9", "encoding", 1, 3),
        ("точка".encode("cp1251"), "encoding", 1, 1),
    ],
)
def test_what_is_not_text(data: bytes, code: str, line: int, column: int) -> None:
    fault = fault_of(lambda: decode("a.csv", data))
    assert (fault.code, fault.line, fault.column) == (code, line, column)


def test_a_byte_order_mark_is_taken_off() -> None:
    assert decode("a.csv", "\ufeffx\ufeff".encode()) == ("x\ufeff", True)
    assert decode("a.csv", b"x") == ("x", False)
