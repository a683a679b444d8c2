"""What a batch costs beside the bare computation, and what a second core gains.

Simulated film strips of 20 photos, each with a seed of its own. The bare computation is one plain loop in one process:
read the project, adjust it, make the texts of the result; nothing is written and nothing watched over. Beside it stand
whole commands: `photostrip batch` with one process and with two, from the start of the interpreter to the last file.

Seconds of computing count all processes of a command; other work on the machine does not count. Speed-up is a matter
of the clock, so everything is done in rounds, a part of the strips at a time, and the ways take turns: each is measured
under the same conditions, and the median of the rounds counts. What two plain loops side by side gain is what
the machine has to give.

Usage: python benchmarks/batch.py [--strips N] [--rounds N] [--photos N] [--dask]
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run from anywhere, installed or not

from photostrip.threads import limit_threads

limit_threads()  # as the command does, before numpy is imported

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

ROOT = Path(__file__).resolve().parents[1]
OVERHEAD, SPEED_UP = 1.2, 1.7  # targets
CORES = 2
ARCHIVE = 50_000  # strips of 20 photos: a million photos

MEASURED = """
import json, resource, subprocess, sys, time
start = time.perf_counter()
running = [subprocess.Popen(command, stdout=subprocess.PIPE) for command in json.loads(sys.argv[1])]
said = [process.communicate()[0].decode() for process in running]
seconds = time.perf_counter() - start
used = resource.getrusage(resource.RUSAGE_CHILDREN)
codes = [process.returncode for process in running]
print(json.dumps([codes, seconds, used.ru_utime + used.ru_stime, used.ru_maxrss / 1000, said]))
"""


# ------------------------------------------------------------------------------------------------ what is run


def write_strip(arguments: tuple[Path, int, int]) -> None:
    """Write one simulated strip."""
    from photostrip.formats.output.simulation import project_files
    from photostrip.formats.text.writing import write_files
    from photostrip.simulation.simulation import simulate
    from photostrip.simulation.spec import Control, Flight, Points, Spec

    folder, seed, photos = arguments
    spec = Spec(
        name=folder.name,
        seed=seed,
        flight=Flight(photos=photos, end_lap_percent=62.0, scale=5000.0),
        points=Points(rows=5, extra_per_model=6, reach_percent=75.0),
        control=Control(every=5),
    )
    write_files(folder, project_files(simulate(spec)))


def write_strips(folder: Path, strips: int, photos: int) -> list[Path]:
    """Write all strips, on all cores; give their folders."""
    folders = [folder / f"strip-{number:05}" for number in range(strips)]
    with ProcessPoolExecutor(CORES) as pool:
        list(pool.map(write_strip, [(each, seed, photos) for seed, each in enumerate(folders)], chunksize=20))
    return folders


def plain_loop(folders: Sequence[str]) -> dict[str, float]:
    """Compute strips one after the other; give seconds of computing: of the loop, of adjusting alone, at the start."""
    from photostrip.library.result import Result
    from photostrip.pipeline.run import triangulate
    from photostrip.project.loading import load_project
    from photostrip.result.document import document_of

    begin, adjusting = time.process_time(), 0.0
    gc.disable()  # as every command does
    for folder in folders:
        project = load_project(Path(folder) / "project.yaml")
        before = time.process_time()
        result = triangulate(project.inputs, project.settings, directory=project.directory)
        adjusting += time.process_time() - before
        Result(document_of(result, project.remarks), resolved=project.resolved).files()
    return {"loop": time.process_time() - begin, "adjusting": adjusting, "start": begin}


# -------------------------------------------------------------------------------------------------- measuring


@dataclass(frozen=True)
class Spent:
    """What commands took together: seconds on the clock, seconds of computing, megabytes, what they printed."""

    wall: float
    computing: float
    megabytes: float
    said: list[str]


def measured(*commands: Sequence[str]) -> Spent:
    """Run commands side by side, below a small process of their own that counts for them alone."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    launch = [sys.executable, "-S", "-c", MEASURED, json.dumps(commands)]
    done = subprocess.run(launch, capture_output=True, text=True, check=True, env=environment)
    codes, wall, computing, megabytes, said = json.loads(done.stdout)
    if any(codes):
        message = f"{commands} ended with {codes}: {done.stderr}"
        raise RuntimeError(message)
    return Spent(wall, computing, megabytes, said)


def loop(folders: Sequence[Path]) -> list[str]:
    """Give the command of a plain loop."""
    return [sys.executable, __file__, "--loop", *map(str, folders)]


def batch(folders: Sequence[Path], output: Path, *options: str) -> list[str]:
    """Give the command of a batch."""
    listed = output.with_suffix(".txt")
    listed.write_text("".join(f"{folder}\n" for folder in folders), encoding="utf-8")
    return [sys.executable, "-m", "photostrip", "batch", f"@{listed}", "-o", str(output), "--quiet", *options]


def ways(folders: Sequence[Path], output: Path, *, dask: bool) -> dict[str, Callable[[], Spent]]:
    """Give the ways of computing some strips; those that write have a folder each."""
    half = len(folders) // 2
    found: dict[str, Callable[[], Spent]] = {
        "plain": lambda: measured(loop(folders)),
        "two plain": lambda: measured(loop(folders[:half]), loop(folders[half:])),
        "one": lambda: measured(batch(folders, output / "one", "-j", "1")),
        "two": lambda: measured(batch(folders, output / "two", "-j", "2")),
        "unchanged": lambda: measured(batch(folders, output / "two", "-j", "2")),
    }
    if dask:
        found["dask"] = lambda: measured(batch(folders, output / "dask", "-j", "2", "--executor", "dask:local"))
    return found


# --------------------------------------------------------------------------------------------------- printing


def line(title: str, value: str, target: str = "") -> None:
    """Print a line of the table."""
    print(f"{title:<58} {value:>12}  {target}".rstrip(), flush=True)


def print_found(rounds: list[dict[str, Spent]], strips: int) -> None:
    """Print the table: medians over the rounds."""
    part = strips / len(rounds)

    def middle(ratio: Callable[[dict[str, Spent]], float]) -> float:
        return median(map(ratio, rounds))

    plain = [json.loads(found["plain"].said[0]) for found in rounds]
    for found, each in zip(rounds, plain, strict=True):
        found["loop"] = Spent(0.0, each["loop"], 0.0, [])

    def to_bare(way: str) -> str:
        return f"{middle(lambda found: found[way].computing / found['loop'].computing):.2f}"

    def speed_up(slow: str, fast: str) -> str:
        return f"{middle(lambda found: found[slow].wall / found[fast].wall):.2f}"

    line("bare computation of a strip, seconds of computing", f"{middle(lambda f: f['loop'].computing) / part:.4f} s")
    line("  of it adjusting", f"{median(each['adjusting'] for each in plain) / part:.4f} s")
    line("batch -j 1, all processes, to the bare computation", to_bare("one"), f"target {OVERHEAD:.2f}")
    starts = median(2 * each["start"] / each["loop"] for each in plain)
    line("  of it the start of two interpreters", f"{starts:.2f}")
    line("batch -j 2, all processes, to the bare computation", to_bare("two"))
    line("two plain loops side by side, speed-up on the clock", speed_up("plain", "two plain"))
    line("batch -j 2 to batch -j 1, speed-up on the clock", speed_up("one", "two"), f"target {SPEED_UP:.2f}")
    line("batch -j 2 to one plain loop, speed-up on the clock", speed_up("plain", "two"))
    again = middle(lambda found: found["unchanged"].wall) / part
    line("unchanged, on the clock", f"{again * 1000:.1f} ms")
    line("memory of the largest process", f"{max(found['two'].megabytes for found in rounds):.0f} MB")
    if "dask" in rounds[0]:
        line("batch --executor dask:local -j 2 to -j 1, on the clock", speed_up("one", "dask"))
    two = middle(lambda found: found["two"].wall) / part
    line("strips an hour with -j 2", f"{3600 / two:.0f}")
    line(f"{ARCHIVE} such strips with -j 2", f"{ARCHIVE * two / 3600:.2f} h")
    line(f"{ARCHIVE} such strips unchanged", f"{ARCHIVE * again / 60:.1f} min")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--strips", type=int, default=200, help="number of strips")
    parser.add_argument("--rounds", type=int, default=4, help="parts in which they are computed")
    parser.add_argument("--photos", type=int, default=20, help="photos of a strip")
    parser.add_argument(
        "--dask", action="store_true", help="also a Dask cluster of two workers on this machine, by the clock"
    )
    parser.add_argument("--loop", nargs="+", help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.loop:
        print(json.dumps(plain_loop(asked.loop)))
        return
    with tempfile.TemporaryDirectory() as folder:
        folders = write_strips(Path(folder) / "strips", asked.strips, asked.photos)
        print(f"{asked.strips} strips of {asked.photos} photos, in {asked.rounds} rounds\n", flush=True)
        rounds = []
        for number in range(asked.rounds):
            output = Path(folder) / f"round-{number}"
            output.mkdir()
            found = ways(folders[number :: asked.rounds], output, dask=asked.dask)
            rounds.append({name: way() for name, way in found.items()})
        print_found(rounds, asked.strips)


if __name__ == "__main__":
    main()
