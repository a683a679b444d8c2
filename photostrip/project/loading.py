"""A project file and its tables, read and checked: plain inputs and settings for the pipeline."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from photostrip.arrays import Numbers
from photostrip.errors import Fault, GeometryError, InputError
from photostrip.formats.faults import Findings
from photostrip.formats.files import current, seen_from
from photostrip.formats.measured import Measurements
from photostrip.geodesy.crs import grid_names
from photostrip.geodesy.frame_spec import FrameSpec
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geodesy.tying import tie_frames
from photostrip.notes import Finding, Note
from photostrip.pipeline.frames import TiedFrames
from photostrip.pipeline.inputs import Inputs, ModelStrip, Settings, Strip
from photostrip.points import PhotoPoints
from photostrip.project import conversion
from photostrip.project.conversion import with_pixel_sizes
from photostrip.project.hints import hints
from photostrip.project.keys import Camera as CameraBlock
from photostrip.project.keys import CameraPositions as CameraPositionsBlock
from photostrip.project.keys import Control, GivenList, Orientations, Output, ProjectFile
from photostrip.project.reading import NO_FILES, Node, Reading, at_own_key, steps, valid_section
from photostrip.project.references import check_references
from photostrip.project.resolved import completed, text_of
from photostrip.project.tables import (
    Tables,
    check_models,
    check_tables,
    in_one_zone,
    measured_models,
    measured_photos,
    read_tables,
)

if TYPE_CHECKING:
    from photostrip.pipeline.results import Result


@dataclass(frozen=True, eq=False)
class ListedPoints:
    """Where the points of a control list stand: all that is kept of it while a project is run."""

    file: str
    ids: Sequence[str]
    lines: Numbers  # (n,): line of each id, counted from 1


def listed_points(tables: Tables) -> tuple[ListedPoints, ...]:
    """Return where the points of all control lists stand that could be read."""
    return tuple(
        ListedPoints(read.table.file, read.ids, read.table.lines) for read in tables.control if read is not None
    )


def places_of(
    findings: Iterable[Finding], tree: Node, control: Sequence[ListedPoints], strips: Sequence[Strip | ModelStrip]
) -> Iterator[Finding]:
    """Return findings with the place of their key, else of the first point in a control list or photo in a strip."""
    for each in findings:
        if each.key:
            path, key = steps(each.key), each.key
        elif each.points and (row := _given(each.points, control)) is not None:
            yield replace(each, file=row[0], line=row[1])
            continue
        else:
            path = _listed(each, strips[: len(tree.list_at("strips"))])
            path = path or (("photos",) if each.photos or each.strips else ())
            key = ""
        if not path or not tree.has(*path[:1]):
            yield each
            continue
        place = tree.place_of(path)
        yield replace(each, file=place.file, line=place.line, column=place.column, key=key)


def of_points(fault: Fault, control: Sequence[ListedPoints]) -> Fault:
    """Return a fault that knows only its points with the place of the first of them in a control list."""
    row = _given(fault.points, control)
    return fault if row is None else replace(fault, file=row[0], line=row[1])


def _given(points: tuple[str, ...], control: Sequence[ListedPoints]) -> tuple[str, int] | None:
    """File and line of the first of some points that a control list gives."""
    for listed in control:
        rows = np.flatnonzero(np.isin(np.array(listed.ids, str), points))
        if len(rows):
            return listed.file, int(listed.lines[rows[0]])
    return None


def _listed(finding: Finding, strips: Sequence[Strip | ModelStrip]) -> tuple[str | int, ...]:
    """Path of the first photo, or of the strip, that a finding names."""
    for number, strip in enumerate(strips):
        if finding.strips and strip.id not in finding.strips:
            continue
        for photo in finding.photos:
            if photo in strip.photos:
                return ("strips", number, "photos", strip.photos.index(photo))
        if finding.strips:
            return ("strips", number, "id")
    return ()


OF_IMAGES = ("photostrip", "cameras", "strips", "photos", "observations", "fiducial_measurements", "accept")
__all__ = ["Project", "adjust_project", "load_project", "read_project"]


@dataclass(frozen=True, eq=False)
class Project:
    """A project, ready to run."""

    inputs: Inputs
    settings: Settings
    path: Path
    files: tuple[Path, ...]  # every file that was read, the project file first, grid files beside it last
    completed: ProjectFile  # the project with all defaults filled in, without absolute paths
    hints: tuple[Note, ...]  # what was passed over or not used, and why
    tree: Node  # the project file with everything merged into it: it knows where each value stands
    control: tuple[ListedPoints, ...]
    # names of the grid files that the ground frames ask for. Those that stand beside the project file are used; for the
    # others PROJ looks elsewhere
    grids: tuple[str, ...]
    grid_folder: Path
    tied: TiedFrames | None  # the ground frames, tied; None where there are none

    @cached_property
    def resolved(self) -> str:
        """The completed project as YAML."""
        return text_of(self.completed)

    @property
    def directory(self) -> Path:
        """Folder of the project file."""
        return self.path.parent

    @property
    def remarks(self) -> tuple[Note, ...]:
        """The hints with files as seen from the project's folder: the same wherever the project is run from."""
        return tuple(replace(note, file=_seen_from(note.file, self.directory)) for note in self.hints)

    def placed(self, findings: Iterable[Finding]) -> tuple[Finding, ...]:
        """Give findings the place in the files where they would be put right."""
        return tuple(places_of(findings, self.tree, self.control, self.inputs.flights))

    def seen(self, file: str) -> str:
        """Return a file that was read as seen from the project's folder."""
        return _seen_from(file, self.directory)

    def result(self, result: Result) -> Result:
        """Return a result whose findings say where, with files as seen from the project's folder."""
        placed = (replace(each, file=_seen_from(each.file, self.directory)) for each in self.placed(result.findings))
        return replace(result, findings=tuple(placed))

    def files_read(self, result: Result) -> tuple[Path, ...]:
        """Return every file that a run read, the project file first, grids of geoids and datum shifts included."""
        grids = [Path(grid) for frame in (*result.frames, result.output) for grid in frame.grids]
        folder = self.directory.resolve()
        near = [self.directory / grid.relative_to(folder) if grid.is_relative_to(folder) else grid for grid in grids]
        return tuple(dict.fromkeys([*self.files, *near]))

    @contextmanager
    def places(self) -> Iterator[None]:
        """Give faults that are found in what was read, not while it was read, their place in the project file."""
        try:
            yield
        except InputError as error:
            faults = [fault if fault.file or fault.key else of_points(fault, self.control) for fault in error.faults]
            placed = InputError(fault if fault.file else at_own_key(fault, self.tree) for fault in faults)
            placed.findings = self.placed(error.findings)
            raise placed from None
        except GeometryError as error:
            error.findings = self.placed(error.findings)
            raise


def adjust_project(project: Project) -> Result:
    """Adjust a project; what is refused has its place in the project file."""
    from photostrip.pipeline.run import triangulate

    with project.places():
        return triangulate(
            project.inputs,
            project.settings,
            directory=project.grid_folder,
            tied=project.tied,
        )


def load_project(path: Path, overrides: Sequence[str] = ()) -> Project:
    """Read a project and all its tables, or raise every fault of every file.

    The tables are let go: with their text they take a fifth of what a run of many points holds.
    """
    return read_project(path, overrides)[0]


def read_project(path: Path, overrides: Sequence[str] = ()) -> tuple[Project, Tables]:
    """Read a project as ``load_project`` does, and give its tables, too."""
    reading = Reading.of(ProjectFile, path, overrides)
    root, findings = reading.root, reading.findings
    checked = reading.checked(ProjectFile)
    findings.add(*check_references(root))
    tables = read_tables(reading)
    findings.add(*check_tables(root, tables))
    placed_models = {} if tables.models is None else check_models(root, tables.models, findings)
    source = current()
    grid_folder = source.grids if source is not None and source.grids is not None else path.parent
    findings.add(*_check_certificates(root))
    tied = _tied_frames(root, grid_folder, findings)
    try:
        project = completed(reading.complete(checked), root, reading.file, measured_photos(tables))
        inputs, notes = _inputs(project, tables, root, placed_models, {} if tied is None else tied.frames)
    except InputError as error:
        error.findings = _units_of_images(reading, tables)
        raise
    specs = (*inputs.frames, *(() if inputs.output is None else (inputs.output,)))
    grids = tuple(dict.fromkeys(grid for spec in specs for grid in grid_names(spec.crs)))
    read = Project(
        inputs=inputs,
        settings=conversion.settings(project),
        path=path,
        files=(*map(Path, reading.files), *(path.parent / grid for grid in grids if (grid_folder / grid).is_file())),
        completed=project,
        hints=(*findings.notes, *hints(project, tables, root), *notes),
        tree=root,
        control=listed_points(tables),
        grids=grids,
        grid_folder=grid_folder,
        tied=tied,
    )
    return read, tables


def _seen_from(file: str, folder: Path) -> str:
    """Path of a file relative to a folder, with slashes on every system; as it is where there is no way."""
    if not file or file in NO_FILES:
        return file
    try:
        return seen_from(file, folder)
    except ValueError:  # another drive
        return file


def _check_certificates(root: Node) -> Iterator[Fault]:
    """Solve the distances between fiducial marks once, to find out whether that can be done."""
    for name, node in root.mapping_at("cameras").items():
        given = valid_section(CameraBlock, node)
        if given is None:
            continue  # the schema says what is wrong with it
        try:
            conversion.certificate_of(given)
        except InputError as error:
            yield from (at_own_key(fault, root, "cameras", name) for fault in error.faults)


def _tied_frames(root: Node, directory: Path, findings: Findings) -> TiedFrames | None:
    """Tie the ground frames together; what forbids it is a fault of the project."""
    given, output = _frames_given(root)
    specs = {name: conversion.frame_spec(each) for name, each in given.items() if each is not None}
    if not specs or len(specs) != len(given) or output is None:
        return None  # the schema says what is wrong with them
    try:
        target = conversion.output_spec(output, next(iter(specs.values())))
        tied, result = tie_frames(list(specs.values()), target, directory=directory, keys=list(specs))
    except InputError as error:
        findings.add(*(at_own_key(fault, root) for fault in error.faults))
        return None
    return TiedFrames(dict(zip(specs.values(), tied, strict=True)), result)


def _frames_given(root: Node) -> tuple[dict[str, GivenList | None], Output | None]:
    """Give the lists of given coordinates by their keys, and the frame of the results; None for what is at fault."""
    blocks: list[tuple[str, type[GivenList], Node | None]] = [
        *((f"control[{i}]", Control, each) for i, each in enumerate(root.list_at("control"))),
        ("camera_positions", CameraPositionsBlock, root.find("camera_positions")),
        ("orientations", Orientations, root.find("orientations")),
    ]
    given = {name: valid_section(kind, node) for name, kind, node in blocks if node is not None}
    return _without_own_frame(given), valid_section(Output, root.find("output"))


def _without_own_frame(given: dict[str, GivenList | None]) -> dict[str, GivenList | None]:
    """Leave out orientations in a frame of their own beside anything else: nothing ties that to the others."""
    own = given.get("orientations")
    alone = len(given) == 1 or not isinstance(own, Orientations) or own.role != "approximate" or own.crs != "local"
    return given if alone else {name: each for name, each in given.items() if each is not own}


def _units_of_images(reading: Reading, tables: Tables) -> tuple[Finding, ...]:
    """Look at the units of image coordinates where anything else is at fault: no fault shall hide them."""
    from photostrip.pipeline import evidence

    root, measured = reading.root, tables.observations
    given = valid_section(ProjectFile, {name: root.entries[name].plain for name in OF_IMAGES if root.has(name)})
    if given is None or measured is None or {each.camera for each in given.groups} - set(given.cameras):
        return ()
    read = Tables(observations=_whole(measured), fiducials=tables.fiducials and _whole(tables.fiducials), control=[])
    try:
        inputs, _ = _inputs(completed(given, root, reading.file, measured_photos(read)), read, root, {}, {})
        if not np.isfinite(inputs.observations.xy).all():
            return ()  # the size of a pixel, or the format, is what is missing
        findings = evidence.of_units(inputs, conversion.settings(given))
    except (GeometryError, InputError):
        return ()
    return tuple(places_of(findings, root, listed_points(tables), inputs.flights))


def _whole(read: Measurements) -> Measurements:
    """Leave out the rows that are no numbers."""
    rows = np.flatnonzero(np.isfinite(read.xy).all(axis=1))
    columns = {name: getattr(read, name)[rows] for name in ("photo", "target", "xy", "sigma", "times")}
    return replace(read, table=read.table.take(rows), **columns)


def _inputs(
    project: ProjectFile,
    tables: Tables,
    root: Node,
    placed_models: Mapping[int, Sequence[str]],
    frames_of: Mapping[FrameSpec, GroundFrame],
) -> tuple[Inputs, list[Note]]:
    """Turn a project without faults into what the pipeline takes."""
    known, derived = with_pixel_sizes(project, tables.fiducials, conversion.cameras(project), root)
    photos = {photo: known[camera] for photo, camera in project.camera_of.items() if camera}
    control = [read for read in tables.control if read is not None]
    models = measured_models(tables.models, project.models, project.strips, placed_models)
    measured = conversion.photo_points(tables.observations, project.observations, photos)
    if models is not None:
        measured = PhotoPoints.naming(models.points.point_ids)
    if measured is None or len(control) != len(project.control):
        raise InputError("a table of the project is missing")
    control, joined = in_one_zone(control, project.control, root)
    frames = tuple(conversion.frame_spec(each) for each in project.control)
    first = conversion.first_frame(project)
    output = conversion.output_spec(project.output, first)
    inputs = Inputs(
        name=str(project.name),
        strips=conversion.strips(project, known) if models is None else (),
        observations=measured,
        control=conversion.control_points(control, project.control),
        frames=frames,
        output=(output or first) if not frames else None if output == first else output,
        fiducials=conversion.photo_points(tables.fiducials, project.fiducial_measurements, photos),
        positions=conversion.camera_positions(tables.positions, project.camera_positions, photos),
        orientations=conversion.given_orientations(tables.orientations, project.orientations, photos, frames_of),
        models=models,
        other_hand=conversion.other_hand(project),
    )
    return inputs, [*derived, *joined, *_from_true_north(project, inputs, root, frames_of)]


def _from_true_north(
    project: ProjectFile, inputs: Inputs, root: Node, frames_of: Mapping[FrameSpec, GroundFrame]
) -> Iterator[Note]:
    """Say by how much the given angles were turned from true to grid north."""
    given, read = project.orientations, inputs.orientations
    if given is None or read is None or not read.photos or given.angles.north != "true":
        return
    turns = np.degrees(conversion.norths(read.photos, read.enu, frames_of[read.frame]))
    message = (
        f"the given angles count from true north; grid north lies {turns.min():+.4f} to {turns.max():+.4f} degrees "
        "from it at the photos, which is taken off their azimuths"
    )
    path = ("orientations", "angles", "north")
    yield root.place_of(path).note("true-north", message, key=".".join(path))
