"""The faults that the tests notice: constants, comparisons and signs of the program changed one at a time.

Run it as ``python benchmarks/mutations.py [--count 120] [--seed 1] [--room strip/polynomial ...]``. Each change
is made in a temporary copy of this tree and undone again. The tests of the room run first, then all that are not slow;
a change that both let pass stands in the table as NOT noticed. Some of those make no difference that a test should
notice (the width of a message, a tolerance that only decides how long something takes): a person judges them.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from queue import SimpleQueue
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

ROOT = Path(__file__).resolve().parents[1]
PACKAGE, TESTS = "photostrip", "tests"
LEFT_OUT = "strip/gross_errors"  # rates of detection: benchmarks/screening.py and gross_errors.py
NOT_COPIED = shutil.ignore_patterns(".*_cache", ".git", ".venv*", "__pycache__", "build", "dist", ".hypothesis")
FACTOR = 1.5  # of a constant that is not whole
SWAPPED: dict[type[ast.AST], tuple[str, str]] = {
    ast.Lt: ("<", "<="),
    ast.LtE: ("<=", "<"),
    ast.Gt: (">", ">="),
    ast.GtE: (">=", ">"),
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
}
NO_NUMBERS = (ast.Constant, ast.JoinedStr, ast.List, ast.Tuple, ast.ListComp, ast.Set, ast.Dict)  # to be added
KINDS = ("constant", "comparison", "sign")
LIMIT = 600.0  # seconds; the tests of a change that takes longer have noticed it


@dataclass(frozen=True)
class Change:
    """One place of the program and what stands there instead."""

    file: str  # below photostrip/
    line: int
    start: int  # offset in the bytes of the file
    end: int
    old: str
    new: str
    kind: str

    @property
    def room(self) -> str:
        """The folder below photostrip/; a dot for the modules at the top."""
        return str(Path(self.file).parent)

    def applied(self, source: bytes) -> bytes:
        """Give the text of the file with this change."""
        return source[: self.start] + self.new.encode() + source[self.end :]


# -------------------------------------------------------------------------------- what may be changed


def changes_of(file: Path) -> list[Change]:
    """Give every change that can be made to a module."""
    source = file.read_bytes()
    tree = ast.parse(source)
    starts = [0]
    for line in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    spared = {id(inner) for node in ast.walk(tree) for outer in _spared(node) for inner in ast.walk(outer)}
    name = file.relative_to(ROOT / PACKAGE).as_posix()

    def span(node: ast.expr) -> tuple[int, int]:
        last, column = node.end_lineno or node.lineno, node.end_col_offset or 0
        return starts[node.lineno - 1] + node.col_offset, starts[last - 1] + column

    def between(left: ast.expr, right: ast.expr, operator: ast.AST) -> Iterator[tuple[int, int, str, str]]:
        old, new = SWAPPED[type(operator)]
        gap_start, gap_end = span(left)[1], span(right)[0]
        if found := re.search(rf"(?<![<>=+-]){re.escape(old)}(?![<>=])", source[gap_start:gap_end].decode()):
            yield gap_start + found.start(), gap_start + found.end(), old, new

    found: list[Change] = []
    for node in ast.walk(tree):
        if id(node) in spared:
            continue
        places: list[tuple[int, int, str, str]] = []
        kind = "constant"
        if isinstance(node, ast.Constant) and type(node.value) in {int, float}:
            start, end = span(node)
            places.append((start, end, source[start:end].decode(), _other(node.value)))
        elif isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in SWAPPED:
            kind = "comparison"
            places += between(node.left, node.comparators[0], node.ops[0])
        elif isinstance(node, ast.BinOp) and type(node.op) in SWAPPED:
            kind = "sign"
            places += between(node.left, node.right, node.op)
        found += [
            Change(name, source[:start].count(b"\n") + 1, start, end, old, new, kind) for start, end, old, new in places
        ]
    return found


def _spared(node: ast.AST) -> Iterator[ast.AST]:
    """Give the parts of a node where a change says nothing: types, indices, axes, texts that are put together."""
    if isinstance(node, ast.AnnAssign | ast.arg) and node.annotation:
        yield node.annotation
    if isinstance(node, ast.FunctionDef) and node.returns:
        yield node.returns
    if isinstance(node, ast.Subscript):
        yield node.slice
    if isinstance(node, ast.keyword) and node.arg in {"axis", "ndmin", "stacklevel"}:
        yield node.value
    if isinstance(node, ast.JoinedStr):
        yield node
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        ends = [node.left, node.right]
        if any(isinstance(end, NO_NUMBERS) and not _is_number(end) for end in ends):
            yield node


def _is_number(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and type(node.value) in {int, float}


def _other(value: object) -> str:
    """Give what a number is changed to: one more, or half as much again."""
    if isinstance(value, float):
        return repr(value * FACTOR if value else 1.0)
    return repr(value + 1) if isinstance(value, int) else repr(value)


def drawn(count: int, seed: int, rooms: Sequence[str]) -> list[Change]:
    """Give a sample that is the same for the same seed: spread evenly over the rooms, and over kinds within a room."""
    rng = random.Random(seed)  # noqa: S311 - a sample, no secret
    urns: dict[str, dict[str, list[Change]]] = {}
    for file in sorted((ROOT / PACKAGE).rglob("*.py")):
        if _asked(str(file.relative_to(ROOT / PACKAGE).parent), rooms):
            for change in changes_of(file):
                urns.setdefault(change.room, {}).setdefault(change.kind, []).append(change)
    queues = []
    for room in sorted(urns):
        kinds = [urns[room][kind] for kind in KINDS if kind in urns[room]]
        for urn in kinds:
            rng.shuffle(urn)
        rng.shuffle(kinds)
        queues.append(kinds)
    rng.shuffle(queues)
    sample: list[Change] = []
    turns = cycle(queues)
    while len(sample) < count and any(any(kinds) for kinds in queues):
        kinds = next(turns)
        if filled := [urn for urn in kinds if urn]:
            sample.append(filled[0].pop())
            kinds.append(kinds.pop(0))
    return sorted(sample, key=lambda change: (change.file, change.start))


def _asked(room: str, rooms: Sequence[str]) -> bool:
    def within(folder: str) -> bool:
        return room == folder or room.startswith(f"{folder}/")

    return any(within(folder) for folder in rooms) if rooms else not within(LEFT_OUT)


# ---------------------------------------------------------------------------------- what notices them


def tests_of(change: Change) -> list[str]:
    """Give the tests that stand where the changed module stands: of its name, of its folder, or of the one above."""
    stem = Path(change.file).stem
    folder = ROOT / TESTS / change.room
    named = sorted(folder.glob(f"test_{stem}.py")) if folder.is_dir() else []
    if named and change.room == ".":
        return [_relative(path) for path in named]
    while folder != ROOT / TESTS:
        if folder.is_dir() and (files := sorted(folder.glob("test_*.py")) or sorted(folder.rglob("test_*.py"))):
            return [_relative(path) for path in [*named, *(file for file in files if file not in named)]]
        folder = folder.parent
    return []


def _relative(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def first_failure(tree: Path, tests: Sequence[str], limit: float) -> str:
    """Run tests that are not slow in `tree` (all when none is named), give the first that fails, or nothing."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    options = ["-x", "-q", "-n", "0", "-m", "not slow", "--tb=no", "-p", "no:cacheprovider"]
    command = [sys.executable, "-m", "pytest", *options, *tests]
    try:
        done = subprocess.run(
            command,
            cwd=tree,
            env=environment | {"PYTHONPATH": str(tree)},
            capture_output=True,
            text=True,
            timeout=limit,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"more than {limit:g} s"
    if done.returncode in {0, 5}:  # 5: all tests there are slow
        return ""
    failed = re.search(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", done.stdout, re.MULTILINE)
    return failed[1].removeprefix(f"{TESTS}/") if failed else "the program does not start"


class Trees:
    """Temporary copies of this tree, one for each job."""

    def __init__(self, folder: Path, jobs: int, limit: float, *, everything: bool) -> None:
        self.free: SimpleQueue[Path] = SimpleQueue()
        self.limit, self.everything = limit, everything
        for number in range(jobs):
            copy = folder / str(number) / ROOT.name
            shutil.copytree(ROOT, copy, ignore=NOT_COPIED)
            self.free.put(copy)

    def stages(self, change: Change) -> list[list[str]]:
        """Give what is run for a change, one after the other until something fails; an empty list runs everything."""
        near = tests_of(change)
        return [near] * bool(near) + [[]] * (self.everything or not near)

    def noticed_by(self, change: Change) -> str:
        """Make a change, run the tests, undo it; give the first test that fails."""
        tree = self.free.get()
        file = tree / PACKAGE / change.file
        kept, times = file.read_bytes(), file.stat()
        try:
            file.write_bytes(change.applied(kept))
            runs = (first_failure(tree, tests, self.limit) for tests in self.stages(change))
            return next((failed for failed in runs if failed), "")
        finally:
            file.write_bytes(kept)
            os.utime(file, ns=(times.st_atime_ns, times.st_mtime_ns))
            self.free.put(tree)

    def unchanged(self, tests: Sequence[str]) -> str:
        """Give the first of these tests that fails without any change."""
        tree = self.free.get()
        self.free.put(tree)
        return first_failure(tree, tests, 1e6) if tests else ""


# --------------------------------------------------------------------------------------------- prints


def place_of(change: Change) -> str:
    """Give a change in words: where, what, and the line it stands in."""
    line = (ROOT / PACKAGE / change.file).read_text(encoding="utf-8").splitlines()[change.line - 1].strip()
    return (
        f"| `{change.file}:{change.line}` | `{change.old}` to `{change.new}` in `{line.replace('|', chr(92) + '|')}` |"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table, and the numbers for each room."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=120, help="changes")
    parser.add_argument("--seed", type=int, default=1, help="of the sample")
    parser.add_argument("--room", nargs="+", default=[], help="folders below photostrip/, with those in them")
    parser.add_argument("--jobs", type=int, default=1, help="changes tried at a time")
    parser.add_argument("--limit", type=float, default=LIMIT, help="seconds for the tests of one change")
    parser.add_argument("--near", action="store_true", help="run the tests of the room only")
    parser.add_argument("--list", action="store_true", help="print the changes and run nothing")
    asked = parser.parse_args(arguments)
    sample = drawn(asked.count, asked.seed, [room.strip("/") for room in asked.room])
    print("| place | change | noticed by |\n|---|---|---|")
    if asked.list:
        for change in sample:
            print(place_of(change), "|")
        return 0
    noticed: Counter[str] = Counter()
    failing = set()
    with tempfile.TemporaryDirectory(prefix="mutations-") as folder:
        trees = Trees(Path(folder), asked.jobs, asked.limit, everything=not asked.near)
        with ThreadPoolExecutor(asked.jobs) as pool:
            for change, test in zip(sample, pool.map(trees.noticed_by, sample), strict=True):
                noticed[change.room] += bool(test)
                failing.add(test)
                print(place_of(change), f"{f'`{test}`' if test else 'NOT noticed'} |", flush=True)
        if failed := trees.unchanged(sorted(f"{TESTS}/{test}" for test in failing if "::" in test)):
            sys.stderr.write(f"this fails without any change: {failed}\n")
            return 1
    print("\n| room | changes | noticed |\n|---|---|---|")
    for room, count in sorted(Counter(change.room for change in sample).items()):
        print(f"| {room} | {count} | {noticed[room]} |")
    print(f"| all | {len(sample)} | {noticed.total()} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
