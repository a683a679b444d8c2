"""Results of small simulated projects, shared by the tests of what is made from results."""

from __future__ import annotations

import copy
import pickle
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from photostrip.foreign.simulated import project_files
from photostrip.geodesy.frame_spec import FrameSpec
from photostrip.library import result as library
from photostrip.pipeline.inputs import Settings
from photostrip.pipeline.run import triangulate
from photostrip.result.derived import with_derived
from photostrip.result.description import Block, Columns, described
from photostrip.result.document import document_of
from photostrip.result.numbers import MATRIX
from photostrip.result.table import Table, as_array, in_frame
from photostrip.simulation.simulation import simulate
from photostrip.simulation.spec import Control, Flight, GrossError, Ground, Image, Points, Spec
from tests.simulated import inputs_of

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from photostrip.pipeline.frames import TiedFrames
    from photostrip.pipeline.inputs import Inputs
    from photostrip.pipeline.results import Result

Document = dict[str, Any]

GRIDS = {".gsb", ".gtx", ".tif"}
EAST_FIRST, NORTH_FIRST = ("east", "north", "up"), ("north", "east", "up")
FRAMES = {
    "local": Ground("local"),
    "projected": Ground("EPSG:32633"),
    "north first": Ground("EPSG:32633", NORTH_FIRST),
    "geographic": Ground("EPSG:4326"),
    "geocentric": Ground("geocentric", ("x", "y", "z")),
    "south": Ground("EPSG:32719", center_deg=(-68.0, -33.0)),
}


def rotation(photo: Document) -> NDArray[np.float64]:
    """Give the matrix of a photo or a model."""
    return np.array([photo[name] for name in MATRIX]).reshape(3, 3)


def result_files(document: Document, resolved: str = "") -> dict[str, str]:
    """Give the files of a result, content by name."""
    return library.Result(document, resolved=resolved).files()


@dataclass(frozen=True, eq=False)
class Case:
    """A project, its result and the document of that."""

    inputs: Inputs
    result: Result
    document: Document

    @property
    def measured(self) -> dict[tuple[str, str], NDArray[np.float64]]:
        """Measured image coordinates by photo and point, mm."""
        o = self.inputs.observations
        return {
            (o.photo_ids[photo], o.point_ids[point]): xy
            for photo, point, xy in zip(o.photo, o.point, o.xy, strict=True)
        }


def spec(frame: str = "projected", strips: int = 1, sigma_um: float = 5.0, *errors: GrossError, bands: int = 3) -> Spec:
    """Give a small project: five photos to a strip."""
    return Spec(
        name="small",
        ground=FRAMES[frame],
        flight=Flight(photos=5, strips=strips, heading_deg=70.0),
        points=Points(extra_per_model=4),
        control=Control(per_band=3, bands=bands, check=4),
        image=Image(sigma_um),
        gross_errors=errors,
    )


def solved(inputs: Inputs, settings: Settings | None = None) -> Case:
    """Run a project."""
    result = triangulate(inputs, settings or Settings())
    return Case(inputs, result, document_of(result))


@cache
def case(frame: str = "projected", strips: int = 1, sigma_um: float = 5.0, *errors: GrossError) -> Case:
    """Run a simulated project by the strip method, which fills more of a result; every other one is run once only."""
    return solved(inputs_of(simulate(spec(frame, strips, sigma_um, *errors))), Settings(adjustment="polynomial"))


_results: dict[bytes, Result] = {}


def known(
    inputs: Inputs, settings: Settings, *, directory: Path | None = None, tied: TiedFrames | None = None
) -> Result:
    """Do as ``triangulate``, or give what the same data with the same settings gave before, far from any grid."""
    if directory is not None and any(path.suffix in GRIDS for path in directory.iterdir()):
        return triangulate(inputs, settings, directory=directory, tied=tied)
    asked = pickle.dumps((inputs, settings))
    if asked not in _results:
        _results[asked] = triangulate(inputs, settings, directory=directory, tied=tied)
    return _results[asked]


def written_to(crs: str, axes: tuple[str, str, str], source: str = "projected", strips: int = 1) -> Case:
    """Run a project whose result is wanted in another frame than its control has."""
    inputs = inputs_of(simulate(spec(source, strips)))
    return solved(replace(inputs, output=FrameSpec(crs, axes)), Settings(adjustment="polynomial"))


def write_project(folder: Path, spec: Spec, more: str = "") -> Path:
    """Write a simulated project as files, with more lines at its end."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in project_files(simulate(spec)).items():
        (folder / name).write_text(text + (more if name == "project.yaml" else ""), encoding="utf-8")
    return folder / "project.yaml"


def by_rows(value: Any) -> Any:  # noqa: ANN401 (any part of a document)
    """Give a copy of a document that may be changed: its tables as lists of rows."""
    if isinstance(value, dict):
        return {key: by_rows(each) for key, each in value.items()}
    return copy.deepcopy(list(value) if isinstance(value, Table) else value)


def in_tables(value: Any, block: Block | None = None) -> Any:  # noqa: ANN401
    """Give a document with tables again; a row that lacks a key has nothing there."""
    entries = described() if block is None else block
    found = dict(value)
    for key, entry in entries.items():
        if isinstance(entry, Columns) and isinstance(value.get(key), list):
            keys = list(dict.fromkeys(name for row in value[key] for name in row)) or [
                name for name, each in entry.items() if not each.optional
            ]
            columns = {name: as_array(entry[name], [row.get(name) for row in value[key]]) for name in keys}
            found[key] = Table(key, columns, entry)
        elif isinstance(entry, Block) and isinstance(value.get(key), dict):
            found[key] = in_tables(value[key], entry)
    return in_frame(with_derived(found)) if block is None and "frame" in found else found


PLACE: Document = {"file": "", "line": 0, "column": 0, "key": "", "photos": [], "points": []}


def a_note(code: str, message: str, **more: object) -> Document:
    """Give a warning as it stands in a result, or a note."""
    return {**PLACE, "code": code, "severity": "warning", "message": message, "strip": "", **more}


def a_finding(code: str, message: str, **more: object) -> Document:
    """Give a finding that nobody has accepted."""
    said = {"code": code, "title": "t", "severity": "warning", "message": message, "fix": "look"}
    return {**PLACE, **said, "strips": [], "evidence": {}, "accepted": False, **more}


def columns_of(rows: list[Document]) -> dict[str, list[Any]]:
    """Give rows as JSON has their table."""
    return {key: [row[key] for row in rows] for key in rows[0]}
