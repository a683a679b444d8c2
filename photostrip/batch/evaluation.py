"""The work itself: one project from its files to the texts of its result. It runs in a worker and never writes."""

from __future__ import annotations

import tempfile
import time
import traceback
from pathlib import Path
from typing import TYPE_CHECKING

from photostrip.batch.parcel import unpack_grids
from photostrip.batch.tasks import BROKEN, FAULTY, WEAK, Answer, failure, out_of_memory, outcome_of
from photostrip.errors import Fault, GeometryError, InputError
from photostrip.formats.output.result_files import result_files
from photostrip.formats.text.source import Source, digest, reading_from
from photostrip.pipeline import triangulate
from photostrip.project.loading import load_project
from photostrip.report.page.messages import result_findings
from photostrip.result.document import document_of

if TYPE_CHECKING:
    from photostrip.batch.tasks import Document, Task
    from photostrip.project.loading import Project


def evaluate(task: Task) -> Answer:
    """Compute a project.

    Returns
    -------
    Answer
        Its result, or why there is none; nothing is raised.
    """
    start = time.perf_counter()
    trace = ""
    try:
        outcome, files, inputs = _from_parcel(task) if task.parcel is not None else _computed(task, Source())
    except InputError as error:
        outcome, files, inputs = failure(FAULTY, error), {}, {}
    except GeometryError as error:
        outcome, files, inputs = failure(WEAK, error), {}, {}
    except MemoryError:
        outcome, files, inputs = out_of_memory(), {}, {}
    except Exception as error:  # noqa: BLE001 (a bug that one project meets must not end the others)
        trace = traceback.format_exc()
        message = f"internal error (a bug): {type(error).__name__}: {error}"
        fault = Fault(message, "internal", fix="`photostrip run PROJECT --debug` shows where")
        outcome, files, inputs = failure(BROKEN, fault), {}, {}
    return Answer(task.number, outcome, files, inputs, time.perf_counter() - start, trace=trace)


def _from_parcel(task: Task) -> tuple[Document, dict[str, str], dict[str, str | None]]:
    """Compute a project whose files came along with it."""
    parcel = task.parcel
    if parcel is None:  # cannot be: evaluate() looked
        raise InputError("there is no parcel")
    if not parcel.grids:
        return _computed(task, Source(parcel.files, parcel.folder, Path("no-such-folder")))
    with tempfile.TemporaryDirectory() as folder:
        unpack_grids(parcel, Path(folder))
        return _computed(task, Source(parcel.files, parcel.folder, Path(folder)))


def _computed(task: Task, source: Source) -> tuple[Document, dict[str, str], dict[str, str | None]]:
    """Read, adjust and render a project."""
    with reading_from(source):
        project = load_project(Path(task.project), task.overrides)
        with project.places():
            result = triangulate(project.inputs, project.settings, directory=project.grid_folder)
        document = document_of(result, project.remarks)
        files = result_files(document, project.resolved)
    return outcome_of(document, result_findings(document)), files, _inputs(project, source)


def _inputs(project: Project, source: Source) -> dict[str, str | None]:
    """Return the digest of every file that the result depends on."""
    inputs: dict[str, str | None] = dict(source.digests)
    for name in project.grids:
        grid = project.grid_folder / name
        inputs[str(project.directory / name)] = digest(grid.read_bytes()) if grid.is_file() else None
    return inputs
