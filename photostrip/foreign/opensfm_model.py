"""A result as a reconstruction of OpenSfM: ``reconstruction.json`` and the rays in ``tracks.csv`` beside it.

Its frame is east, north, up at ``reference_lla`` in the middle of the block, or the local frame of the result, which
has no such place. Image points are the measured ones with all corrections that its camera does not know made.

Described by opensfm.org/docs/dataset.html, geometry.html; the tracks are those of version 2.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import PurePosixPath

import numpy as np
from scipy.spatial.transform import Rotation

from photostrip.arrays import Floats
from photostrip.errors import Fault, InputError
from photostrip.foreign.adjusted import Adjusted
from photostrip.foreign.opensfm import POINT
from photostrip.formats.result_json import on_one_line as text
from photostrip.geodesy.ground_frame import true_axes
from photostrip.notes import Document, counted
from photostrip.project.keys import ENDINGS

DISTORTION = ("k1", "k2", "k3", "p1", "p2")
TRACKS = "tracks.csv"
HEAD = "OPENSFM_TRACKS_VERSION_v2\n"
OTHERS = "0.001\t128\t128\t128\t-1\t-1"  # scale of a feature, its colour, segmentation and instance: none of ours


def write(block: Adjusted, target: str, _form: str) -> tuple[dict[str, str | bytes], list[str]]:
    """Return both files, and what is in them.

    Raises InputError where strips were adjusted each by itself.
    """
    block.require_photos("OpenSfM")
    block.require_one_place("OpenSfM")
    if PurePosixPath(target).name != ENDINGS["opensfm"]:
        message = f"OpenSfM calls this file {ENDINGS['opensfm']}"
        raise InputError(Fault(message, "export", fix=f"write FOLDER/{ENDINGS['opensfm']}"))
    origin, axes, place = _frame(block)
    names = _names([each["id"] for each in block.points])
    files: dict[str, str | bytes] = {
        target: _reconstruction(block, names, (origin, axes), place),
        str(PurePosixPath(target).with_name(TRACKS)): HEAD + "".join(_tracks(block, names)),
    }
    rays = sum(int(each.used.sum()) for each in block.rays)
    counts = f"{counted(len(block.photos), 'photo')} of {counted(len(block.cameras), 'camera')}"
    frame = "frame: the local one of the result, metres, without reference_lla"
    if place:
        at = "latitude {latitude:.9f}, longitude {longitude:.9f}, height {altitude:.3f}".format(**place)
        frame = f"frame: east, north, up at {at}, Cartesian, metres"
    said = [f"{counts}, {counted(len(block.points), 'point')}, {counted(rays, 'ray')}", frame]
    return files, said + block.said_of_cameras()


def _frame(block: Adjusted) -> tuple[Floats, Floats, Document]:
    """Return origin and axes (rows) of the frame in the Cartesian one, and where it is."""
    if block.ground.kind == "local":
        return np.zeros(3), np.eye(3), {}
    origin = block.xyz.mean(axis=0)
    geodetic = block.ground.geodetic(origin[None])
    (longitude, latitude), height = np.degrees(geodetic[0, :2]).tolist(), float(geodetic[0, 2])
    return origin, true_axes(geodetic)[0], {"latitude": latitude, "longitude": longitude, "altitude": height}


def _names(ids: list[str]) -> list[str]:
    """Give the points their names: those from OpenSfM have theirs again, as long as all differ."""
    own = [each.removeprefix(POINT.format("")) for each in ids]
    return own if len(set(own)) == len(ids) else ids


def _reconstruction(block: Adjusted, names: list[str], frame: tuple[Floats, Floats], place: Document) -> str:
    origin, axes = frame
    rotations, shifts = block.into_cameras(origin, axes)
    turns = Rotation.from_matrix(rotations).as_rotvec().tolist()
    posed = zip(block.photos, turns, shifts.tolist(), block.camera_of, strict=True)
    shots = (
        (photo["id"], {"rotation": turn, "translation": shift, "camera": camera, "orientation": 1})
        for photo, turn, shift, camera in posed
    )
    points = zip(names, ((block.xyz - origin) @ axes.T).tolist(), strict=True)
    blocks = {
        "cameras": _cameras(block),
        "shots": shots,
        "points": ((name, {"color": [128.0, 128.0, 128.0], "coordinates": xyz}) for name, xyz in points),
    }
    parts = [
        f'"{name}": {{\n' + ",\n".join(f"{text(key)}: {text(each)}" for key, each in rows) + "\n}"
        for name, rows in blocks.items()
    ]
    if place:
        parts.append(f'"reference_lla": {text(place)}')
    return "[{" + ",\n".join(parts) + "}]\n"


def _cameras(block: Adjusted) -> Iterator[tuple[str, Document]]:
    for name, camera in block.cameras.items():
        (width, height), side, pixels = camera.size, max(camera.size), camera.pixels
        (fx, fy), (x, y) = pixels.focal_length, pixels.principal_point
        yield (
            name,
            {
                "projection_type": "brown",
                "width": width,
                "height": height,
                "focal_x": fx / side,
                "focal_y": fy / side,
                "c_x": (x - width / 2.0) / side,
                "c_y": (y - height / 2.0) / side,
                **{each: pixels.distortion[each] for each in DISTORTION},
            },
        )


def _tracks(block: Adjusted, names: list[str]) -> Iterator[str]:
    for photo, name, rays in zip(block.photos, block.camera_of, block.rays, strict=True):
        camera = block.cameras[name]
        xy = (camera.image(rays.xy) - np.array(camera.size) / 2.0) / max(camera.size)
        used = np.flatnonzero(rays.used).tolist()
        points = rays.points.tolist()
        for feature, row in enumerate(used):
            x, y = xy[row].tolist()
            yield f"{photo['id']}\t{names[points[row]]}\t{feature}\t{x:.9f}\t{y:.9f}\t{OTHERS}\n"
