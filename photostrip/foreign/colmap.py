"""Models of COLMAP, as text or binary: ``cameras`` and ``images``; the rays in them are all that is measured.

A pose takes the world to the camera (x right, y down, z ahead), pixels count from the corner of the first one.
``points3D`` repeats the tracks with coordinates that a run finds itself; ``rigs`` and ``frames`` of newer versions
repeat the poses in parts, those of ``images`` stay whole.

COLMAP documents the files in colmap.github.io/format.html, the cameras in cameras.html.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.foreign.gathering import Origin, Photo, checked_camera, gathered
from photostrip.foreign.places import LARGEST, Place, unique
from photostrip.foreign.tables import ForeignBlock
from photostrip.formats.faults import LARGEST_NUMBER, shown
from photostrip.formats.files import BOM, decode, read_bytes
from photostrip.notes import counted
from photostrip.strip.pixel_cameras import PixelCamera

MODELS = {  # names of the parameters
    "SIMPLE_PINHOLE": "f cx cy",
    "PINHOLE": "fx fy cx cy",
    "SIMPLE_RADIAL": "f cx cy k1",
    "RADIAL": "f cx cy k1 k2",
    "OPENCV": "fx fy cx cy k1 k2 p1 p2",
    "FULL_OPENCV": "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6",
}
NUMBERED = (
    *("SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "OPENCV_FISHEYE", "FULL_OPENCV", "FOV"),
    *("SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE", "THIN_PRISM_FISHEYE", "RAD_TAN_THIN_PRISM_FISHEYE"),
    *("SIMPLE_DIVISION", "DIVISION", "SIMPLE_FISHEYE", "FISHEYE", "EUCM", "EQUIRECTANGULAR"),
)
POINT = "colmap-{}"  # an id that no control point has
RAY = np.dtype([("x", "<f8"), ("y", "<f8"), ("point", "<i8")])
LARGEST_ID = 2.0**53  # of a point in a text: from there on a float is no whole number of its own


def is_model(folder: Path) -> bool:
    return any((folder / f"cameras.{each}").is_file() for each in ("bin", "txt"))


def read(folder: Path) -> ForeignBlock:
    """Read a model, the binary one where both stand in a folder, as COLMAP does.

    Raises InputError with file and line, or record, for all that is no such model or has no counterpart here.
    """
    kind = "bin" if (folder / "cameras.bin").is_file() else "txt"
    files = [str(folder / f"{name}.{kind}") for name in ("cameras", "images")]
    binary = kind == "bin"
    cameras = dict(unique("camera", _binary_cameras(files[0]) if binary else _text_cameras(files[0])))
    images = dict(unique("image", (_binary if binary else _text)(files[1])))
    source = f"COLMAP model ({'binary' if binary else 'text'})"
    origin = Origin(source=source, files=tuple(files), rays=files[1], label=POINT.format)
    return gathered(origin, {str(each): cameras[each] for each in sorted(cameras)}, list(images.values()))


# ------------------------------------------------------------------------------------------------------- text


def _lines(file: str) -> Iterator[tuple[Place, bytes]]:
    data = read_bytes(file, LARGEST)
    _, marked = decode(file, data)  # refuses what is no text
    start, number = len(BOM) if marked else 0, 0
    while start < len(data):
        end = data.find(b"\n", start)
        end = len(data) if end < 0 else end
        number += 1
        yield Place(file, number), data[start:end].strip()
        start = end + 1


def _numbers(place: Place, words: list[bytes], what: str) -> Floats:
    try:
        found = np.array(words, float)
    except ValueError:
        found = np.array([np.nan])
    if not (np.abs(found) < LARGEST_NUMBER).all():
        wrong = next(word.decode() for word in words if not _is_number(word))
        raise place.wrong(f"`{shown(wrong)}` is no number of {what}", "number")
    return found


def _is_number(word: bytes) -> bool:
    try:
        return abs(float(word)) < LARGEST_NUMBER
    except ValueError:
        return False


def _whole(place: Place, word: bytes, what: str) -> int:
    if not word.isdigit() or len(word) > 18:
        raise place.wrong(f"`{shown(word.decode())}` is no {what}", "number", expected="a whole number")
    return int(word)


def _text_cameras(file: str) -> Iterator[tuple[Place, int, PixelCamera]]:
    for place, line in _lines(file):
        if not line or line.startswith(b"#"):
            continue
        words = line.split()
        if len(words) < 5:
            message = f"{counted(len(words), 'value')} in the line"
            raise place.wrong(message, "row-length", expected="id, model, width, height, parameters")
        number, model = _whole(place, words[0], "id of a camera"), words[1].decode()
        yield place, number, _camera(place, model, _numbers(place, words[2:], f"camera {number}").tolist())


def _text(file: str) -> Iterator[tuple[Place, int, Photo]]:
    lines = _lines(file)
    for place, line in lines:
        if not line or line.startswith(b"#"):
            continue
        words = line.split(None, 9)
        if len(words) < 10:
            message = f"{counted(len(words), 'value')} in the line"
            expected = "id, qw, qx, qy, qz, tx, ty, tz, camera, name; and a line of x, y, point below it"
            raise place.wrong(message, "row-length", expected=expected)
        number, name = _whole(place, words[0], "id of an image"), words[9].decode()
        pose = _numbers(place, words[1:8], f"the pose of image {number}")
        camera = _whole(place, words[8], "id of a camera")
        below, measured = next(lines, (place, b""))
        rays = _numbers(below, measured.split(), f"the points of image {number}")
        if len(rays) % 3:
            message = f"{counted(len(rays), 'value')} in the points of image {number}"
            raise below.wrong(message, "row-length", expected="x, y, point for each, -1 for no point")
        points = rays[2::3]
        if ((points != np.floor(points)) | (points < -1) | (points >= LARGEST_ID)).any():
            raise below.wrong(
                f"an id of a point of image {number} is no id", "number", expected="a whole number, or -1"
            )
        xy = rays.reshape(-1, 3)[:, :2]
        yield place, number, _image(place, (pose, camera, name), xy, points.astype(np.int64))


# ----------------------------------------------------------------------------------------------------- binary


class _Records:
    """The bytes of a file, taken from its beginning on; none is taken that is not there."""

    def __init__(self, file: str) -> None:
        self.file, self.data, self.at, self.record = file, read_bytes(file, LARGEST), 0, "the head"

    @property
    def place(self) -> Place:
        return Place(self.file, record=self.record)

    def require(self, count: int, what: str) -> None:
        if count > len(self.data) - self.at:
            message = f"ends within {what}: {len(self.data) - self.at} bytes are left, {count} are needed"
            raise self.place.wrong(message, fix="copy or write the model again")

    def take(self, layout: str, what: str) -> tuple[Any, ...]:
        size = struct.calcsize(layout)
        self.require(size, what)
        self.at += size
        return struct.unpack_from(layout, self.data, self.at - size)

    def text(self) -> str:
        end = self.data.find(b"\0", self.at)
        if end < 0:
            raise self.place.wrong("its name has no end", fix="copy or write the model again")
        try:
            found = self.data[self.at : end].decode()
        except UnicodeDecodeError:
            raise self.place.wrong("its name is not UTF-8 text", "encoding") from None
        self.at = end + 1
        return found

    def each(self, what: str, least: int) -> Iterator[int]:
        """Count through the records that the file says it has, of so many bytes at least."""
        (count,) = self.take("<Q", "the number of its records")
        self.require(count * least, f"its {count} records of {what}s")
        for number in range(1, count + 1):
            self.record = f"{what} {number} of {count}"
            yield number
        if self.at < len(self.data):
            message = f"{len(self.data) - self.at} bytes follow the last of its {count} {what}s"
            raise Place(self.file).wrong(message, fix="copy or write the model again")


def _binary_cameras(file: str) -> Iterator[tuple[Place, int, PixelCamera]]:
    records = _Records(file)
    for _ in records.each("camera", 24):
        number, model, width, height = records.take("<iiQQ", "the record")
        name = NUMBERED[model] if 0 <= model < len(NUMBERED) else f"number {model}"
        values = records.take(f"<{len(MODELS.get(name, '').split())}d", "its parameters")
        yield records.place, number, _camera(records.place, name, [width, height, *values])


def _binary(file: str) -> Iterator[tuple[Place, int, Photo]]:
    records = _Records(file)
    for _ in records.each("image", 73):
        number, *pose, camera = records.take("<I7dI", "the pose")
        name = records.text()
        (count,) = records.take("<Q", "the number of its points")
        records.require(count * RAY.itemsize, f"its {count} points")
        rays = np.frombuffer(records.data, RAY, count, records.at)
        records.at += count * RAY.itemsize
        kept = rays[rays["point"] != -1]
        xy = np.stack([kept["x"], kept["y"]], axis=-1)
        if not ((np.abs(xy) < LARGEST_NUMBER).all() and (kept["point"] >= 0).all()):
            raise records.place.wrong("a point of it has no place, or no id", "number")
        values = np.array(pose)
        if not (np.abs(values) < LARGEST_NUMBER).all():
            raise records.place.wrong("its pose holds what is no number", "number")
        yield records.place, number, _image(records.place, (values, camera, name), xy, kept["point"])


# ------------------------------------------------------------------------------------------------------- both


def _image(place: Place, head: tuple[Floats, int, str], xy: Floats, points: Numbers) -> Photo:
    pose, camera, name = head
    if not np.linalg.norm(pose[:4]) > 0.0:
        raise place.wrong("the quaternion of its pose is 0", "range")
    return Photo(place=place, pose=pose, camera=str(camera), name=name, xy=xy, points=points)


def _camera(place: Place, model: str, values: list[float]) -> PixelCamera:
    """Return a camera by its model, its size and its parameters."""
    if model not in MODELS:
        fix = "calibrate with OPENCV, or undistort the photos (colmap image_undistorter)"
        raise place.wrong(f"the model {shown(model)} has no counterpart", "camera-model",
                          expected=f"one of {', '.join(MODELS)}", fix=fix)  # fmt: skip
    names, (width, height, *parameters) = MODELS[model].split(), values
    if len(parameters) != len(names):
        message = f"{counted(len(parameters), 'parameter')} of the model {model}"
        raise place.wrong(message, "row-length", expected=f"{len(names)}: {', '.join(names)}")
    given = dict(zip(names, parameters, strict=True))
    focal = given.pop("fx", 0.0) or given.pop("f", 0.0)
    focals = focal, given.pop("fy", focal)
    point = given.pop("cx"), given.pop("cy")
    found = PixelCamera(
        convention="colmap",
        image_size=(width, height),
        focal_length=focals,
        principal_point=point,
        distortion=given,
    )
    return checked_camera(place, model, found)
