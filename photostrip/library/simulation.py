"""Synthetic projects with known truth, in memory."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

from photostrip.errors import Fault, InputError
from photostrip.formats.files import Source
from photostrip.library.project import Project, assignments_of, loaded_from, reading_from

KEY = "photostrip_simulation"  # number of the schema
PROJECT, TRUTH = "project.yaml", "truth.json"


class Simulation:
    """A simulated project: its files, and the truth that they were made from."""

    def __init__(self, files: Mapping[str, str], summary: str, read: Iterable[str] = ()) -> None:
        self.files = dict(files)
        """Content by name: project.yaml, its tables, truth.json."""
        self.summary = summary
        """What was simulated, in a line."""
        self.files_read = tuple(read)
        """Every file that was read."""

    @property
    def truth(self) -> dict[str, Any]:
        """The content of truth.json: true coordinates, perspective centres, rotations; the errors that were put in."""
        from photostrip.formats.result_json import parsed

        with reading_from(self._source):
            return dict(parsed(TRUTH))

    @property
    def project(self) -> Project:
        """The project, ready to run, without files."""
        return loaded_from(Path(PROJECT), (), self._source)

    @property
    def _source(self) -> Source:
        return Source({name: text.encode() for name, text in self.files.items()})

    def write(self, folder: str | PathLike[str]) -> None:
        """Write the files into a folder, as ``photostrip simulate -o`` does: all of them or none.

        Raises InputError where a project stands there that no simulation wrote.
        """
        from photostrip.formats.files import write_files

        there = Path(folder) / PROJECT
        if there.exists() and not there.with_name(TRUTH).exists():
            message, fix = "is no simulated project, and is not overwritten", "choose another folder, or remove it"
            raise InputError(Fault(message, "exists", str(there), fix=fix))
        write_files(Path(folder), self.files)

    def __repr__(self) -> str:
        """Say in a line what was simulated."""
        return f"<Simulation: {self.summary}>"


def simulate(
    specification: str | PathLike[str] | Mapping[str, Any],
    **overrides: Any,  # noqa: ANN401 (values of a specification)
) -> Simulation:
    """Simulate a project with known truth.

    specification: a file, or its content as a mapping; ``{}`` takes every default.
    overrides: keys with other values: ``flight={"photos": 20}, seed=3``.
    Raises InputError with every fault of the specification.
    """
    from photostrip.project.in_memory import SPECIFICATION, source_of

    source = source_of(SPECIFICATION, {KEY: 1, **specification}, {}) if isinstance(specification, Mapping) else None
    path = Path(SPECIFICATION) if isinstance(specification, Mapping) else Path(specification)
    with reading_from(source):
        return simulated(path, assignments_of(overrides))


def simulated(path: Path, assignments: Sequence[str]) -> Simulation:
    from photostrip.formats.simulation import project_files, summary
    from photostrip.project.simulation import load_specification

    specification = load_specification(path, assignments)
    found = specification.simulate()
    return Simulation(project_files(found), summary(found), specification.reading.files)
