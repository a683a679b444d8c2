"""Which projects a batch has, and where the result of each goes."""

from __future__ import annotations

import glob
import os
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from photostrip.errors import Fault, InputError
from photostrip.formats.files import MEGABYTE, decode, read_bytes

PROJECT = "project.yaml"
ENDINGS = {".yaml", ".yml"}
LIST = "@"
LARGEST_LIST_FILE = 100 * MEGABYTE


@dataclass(frozen=True)
class ChosenProject:
    number: int
    project: str  # path of the project file as the user knows it
    output: str  # folder of its result below that of the batch, with slashes


def choose(arguments: Sequence[str]) -> list[ChosenProject]:
    """Find the projects that the user names, each once, in the order of the arguments.

    An argument is a project file; a folder (its ``project.yaml``, or all of them below it); a pattern with ``*``, ``?``
    or ``**``; or ``@FILE``, a list of such arguments, one a line, with paths relative to FILE (``@-``: from stdin).
    Those that lead to no project are faults.
    """
    faults: list[Fault] = []
    found: dict[str, str] = {}
    for argument in _listed(arguments, faults):
        for project in _projects(argument, faults):
            found.setdefault(os.path.realpath(project), project)
    if not found and not faults:
        faults.append(Fault("no project is named", "no-project", expected="project files, folders, or @FILE"))
    if faults:
        raise InputError(faults)
    projects = list(found.values())
    return [ChosenProject(n, *pair) for n, pair in enumerate(zip(projects, output_names(projects), strict=True))]


def _listed(arguments: Iterable[str], faults: list[Fault]) -> Iterator[str]:
    for argument in arguments:
        if not argument.startswith(LIST):
            yield argument
            continue
        file = argument.removeprefix(LIST)
        try:
            data = sys.stdin.buffer.read() if file == "-" else read_bytes(file, LARGEST_LIST_FILE)
            text, _ = decode(file, data)
        except InputError as error:
            faults += error.faults
            continue
        folder = Path() if file == "-" else Path(file).parent
        lines = [line.strip() for line in text.splitlines()]
        yield from (str(folder / line) for line in lines if line and not line.startswith("#"))


def _projects(argument: str, faults: list[Fault]) -> list[str]:
    path = Path(argument)
    if path.is_dir():
        found = _below(path)
        if not found:
            message = f"there is no {PROJECT} in this folder or below it"
            faults.append(Fault(message, "no-project", argument, fix="name the project files themselves"))
        return found
    if glob.has_magic(argument) and not path.exists():
        matches = [Path(each) for each in sorted(glob.glob(argument, recursive=True))]  # noqa: PTH207 (takes any path)
        found = []
        for each in matches:
            found += _below(each) if each.is_dir() else [str(each)] * (each.suffix in ENDINGS)
        if not found:
            faults.append(Fault("no project matches this pattern", "no-project", argument))
        return found
    return [str(path)]  # a file that is not there is reported as the fault of that project, among the others


def _below(folder: Path) -> list[str]:
    """Return the project of a folder, or those of all folders below it except hidden ones."""
    if (folder / PROJECT).is_file():
        return [str(folder / PROJECT)]
    found = []
    for place, inner, files in os.walk(folder, followlinks=True):
        inner[:] = sorted(name for name in inner if not name.startswith("."))
        if PROJECT in files:
            found.append(str(Path(place) / PROJECT))
            inner.clear()
    return sorted(found)


def output_names(projects: Sequence[str]) -> list[str]:
    """Return the name of each project's result folder.

    It is the folder of a ``project.yaml``, the name of any other file without its ending; where that is not enough,
    with as many folders above it as tell one from the other (``north/s1``, ``south/s1``).
    """
    parts = [_parts(project) for project in projects]
    names = [["/".join(each[-depth:]) for depth in range(1, len(each) + 1)] for each in parts]
    deepest = max(map(len, parts), default=0)
    # some file systems know no case
    shared = [Counter(each[min(depth, len(each) - 1)].casefold() for each in names) for depth in range(deepest)]
    return [
        next((name for name, of in zip(each, shared, strict=False) if of[name.casefold()] == 1), f"{each[-1]}/{number}")
        for number, each in enumerate(names, 1)
    ]


def _parts(project: str) -> tuple[str, ...]:
    """Return the folders above a result and its name."""
    path = Path(os.path.abspath(project))  # noqa: PTH100 (links stay: the user named them)
    folders = path.parent.parts[1:]
    if path.stem == "project" and folders:
        return folders
    return (*folders, path.stem)
