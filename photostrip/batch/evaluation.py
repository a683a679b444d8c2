"""One project from its files to the texts of its result, as a worker computes it; nothing is written."""

from __future__ import annotations

import tempfile
import traceback
from pathlib import Path
from typing import TYPE_CHECKING

from photostrip.batch.outcomes import BROKEN, FAULTY, WEAK, failure, out_of_memory, outcome_of
from photostrip.batch.parcel import Parcel, unpack_grids
from photostrip.batch.places import place_of
from photostrip.batch.tasks import Answer, Task
from photostrip.errors import Fault, GeometryError, InputError
from photostrip.formats.text.source import Source, digest, reading_from
from photostrip.library.project import loaded_from
from photostrip.report.page.messages import result_findings

if TYPE_CHECKING:
    from photostrip.project.loading import Project


def evaluate(task: Task) -> Answer:
    """Compute a project: its result, or why there is none; nothing is raised."""
    try:
        return _from_parcel(task, task.parcel) if task.parcel is not None else _computed(task, Source())
    except InputError as error:
        return Answer(task.number, failure(FAULTY, error))
    except GeometryError as error:
        return Answer(task.number, failure(WEAK, error))
    except MemoryError:
        return Answer(task.number, out_of_memory())
    except Exception as error:  # noqa: BLE001 (a bug that one project meets must not end the others)
        message = f"internal error (a bug): {type(error).__name__}: {error}"
        fault = Fault(message, "internal", fix="`photostrip run PROJECT --debug` shows where")
        return Answer(task.number, failure(BROKEN, fault), trace=traceback.format_exc())


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
        files = result.files(html=task.html)
    outcome = outcome_of(result.document, result_findings(result.document)) | place_of(result)
    return Answer(number=task.number, outcome=outcome, files=files, inputs=_inputs(project.loaded, source))


def _inputs(project: Project, source: Source) -> dict[str, str | None]:
    """Return the digest of every file that the result depends on."""
    inputs: dict[str, str | None] = dict(source.digests)
    for name in project.grids:
        grid = project.grid_folder / name
        inputs[str(project.directory / name)] = digest(grid.read_bytes()) if grid.is_file() else None
    return inputs
