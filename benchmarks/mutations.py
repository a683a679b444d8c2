"""The faults that the tests notice: constants, comparisons and signs of the program changed one at a time.

Run it as ``python benchmarks/mutations.py [--count 60] [--seed 1] [--room strip/polynomial ...] [--near]``. Each change
is made in a temporary copy of this tree and undone again. The tests of its folder run first, then all that are not
slow; a change that both let pass stands in the table as NOT noticed. Some of those make no difference that a test
should notice (the width of a message, a tolerance that only decides how long something takes): a person judges them.
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
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

ROOT = Path(__file__).resolve().parents[1]
PACKAGE, TESTS = "photostrip", "tests"
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
NO_NUMBERS = (ast.JoinedStr, ast.List, ast.Tuple, ast.ListComp, ast.Set, ast.Dict)  # to be added
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

    def applied(self, source: bytes) -> bytes:
        """Give the text of the file with this change."""
        return source[: self.start] + self.new.encode() + source[self.end :]


def changes_of(file: Path) -> Iterator[Change]:
    """Give every change that can be made to a module."""
    source = file.read_bytes()
    tree = ast.parse(source)
    starts = [0]
    for line in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    spared = {id(inner) for node in ast.walk(tree) for outer in _spared(node) for inner in ast.walk(outer)}
    name = file.relative_to(ROOT / PACKAGE).as_posix()

    def start(node: ast.expr) -> int:
        return starts[node.lineno - 1] + node.col_offset

    def end(node: ast.expr) -> int:
        return starts[(node.end_lineno or 0) - 1] + (node.end_col_offset or 0)

    def change(first: int, last: int, new: str) -> Change:
        return Change(name, source[:first].count(b"\n") + 1, first, last, source[first:last].decode(), new)

    for node in ast.walk(tree):
        if id(node) in spared:
            continue
        if isinstance(node, ast.Constant) and type(node.value) in {int, float}:
            yield change(start(node), end(node), _other(node.value))
        for left, operator, right in _operations(node):
            old, new = SWAPPED[type(operator)]
            between = source[end(left) : start(right)].decode()
            if place := re.search(rf"(?<![<>=+-]){re.escape(old)}(?![<>=])", between):
                yield change(end(left) + place.start(), end(left) + place.end(), new)


def _operations(node: ast.AST) -> Iterator[tuple[ast.expr, ast.AST, ast.expr]]:
    if isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in SWAPPED:
        yield node.left, node.ops[0], node.comparators[0]
    if isinstance(node, ast.BinOp) and type(node.op) in SWAPPED:
        yield node.left, node.op, node.right


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
        texts = [end for end in (node.left, node.right) if isinstance(end, ast.Constant) and isinstance(end.value, str)]
        if texts or isinstance(node.left, NO_NUMBERS) or isinstance(node.right, NO_NUMBERS):
            yield node


def _other(value: object) -> str:
    """Give what a number is changed to: one more, or half as much again."""
    if isinstance(value, float):
        return repr(value * FACTOR if value else 1.0)
    return repr(value + 1) if isinstance(value, int) else repr(value)


def drawn(count: int, seed: int, rooms: Sequence[str]) -> list[Change]:
    """Give a sample that is the same for the same seed, spread evenly over the folders."""
    rng = random.Random(seed)  # noqa: S311 - a sample, no secret
    urns: dict[str, list[Change]] = {}
    for file in sorted((ROOT / PACKAGE).rglob("*.py")):
        folder = file.relative_to(ROOT / PACKAGE).parent
        if not rooms or {str(folder), *map(str, folder.parents)} & set(rooms):
            urns.setdefault(str(folder), []).extend(changes_of(file))
    for urn in urns.values():
        rng.shuffle(urn)
    queues = list(urns.values())
    rng.shuffle(queues)
    turns = [change for turn in zip_longest(*queues) for change in turn if change]
    return sorted(turns[:count], key=lambda change: (change.file, change.start))


def tests_of(change: Change) -> list[str]:
    """Give the folder of tests that stands where the changed module stands, or above it."""
    folders = Path(TESTS, change.file).parents
    return [str(folder) for folder in folders if folder.is_relative_to(f"{TESTS}/") and (ROOT / folder).is_dir()][:1]


def first_failure(tree: Path, tests: Sequence[str]) -> str:
    """Run tests that are not slow in `tree` (all when none is named), give the first that fails, or nothing."""
    environment = {**os.environ, "PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": ""}  # empty: as if it were not set
    options = ["-x", "-q", "-m", "not slow", "--tb=no", "-p", "no:cacheprovider"]
    command = [sys.executable, "-m", "pytest", *options, *tests]
    try:
        done = subprocess.run(
            command, cwd=tree, env=environment, capture_output=True, text=True, timeout=LIMIT, check=False
        )
    except subprocess.TimeoutExpired:
        return f"more than {LIMIT:g} s"
    if done.returncode in {0, 5}:  # 5: all tests there are slow
        return ""
    failed = re.search(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", done.stdout, re.MULTILINE)
    return failed[1].removeprefix(f"{TESTS}/") if failed else "the program does not start"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=60, help="changes")
    parser.add_argument("--seed", type=int, default=1, help="of the sample")
    parser.add_argument("--room", nargs="+", default=[], help="folders below photostrip/, with those in them")
    parser.add_argument("--near", action="store_true", help="run the tests of the folder only")
    asked = parser.parse_args(arguments)
    sample, noticed = drawn(asked.count, asked.seed, asked.room), 0
    print("| place | change | noticed by |\n|---|---|---|")
    with tempfile.TemporaryDirectory(prefix="mutations-") as folder:
        tree = shutil.copytree(ROOT, Path(folder, ROOT.name), ignore=NOT_COPIED)
        for change in sample:
            file = tree / PACKAGE / change.file
            kept = file.read_bytes()
            file.write_bytes(change.applied(kept))
            stages = [tests_of(change)] if asked.near else [tests_of(change), []]
            failed = next(filter(None, (first_failure(tree, tests) for tests in stages)), "")
            file.write_bytes(kept)
            os.utime(file)  # not in the same second as the change, or its byte code would stay
            noticed += bool(failed)
            line = kept.splitlines()[change.line - 1].decode().strip().replace("|", "\\|")
            place = f"`{change.file}:{change.line}` | `{change.old}` to `{change.new}` in `{line}`"
            print(f"| {place} | {f'`{failed}`' if failed else 'NOT noticed'} |", flush=True)
    print(f"\n{noticed} of {len(sample)} changes noticed")
    return 0


if __name__ == "__main__":
    sys.exit(main())
