"""Projects of HISTORIX: one film camera, rough positions of its photos, and control with its marks.

``camera_model_intrinsics.csv`` has one row: ``focal_length``, ``pixel_pitch`` and principal point in millimetres, and
fiducial marks by their place, y up. ``camera_model_extrinsics.csv`` has ``image_file_name,lon,lat,alt``, which come
from the index of an archive. ``gcp.csv`` is a table of ``control``. The photos were resampled with their marks in place
and cut about the origin of these: it lies in the middle of each.

The layouts are those of github.com/shippp/history and github.com/shippp/hipp.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from photostrip.arrays import Floats
from photostrip.camera import Camera
from photostrip.errors import Fault, InputError
from photostrip.foreign.tables import NORTHERNMOST, ROUND, ForeignBlock, GivenPositions, Wanted
from photostrip.formats.faults import Findings, shown
from photostrip.formats.measured import numbers, repeated_rows
from photostrip.formats.tables import Column, Table, read_table
from photostrip.notes import counted

INTRINSICS, EXTRINSICS, CONTROL = "camera_model_intrinsics.csv", "camera_model_extrinsics.csv", "gcp.csv"
SIDES = {"left": (-1, 0), "top": (0, 1), "right": (1, 0), "bottom": (0, -1)}
MARKS = {f"midside_{side}": place for side, place in SIDES.items()} | {
    f"corner_{up}_{across}": (SIDES[across][0], SIDES[up][1])
    for up in ("top", "bottom")
    for across in ("left", "right")
}
"""Fiducial marks, and on which side of the origin they lie along x and y."""
DISTORTION = ("k1", "k2", "k3", "k4", "k5", "p1", "p2", "b1", "b2")
POINT = ("principal_point_x_mm", "principal_point_y_mm")
CAMERA = (
    *(Column(name, number=True, positive=True) for name in ("focal_length", "pixel_pitch")),
    *numbers(*POINT),
    *(Column(f"{mark}_{axis}_mm", number=True, required=False, filled=False) for mark in MARKS for axis in "xy"),
    *(Column(name, number=True, required=False, filled=False) for name in DISTORTION),
)
PHOTOS = (Column("image_file_name"), *numbers("lon", "lat", "alt"))
NAME = "film"


def is_project(folder: Path) -> bool:
    return (folder / INTRINSICS).is_file()


def read(folder: Path, wanted: Wanted) -> ForeignBlock:
    """Read camera and positions of a project; its photos have no rays yet.

    Raises InputError with file and line for all that is wrong in them, and where they do not say what is needed.
    """
    camera, photos = (str(folder / name) for name in (INTRINSICS, EXTRINSICS))
    if wanted.pixel_size is not None:
        message = "says how large a pixel is, by its pixel_pitch"
        raise InputError(Fault(message, "option", camera, key="--pixel-size", fix="leave it out"))
    findings = Findings()
    given = read_table(camera, CAMERA, findings)
    rows = read_table(photos, PHOTOS, findings)
    if wanted.image_size is None:
        message, fix = "does not say how large the photos are", "give --image-size WIDTH,HEIGHT, in pixels"
        findings.add(Fault(message, "option", camera, key="--image-size", fix=fix))
    if wanted.positions_sigma is None:
        message = "does not say how precise its positions are"
        fix = "give --positions-sigma M, or EAST,NORTH,UP: those of an archive's index lie hundreds of metres off"
        findings.add(Fault(message, "option", photos, key="--positions-sigma", fix=fix))
    if given is None or rows is None or wanted.image_size is None or wanted.positions_sigma is None:
        raise InputError(findings.faults)
    _check(given, rows, findings)
    findings.stop()
    film = _camera(given, wanted.image_size)
    names = rows.cells("image_file_name")
    xyz = rows.columns("lon", "lat", "alt")
    east, north, up = wanted.positions_sigma
    return ForeignBlock(
        source="HISTORIX project",
        files=(camera, photos),
        cameras={NAME: film},
        photos=tuple(names),
        camera_of=(NAME,) * len(names),
        points=(),
        photo=np.zeros(0, np.intp),
        point=np.zeros(0, np.intp),
        xy=np.zeros((0, 2)),
        frame="that of the control; positions of the photos, without angles; rays of tie points are to be added",
        positions=GivenPositions(
            xyz=xyz,
            sigma=np.tile(wanted.positions_sigma, (len(xyz), 1)),
            said=f"{counted(len(xyz), 'rough position')}, standard deviations {east:g}, {north:g}, {up:g} m; WGS 84, "
            "alt taken as over the ellipsoid",
        ),
        left_out=tuple(each.message for each in findings.notes),
    )


def _check(given: Table, rows: Table, findings: Findings) -> None:
    """Add what is wrong with values that are numbers."""
    if len(given) > 1:
        message = f"{counted(len(given), 'camera')}, and nothing says which photo has which"
        findings.add(given.fault(1, "focal_length", message, "foreign", fix="keep one row"))
    for name in DISTORTION:
        if (given.column(name)[:1] != 0.0).any() and not np.isnan(given.column(name)[:1]).all():
            message = f"nothing says in which unit {name} is, and which way it goes"
            fix = "leave the column empty, and give `distortion` in the project"
            findings.add(given.fault(0, name, message, "camera-model", fix=fix))
    for mark, sides in MARKS.items():
        place = _mark(given, mark)
        if np.isnan(place).all():
            continue
        wrong = next((axis for axis, each, side in zip("xy", place, sides, strict=True) if not each * side >= 0.0), "")
        if wrong:
            message = f"{shown(mark)} has no place on its side of the origin"
            expected = "x to the right and y up, both or none"
            findings.add(given.fault(0, f"{mark}_{wrong}_mm", message, "range", expected=expected))
    for row, before in repeated_rows(rows.cells("image_file_name")):
        message = f"photo {shown(rows.cells('image_file_name')[row])} is already in line {rows.lines[before]}"
        findings.add(rows.fault(row, "image_file_name", message, "given-twice", fix="keep one of the two"))
    for name, limit in (("lon", ROUND), ("lat", NORTHERNMOST)):
        for row in np.flatnonzero(np.abs(rows.column(name)) > limit).tolist():
            findings.add(rows.fault(row, name, f"{rows.column(name)[row]:g} is no angle in degrees", "range"))


def _mark(given: Table, mark: str) -> Floats:
    return np.concatenate([given.column(f"{mark}_{axis}_mm")[:1] for axis in "xy"])


def _camera(given: Table, image_size: tuple[float, float]) -> Camera:
    """Return the camera; raises InputError for a mark that lies outside photos of such a size."""
    focal, pixel, x0, y0 = (float(given.column(name)[0]) for name in ("focal_length", "pixel_pitch", *POINT))
    width, height = (each * pixel for each in image_size)
    marks = {name: (float(x), float(y)) for name in MARKS for x, y in [_mark(given, name)] if not np.isnan(x)}
    for name, (x, y) in marks.items():
        if abs(x) > width / 2.0 or abs(y) > height / 2.0:
            message = f"{name} lies outside photos of {image_size[0]:g} x {image_size[1]:g} px of {pixel:g} mm"
            raise InputError(given.fault(0, f"{name}_x_mm", message, "range", fix="give their --image-size"))
    if len(marks) == 1:
        message, fix = "one fiducial mark alone says nothing", "give two or more, or none"
        raise InputError(given.fault(0, f"{next(iter(marks))}_x_mm", message, "foreign", fix=fix))
    return Camera(
        name=NAME,
        principal_distance=focal,
        principal_point=(x0, y0),
        format=(width, height),
        fiducials=marks,
        pixel_size=pixel,
    )
