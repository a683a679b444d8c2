"""The project of HISTORIX of Casa Grande, with tie points simulated on its stations."""

from __future__ import annotations

import csv
import shutil
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pyproj import Transformer
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from photostrip.arrays import Flags, Floats, Numbers
from tests.source_tree import ROOT

CASA_GRANDE = ROOT / "sample_data" / "casa-grande"
FILES = ("camera_model_intrinsics.csv", "camera_model_extrinsics.csv", "gcp.csv")
SIZE = 10_000  # pixels: the files do not say it; the marks have their middle at about 5000
ROUGH = (300.0, 300.0, 500.0)  # metres
OPTIONS = ("--image-size", f"{SIZE},{SIZE}", "--positions-sigma", "300,300,500", "--crs", "EPSG:4979")
F, POINT, PIXEL = 152.865, (-0.030, -0.001), 0.025
TO_PLANE = Transformer.from_pipeline(
    "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart +ellps=WGS84 "
    "+step +proj=topocentric +ellps=WGS84 +lon_0=-111.81 +lat_0=32.82 +h_0=0"
)  # east, north, up about the middle: Cartesian


class Tied(NamedTuple):
    """Tie points of a block."""

    xyz: dict[str, Floats]  # true places, east, north, up
    rays: list[tuple[str, str, float, float]]  # photo, point, x, y in pixels


def copied(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for name in FILES:
        shutil.copy(CASA_GRANDE / name, folder / name)
    return folder


def simulated(sigma: float = 0.5) -> Tied:
    """Give the photos orientations near their rough positions, which its real marks fit, and simulate points on them.

    sigma: of an image coordinate, pixels.
    """
    stations, marks = _rows("camera_model_extrinsics.csv"), _rows("gcp.csv")
    number = {row["image_file_name"]: place for place, row in enumerate(stations)}
    photo = np.array([number[row["image_file_name"]] for row in marks])
    rough, control = plane(stations, "lon lat alt"), plane(marks, "lon lat elev")
    measured = np.array([[row["x"], row["y"]] for row in marks], float)
    turned = _turned(rough, control, measured, photo)

    def posed(unknown: Floats) -> tuple[Floats, Floats]:
        shift, turn = unknown.reshape(2, -1, 3)
        return rough + shift * ROUGH, Rotation.from_rotvec(np.radians(turn)).as_matrix() @ turned

    def off(unknown: Floats) -> Floats:
        centers, rotations = posed(unknown)
        return np.concatenate([(image(control, centers[photo], rotations[photo]) - measured).ravel(), unknown])

    centers, rotations = posed(least_squares(off, np.zeros(6 * len(stations))).x)
    return _points(list(number), centers, rotations, control, sigma)


def _points(photos: list[str], centers: Floats, rotations: Floats, control: Floats, sigma: float) -> Tied:
    """Scatter points over ground that bends through the control, and take those that two photos see."""
    random = np.random.default_rng(1)
    plan = random.uniform(centers[:, :2].min(axis=0) - 4000.0, centers[:, :2].max(axis=0) + 4000.0, (2000, 2))
    up = _bent(plan) @ np.linalg.lstsq(_bent(control), control[:, 2])[0] + random.uniform(-15.0, 15.0, len(plan))
    xyz = np.column_stack([plan, up])
    seen = np.stack(
        [image(xyz, center[None], rotation[None]) for center, rotation in zip(centers, rotations, strict=True)]
    )
    inside: Flags = np.asarray((np.abs(seen - SIZE / 2) < 4300.0).all(axis=-1))
    noisy = seen + random.normal(0.0, sigma, seen.shape)
    points = np.flatnonzero(inside.sum(axis=0) > 1).tolist()
    rays = [
        (photo, f"T{point}", *noisy[row, point].tolist())
        for point in points
        for row, photo in enumerate(photos)
        if inside[row, point]
    ]
    return Tied({f"T{point}": xyz[point] for point in points}, rays)


def _bent(xyz: Floats) -> Floats:
    return np.column_stack([xyz[:, :2], xyz[:, :2] ** 2, np.ones(len(xyz))])


def _turned(centers: Floats, control: Floats, measured: Floats, photo: Numbers) -> Floats:
    """Choose for each photo whether its x axis looks to the south or to the north, as its marks say."""
    south = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    found = []
    for place in range(len(centers)):
        own = np.flatnonzero(photo == (place if place in photo else place + 1))  # one photo has no mark
        away = [
            np.linalg.norm(image(control[own], centers[photo[own]], each[None]) - measured[own])
            for each in (south, south * (-1.0, -1.0, 1.0))
        ]
        found.append(south if away[0] < away[1] else south * (-1.0, -1.0, 1.0))
    return np.array(found)


def image(xyz: Floats, centers: Floats, rotations: Floats) -> Floats:
    """Project points by the real camera, in pixels from the corner, y down."""
    ray = ((xyz - centers)[:, None, :] @ rotations)[:, 0, :]
    x, y = (-F * ray[:, :2] / ray[:, 2:] + POINT).T / PIXEL
    return np.stack([SIZE / 2 + x, SIZE / 2 - y], axis=-1)


def plane(rows: list[dict[str, str]], names: str) -> Floats:
    """Give longitude, latitude and height as east, north, up."""
    return np.stack(TO_PLANE.transform(*(np.array([float(row[name]) for row in rows]) for name in names.split())), -1)


def _rows(name: str) -> list[dict[str, str]]:
    with (CASA_GRANDE / name).open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def with_ties(project: Path, tied: Tied) -> Path:
    with (project / "observations.csv").open("a", encoding="utf-8") as file:
        file.writelines(f"{photo},{point},{x:.3f},{y:.3f}\n" for photo, point, x, y in tied.rays)
    return project / "project.yaml"
