"""Processes that need not load the libraries: copies of one that has loaded them.

A test that only looks at what commands print, write and return gets its ``photostrip`` from ``Forks.command``, and its
``python`` from ``Forks.python``: scripts that hand their arguments, folder, environment and open files to a server,
which forks. Loading takes half a second of the processor for each process, a copy takes a hundredth. The server has
adjusted a project, too: that halves what the next one takes. What a copy starts with ``sys.executable`` is a copy, too.
A script ends as its copy does, by the same code or signal, and a copy whose script is gone is killed. What tests of the
start itself need (imports, encodings, threads, limits, signals that can be caught) is ``sys.executable`` as it is.
"""

from __future__ import annotations

import atexit
import fcntl
import marshal
import multiprocessing
import os
import runpy
import select
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import traceback
from contextlib import redirect_stdout, suppress
from io import StringIO
from pathlib import Path
from pkgutil import walk_packages
from types import ModuleType
from typing import TYPE_CHECKING, Self

from tests.source_tree import ROOT

if TYPE_CHECKING:
    from collections.abc import Sequence

# What commands import when they need it, beside the modules of the program.
LIBRARIES = (
    "jinja2", "pyproj.network", "pyproj.transformer", "rich.live", "rich.table", "scipy.interpolate",
    "scipy.sparse.csgraph", "scipy.sparse.linalg",
)  # fmt: skip
FLAGS = {"-E", "-I", "-S", "-B", "-u"}  # of the interpreter: too late for a copy, and none needs them
LENGTH = struct.Struct("<q")
STATUS = struct.Struct("<i")
MOST_FILES = 100  # that one process hands to another
OUT_OF_THE_WAY = 120  # no file that is handed over has a number like this or higher
# The other end, of modules that are built in alone: ``os`` and ``signal`` take as long to import as all else it does.
ASKING = """\
import _signal, _socket, marshal, posix, sys
names = []
for name in posix.listdir("/dev/fd"):
    try:
        if posix.get_inheritable(int(name)):
            names.append(int(name))
    except OSError:
        pass
names.sort()
asked = marshal.dumps((sys.argv[2:], posix.getcwd(), posix.environ, names))
with_server = _socket.socket(_socket.AF_UNIX, _socket.SOCK_STREAM)
with_server.connect(sys.argv[1])
handles = b"".join(number.to_bytes(4, sys.byteorder) for number in names)
with_server.sendmsg([len(asked).to_bytes(8, "little")], [(_socket.SOL_SOCKET, _socket.SCM_RIGHTS, handles)])
while asked:
    asked = asked[with_server.send(asked):]
for number in names:
    if number > 2:
        posix.close(number)
code = posix.waitstatus_to_exitcode(int.from_bytes(with_server.recv(4), "little"))
if code < 0:
    if -code not in (_signal.SIGKILL, _signal.SIGSTOP):
        _signal.signal(-code, _signal.SIG_DFL)
    posix.kill(posix.getpid(), -code)
posix._exit(code)
"""


class Forks:
    """The server, as the tests see it; it ends with the process that began it."""

    def __init__(self, python: str = sys.executable, libraries: Sequence[str] = (), **environment: str) -> None:
        self.started_by, self.libraries, self.environment = python, libraries, environment

    def with_libraries(self, *libraries: str, **environment: str) -> Forks:
        """Give a server that is a copy of this one and loads more."""
        return Forks(str(self.python), libraries, **environment)

    def __enter__(self) -> Self:
        self._folder = tempfile.TemporaryDirectory()
        folder = Path(self._folder.name)
        self.python, self.command = folder / "python", folder / "bin" / "photostrip"  # apart: no PATH has both
        self.command.parent.mkdir()
        program, address = folder / "asking.py", folder / "socket"
        program.write_text(ASKING, encoding="utf-8")
        for script, more in ((self.python, ""), (self.command, "-m photostrip ")):
            ask = f'"{sys.executable}" -I -S "{program}" "{address}" "{self.python}"'
            script.write_text(f'#!/bin/sh\nexec {ask} {more}"$@"\n')
            script.chmod(0o755)
        environment = os.environ | {"PYTHONPATH": str(ROOT), "PYTHONUTF8": "1"} | self.environment
        self._server = subprocess.Popen(
            [self.started_by, "-m", "tests.forked", str(address), *self.libraries],
            cwd=ROOT, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        )  # fmt: skip
        assert self._server.stdout is not None
        assert self._server.stdout.read(1), "the server did not start"
        return self

    def __exit__(self, *_: object) -> None:
        for pipe in (self._server.stdin, self._server.stdout):
            assert pipe is not None
            pipe.close()
        self._server.wait()
        self._folder.cleanup()


def load(libraries: Sequence[str]) -> None:
    """Import all that a command may import, except what only batches on many machines need, and use it."""
    import gc
    from importlib import import_module

    import photostrip
    from photostrip.threads import limit_threads

    limit_threads()
    from photostrip.cli.main import main
    from tests.results import spec, write_project

    for found in walk_packages(photostrip.__path__, "photostrip."):
        if found.name != "photostrip.__main__":
            import_module(found.name)
    for name in libraries:
        import_module(name)
    with tempfile.TemporaryDirectory() as folder, redirect_stdout(StringIO()):
        project = write_project(Path(folder), spec())  # what the libraries do at the first one takes as long as itself
        assert main(["run", str(project), "-o", str(project.parent / "out"), "--html", "--quiet"]) == 0
    gc.collect()
    gc.freeze()  # no copy looks through what it has from here


def serve(address: str) -> None:
    """Fork for each connection until stdin is closed; tell each how its copy ended."""
    copies: dict[int, socket.socket] = {}
    dead, signalled = socket.socketpair()
    signalled.setblocking(False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(signalled.fileno())
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(address)
        listening.listen(64)
        os.write(1, b".")
        while True:
            listened_to: list[int | socket.socket] = [0, dead, listening, *copies.values()]
            ready, _, _ = select.select(listened_to, [], [])
            if 0 in ready:
                break
            for number, connection in copies.items():
                if connection in ready:  # its end: the script is gone
                    os.kill(number, signal.SIGKILL)
            if dead in ready:
                dead.recv(1 << 10)
                for number, status in iter(ended, None):
                    with copies.pop(number) as connection, suppress(OSError):
                        connection.send(STATUS.pack(status))
            if listening in ready:
                connection, _ = listening.accept()
                copies[copy(connection, [listening, dead, signalled, *copies.values()])] = connection
    for number in copies:
        os.kill(number, signal.SIGKILL)
        os.waitpid(number, 0)


def copy(connection: socket.socket, others: list[socket.socket]) -> int:
    """Fork for a connection; give the process of the copy."""
    head, handles, _, _ = socket.recv_fds(connection, LENGTH.size, MOST_FILES)
    asked = b""
    while len(asked) < LENGTH.unpack(head)[0]:
        asked += connection.recv(1 << 20)
    number = os.fork()
    if not number:
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        for mine in (connection, *others):
            mine.close()
        answer(asked, handles)
    for handle in handles:
        os.close(handle)
    return number


def ended() -> tuple[int, int] | None:
    """Give a copy that ended and its status, if there is one."""
    try:
        number, status = os.waitpid(-1, os.WNOHANG)
    except ChildProcessError:
        return None
    return (number, status) if number else None


def answer(asked: bytes, handles: list[int]) -> None:
    """Be the process that was asked for, then end."""
    code = 99
    try:
        arguments, folder, environment, numbers = marshal.loads(asked)  # noqa: S302 (from our own script)
        away = [fcntl.fcntl(handle, fcntl.F_DUPFD_CLOEXEC, OUT_OF_THE_WAY) for handle in handles]
        for handle in handles:
            os.close(handle)
        for number, handle in zip(numbers, away, strict=True):
            os.dup2(handle, number)
            os.close(handle)
        os.chdir(folder)
        os.environb.clear()
        os.environb.update(environment)
        sys.stdin, sys.stdout = open(0, encoding="utf-8"), open(1, "w", encoding="utf-8")  # noqa: SIM115
        sys.stderr = open(2, "w", buffering=1, encoding="utf-8", errors="backslashreplace")  # noqa: SIM115
        sys.executable = arguments[0]
        multiprocessing.set_executable(sys.executable)
        try:
            interpret([each for each in arguments[1:] if each not in FLAGS])
            code = 0
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(end.code is not None)
            if isinstance(end.code, str):
                sys.stderr.write(f"{end.code}\n")
        atexit._run_exitfuncs()
        with suppress(ValueError):  # closed
            sys.stdout.flush()
    except BaseException:  # noqa: BLE001 (what is left of it shall be seen)
        traceback.print_exc()
        code = 1
    finally:
        os._exit(code)


def interpret(arguments: list[str]) -> None:
    """Do what the interpreter does with arguments."""
    kind, *rest = arguments
    if kind == "-m":
        sys.argv = rest
        runpy.run_module(rest[0], run_name="__main__", alter_sys=True)
        return
    program = ModuleType("__main__")
    sys.modules["__main__"] = sys.modules["__mp_main__"] = program  # the latter is the name for other processes
    if kind == "-c":
        sys.argv = ["-c", *rest[1:]]
        text = rest[0]
    else:
        sys.argv = arguments
        sys.path.insert(0, str(Path(kind).resolve().parent))
        program.__file__, text = kind, Path(kind).read_text(encoding="utf-8")
    exec(compile(text, kind, "exec"), vars(program))  # noqa: S102 (as it was asked)


if __name__ == "__main__":
    low = [os.open(os.devnull, os.O_RDONLY) for _ in range(OUT_OF_THE_WAY - 20)]  # not for files that libraries open
    load([*LIBRARIES, *sys.argv[2:]])
    for each in low:
        os.close(each)
    serve(sys.argv[1])
