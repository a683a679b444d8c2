"""Commands of ``photostrip`` as processes that need not load the libraries: copies of one that has loaded them.

A test that only looks at what commands print, write and return gets its ``photostrip`` from ``Forks.command``: a script
that hands its arguments, folder, environment and open files to a server, which forks. Loading takes half a second of
the processor for each command, a copy takes a hundredth. What tests of the start itself need (imports, encodings,
threads, signals) is ``python -m photostrip``.
"""

from __future__ import annotations

import marshal
import os
import select
import socket
import struct
import subprocess
import sys
import tempfile
import traceback
from contextlib import suppress
from pathlib import Path
from pkgutil import walk_packages
from typing import TYPE_CHECKING, Self

from tests.source_tree import ROOT

if TYPE_CHECKING:
    from types import TracebackType

# What commands import when they need it, beside the modules of the program.
LIBRARIES = (
    "jinja2",
    "matplotlib.backends.backend_svg",
    "matplotlib.figure",
    "pyproj.network",
    "pyproj.transformer",
    "rich.live",
    "rich.table",
    "scipy.interpolate",
    "scipy.sparse.csgraph",
    "scipy.sparse.linalg",
)
LEFT_OUT = ("photostrip.__main__",)
LENGTH = struct.Struct("<q")
# The other end, without any module that is not built in.
ASKING = """\
import marshal, os, sys, _socket
asked = marshal.dumps((sys.argv[2:], os.getcwd(), dict(os.environ)))
with_server = _socket.socket(_socket.AF_UNIX, _socket.SOCK_STREAM)
with_server.connect(sys.argv[1])
handles = b"".join(number.to_bytes(4, sys.byteorder) for number in (0, 1, 2))
with_server.sendmsg([len(asked).to_bytes(8, "little")], [(_socket.SOL_SOCKET, _socket.SCM_RIGHTS, handles)])
while asked:
    asked = asked[with_server.send(asked):]
code = with_server.recv(1)
if not code:
    sys.stderr.write("the copy of photostrip died\\n")
os._exit(code[0] if code else 99)
"""


class Forks:
    """The server, as the tests see it; it ends with the process that began it."""

    def __enter__(self) -> Self:
        self._folder = tempfile.TemporaryDirectory()
        folder = Path(self._folder.name)
        self.command = folder / "bin" / "photostrip"
        self.command.parent.mkdir()
        program, address = folder / "asking.py", folder / "socket"
        program.write_text(ASKING, encoding="utf-8")
        self.command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -I -S "{program}" "{address}" "$@"\n')
        self.command.chmod(0o755)
        environment = os.environ | {"PYTHONPATH": str(ROOT), "PYTHONUTF8": "1"}
        self._server = subprocess.Popen(
            [sys.executable, "-m", "tests.forked", str(address)],
            cwd=ROOT, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        )  # fmt: skip
        assert self._server.stdout is not None
        assert self._server.stdout.read(1), "the server did not start"
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for pipe in (self._server.stdin, self._server.stdout):
            assert pipe is not None
            pipe.close()
        self._server.wait()
        self._folder.cleanup()


# ------------------------------------------------------------------------------------------------------ the server


def load() -> None:
    """Import all that a command may import, except what only batches on many machines need."""
    from importlib import import_module

    import photostrip
    from photostrip.threads import limit_threads

    limit_threads()
    for found in walk_packages(photostrip.__path__, "photostrip."):
        if found.name not in LEFT_OUT:
            import_module(found.name)
    for name in LIBRARIES:
        import_module(name)


def serve(address: str) -> None:
    """Fork for each connection until stdin is closed."""
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(address)
        listening.listen(16)
        os.write(1, b".")
        while True:
            ready, _, _ = select.select([listening.fileno(), 0], [], [])
            with suppress(ChildProcessError):
                while os.waitpid(-1, os.WNOHANG)[0]:
                    pass
            if 0 in ready:
                return
            connection, _ = listening.accept()
            if not os.fork():
                listening.close()
                answer(connection)
            connection.close()


def answer(connection: socket.socket) -> None:
    """Be the process that was asked for, then end."""
    code = 99
    try:
        head, handles, _, _ = socket.recv_fds(connection, LENGTH.size, 3)
        text = b""
        while len(text) < LENGTH.unpack(head)[0]:
            text += connection.recv(1 << 20)
        arguments, folder, environment = marshal.loads(text)  # noqa: S302 (from our own script)
        for number, handle in enumerate(handles):
            os.dup2(handle, number)
            os.close(handle)
        os.chdir(folder)
        os.environ.clear()
        os.environ.update(environment)
        sys.argv = ["photostrip", *arguments]
        sys.stdin, sys.stdout = open(0, encoding="utf-8"), open(1, "w", encoding="utf-8")  # noqa: SIM115
        sys.stderr = open(2, "w", buffering=1, encoding="utf-8", errors="backslashreplace")  # noqa: SIM115
        from photostrip.cli.main import main

        code = main()
        sys.stdout.flush()
        sys.stderr.flush()
        connection.send(bytes([code]))
    except BaseException:  # noqa: BLE001 (what is left of it shall be seen)
        traceback.print_exc()
    finally:
        os._exit(code)


if __name__ == "__main__":
    load()
    serve(sys.argv[1])
