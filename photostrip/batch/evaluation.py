"""One project of a batch: what goes to a worker, how it is computed there, and what comes back.

Tasks and answers are plain values that travel between processes and machines. Nothing is written here.
"""

from __future__ import annotations

import tempfile
import traceback
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from photostrip.errors import EXIT_GEOMETRY, EXIT_INPUT, EXIT_INTERNAL, Fault, GeometryError, InputError
from photostrip.foreign.exports import exported
from photostrip.formats.faults import Findings
from photostrip.formats.files import LARGEST_FILE, Source, digest, from_disk, read_bytes, reading_from
from photostrip.formats.tables import LARGEST_TABLE
from photostrip.geodesy.crs import grid_names
from photostrip.library.project import loaded_from
from photostrip.notes import Document
from photostrip.project.reading import Node, override, path_of, read_tree
from photostrip.report.page.messages import findings_of, line_of, result_findings
from photostrip.result.verdict import FAILED, GOOD, LOOK, UNVERIFIED, exit_code, headline_rms, seen_at

if TYPE_CHECKING:
    from photostrip.library.result import Result
    from photostrip.project.loading import Project

DECIMALS = 5  # of degrees: a metre
# How a project can end beside the verdicts of a result (good, unverified, look, failed), and the exit code of each.
FAULTY, UNWRITTEN, WEAK = "faulty", "unwritten", "weak"
BROKEN, TIMEOUT, MEMORY, NOT_RUN = "crashed", "timeout", "memory", "not run"
EXIT_CODES = {
    **{status: exit_code(status, strict=False) for status in (GOOD, UNVERIFIED, LOOK, FAILED)},
    FAULTY: EXIT_INPUT,
    UNWRITTEN: EXIT_INPUT,
    WEAK: EXIT_GEOMETRY,
    BROKEN: EXIT_INTERNAL,
    TIMEOUT: EXIT_INTERNAL,
    MEMORY: EXIT_INTERNAL,
    NOT_RUN: 0,
}


@dataclass(frozen=True)
class Parcel:
    """The files of a project."""

    # content of the project file, of what it extends and of its tables, by path as the user typed it
    files: dict[str, bytes]
    grids: dict[str, bytes]  # content of the grid files beside the project file, by name
    folder: str


@dataclass(frozen=True)
class Task:
    """One project to be computed."""

    number: int
    project: str  # path of the project file as the user knows it
    overrides: tuple[str, ...] = ()
    html: bool = False  # whether its report is wanted as a page, too
    parcel: Parcel | None = None  # its files, when it goes to another machine; None: they are read from the disk


@dataclass(frozen=True)
class Answer:
    """What became of a project."""

    number: int
    outcome: Document  # its line in the summary, see ``outcome_of``
    files: dict[str, str | bytes] = field(default_factory=dict)  # content by name; none after a failure
    # SHA-256 of every file read, by path; None for a file that would have been read if it were there
    inputs: dict[str, str | None] = field(default_factory=dict)
    trace: str = ""


@dataclass(frozen=True)
class Limits:
    """What one project may use."""

    seconds: float | None = None  # time; None: any
    megabytes: float | None = None  # memory of the worker that computes it; None: an even share of the machine's memory


def evaluate(task: Task) -> Answer:
    """Compute a project: its result, or why there is none; nothing is raised."""
    try:
        return _from_parcel(task, task.parcel) if task.parcel is not None else _computed(task, Source())
    except InputError as error:
        return Answer(task.number, failure(FAULTY, error))
    except GeometryError as error:
        return Answer(task.number, failure(WEAK, error))
    except MemoryError:
        return out_of_memory(task)
    except Exception as error:  # noqa: BLE001 (a bug that one project meets must not end the others)
        message, fix = (
            f"internal error (a bug): {type(error).__name__}: {error}",
            "`photostrip run PROJECT --debug` shows where",
        )
        return failed(task, BROKEN, message, "internal", fix, traceback.format_exc())


def _from_parcel(task: Task, parcel: Parcel) -> Answer:
    """Compute a project whose files came along with it."""
    if not parcel.grids:
        return _computed(task, Source(parcel.files, parcel.folder, Path("no-such-folder")))
    with tempfile.TemporaryDirectory() as folder:
        unpack_grids(parcel, Path(folder))
        return _computed(task, Source(parcel.files, parcel.folder, Path(folder)))


def _computed(task: Task, source: Source) -> Answer:
    with reading_from(source):
        project = loaded_from(Path(task.project), task.overrides)
        result = project.run()
        files = exported(result.document, project.loaded.completed.export).files | result.files(html=task.html)
    outcome = outcome_of(result.document, result_findings(result.document)) | _place_of(result)
    return Answer(number=task.number, outcome=outcome, files=files, inputs=_inputs(project.loaded, source))


def _inputs(project: Project, source: Source) -> dict[str, str | None]:
    """Return the digest of every file that the result depends on."""
    inputs: dict[str, str | None] = dict(source.digests)
    for name in project.grids:
        grid = project.grid_folder / name
        inputs[str(project.directory / name)] = digest(from_disk(str(grid), LARGEST_FILE)) if grid.is_file() else None
    return inputs


def _place_of(result: Result) -> Document:
    """Return longitude and latitude of the first and the last photo of each strip, degrees, and the body's radius.

    None where the frame is local: only the project knows where it lies.
    """
    found = result.computed
    if found is None or found.output.kind == "local":
        return {"body": None, "track": None}
    frame, photos = found.output, result.document["photos"]
    strips: dict[str, list[Document]] = {}
    for photo in photos:
        strips.setdefault(photo["strip"], []).append(photo)
    ends = [end for group in strips.values() for end in (group[0], group[-1])]
    given = np.array([[end["x"], end["y"], end["z"]] for end in ends], float)
    internal = np.empty_like(given)
    internal[:, list(frame.order)] = given
    degrees = np.degrees(frame.geodetic(frame.cartesian_from_ground(internal))[:, :2]).round(DECIMALS).tolist()
    radius = frame.ellipsoid[0] if frame.ellipsoid else 6378137.0
    return {"body": radius, "track": [degrees[n : n + 2] for n in range(0, len(degrees), 2)]}


def outcome_of(document: Document, findings: list[Document]) -> Document:
    """Return the line of the summary for a result with its findings.

    The rms are those at check points, at control left out in turn, or at control points; ``rms_at`` says which. Points
    that stand out are left out. ``messages`` are
    sentences, worst first.
    """
    summary, status = document["summary"], document["status"]
    role = seen_at(document)
    return {
        "status": status,
        "exit_code": EXIT_CODES[status],
        "adjustment": document["adjustment"],
        "strips": len(document["strips"]),
        "photos": len(document["photos"]),
        "points": len(document["points"]),
        "rejected": len(document["rejected"]),
        "sigma0_um": summary["sigma0_um"],
        "rms_at": "left-out" if role == "cross_validation" else role,
        "rms_plan_m": headline_rms(document, role, "plan")["rms"],
        "rms_height_m": headline_rms(document, role, "height")["rms"],
        "messages": [document["verdict"]["verification"]] if status == UNVERIFIED else document["verdict"]["look_at"],
        "findings": [each for each in findings if each["severity"] == "error"],
    }


def failure(status: str, error: InputError | GeometryError | Fault) -> Document:
    """Return the line of the summary for a project without a result: the keys of a result, without numbers."""
    findings = findings_of(InputError(error) if isinstance(error, Fault) else error)
    nothing = dict.fromkeys(
        ("strips", "photos", "points", "rejected", "sigma0_um", "rms_at", "rms_plan_m", "rms_height_m")
    )
    return {
        "status": status,
        "exit_code": EXIT_CODES[status],
        "adjustment": None,
        **nothing,
        "messages": [line_of(each).removeprefix("error: ") for each in findings],
        "findings": findings,
        "body": None,
        "track": None,
    }


def not_run() -> Document:
    """Return the line of the summary for a project that was not reached."""
    return failure(NOT_RUN, InputError(()))


def failed(task: Task, status: str, message: str, code: str, fix: str, trace: str = "") -> Answer:
    """Answer why a project has no result."""
    return Answer(task.number, failure(status, Fault(message, code, fix=fix)), trace=trace)


def out_of_memory(task: Task) -> Answer:
    fix = "give more with --memory, with fewer processes (-j) if need be"
    return failed(task, MEMORY, "needs more memory than a worker may have", "memory", fix)


def pack(path: Path, overrides: Sequence[str] = ()) -> Parcel:
    """Read all files of a project without looking into its tables."""
    findings, names = Findings(), list[str]()
    with reading_from(Source()):  # a separate account: what is read now is not what a result is made from
        root = read_tree(str(path), findings, names)
        if root is not None:
            root = override(root, overrides, findings)
            names += [path_of(node, str(path)) for node in _values(root, "file")]
        findings.stop()
        files = {name: read_bytes(name, LARGEST_TABLE) for name in dict.fromkeys(names)}
    if root is None:  # cannot be: read_tree() had a reason, and stop() raised it
        raise InputError(f"{path} cannot be read")
    grids = {name for node in _values(root, "crs") for name in grid_names(node.text)}
    # grids elsewhere than below the project's folder must be on every machine
    below = (name for name in sorted(grids) if not Path(name).is_absolute() and ".." not in Path(name).parts)
    found = {name: path.parent / name for name in below if (path.parent / name).is_file()}
    return Parcel(files, {name: from_disk(str(grid), LARGEST_FILE) for name, grid in found.items()}, str(Path.cwd()))


def unpack_grids(parcel: Parcel, folder: Path) -> None:
    """Write the grid files of a parcel, which PROJ reads by itself, into a folder."""
    for name, data in parcel.grids.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)


def _values(node: Node, key: str) -> Iterator[Node]:
    """Return every text of the project that stands under a key of this name, or in a list under it."""
    for name, inner in node.entries.items():
        if name == key:
            yield from (each for each in (inner, *inner.elements) if each.text)
        yield from _values(inner, key)
    for inner in node.elements:
        yield from _values(inner, key)
