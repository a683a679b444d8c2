"""Copies of a process that has loaded the libraries behave as processes of their own."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pathlib import Path

    from tests.forked import Forks

pytestmark = pytest.mark.slow  # starting what is copied takes 2 s, and nothing that is not slow needs it


@pytest.mark.parametrize(
    ("code", "ending"),
    [
        ("pass", 0),
        ("raise SystemExit(3)", 3),
        ("raise SystemExit('a reason')", 1),
        ("1 / 0", 1),
        ("import os; os._exit(5)", 5),
        ("import os; os.kill(os.getpid(), 11)", -signal.SIGSEGV),
        ("import os; os.kill(os.getpid(), 9)", -signal.SIGKILL),
    ],
)
def test_a_script_ends_as_its_copy_does(forks: Forks, code: str, ending: int) -> None:
    assert subprocess.run([forks.python, "-c", code], capture_output=True, check=False).returncode == ending


def test_a_copy_has_the_arguments_folder_environment_and_files_of_its_script(forks: Forks, tmp_path: Path) -> None:
    (tmp_path / "program.py").write_text(
        "import os, sys\n"
        "class Kept: pass\n"
        "os.write(int(sys.argv[2]), b'; '.join(os.fsencode(each) for each in (\n"
        "    sys.argv[1], os.getcwd(), os.environ['COLOUR'], sys.executable, input(), Kept.__module__)))\n",
        encoding="utf-8",
    )
    reading, writing = os.pipe()
    command = [str(forks.python), "program.py", "a b", str(writing)]
    environment = os.environ | {"COLOUR": "blue"}
    subprocess.run(
        command, cwd=tmp_path, env=environment, pass_fds=[writing], input="said\n", text=True, check=True
    )  # fmt: skip
    os.close(writing)
    with open(reading, encoding="utf-8") as stream:  # noqa: PTH123 (a pipe)
        assert stream.read() == f"a b; {tmp_path}; blue; {forks.python}; said; __main__"


def test_a_copy_dies_with_its_script(forks: Forks) -> None:
    code = "import os, time; print(os.getpid(), flush=True); time.sleep(100)"
    with subprocess.Popen([forks.python, "-c", code], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        copy = int(process.stdout.readline())
        process.kill()
    assert copy != process.pid
    for _ in range(300):
        try:
            os.kill(copy, 0)
        except ProcessLookupError:
            return
        time.sleep(0.1)
    pytest.fail("the copy lives on")
