"""The size of a pixel of scanned film, from its fiducial marks: measured in pixels, calibrated in millimetres."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from photostrip.arrays import Floats
from photostrip.camera import Camera
from photostrip.errors import Fault, InputError
from photostrip.formats.measured.measurements import Measurements
from photostrip.notes import Note, counted
from photostrip.project.schema.project_file import ProjectFile
from photostrip.project.yaml.tree import Node

PIXELS = "px"


def with_pixel_sizes(
    project: ProjectFile, marks: Measurements | None, known: Mapping[str, Camera], root: Node
) -> tuple[dict[str, Camera], list[Note]]:
    """Return the cameras with the sizes of pixels that the project does not state and its marks tell.

    The interior orientation of each photo finds its own scale: this one makes millimetres of the stated standard
    deviations and of whatever is said about measured coordinates.

    Raises InputError for a camera whose marks tell no scale.
    """
    found = dict(known)
    notes: list[Note] = []
    faults: list[Fault] = []
    given, observations = project.fiducial_measurements, project.observations
    if given is None or marks is None or observations is None:
        return found, notes
    if observations.unit != PIXELS or (given.unit or PIXELS) != PIXELS:
        return found, notes
    for name, camera in known.items():
        photos = {photo for photo, owner in project.camera_of.items() if owner == name}
        if camera.pixel_size is not None or not camera.fiducials or not photos:
            continue
        sizes = _sizes(marks, camera, photos)
        path = ("cameras", name, "pixel_size")
        if not len(sizes):
            message = "the fiducial marks do not tell the size of a pixel"
            faults.append(Fault(message, "missing-key", key=".".join(path), expected="the size of a pixel in mm"))
            continue
        size = float(f"{np.median(sizes):.6g}")
        found[name] = replace(camera, pixel_size=size)
        message = (
            f"camera {name} has no pixel_size: a pixel is {size * 1000:.4g} µm by the calibrated fiducial marks of "
            f"{counted(len(sizes), 'photo')}"
        )
        place = root.place_of(path[:2])
        note = Note("pixel-size-derived", message, "note", file=place.file, line=place.line, column=place.column)
        notes.append(replace(note, key=".".join(path)))
    if faults:
        raise InputError(faults)
    return found, notes


def _sizes(marks: Measurements, camera: Camera, photos: set[str]) -> Floats:
    """Millimetres to a pixel of each photo with two marks or more, from how far its marks lie about their centroid."""
    names = {name: row for row, name in enumerate(camera.fiducials)}
    calibrated = np.array(list(camera.fiducials.values()), float)
    row_of = np.array([names.get(name, -1) for name in marks.target_ids], np.intp)[marks.target]
    found = []
    for number, photo in enumerate(marks.photo_ids):
        rows = np.flatnonzero((marks.photo == number) & (row_of >= 0))
        if photo not in photos or len(rows) < 2:
            continue
        spreads = [np.linalg.norm(xy - xy.mean(axis=0)) for xy in (calibrated[row_of[rows]], marks.xy[rows])]
        if min(spreads) > 0.0:
            found.append(float(spreads[0] / spreads[1]))
    return np.array(found)
