"""Simulated blocks as COLMAP models, text and binary, in a frame of any place, direction and scale."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import photostrip
from photostrip.arrays import Floats
from photostrip.result.table import rows_of
from tests.results import rotation

NUMBERS = {"SIMPLE_PINHOLE": 0, "PINHOLE": 1, "SIMPLE_RADIAL": 2, "RADIAL": 3, "OPENCV": 4, "FULL_OPENCV": 6, "FOV": 7}
SPEC = {
    "flight": {"photos": 4, "strips": 3, "flying_height": 100, "end_lap_percent": 80, "side_lap_percent": 60},
    "terrain": {"relief": 8},
    "camera": {
        "preset": "digital",
        "name": "fc",
        "principal_distance": 8.8,
        "principal_point": [0.024, -0.012],
        "format": [13.2, 8.8],
        "pixel_size": 0.0024,
        "distortion": {"model": "brown", "k": [-2e-4, 0, 0], "p": [1e-5, -2e-5], "direction": "ideal_to_image"},
    },
    "control": {"layout": "random", "count": 3, "sigma": [0.01, 0.01, 0.015], "check": 6},
    "ground": {"crs": "local"},
    "image": {"unit": "px", "y_axis": "down", "sigma_um": 1.2},
}
F, K1, P1, P2 = 8.8 / 0.0024, -2e-4 * 8.8**2, 2e-5 * 8.8, 1e-5 * 8.8
OPENCV = [F, F, 2760.0, 5500 / 3 + 5, K1, 0.0, P1, P2]
TO_MODEL = Rotation.from_rotvec([0.9, -0.4, 2.0])
SHIFT, SCALE = np.array([3.0, -7.0, 2.0]), 0.037


@dataclass
class Model:
    """What a COLMAP model holds: cameras by id, and images."""

    cameras: dict[int, tuple[str, int, int, list[float]]]
    images: list[tuple[int, Floats, Floats, int, str, Floats, list[int]]]  # id, quaternion, t, camera, name, xy, points

    def write_text(self, folder: Path) -> Path:
        folder.mkdir(parents=True, exist_ok=True)
        lines = ["# Camera list with one line of data per camera:"]
        for number, (model, *size, parameters) in self.cameras.items():
            lines.append(" ".join(map(repr_of, (number, model, *size, *parameters))))
        (folder / "cameras.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
        lines = ["# Image list with two lines of data per image:"]
        for number, q, t, camera, name, xy, points in self.images:
            lines.append(" ".join(map(repr_of, (number, *q.tolist(), *t.tolist(), camera, name))))
            rays = zip(xy.tolist(), points, strict=True)
            lines.append(" ".join(f"{x!r} {y!r} {point}" for (x, y), point in rays))
        (folder / "images.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
        return folder

    def write_binary(self, folder: Path) -> Path:
        folder.mkdir(parents=True, exist_ok=True)
        parts = [struct.pack("<Q", len(self.cameras))]
        for number, (model, *size, parameters) in self.cameras.items():
            parts.append(struct.pack("<iiQQ", number, NUMBERS[model], *size))
            parts.append(struct.pack(f"<{len(parameters)}d", *parameters))
        (folder / "cameras.bin").write_bytes(b"".join(parts))
        parts = [struct.pack("<Q", len(self.images))]
        for number, q, t, camera, name, xy, points in self.images:
            parts += [struct.pack("<I7dI", number, *q, *t, camera), name.encode() + b"\0"]
            parts.append(struct.pack("<Q", len(points)))
            parts += [struct.pack("<ddq", *place, point) for place, point in zip(xy.tolist(), points, strict=True)]
        (folder / "images.bin").write_bytes(b"".join(parts))
        return folder

    def write(self, folder: Path, kind: str) -> Path:
        return self.write_text(folder) if kind == "text" else self.write_binary(folder)


def repr_of(value: object) -> str:
    return value if isinstance(value, str) else repr(value)


def name_of(photo: str) -> str:
    """Give a photo a name in a folder, with a blank and letters that are not ASCII."""
    return f"flight {photo[0]}/Фото {photo}.JPG"


def posed(
    made: photostrip.Simulation, to_model: Callable[[Floats], Floats], number: Callable[[int], int]
) -> Iterator[tuple[str, Floats, Floats, Floats, list[int]]]:
    """Give each photo, its orientation in the model (quaternion, shift), its tie points in pixels and their ids."""
    rows = [line.split(",") for line in made.files["observations.csv"].splitlines()[1:]]
    numbers: dict[str, int] = {}
    for photo in rows_of(made.truth["photos"]):
        upright = rotation(photo) * (1.0, -1.0, -1.0)  # camera, y down, to the ground
        to_camera = (TO_MODEL * Rotation.from_matrix(upright)).inv()
        own = [row for row in rows if row[0] == photo["id"] and row[1][0] not in "GK"]  # control is marked by hand
        points = [numbers.setdefault(row[1], number(len(numbers))) for row in own]
        center = to_model(np.array([photo[name] for name in "xyz"]))
        xy = np.array([[float(each) for each in row[2:4]] for row in own])
        yield photo["id"], to_camera.as_quat()[[3, 0, 1, 2]], -to_camera.apply(center), xy, points


def simulated(folder: Path, **changes: object) -> Model:
    """Write a simulated project into a folder, and give its tie points and true orientations as a model."""
    made = photostrip.simulate({**SPEC, **changes})
    made.write(folder)
    photos = posed(made, lambda place: TO_MODEL.apply(SCALE * place) + SHIFT, lambda count: 5 * count + 2)
    images = [(997 - 3 * n, q, t, 4, name_of(photo), xy, points) for n, (photo, q, t, xy, points) in enumerate(photos)]
    return Model({4: ("OPENCV", 5500, 3667, OPENCV)}, images)


def small_model() -> Model:
    """Give a small one: two cameras, four photos, twelve points."""
    images = []
    for number in range(4):
        xy = np.random.default_rng(number).uniform(10.0, 990.0, (12, 2)).round(2)
        pose = np.array([0.0, 1.0, 0.0, 0.01 * number]), np.array([-5.0 * number, 0.0, 50.0])
        images.append((number + 1, *pose, 1 + number % 2, f"DJI {number}.JPG", xy, list(range(12))))
    opencv = ("OPENCV", 1000, 1000, [900.0, 901.0, 500.0, 500.0, 0.01, 0.0, 0.0, 0.0])
    return Model({1: ("SIMPLE_RADIAL", 1000, 1000, [900.0, 500.0, 500.0, 0.01]), 2: opencv}, images)
