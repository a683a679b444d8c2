"""A result as a model of COLMAP, as text: ``cameras.txt``, ``images.txt``, ``points3D.txt``.

Its frame is Cartesian: that of the result where it is local, else east, north, up at the middle of the block. Image
points are the measured ones with all corrections that COLMAP's camera does not know (refraction, film) made.

Described by colmap.github.io/format.html, cameras.html.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from photostrip.arrays import Floats
from photostrip.errors import Fault, InputError
from photostrip.foreign.adjusted import Adjusted
from photostrip.notes import counted, named

PARAMETERS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
OWN = re.compile(r"colmap-(\d{1,15})")  # ids that were made from COLMAP's


def write(block: Adjusted, target: str, _form: str) -> tuple[dict[str, str | bytes], list[str]]:
    """Return the files of a model, and what is in them.

    Raises InputError where strips were adjusted each by itself: a point on two of them has no one position that its
    image points belong to.
    """
    block.require_photos("COLMAP")
    block.require_one_place("COLMAP")
    if blank := [each["id"] for each in block.photos if len(each["id"].split()) > 1]:
        message = f"COLMAP ends the name of a photo at its first blank: {named('photo', blank)}"
        raise InputError(Fault(message, "export", fix="call the photos otherwise"))
    frame, shift, axes = _frame(block)
    numbers = _numbers([each["id"] for each in block.points])
    comment = f"# {frame}\n"
    files: dict[str, str | bytes] = {
        f"{target}cameras.txt": comment + "".join(_cameras(block)),
        f"{target}images.txt": comment + "".join(_images(block, numbers, shift, axes)),
        f"{target}points3D.txt": comment + "".join(_points(block, numbers, shift, axes)),
    }
    rays = sum(int(each.used.sum()) for each in block.rays)
    counts = f"{counted(len(block.photos), 'photo')} of {counted(len(block.cameras), 'camera')}"
    said = [f"{counts}, {counted(len(block.points), 'point')}, {counted(rays, 'ray')}", frame]
    return files, said + block.said_of_cameras()


def _frame(block: Adjusted) -> tuple[str, Floats, Floats]:
    """Say in which frame the model is; return its origin in the Cartesian frame, and its axes as rows."""
    if block.ground.kind == "local":
        bent = ", heights above its tangent plane" if block.ground.origin is not None else ""
        return f"frame: the local one of the result{bent}, metres", np.zeros(3), np.eye(3)
    origin = block.xyz.mean(axis=0).round()
    axes = block.ground.level_axes_at(origin[None])[0]
    east, north, up = block.ground.ground_from_cartesian(origin[None])[0].tolist()
    named = "X {:.3f}, Y {:.3f}, Z {:.3f}".format(*origin)
    grid = "of the grid " if block.ground.kind == "projected" else ""
    at = (
        ""
        if block.ground.kind == "geocentric"
        else f" = {east:.10g}, {north:.10g}, {up:.3f} in {block.ground.spec.name}"
    )
    return f"frame: east, north, up {grid}at geocentric {named}{at}, Cartesian, metres", origin, axes


def _numbers(ids: list[str]) -> list[int]:
    """Give the points numbers: those from COLMAP have theirs again, others follow."""
    own = [OWN.fullmatch(each) for each in ids]
    given = [0 if found is None else int(found[1]) for found in own]
    following = iter(range(max(given, default=0) + 1, max(given, default=0) + len(ids) + 1))
    return [number or next(following) for number in given]


def _cameras(block: Adjusted) -> Iterator[str]:
    yield "# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n"
    for number, camera in enumerate(block.cameras.values(), 1):
        pixels = camera.pixels
        kept = PARAMETERS if pixels.distortion.get("k3") else PARAMETERS[:4]
        model = "FULL_OPENCV" if len(kept) > 4 else "OPENCV"
        values = (*pixels.focal_length, *pixels.principal_point, *(pixels.distortion.get(each, 0.0) for each in kept))
        yield f"{number} {model} {camera.size[0]} {camera.size[1]} {' '.join(repr(float(each)) for each in values)}\n"


def _images(block: Adjusted, numbers: list[int], shift: Floats, axes: Floats) -> Iterator[str]:
    yield "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n# POINTS2D[] as (X, Y, POINT3D_ID)\n"
    of_world, moved = block.into_cameras(shift, axes)
    turned = Rotation.from_matrix(of_world).as_quat(canonical=True)[:, [3, 0, 1, 2]]
    order = {name: number for number, name in enumerate(block.cameras, 1)}
    for row, photo in enumerate(block.photos):
        camera, rays = block.camera_of[row], block.rays[row]
        pose = " ".join(map(repr, (*turned[row].tolist(), *moved[row].tolist())))
        yield f"{row + 1} {pose} {order[camera]} {photo['id']}\n"
        xy = block.cameras[camera].image(rays.xy)
        seen = zip(xy.tolist(), rays.points.tolist(), rays.used.tolist(), strict=True)
        yield " ".join(f"{x:.4f} {y:.4f} {numbers[point] if used else -1}" for (x, y), point, used in seen) + "\n"


def _points(block: Adjusted, numbers: list[int], shift: Floats, axes: Floats) -> Iterator[str]:
    yield "# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n"
    tracks: list[list[str]] = [[] for _ in numbers]
    squares = np.zeros(len(numbers))
    for row, rays in enumerate(block.rays):
        written = block.cameras[block.camera_of[row]]
        true = written.image(block.computed(row))
        np.add.at(squares, rays.points, np.where(rays.used, ((written.image(rays.xy) - true) ** 2).sum(axis=1), 0.0))
        for place in np.flatnonzero(rays.used).tolist():
            tracks[rays.points[place]].append(f"{row + 1} {place}")
    xyz = ((block.xyz - shift) @ axes.T).tolist()
    for number, (x, y, z), track, square in zip(numbers, xyz, tracks, squares.tolist(), strict=True):
        if track:
            error = (square / len(track)) ** 0.5
            yield f"{number} {x!r} {y!r} {z!r} 128 128 128 {error:.4f} {' '.join(track)}\n"
