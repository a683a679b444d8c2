"""Files: what can go wrong before the first line is read; written whole or not at all; rules for make."""

from __future__ import annotations

import io
import os
import shutil
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from photostrip.errors import Fault, InputError
from photostrip.formats import files
from photostrip.formats.files import decode, make_rule, read_bytes, write_files, write_text
from tests.loops import nonempty

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator


def fault_of(function: Callable[[], object]) -> Fault:
    with pytest.raises(InputError) as caught:
        function()
    assert len(caught.value.faults) == 1
    return caught.value.faults[0]


def test_content_up_to_the_limit(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(b"abc\r\n\xff")
    assert read_bytes(str(path), 6) == b"abc\r\n\xff"
    fault = fault_of(lambda: read_bytes(str(path), 5))
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


def texts_in(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text(encoding="utf-8") for path in folder.iterdir()}


def test_files_are_written_as_the_user_wants_and_missing_folders_made(tmp_path: Path) -> None:
    folder, before = tmp_path / "a" / "b", os.umask(0o027)
    try:
        write_files(folder, {"one.csv": "1\n", "two.json": "µ\r\n"})
    finally:
        os.umask(before)
    assert (folder / "one.csv").stat().st_mode & 0o777 == 0o640  # readable by others of the group
    assert (folder / "two.json").read_bytes() == "µ\r\n".encode()
    write_files(folder, {"one.csv": "2\n"})
    assert sorted(texts_in(folder)) == ["one.csv", "two.json"]


def test_a_text_is_made_piece_by_piece_while_it_is_written(tmp_path: Path) -> None:
    def pieces(count: int) -> Iterator[str]:
        for number in range(count):
            yield f"{number}µ" * files.PIECE
        if count > 2:
            raise OSError(28, "No space left on device")

    write_files(tmp_path, {"one.csv": pieces(2)})
    assert (tmp_path / "one.csv").read_text(encoding="utf-8") == "0µ" * files.PIECE + "1µ" * files.PIECE
    with pytest.raises(OSError, match="No space left"):
        write_files(tmp_path, {"one.csv": pieces(3)})
    assert texts_in(tmp_path) == {"one.csv": "0µ" * files.PIECE + "1µ" * files.PIECE}


def test_a_failure_in_the_middle_leaves_everything_as_it_was_and_names_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_files(tmp_path, {"one.csv": "old", "two.csv": "old"})
    with pytest.raises(UnicodeEncodeError):
        write_files(tmp_path, {"one.csv": "new", "two.csv": "\ud800"})
    assert texts_in(tmp_path) == {"one.csv": "old", "two.csv": "old"}
    write = files._write

    def full(self: Path, data: str | Iterable[str]) -> None:
        if "two.csv" in self.name:
            write(self, "".join(data)[:1])
            raise OSError(28, "No space left on device", str(self))
        write(self, data)

    monkeypatch.setattr(files, "_write", full)
    with pytest.raises(OSError, match="No space left") as caught:
        write_files(tmp_path, {"one.csv": "new", "two.csv": "new"})
    assert caught.value.filename == str(tmp_path / "two.csv")
    assert texts_in(tmp_path) == {"one.csv": "old", "two.csv": "old"}


def test_an_interrupt_leaves_no_temporary_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write = files._write

    def interrupted(self: Path, data: str) -> None:
        write(self, data)
        raise KeyboardInterrupt

    monkeypatch.setattr(files, "_write", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_text(tmp_path / "one.csv", "new")
    assert texts_in(tmp_path) == {}


@pytest.mark.parametrize("which", [0, 1, 2])
def test_an_interrupt_while_files_are_renamed_leaves_them_all_new(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, which: int
) -> None:
    names = ["one.csv", "two.csv", "three.json"]
    write_files(tmp_path, dict.fromkeys(names, "old"))
    rename = Path.replace
    seen: list[str] = []

    def interrupted(self: Path, target: Path) -> Path:
        seen.append(target.name)
        renamed = rename(self, target)
        if len(seen) == which + 1:
            raise KeyboardInterrupt
        return renamed

    monkeypatch.setattr(Path, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_files(tmp_path, dict.fromkeys(names, "new"))
    assert texts_in(tmp_path) == dict.fromkeys(names, "new")


def test_a_file_that_was_read_is_not_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (given := tmp_path / "points.csv").write_text("given", encoding="utf-8")
    (tmp_path / "link.csv").symlink_to(given)
    monkeypatch.chdir(tmp_path)
    for name in nonempty(("points.csv", "link.csv")):
        with pytest.raises(InputError, match=rf"{name}: was read, and what is written would replace it"):
            write_files(tmp_path, {"one.csv": "new", name: "new"}, ["points.csv"])
    assert texts_in(tmp_path) == {"points.csv": "given", "link.csv": "given"}


def test_a_file_where_a_folder_should_be_is_refused_and_the_reverse(tmp_path: Path) -> None:
    (tmp_path / "one.csv").mkdir()
    with pytest.raises(InputError, match=r"one\.csv: is a folder; expected a file"):
        write_files(tmp_path, {"zero.csv": "", "one.csv": ""})
    assert [path.name for path in tmp_path.iterdir()] == ["one.csv"]
    (tmp_path / "file").write_text("", encoding="utf-8")
    for place in ("file", "file/below"):
        with pytest.raises(InputError, match="file: is a file; expected a folder"):
            write_files(tmp_path / place, {"one.csv": ""})


def test_a_link_stays_a_link_and_a_pipe_a_pipe(tmp_path: Path) -> None:
    target = tmp_path / "elsewhere" / "real.txt"
    write_text(target, "old")
    (tmp_path / "link.txt").symlink_to(target)
    write_text(tmp_path / "link.txt", "new")
    assert (tmp_path / "link.txt").is_symlink()
    assert target.read_text(encoding="utf-8") == "new"
    pipe = tmp_path / "pipe"  # of the test's own: a mistake would replace a device of the whole machine
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    write_text(pipe, "text")
    assert os.read(reader, 9) == b"text"
    os.close(reader)
    assert pipe.is_fifo()


# -------------------------------------------------------------------------------------------------- rules of make


@pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")
def test_make_understands_odd_names(tmp_path: Path) -> None:
    names = ["with blank.csv", "with#hash.csv", "with$dollar.csv", "straße.csv"]
    for name in names:
        (tmp_path / name).write_text("", encoding="utf-8")
    assert make_rule("out", ["p.yaml", "o.csv", "p.yaml"]) == "out: p.yaml o.csv\n\np.yaml:\n\no.csv:\n"
    rule = make_rule("target", names)
    (tmp_path / "Makefile").write_text(f"target:\n\t@echo made\n{rule}", encoding="utf-8")

    def made() -> str:
        # a make that runs the tests hands its flags on, and they print the folders that are entered
        alone = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
        return subprocess.run(["make"], cwd=tmp_path, env=alone, capture_output=True, text=True, check=True).stdout

    (tmp_path / "target").write_text("", encoding="utf-8")
    for path in tmp_path.iterdir():
        os.utime(path, (1000, 1000))
    os.utime(tmp_path / "target", (2000, 2000))
    assert "made" not in made()
    for name in nonempty(names):
        os.utime(tmp_path / name, (3000, 3000))
        assert made() == "made\n", name
        os.utime(tmp_path / name, (1000, 1000))
    (tmp_path / names[0]).unlink()
    assert made() == "made\n"
