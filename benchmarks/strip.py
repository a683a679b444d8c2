"""How long runs take and how much memory: whole processes, and how both grow with the number of photos.

Simulated film strips with about 30 points on a photo and, as users have them, one check point for each photo. A whole
process is timed in seconds of computing, reading and writing included, by a small process of its own, so that nothing
of this program counts for it. The unit is L, a bare ``import numpy, yaml, pyproj``, timed in turn with the rows: a busy
machine makes both slower. Of several repetitions the fastest counts.

Usage: python benchmarks/strip.py [--rows NAME ...] [--sizes N ...] [--repeat N]
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run from anywhere, installed or not

import numpy as np

from photostrip.foreign.simulated import project_files
from photostrip.formats.files import write_files
from photostrip.simulation.simulation import simulate
from photostrip.simulation.spec import Control, Flight, Gnss, Points, Spec

if TYPE_CHECKING:
    from collections.abc import Sequence

MEGABYTE = 1024  # kilobytes, in which the system counts
UNIT = "import numpy, yaml, pyproj"
EXPONENT = 1.05  # at most, of whole runs from the first to the last of the sizes
GROWTH_SCALE = 1500.0  # of the strips that grow: 10 000 photos are 1300 km
FAILED = 1  # exit code of a run whose verdict is that: all work is done

LAUNCHER = """
import json, resource, subprocess, sys
code = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(json.dumps([code, used.ru_utime + used.ru_stime, used.ru_maxrss]))
"""


# ------------------------------------------------------------------------------------------------ what is run


@dataclass(frozen=True)
class Row:
    """A whole process of the table."""

    title: str
    spec: Spec
    most: float | None = None  # units of L at most
    megabytes: float | None = None  # at most
    command: str = "run"
    adjustment: str = "polynomial"


def strip_spec(photos: int, every: int, *, scale: float = 5000.0) -> Spec:
    """Give a film strip with 30 points on a photo and a band of three control points every so many models."""
    return Spec(
        name=f"{photos} photos",
        flight=Flight(photos=photos, end_lap_percent=62.0, heading_deg=0.0, scale=scale),
        points=Points(rows=5, extra_per_model=6, reach_percent=75.0),
        control=Control(every=every, check=photos),
    )


BLOCK = Spec(
    name="block",
    flight=Flight(photos=40, strips=10, end_lap_percent=62.0, heading_deg=0.0, scale=5000.0),
    points=Points(rows=5, extra_per_model=6, reach_percent=90.0),
    control=Control(check=100),
    gnss=Gnss(use=True),
)
DENSE = strip_spec(1000, 5)
ROWS = {
    "short": Row("20 photos", strip_spec(20, 5), 5.0),
    "dense": Row("1000 photos, band every 5 models, polynomial", DENSE, 8.0, 200.0),
    "dense-bundle": Row("1000 photos, every 5, bundle", DENSE, 12.0, 210.0, adjustment="bundle"),
    "long": Row("3000 photos, band every 600 models", strip_spec(3000, 600), 20.0, 400.0),
    "block": Row("bundle block 10 x 40 with GNSS", BLOCK, adjustment="bundle"),
    "check": Row("check of 1000 photos", DENSE, 4.0, command="check"),
}


def write_project(folder: Path, spec: Spec) -> Path:
    """Write a simulated project; give its file."""
    write_files(folder, project_files(simulate(spec)))
    return folder / "project.yaml"


# ------------------------------------------------------------------------------------------- whole processes


@dataclass(frozen=True)
class Spent:
    """What a process took: seconds of computing, the unit in the same minute, megabytes at the peak."""

    computing: float
    unit: float
    megabytes: float

    @property
    def units(self) -> float:
        """Seconds of computing in units of L."""
        return self.computing / self.unit


def process(arguments: Sequence[str]) -> tuple[float, float]:
    """Run an interpreter: seconds of computing, and megabytes at the peak."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    launch = [sys.executable, "-S", "-c", LAUNCHER, sys.executable, *arguments]
    environment["PYTHONPATH"] = sys.path[0]
    done = subprocess.run(launch, capture_output=True, text=True, check=True, env=environment)
    code, computing, kilobytes = json.loads(done.stdout)
    if code not in {0, FAILED}:
        message = f"{' '.join(arguments)} ended with {code}"
        raise RuntimeError(message)
    return computing, kilobytes / MEGABYTE


def whole_run(project: Path, row: Row, repeat: int) -> Spent:
    """Run the command as processes of their own, in turn with the unit; the fastest of each counts."""
    arguments = ["-m", "photostrip", row.command, str(project)]
    if row.command == "run":
        arguments += ["-o", str(project.parent / "result"), f"--set=processing.adjustment={row.adjustment}"]
    units, found = [process(["-c", UNIT])[0]], []
    for _ in range(repeat):
        found.append(process(arguments))
        units.append(process(["-c", UNIT])[0])
    computing, megabytes = min(found)
    return Spent(computing, min(units), megabytes)


# ----------------------------------------------------------------------------------------------- printing


def print_rows(folder: Path, names: Sequence[str], repeat: int) -> None:
    """Print the table of whole processes."""
    print(f"{'whole processes':<50}{'seconds':>9}{'L':>8}{'at most':>9}{'MB':>7}{'at most':>9}")
    projects: dict[int, Path] = {}
    units = []
    for name in names:
        row = ROWS[name]
        if id(row.spec) not in projects:
            projects[id(row.spec)] = write_project(folder / name, row.spec)
        spent = whole_run(projects[id(row.spec)], row, repeat)
        units.append(spent.unit)
        most, megabytes = (f"{limit:g}" if limit else "" for limit in (row.most, row.megabytes))
        numbers = f"{spent.computing:>9.2f}{spent.units:>8.1f}{most:>9}{spent.megabytes:>7.0f}{megabytes:>9}"
        print(f"{row.title:<50}{numbers}", flush=True)
    print(f"{'L: ' + UNIT:<50}{min(units):>9.2f}\n", flush=True)


def print_growth(folder: Path, sizes: Sequence[int], repeat: int) -> None:
    """Print how the time grows with the number of photos, six bands of control on each."""
    print(f"{'photos':>8}{'whole run':>12}{'memory':>10}")
    whole = []
    for photos in sizes:
        spec = strip_spec(photos, max(photos // 5, 1), scale=GROWTH_SCALE)
        project = write_project(folder / str(photos), spec)
        spent = whole_run(project, Row("", spec), repeat)
        whole.append(spent.units)
        print(f"{photos:>8}{spent.units:>10.1f} L{spent.megabytes:>7.0f} MB", flush=True)
    exponent = float(np.polyfit(np.log(sizes), np.log(whole), 1)[0])
    print(f"\nexponent from {sizes[0]} to {sizes[-1]} photos {exponent:.2f}, at most {EXPONENT}")


def main() -> None:
    """Read the options and print the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--rows", nargs="*", choices=ROWS, default=list(ROWS), help="whole processes (default all)")
    parser.add_argument("--sizes", type=int, nargs="*", default=[300, 1000, 3000], help="sizes for the growth")
    parser.add_argument("--repeat", type=int, default=3, help="repetitions, of which the fastest counts (default 3)")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        if options.rows:
            print_rows(Path(name), options.rows, options.repeat)
        if options.sizes:
            print_growth(Path(name), options.sizes, options.repeat)


if __name__ == "__main__":
    main()
