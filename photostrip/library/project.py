"""A project: read from its file, made in memory or simulated; checked and run."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from photostrip.errors import Fault, InputError
from photostrip.formats.files import LARGEST_FILE, Source, current, digest, from_disk
from photostrip.formats.files import reading_from as accounted
from photostrip.library.result import Result
from photostrip.notes import counted

if TYPE_CHECKING:
    from photostrip.pipeline.results import Result as Computed
    from photostrip.project.check import Checked
    from photostrip.project.loading import Project as Loaded

PROJECT_FILE, TRUTH = "project.yaml", "truth.json"  # of a simulation
_WORD = re.compile(r"[\w-]+")


class Project:
    """A project that was read without a fault, ready to run; made by ``photostrip.load``."""

    def __init__(
        self,
        loaded: Loaded,
        assignments: Sequence[str] = (),
        source: Source | None = None,
        digests: Mapping[str, str] | None = None,
    ) -> None:
        self.loaded = loaded
        """What the pipeline takes: ``inputs`` and ``settings``, with the places of all values in the files."""
        self._assignments, self._source, self._digests = assignments, source, digests or {}

    @property
    def name(self) -> str:
        """Its name."""
        return self.loaded.inputs.name

    @property
    def photos(self) -> tuple[str, ...]:
        """Photos in flight order, strip by strip."""
        return tuple(photo for strip in self.loaded.inputs.flights for photo in strip.photos)

    @property
    def resolved(self) -> str:
        """The project as YAML, with every default filled in."""
        return self.loaded.resolved

    def overridden(self, **overrides: Any) -> Project:  # noqa: ANN401 (values of a project file)
        """Read the project again with other values of some keys (see ``load``)."""
        return loaded_from(self.loaded.path, (*self._assignments, *assignments_of(overrides)), self._source)

    def check(self) -> Check:
        """Return all that can be said before anything is adjusted."""
        return _checked(self.loaded.path, self._assignments, self._source)

    def run(self) -> Result:
        """Adjust it.

        Raises InputError or GeometryError, with the findings that may be the cause.
        """
        from photostrip.project.loading import adjust_project
        from photostrip.result.document import document_of

        with reading_from(self._source):
            computed = self.loaded.result(adjust_project(self.loaded))
            document = document_of(computed, self.loaded.remarks)
            document["certificate"] = self._certificate(document, computed)
        read = self.loaded.files_read(computed) if self._source is None else ()
        exports = self.loaded.completed.export
        return Result(document, computed=computed, resolved=self.loaded.resolved, read=read, exports=exports)

    def _certificate(self, document: dict[str, Any], computed: Computed) -> dict[str, Any]:
        """Say what the result was made from, by hashes that any machine can repeat."""
        from photostrip.result.certificate import certificate_of

        loaded, inputs = self.loaded, self.loaded.inputs
        grids = {Path(grid) for frame in (*computed.frames, computed.output) for grid in frame.grids}
        return certificate_of(
            document,
            frames=[*inputs.frames, inputs.output or inputs.frames[0]],
            inputs={loaded.seen(file): content for file, content in self._digests.items()},
            grids={grid.name: digest(from_disk(str(grid), LARGEST_FILE)) for grid in grids if grid.is_file()},
            settings={"set": list(self._assignments), "resolved_sha256": digest(loaded.resolved.encode())},
        )

    def files_read(self, result: Result) -> tuple[Path, ...]:
        """Return every file that a run of it read, grids of geoids and datum shifts included."""
        return self.loaded.files if result.computed is None else self.loaded.files_read(result.computed)

    def __repr__(self) -> str:
        """Say in a line what there is."""
        inputs = self.loaded.inputs
        measured = counted(len(inputs.observations), "image point") if inputs.models is None else "independent models"
        flown = f"{counted(len(inputs.flights), 'strip')}, {counted(len(self.photos), 'photo')}"
        return f"<Project {self.name}: {flown}, {measured}>"


class Check:
    """What ``photostrip check`` finds: faults, findings and notes, each with its place and its cure."""

    def __init__(self, checked: Checked) -> None:
        self._checked = checked
        self.faults = checked.faults
        """What must be put right before the project is run."""
        self.findings = checked.findings
        """What the data say against themselves."""
        self.notes = checked.notes
        """What is worth knowing beside."""
        self.ok = not checked.wrong
        """Whether nothing must be put right before the project is run."""
        self.document = checked.document
        """What was decoded: counts, rows of tables, frames, control; empty when the files could not be read."""

    def __repr__(self) -> str:
        """Return the messages, a line each."""
        from photostrip.report.page.messages import finding_of, lines_of

        found = [finding_of(each) for each in self._checked.everything]
        return "\n".join([f"<Check {'ok' if self.ok else 'faulty'}>", *lines_of(found)])


def load(
    project: str | PathLike[str] | Mapping[str, Any],
    **overrides: Any,  # noqa: ANN401 (values of a project file)
) -> Project:
    """Read a project and all its tables.

    project: the project file; or its content as a mapping, with tables in memory where files are named: data frames,
        structured arrays, or mappings of names of columns to values.
    overrides: keys with other values than the project has, ``processing={"adjustment": "bundle"}``; of a mapping
        the tables of its blocks, too: ``observations=frame, control=frame``, of several lists ``control=[one, other]``.
    Raises InputError with every fault of every file.
    """
    path, source, rest = place_of(project, "project", overrides)
    return loaded_from(path, assignments_of(rest), source)


def check(
    project: Project | str | PathLike[str] | Mapping[str, Any],
    **overrides: Any,  # noqa: ANN401 (values of a project file)
) -> Check:
    """Check a project without adjusting it; a faulty one raises nothing. Its arguments are those of ``load``."""
    if isinstance(project, Project):
        return (project.overridden(**overrides) if overrides else project).check()
    path, source, rest = place_of(project, "project", overrides)
    return _checked(path, assignments_of(rest), source)


def run(
    project: Project | str | PathLike[str] | Mapping[str, Any],
    **overrides: Any,  # noqa: ANN401 (values of a project file)
) -> Result:
    """Adjust a project. Its arguments are those of ``load``.

    Raises InputError or GeometryError, with the findings that may be the cause.
    """
    if isinstance(project, Project):
        return (project.overridden(**overrides) if overrides else project).run()
    return load(project, **overrides).run()


def place_of(
    given: str | PathLike[str] | Mapping[str, Any],
    name: str,
    overrides: Mapping[str, Any],
    schema: str = "photostrip",
) -> tuple[Path, Source | None, dict[str, Any]]:
    """Return the path of a file, what it is read from where its content is given, and overrides that are no tables.

    name: what the content is called in messages.
    """
    from photostrip.project.in_memory import source_of, with_tables

    if not isinstance(given, Mapping):
        if with_tables({}, overrides)[0]:
            raise InputError(Fault("tables in memory go with a project that is a mapping", "type", str(given)))
        return Path(given), None, dict(overrides)
    content, rest = with_tables({schema: 1, **given}, overrides)
    return Path(name), source_of(name, content), rest


def assignments_of(overrides: Mapping[str, Any], above: str = "") -> list[str]:
    """Return overrides as assignments to keys: ``processing.adjustment="bundle"``."""
    from photostrip.project.in_memory import text_of
    from photostrip.project.reading import OVERRIDE, Override

    found: list[str] = []
    for key, value in overrides.items():
        name = key if not above or _WORD.fullmatch(key) else f'"{key}"'
        path = f"{above}.{name}" if above else name
        if isinstance(value, Mapping):
            found += assignments_of(value, path)
        else:
            found.append(Override(f"{path}={text_of(value, OVERRIDE, path)}"))
    return found


def loaded_from(path: Path, assignments: Sequence[str], source: Source | None = None) -> Project:
    """Read a project from files, or from a source in memory."""
    from photostrip.project.loading import load_project

    with reading_from(source), accounted(current() or Source()) as account:
        loaded = load_project(path, assignments)
        return Project(loaded, assignments, source, dict(account.digests))


def _checked(path: Path, assignments: Sequence[str], source: Source | None) -> Check:
    from photostrip.project.check import check_project

    with reading_from(source):
        checked = check_project(path, assignments)
    if source is not None:
        from photostrip.project.in_memory import unplaced

        faults, findings, notes = unplaced(checked.faults), unplaced(checked.findings), unplaced(checked.notes)
        checked = replace(checked, faults=faults, findings=findings, notes=notes)
    return Check(checked)


def reading_from(source: Source | None) -> AbstractContextManager[None]:
    """Read from memory where the project has no files."""
    if source is None:
        return nullcontext()
    from photostrip.project.in_memory import in_memory

    return in_memory(source)


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
        return loaded_from(Path(PROJECT_FILE), (), self._source)

    @property
    def _source(self) -> Source:
        return Source({name: text.encode() for name, text in self.files.items()})

    def write(self, folder: str | PathLike[str]) -> None:
        """Write the files into a folder, as ``photostrip simulate -o`` does: all of them or none.

        Raises InputError where a project stands there that no simulation wrote.
        """
        from photostrip.formats.files import write_files

        there = Path(folder) / PROJECT_FILE
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
    path, source, rest = place_of(specification, "specification", overrides, "photostrip_simulation")
    with reading_from(source):
        return simulated(path, assignments_of(rest))


def simulated(path: Path, assignments: Sequence[str]) -> Simulation:
    from photostrip.foreign.simulated import project_files, summary
    from photostrip.project.simulation import load_specification

    specification = load_specification(path, assignments)
    found = specification.simulate()
    return Simulation(project_files(found), summary(found), specification.reading.files)
