"""README.md and docs/ as programs: their fenced blocks, run in order in a scratch copy of what a user has.

What stands behind the three backticks says what a block is::

    console             lines "$ command", each followed by what it prints; "..." alone on a line stands for any lines
    console exit=2      the same for commands that must end with this code
    console no-run      shown, not run; the line above is a comment <!-- ... --> that says why
    python              a program of its own; it must run. With file=NAME it is only written: a command below runs it
    yaml project        a project file; it and the tables it names must be valid
    ANY file=NAME       the block is written to NAME in the scratch folder before it is treated further
    sh                  shown only: make, pip, git, which belong to a fresh clone

stdout is compared; stderr only where the command says ``2>&1``.
"""

from __future__ import annotations

import difflib
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

from photostrip.errors import InputError
from photostrip.project.loading import load_project
from tests.source_tree import ROOT

FENCE = "```"
FRESH_CLONE = re.compile(r"(^|[|;&]\s*)(make|pip|git|python\S* -m (pip|venv))\b")
COPIED = ("sample_data", "configs")


class Block(NamedTuple):
    """One fenced block: its page, the line of its first content line, the words behind the fence, its lines."""

    page: Path
    line: int
    words: tuple[str, ...]
    lines: tuple[str, ...]
    above: str

    @property
    def kind(self) -> str:
        return self.words[0] if self.words else ""

    @property
    def runs(self) -> bool:
        return self.kind == "console" and "no-run" not in self.words

    @property
    def place(self) -> str:
        return f"{self.page.name}:{self.line}"

    def option(self, name: str) -> str:
        """Give the value of the word ``name=value``; empty when it is not there."""
        return next((word.partition("=")[2] for word in self.words if word.startswith(f"{name}=")), "")


class Step(NamedTuple):
    """One command of a console block and the lines that it should print."""

    command: str
    shown: tuple[str, ...]
    expected: tuple[str, ...]


class Outcome(NamedTuple):
    """What a command did."""

    code: int
    out: tuple[str, ...]
    err: str


def pages(root: Path = ROOT) -> list[Path]:
    """Give README.md and every page of docs/."""
    return [root / "README.md", *sorted((root / "docs").rglob("*.md"))]


def blocks(page: Path) -> list[Block]:
    """Give the fenced blocks of a page in order."""
    found = []
    lines = page.read_text(encoding="utf-8").splitlines()
    fences = iter(number for number, line in enumerate(lines) if line.startswith(FENCE))
    for begin in fences:
        end = next(number for number in fences if lines[number] == FENCE)
        above = next((line for line in reversed(lines[:begin]) if line.strip()), "")
        words = tuple(lines[begin].removeprefix(FENCE).split())
        found.append(Block(page, begin + 2, words, tuple(lines[begin + 1 : end]), above))
    return found


def steps(block: Block) -> list[Step]:
    """Split a console block into commands and what each should print."""
    found: list[tuple[list[str], list[str]]] = []
    for line in block.lines:
        if line.startswith("$ "):
            found.append(([line], []))
        elif found and not found[-1][1] and found[-1][0][-1].endswith("\\"):
            found[-1][0].append(line)
        elif found:
            found[-1][1].append(line)
        else:
            message = f"{block.place}: a console block begins with '$ command'"
            raise ValueError(message)
    return [Step("\n".join(shown).removeprefix("$ "), tuple(shown), tuple(out)) for shown, out in found]


def matches(expected: tuple[str, ...], actual: tuple[str, ...]) -> bool:
    """Compare line by line; ``...`` alone on a line of `expected` stands for any number of lines."""
    if "..." not in expected:
        return expected == actual
    gap = expected.index("...")
    head, tail = expected[:gap], expected[gap + 1 :]
    if actual[:gap] != head:
        return False
    return any(matches(tail, actual[start:]) for start in range(gap, len(actual) + 1))


class Scratch:
    """A folder with what a user has, in which the blocks of one page run one after the other."""

    def __init__(self, folder: Path, command: Path | None = None) -> None:
        """`command` is that of ``Forks``, whose ``python`` is taken, too; without it, what is installed."""
        self.folder = folder / "project"
        self.folder.mkdir()
        for name in COPIED:
            if (ROOT / name).is_dir():
                shutil.copytree(ROOT / name, self.folder / name)
        self.environment = os.environ | {"COLUMNS": "100", "NO_COLOR": "1", "PYTHONUTF8": "1"}
        path = [str(Path(sys.executable).parent), os.environ.get("PATH", os.defpath)]
        if command is not None:
            path[:0] = [str(command.parent), str(command.parent.parent)]  # and the ``python`` beside it
        self.environment["PATH"] = os.pathsep.join(path)

    def write(self, name: str, lines: tuple[str, ...]) -> Path:
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path

    def shell(self, command: str) -> Outcome:
        done = subprocess.run(
            ["bash", "-c", command], cwd=self.folder, env=self.environment, capture_output=True, encoding="utf-8",
            check=False,
        )  # fmt: skip
        return Outcome(done.returncode, tuple(line.rstrip() for line in done.stdout.splitlines()), done.stderr)


def faults_of_page(page: Path, folder: Path, command: Path | None = None) -> list[str]:
    """Run every block of `page` and give what does not do what the page says."""
    scratch = Scratch(folder, command)
    found = []
    for block in blocks(page):
        if name := block.option("file"):
            scratch.write(name, block.lines)
        if block.runs:
            found += [fault for step in steps(block) for fault in _faults_of_step(block, step, scratch)]
        elif block.kind == "python" and not block.option("file"):
            scratch.write("block.py", block.lines)
            outcome = scratch.shell("python block.py")
            if outcome.code:
                found.append(f"{block.place}: {outcome.err}")
        elif block.words[:2] == ("yaml", "project"):
            try:
                load_project(scratch.write(block.option("file") or "block.yaml", block.lines))
            except InputError as error:
                found += [f"{block.place}: {fault}" for fault in error.faults]
    return found


def _faults_of_step(block: Block, step: Step, scratch: Scratch) -> list[str]:
    outcome = scratch.shell(step.command)
    found, code = [], int(block.option("exit") or 0)
    if outcome.code != code:
        found.append(f"{block.place}: $ {step.command}: exit code {outcome.code}, not {code}\n{outcome.err}")
    if not matches(step.expected, outcome.out):
        diff = "\n".join(difflib.unified_diff(step.expected, outcome.out, "the page", "the command", lineterm=""))
        found.append(f"{block.place}: $ {step.command}: prints something else (renew with `make docs`)\n{diff}")
    return found


def renewed(page: Path, folder: Path) -> str:
    """Give the text of `page` with the output of its commands as it is now.

    Output that still matches, ``...`` included, stays as it is.
    """
    scratch = Scratch(folder)
    lines = page.read_text(encoding="utf-8").splitlines()
    shift = 0
    for block in blocks(page):
        if name := block.option("file"):
            scratch.write(name, block.lines)
        if not block.runs:
            continue
        fresh: list[str] = []
        for step in steps(block):
            out = scratch.shell(step.command).out
            fresh += [*step.shown, *(step.expected if matches(step.expected, out) else out)]
        first = block.line - 1 + shift
        lines[first : first + len(block.lines)] = fresh
        shift += len(fresh) - len(block.lines)
    return "\n".join(lines) + "\n"
