"""Blocks flown in any way, as projects in memory: corridors, oblique and convergent cameras, kites, orbits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from photostrip.geometry.rotation import angles, from_vector

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Project = tuple[dict[str, Any], dict[str, dict[str, Any]]]
    Rng = np.random.Generator

FOCAL, FORMAT = 8.8, (13.2, 8.8)  # mm
RELIEF, HILLS = 0.05, 2.0  # over the flying height: height and breadth of the hills
GROUND = {"crs": "local", "axes": ["east", "north", "up"]}


@dataclass(frozen=True)
class Flown:
    """Where the photos were taken, and how."""

    centers: Floats  # (n, 3), metres above the ground at 0
    rotations: Floats  # (n, 3, 3), photo to ground
    strips: list[list[str]]


def looking(way: Floats, above: Floats) -> Floats:
    """Turn a camera so that it looks along a direction, its y axis towards another."""
    z = -way / np.linalg.norm(way)
    y = above - (above @ z) * z
    y /= np.linalg.norm(y)
    return np.column_stack([np.cross(y, z), y, z])


def corridor(rng: Rng, *, height: float = 60.0, ahead: float = 0.0, wind: float = 0.02, tilt: float = 2.0) -> Flown:
    """Fly three strips of eight photos to and fro, 80 % end lap and 60 % side lap, short side along the flight.

    ahead: direction of the cameras, degrees from the nadir; wind: scatter of the positions, over the height.
    """
    base, gap = (share * side / FOCAL * height for share, side in zip((0.2, 0.4), FORMAT[::-1], strict=True))
    centers, rotations, strips = [], [], []
    for strip in range(3):
        heading = 1.0 - 2.0 * (strip % 2)
        for photo in range(8):
            along = base * (photo if heading > 0 else 7 - photo)
            centers.append(np.array([along, strip * gap, height]) + rng.normal(0.0, wind * height, 3))
            way = np.array([heading * np.tan(np.radians(ahead)), 0.0, -1.0])
            rotations.append(looking(way, np.array([heading, 0.0, 0.0])) @ turn(rng, tilt))
        strips.append([f"{strip + 1}{photo + 1:02d}" for photo in range(8)])
    return Flown(np.array(centers), np.array(rotations), strips)


def snake(rng: Rng) -> Flown:
    """List the photos of a corridor as one strip."""
    flown = corridor(rng)
    return Flown(flown.centers, flown.rotations, [[name for strip in flown.strips for name in strip]])


def orbit(rng: Rng) -> Flown:
    """Fly around a place, looking at it."""
    angle, names = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False), [f"o{number:02d}" for number in range(24)]
    centers = np.column_stack([50.0 * np.cos(angle), 50.0 * np.sin(angle), np.full(24, 40.0)])
    centers += rng.normal(0.0, 0.8, centers.shape)
    up = np.array([0.0, 0.0, 1.0])
    return Flown(centers, np.array([looking(-each, up) @ turn(rng, 2.0) for each in centers]), [names])


def turn(rng: Rng, degrees: float) -> Floats:
    return from_vector(rng.normal(0.0, np.radians(degrees), 3))


def project(
    rng: Rng,
    flown: Flown,
    *,
    rays: int = 100,
    noise: Callable[[tuple[int, int]], Floats] | None = None,
    rough: float | None = None,
    adjustment: str = "bundle",
) -> Project:
    """Measure some points on each photo, and give control, check points and camera positions.

    noise: of image coordinates, in standard deviations of 2 µm; rough: scatter of given angles, degrees.
    """
    height = float(flown.centers[:, 2].mean())
    names = [name for strip in flown.strips for name in strip]
    low, high = flown.centers[:, :2].min(axis=0), flown.centers[:, :2].max(axis=0)

    def ground(count: int) -> Floats:
        xy = rng.uniform(low - height, high + height, (count, 2))
        hills = np.sin(xy[:, 0] / height * HILLS) + np.cos(xy[:, 1] / height * HILLS)
        return np.column_stack([xy, RELIEF * height * hills])

    def seen(points: Floats) -> list[tuple[NDArray[np.intp], Floats]]:
        views = []
        for center, rotation in zip(flown.centers, flown.rotations, strict=True):
            arm = (points - center) @ rotation
            xy = -FOCAL * arm[:, :2] / arm[:, 2:]
            shown = (arm[:, 2] < 0) & (np.abs(xy) < np.array(FORMAT) / 2.0).all(axis=1)
            rows = np.flatnonzero(shown & (np.linalg.norm(arm, axis=1) < 4.0 * height))
            views.append((rows, xy[rows]))
        return views

    def counted(points: Floats) -> NDArray[np.intp]:
        return np.bincount(np.concatenate([rows for rows, _ in seen(points)]), minlength=len(points))

    trial = ground(2000)
    points = ground(int(rays * 2000 * len(names) / counted(trial).sum()))
    offered = trial[counted(trial) > 2]
    given = [offered[0]]
    while len(given) < 20:  # the farthest from those that are given
        far = np.min([np.linalg.norm(offered - each, axis=1) for each in given], axis=0)
        given.append(offered[far.argmax()])
    every = np.concatenate([points, given])
    ids = np.array([f"P{number}" for number in range(len(points))] + [f"G{number:02d}" for number in range(20)])
    enough = counted(every) > 1
    photo, point, measured = [], [], []
    for name, (rows, xy) in zip(names, seen(every), strict=True):
        shown = enough[rows]
        photo += [name] * int(shown.sum())
        point += ids[rows[shown]].tolist()
        measured.append(xy[shown])
    xy = np.concatenate(measured)
    xy += 0.002 * (rng.normal(size=xy.shape) if noise is None else noise(xy.shape))
    control, positions = (np.array(each) for each in (given, flown.centers))
    control, positions = (
        control + rng.normal(0.0, 0.02, control.shape),
        positions + rng.normal(0.0, 0.03, positions.shape),
    )
    tables: dict[str, dict[str, Any]] = {
        "images.csv": {"photo": photo, "point": point, "x": xy[:, 0], "y": xy[:, 1]},
        "control.csv": {
            "point": ids[-20:].tolist(),
            **columns("x y z", control),
            "role": ["control"] * 12 + ["check"] * 8,
        },
        "positions.csv": {"photo": names, **columns("x y z", positions)},
    }
    document: dict[str, Any] = {
        "name": "flown",
        "cameras": {"C": {"principal_distance": FOCAL, "format": list(FORMAT)}},
        "strips": [{"id": f"S{n + 1}", "camera": "C", "photos": each} for n, each in enumerate(flown.strips)],
        "observations": {"file": "images.csv", "unit": "mm", "sigma": 0.002},
        "control": [{"file": "control.csv", **GROUND, "sigma": [0.02] * 3}],
        "camera_positions": {"file": "positions.csv", **GROUND, "sigma": [0.03] * 3},
        "processing": {"adjustment": adjustment},
    }
    if rough is not None:
        turned = np.array([each @ turn(rng, rough) for each in flown.rotations])
        values = np.degrees(angles(turned, "omega-phi-kappa"))
        tables["angles.csv"] = {"photo": names, **columns("x y z", positions), **columns("omega phi kappa", values)}
        system = {"system": "omega-phi-kappa", "unit": "deg"}
        document["orientations"] = {"file": "angles.csv", **GROUND, "angles": system, "role": "approximate"}
    return document, tables


def columns(names: str, values: Floats) -> dict[str, Floats]:
    return dict(zip(names.split(), values.T, strict=True))
