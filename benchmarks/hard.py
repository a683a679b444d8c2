"""20 photos with much that is wrong: processor time and memory of whole runs, and how they end.

Run it as ``python benchmarks/hard.py [case ...]``; all take a few minutes. A search is bounded in work: no input of 20
photos takes more than 10 s of an idle core, on which L, the bare import of numpy, yaml and pyproj, takes 0.2 s.
"""

from __future__ import annotations

import argparse
import csv
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))  # run from anywhere, installed or not

from dataclasses import replace  # noqa: E402
from typing import NamedTuple  # noqa: E402

from benchmarks.strip import UNIT  # noqa: E402
from photostrip.formats.output.simulation import project_files  # noqa: E402
from photostrip.simulation import Control, Flight, Gnss, Ground, Points, Spec, Terrain, simulate  # noqa: E402

if TYPE_CHECKING:
    from collections.abc import Callable

LIMIT = 50.0  # of L: 10 s where L takes 0.2 s
BUNDLE = ("--set", "processing.adjustment=bundle")
ALL, FOLDS = "--compare-methods", "--cross-validate"
STRIP, BLOCK = Flight(photos=20), Flight(photos=5, strips=4)
MIDDLE, LAP = (Flight(photos=20, end_lap_percent=lap) for lap in (80.0, 94.0))


def spec(flight: Flight, extra: int, bands: int, *, gnss: bool = False) -> Spec:
    """Give strips over relief, with so many bands of control and more points in each model."""
    return Spec(
        flight=flight,
        terrain=Terrain(relief=60.0),
        ground=Ground(),
        control=Control(every=bands),
        points=Points(rows=5, extra_per_model=extra),
        gnss=Gnss(use=True) if gnss else None,
    )


def moved(folder: Path, table: str, columns: slice, share: float, size: float) -> None:
    """Move the coordinates of a share of the rows of a table by normal errors of a size."""
    rng, place = np.random.default_rng(7), folder / table
    with place.open(encoding="utf-8", newline="") as file:
        head, *rows = csv.reader(file)
    for row in rows:
        if rng.random() < share:
            row[columns] = [f"{float(value) + rng.normal(0.0, size):.4f}" for value in row[columns]]
    with place.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([head, *rows])


def images(share: float, mm: float) -> Callable[[Path], None]:
    return lambda folder: moved(folder, "observations.csv", slice(2, 4), share, mm)


def control(share: float) -> Callable[[Path], None]:
    return lambda folder: moved(folder, "control.csv", slice(1, 4), share, 30.0)


def cameras(folder: Path, share: float = 1.0) -> None:
    moved(folder, "gnss.csv", slice(1, 4), share, 20.0)


def a_third(folder: Path) -> None:
    cameras(folder, 1 / 3)
    images(1 / 3, 5.0)(folder)


def sound(folder: Path) -> None:
    """Leave it as it is."""


DENSE = replace(
    spec(STRIP, 10, 1), points=Points(rows=25, extra_per_model=10), control=Control(every=1, per_band=25, check=0)
)
# every control point is measured
MANY = replace(spec(Flight(photos=6), 433, 5), control=Control(layout="random", count=1300, check=6))
CASES: dict[str, tuple[Spec, Callable[[Path], None], tuple[str, ...]]] = {
    "strip of 200 points a photo": (spec(STRIP, 150, 5), sound, (ALL, FOLDS)),
    "strip of 200 points, 30 % 0.1 mm wrong": (spec(STRIP, 150, 5), images(0.3, 0.1), (ALL, FOLDS)),
    "strip, 25 % of the control 30 m off": (spec(STRIP, 60, 2), control(0.25), (FOLDS,)),
    "block of 200 points, 30 % 5 mm wrong": (spec(BLOCK, 150, 2), images(0.3, 5.0), (ALL,)),
    "block, 40 % of the control 30 m off": (spec(BLOCK, 60, 1), control(0.4), (*BUNDLE, FOLDS)),
    "block, 20 % 5 mm wrong, variance components": (
        spec(BLOCK, 100, 2), images(0.2, 5.0), (*BUNDLE, "--set", "processing.bundle.variance_components=true"),
    ),
    "block, 20 % 5 mm wrong, self-calibration": (
        spec(BLOCK, 100, 2), images(0.2, 5.0),
        (*BUNDLE, "--set", "processing.self_calibration=[principal_distance, principal_point, k1]"),
    ),
    "block, camera positions 20 m off": (spec(BLOCK, 100, 2, gnss=True), cameras, BUNDLE),
    "block, a third of images and cameras off": (spec(BLOCK, 150, 2, gnss=True), a_third, (ALL,)),
    "strip with 500 control points, half 30 m off": (DENSE, control(0.5), (FOLDS,)),
    "80 % end lap, 800 points, 30 % 0.1 mm wrong": (spec(MIDDLE, 150, 5), images(0.3, 0.1), (ALL, FOLDS)),
    "80 % end lap, 800 points, 30 % 5 mm wrong": (spec(MIDDLE, 150, 5), images(0.3, 5.0), (ALL, FOLDS)),
    "80 % end lap, 800 points, 33 % 0.1 mm wrong": (spec(MIDDLE, 150, 5), images(1 / 3, 0.1), (ALL, FOLDS)),
    "80 % end lap, 800 points, 33 % 5 mm wrong": (spec(MIDDLE, 150, 5), images(1 / 3, 5.0), (ALL, FOLDS)),
    "94 % end lap, 813 points": (spec(LAP, 60, 3), sound, ()),
    "94 % end lap, 813 points, 30 % 5 mm wrong": (spec(LAP, 60, 3), images(0.3, 5.0), (ALL,)),
    "94 % end lap, 813 points, 30 % 0.1 mm wrong": (spec(LAP, 60, 3), images(0.3, 0.1), (FOLDS,)),
    "94 % end lap, 813 points, 0.1 mm wrong, bundle": (spec(LAP, 60, 3), images(0.3, 0.1), (*BUNDLE, FOLDS)),
    "94 % end lap, 813 points, 0.1 mm wrong, all methods": (spec(LAP, 60, 3), images(0.3, 0.1), (ALL, FOLDS)),
    "6 photos on 1300 control points": (MANY, sound, (FOLDS,)),
    "strip of 2000 points": (spec(STRIP, 1500, 3), sound, ()),
    "strip of 2000 points, 10 % 0.1 mm wrong": (spec(STRIP, 1500, 3), images(0.1, 0.1), ()),
    "strip of 2000 points, 30 % 0.1 mm wrong": (spec(STRIP, 1500, 3), images(0.3, 0.1), ()),
    "strip of 2000 points, 30 % 0.1 mm wrong, bundle": (spec(STRIP, 1500, 3), images(0.3, 0.1), (*BUNDLE, FOLDS)),
    "strip of 2000 points, 30 % 5 mm wrong": (spec(STRIP, 1500, 3), images(0.3, 5.0), (ALL,)),
}  # fmt: skip


class Used(NamedTuple):
    """What a process used, and how it ended."""

    seconds: float  # of the processor
    megabytes: int  # of memory at its peak
    code: int


def timed(*arguments: str) -> Used:
    """Run an interpreter in a process of its own."""
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    quiet = subprocess.DEVNULL
    process = subprocess.Popen([sys.executable, *arguments], cwd=ROOT, env=environment, stdout=quiet, stderr=quiet)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return Used(used.ru_utime + used.ru_stime, used.ru_maxrss // 1024, process.returncode)


def main() -> int:
    """Print the table; 1 where a case takes longer than it may."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("cases", nargs="*", metavar="CASE", help="words of the cases wanted; all by default")
    wanted = parser.parse_args().cases
    slow = 0
    for name, (planned, spoil, options) in CASES.items():
        if wanted and not any(word in name for word in wanted):
            continue
        with tempfile.TemporaryDirectory() as place:
            for file, text in project_files(simulate(planned)).items():
                (Path(place) / file).write_text(text, encoding="utf-8")
            spoil(Path(place))
            unit = min(timed("-c", UNIT).seconds for _ in range(3))
            seconds, megabytes, code = timed("-m", "photostrip", "run", f"{place}/project.yaml", *options)
        shown = " ".join(each.removeprefix("processing.") for each in options if each != "--set")
        print(
            f"{seconds:6.1f} s {seconds / unit:4.0f} L {megabytes:4d} MB  exit {code}  {name:51s} {shown}", flush=True
        )
        slow += seconds > LIMIT * unit
    return 1 if slow else 0


if __name__ == "__main__":
    raise SystemExit(main())
