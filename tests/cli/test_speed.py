"""``photostrip check`` on a thousand photos: a small multiple of loading the libraries, and little memory."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from photostrip.simulation.spec import Control, Flight, Points, Spec
from tests.results import write_project
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from pathlib import Path

RATIO = 8.5  # to loading the libraries (0.14 to 0.35 s of the processor): 6.0; done twice, it is 9.2 to 9.9
MEMORY_MB = 200
LIBRARIES = "import numpy, pyproj, typer, yaml"
# A small process starts the command: the system counts the memory of the process that starts one as its own at first.
MEASURED = """
import json, os, subprocess, sys
with open(sys.argv[1], "w", encoding="utf-8") as out:
    process = subprocess.Popen(sys.argv[2:], stdout=out)
    _, status, used = os.wait4(process.pid, 0)
print(json.dumps([os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime, used.ru_maxrss]))
"""


@pytest.mark.slow
def test_a_thousand_photos_are_formed_and_checked_in_about_two_seconds(tmp_path: Path) -> None:
    """Seconds of the processor, at their best, in units of loading the libraries in turn with it."""
    spec = Spec(
        name="big",
        flight=Flight(photos=250, strips=4, side_lap_percent=30.0),
        points=Points(extra_per_model=6),
        control=Control(bands=12, per_band=3, check=200),
    )
    path = write_project(tmp_path / "big", spec)
    assert (path.parent / "observations.csv").read_text(encoding="utf-8").count("\n") > 30_000
    program = [sys.executable, "-m", "photostrip", "check", str(path)]
    libraries = [sys.executable, "-c", LIBRARIES]
    taken, unit = [], []
    for _ in range(3):
        seconds, kilobytes = measured(program, tmp_path / "out.txt")
        taken.append(seconds)
        assert kilobytes < MEMORY_MB * 1024
        unit.append(measured(libraries, tmp_path / "none.txt")[0])
        if min(taken) < RATIO * min(unit):
            break  # what is fast enough is not tried again
    assert "1000 in 4 strips" in (tmp_path / "out.txt").read_text(encoding="utf-8")
    assert min(taken) < RATIO * min(unit)


def measured(command: list[str], out: Path) -> tuple[float, int]:
    """Run a command that must succeed: seconds of the processor, and kilobytes."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    call = [sys.executable, "-c", MEASURED, str(out), *command]
    done = subprocess.run(call, env=environment, capture_output=True, text=True, check=True)
    code, seconds, kilobytes = json.loads(done.stdout)
    assert code == 0
    return seconds, kilobytes
