"""One project from its files to the texts of its result, as a worker computes it; nothing is written."""

from __future__ import annotations

import tempfile
import traceback
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from photostrip.batch.outcomes import BROKEN, FAULTY, WEAK, failure, out_of_memory, outcome_of
from photostrip.batch.parcel import Parcel, unpack_grids
from photostrip.batch.tasks import Answer, Task
from photostrip.errors import Fault, GeometryError, InputError
from photostrip.foreign.exports import exported
from photostrip.formats.text.files import LARGEST_FILE, from_disk
from photostrip.formats.text.source import Source, digest, reading_from
from photostrip.library.project import loaded_from
from photostrip.notes import Document
from photostrip.report.page.messages import result_findings

if TYPE_CHECKING:
    from photostrip.library.result import Result
    from photostrip.project.loading import Project

DECIMALS = 5  # of degrees: a metre


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
