"""Damaged projects and tables: how they end, how long they take, and whether anything comes out that must not.

Run it as ``python benchmarks/fuzz.py [cases] [seed]``; 10 000 cases are usual. Every case is a right project to which
one to four things were done: characters and bytes put in, values, lines and columns exchanged, files cut off or saved
as other programs do. Half of them are checked, half are run with a result. The exit code is 1 when a case ends with a
traceback, another exit code than 0, 1, 2 and 3, a changed input, half a result, or takes longer than 10 s.

``python benchmarks/fuzz.py blocks [cases] [seed]`` does the same to bundles: two strips, camera positions, given
orientations, strips of single photos; 5000 cases.
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path
from random import Random
from statistics import median

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run from anywhere, installed or not

from tests.fuzzing import blocks, damaged, projects, tried

CASES, SEED = 10_000, 1
MEMORY_MB = 600  # of the process, with all cases one after the other
SHOWN = 10


def damaged_projects(number: int, seed: int, *, of_blocks: bool) -> int:
    """Try the cases and print the table."""
    codes: Counter[tuple[str, int]] = Counter()
    seconds: list[float] = []
    wrong: list[str] = []
    begin = time.perf_counter()
    with tempfile.TemporaryDirectory() as place:
        right = (blocks if of_blocks else projects)(Path(place) / "right")
        for each in range(number):
            random = Random(f"{seed} {each}")  # noqa: S311 (the same cases every time)
            case, command = damaged(right, random), random.choice(["run", "check"])
            with tempfile.TemporaryDirectory(dir=place) as folder:
                outcome = tried(case, Path(folder), command)
            codes[command, outcome.code] += 1
            seconds.append(outcome.seconds)
            wrong += [f"case {each} ({', '.join(case.done)}; {command}): {fault}" for fault in outcome.faults]
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    if peak > MEMORY_MB:
        wrong.append(f"{peak:.0f} MB of memory")
    print(f"{number} cases, seed {seed}, {time.perf_counter() - begin:.0f} s, peak {peak:.0f} MB")
    print("exit code        0      1      2      3  other")
    for command in ("run", "check"):
        row = [codes[command, code] for code in range(4)]
        other = sum(count for (name, _), count in codes.items() if name == command) - sum(row)
        print(f"{command:<10}" + "".join(f"{count:7d}" for count in (*row, other)))
    print(f"seconds: median {median(seconds):.3f}, largest {max(seconds):.3f}")
    print(f"wrong: {len(wrong)}", *wrong[:SHOWN], sep="\n  ")
    return 1 if wrong else 0


def main() -> int:
    """Read what is asked."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("what", nargs="*", metavar="[blocks] CASES SEED", help="projects of strips where blocks "
                        f"are not named; {CASES} cases, seed {SEED}")  # fmt: skip
    what = parser.parse_args().what
    numbers = what[(of_blocks := what[:1] == ["blocks"]) :]
    if len(numbers) > 2 or not all(each.isdecimal() for each in numbers):
        parser.error("numbers are wanted: cases and seed")
    number, seed = [*map(int, numbers), *(CASES, SEED)[len(numbers) :]]
    return damaged_projects(number, seed, of_blocks=of_blocks)


if __name__ == "__main__":
    warnings.simplefilter("error")  # a warning on the user's terminal would be one more surprise
    sys.exit(main())
