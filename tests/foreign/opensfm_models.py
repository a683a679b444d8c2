"""Simulated blocks as OpenSfM has them: reconstruction.json, tracks.csv, ground_control_points.json."""

from __future__ import annotations

import csv
import gzip
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pyproj import Transformer
from scipy.spatial.transform import Rotation

from tests.foreign.colmap_models import K1, P1, P2, F, Model, name_of

WIDTH, HEIGHT = 5500, 3667
BROWN = {
    "projection_type": "brown", "width": WIDTH, "height": HEIGHT, "focal_x": F / WIDTH, "focal_y": F / WIDTH,
    "c_x": 10 / WIDTH, "c_y": 5 / WIDTH, "k1": K1, "k2": 0.0, "k3": 0.0, "p1": P1, "p2": P2,
}  # fmt: skip


def reconstruction(model: Model) -> dict[str, Any]:
    shots: dict[str, Any] = {}
    points: dict[str, Any] = {}
    for _, q, t, _, name, _, tracks in model.images:
        rotation = Rotation.from_quat(q[[1, 2, 3, 0]]).as_rotvec().tolist()
        shots[name] = {"rotation": rotation, "translation": t.tolist(), "camera": "v2 fc", "orientation": 1}
        points |= {str(track): {"color": [1, 2, 3], "coordinates": [0, 0, 0]} for track in tracks}
    return {
        "cameras": {"v2 fc": dict(BROWN)},
        "shots": shots,
        "points": points,
        "reference_lla": {"latitude": 49.2, "longitude": 15.3, "altitude": 0.0},
    }


def tracks(model: Model, version: int = 2) -> str:
    lines = [f"OPENSFM_TRACKS_VERSION_v{version}"] if version else []
    others = {0: "1\t2\t3", 1: "0.001\t1\t2\t3", 2: "0.001\t1\t2\t3\t-1\t-1"}[version]
    for _, _, _, _, name, xy, points in model.images:
        parts = (np.asarray(xy) - (WIDTH / 2.0, HEIGHT / 2.0)) / WIDTH
        rows = zip(points, parts.tolist(), strict=True)
        lines += [f"{name}\t{point}\t{n}\t{x!r}\t{y!r}\t{others}" for n, (point, (x, y)) in enumerate(rows)]
    return "\n".join(lines) + "\n"


def ground_control(native: Path) -> dict[str, Any]:
    """Give the control of a native project in UTM, with its measurements, as OpenSfM has it."""
    to_wgs84 = Transformer.from_crs("EPSG:32633", "EPSG:4326", always_xy=True)
    with (native / "observations.csv").open(encoding="utf-8") as file:
        rays = [row for row in csv.DictReader(file) if row["point"][0] in "GK"]
    points = []
    with (native / "control.csv").open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            longitude, latitude = to_wgs84.transform(float(row["x"]), float(row["y"]))
            observations = [
                {
                    "shot_id": name_of(ray["photo"]),
                    "projection": [(float(ray["x"]) - WIDTH / 2) / WIDTH, (float(ray["y"]) - HEIGHT / 2) / WIDTH],
                }
                for ray in rays
                if ray["point"] == row["point"]
            ]
            position = {"latitude": latitude, "longitude": longitude, "altitude": float(row["z"])}
            role = "metrics_only" if row["role"] == "check" else "optimization"
            points.append({"id": row["point"], "position": position, "role": role, "observations": observations})
    return {"points": points}


def write(folder: Path, parts: Sequence[object], rays: str, *, packed: bool = False) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in {"reconstruction.json": json.dumps(parts, indent=1), "tracks.csv": rays}.items():
        data = text.encode()
        (folder / (f"{name}.gz" if packed else name)).write_bytes(gzip.compress(data) if packed else data)
    return folder
