"""A result as a GeoPackage: layers that QGIS and GDAL open, with what the tables hold as columns.

Points, control, check points and photos lie where the result has them, footprints where the corners of a photo meet the
plane through its points; differences in plan and standard error ellipses are drawn larger, as their layers say.

Described by OGC 12-128r19.
"""

from __future__ import annotations

import math
import sqlite3
import struct
from collections.abc import Iterator, Sequence
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.foreign.adjusted import Adjusted, coordinates
from photostrip.geodesy.crs import map_entry
from photostrip.notes import Document, counted

APPLICATION, VERSION = 0x47504B47, 10400  # "GPKG", 1.4
HEAD = f"""
PRAGMA synchronous = OFF;
PRAGMA application_id = {APPLICATION};
PRAGMA user_version = {VERSION};
CREATE TABLE gpkg_spatial_ref_sys (srs_name TEXT NOT NULL, srs_id INTEGER PRIMARY KEY, organization TEXT NOT NULL,
  organization_coordsys_id INTEGER NOT NULL, definition TEXT NOT NULL, description TEXT);
CREATE TABLE gpkg_contents (table_name TEXT PRIMARY KEY, data_type TEXT NOT NULL, identifier TEXT UNIQUE,
  description TEXT DEFAULT '', last_change DATETIME NOT NULL DEFAULT '1970-01-01T00:00:00.000Z', min_x DOUBLE,
  min_y DOUBLE, max_x DOUBLE, max_y DOUBLE, srs_id INTEGER REFERENCES gpkg_spatial_ref_sys(srs_id));
CREATE TABLE gpkg_geometry_columns (table_name TEXT PRIMARY KEY REFERENCES gpkg_contents(table_name),
  column_name TEXT NOT NULL, geometry_type_name TEXT NOT NULL, srs_id INTEGER NOT NULL
  REFERENCES gpkg_spatial_ref_sys(srs_id), z TINYINT NOT NULL, m TINYINT NOT NULL);
"""
KINDS = {bool: "BOOLEAN", int: "INTEGER", float: "DOUBLE", str: "TEXT"}
CARTESIAN, GEOGRAPHIC = -1, 0  # reference systems of which nothing is known
OWN = 100_000  # number of a reference system without one
POINT, LINE, POLYGON = 1001, 1002, 1003  # of well-known binary, with heights
NAMES = {POINT: "POINT", LINE: "LINESTRING", POLYGON: "POLYGON"}
DIFFERENCES = ("dx", "dy", "dz")
CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) / 2.0
ARC = np.linspace(0.0, 2.0 * np.pi, 37)  # of an ellipse
SHARE = 1 / 40  # of the block's extent that the largest drawn difference has, at most


class Layer(NamedTuple):
    name: str
    kind: int
    places: Sequence[Floats]  # of each record (k, 3): x to the east, y to the north, height
    records: Sequence[Document]  # columns by name, the same in each
    description: str


def write(block: Adjusted, target: str, _form: str) -> tuple[dict[str, str | bytes], list[str]]:
    """Return a GeoPackage, the same bytes for the same result, and what is in it."""
    layers = [each for each in _layers(block) if each.records]
    with TemporaryDirectory() as folder:  # not every SQLite gives the bytes of a base in memory
        file = Path(folder) / "layers.gpkg"
        with closing(sqlite3.connect(file)) as base, base:
            base.executescript(HEAD)
            srs = _reference_system(base, block)
            for each in layers:
                _write(base, each, srs)
        content = file.read_bytes()
    said = [f"{each.name}: {counted(len(each.records), 'row')}; {each.description}" for each in layers]
    return {target: content}, said


def _layers(block: Adjusted) -> Iterator[Layer]:
    places, centers = block.on_map(block.xyz, block.enu), block.on_map(block.centers, block.enu_centers)
    axes = block.document["frame"]["axes"]
    of_points = [_of_point(each, axes) for each in block.points]
    yield Layer(
        name="points",
        kind=POINT,
        places=list(places[:, None]),
        records=of_points,
        description="adjusted points, standard deviations in metres",
    )
    row_of = {each["id"]: row for row, each in enumerate(block.points)}
    given = [each for each in block.document["control"] if each["id"] in row_of]
    rows = np.array([row_of[each["id"]] for each in given], np.intp)
    for role in ("control", "check"):
        some = [number for number, each in enumerate(given) if each["role"] == role]
        records = [_of_given(given[number], axes) for number in some]
        yield Layer(
            name=role,
            kind=POINT,
            places=list(places[rows[some]][:, None]),
            records=records,
            description="differences adjusted minus given, metres",
        )
    of_photos = [_of_photo(each, axes, block.document["angles"]) for each in block.photos]
    yield Layer(
        name="photos", kind=POINT, places=list(centers[:, None]), records=of_photos, description="perspective centres"
    )
    prints = [_footprint(block, number) for number in range(len(block.photos))]
    seen = [number for number, each in enumerate(prints) if each is not None]
    records = [{"id": block.photos[number]["id"], "strip": block.photos[number]["strip"]} for number in seen]
    ground = "photos on the planes through their adjusted points"
    yield Layer(
        name="footprints",
        kind=POLYGON,
        places=[each for each in prints if each is not None],
        records=records,
        description=ground,
    )
    known = [number for number, each in enumerate(given) if each["plan"] is not None]
    yield _vectors(block, [given[number] for number in known], rows[known])
    yield _ellipses(block)


def _of_point(point: Document, axes: Sequence[str]) -> Document:
    found = _columns(point, ("id", "role"))
    if "sigma_x" in point:
        found |= _along("sigma_", axes, [point[f"sigma_{each}"] for each in "xyz"])
    names = ["ellipse_a", "ellipse_b", "ellipse_azimuth_deg", "rays", "models", "checked", "image_rms_um"]
    return found | _columns(point, [name for name in names if name in point])


def _of_given(given: Document, axes: Sequence[str]) -> Document:
    differences = _along("d_", axes, [given[each] for each in DIFFERENCES])
    return _columns(given, ("id", "use", "rejected")) | differences | _columns(given, ("plan", "height", "normalised"))


def _of_photo(photo: Document, axes: Sequence[str], angles: Document) -> Document:
    names = {f"angle_{k}": f"{name}_{angles['unit']}" for k, name in enumerate(angles["system"].split("-"), 1)}
    found = _columns(photo, ("id", "strip")) | {name: photo[key] for key, name in names.items()}
    found |= _along("sigma_", axes, [photo[f"sigma_{each}"] for each in "xyz"])
    found |= {f"sigma_{name}": photo[f"sigma_{key}"] for key, name in names.items()}
    return found | _columns(photo, ("points", "image_rms_um"))


def _along(name: str, axes: Sequence[str], values: Sequence[float | None]) -> Document:
    """Name three values by the axes of the frame, in whatever order it has them."""
    return {f"{name}{axis}": value for axis, value in zip(axes, values, strict=True)}


def _columns(record: Document, names: Sequence[str]) -> Document:
    return {name: record[name] for name in names}


def _footprint(block: Adjusted, number: int) -> Floats | None:
    """Return where the corners of a photo meet the plane through its points; None where they do not, ahead of it."""
    rays = block.rays[number]
    camera = next(each for each in block.document["cameras"] if each["id"] == block.given_camera_of[number])
    if camera["format_mm"] is None:
        low, high = rays.xy.min(axis=0, initial=0.0), rays.xy.max(axis=0, initial=0.0)
        corners = (low + high) / 2.0 + CORNERS * (high - low)
    else:
        corners = (CORNERS * camera["format_mm"] - camera["principal_point_mm"]) / camera["principal_distance_mm"]
    points = block.xyz[np.unique(rays.points[rays.used])]
    if len(points) < 3:
        return None
    middle = points.mean(axis=0)
    center, turned = block.centers[number], block.rotations[number]
    normal = np.linalg.svd(points - middle, full_matrices=False)[2][2]
    directions = np.column_stack([corners, -np.ones(len(corners))]) @ turned.T
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (middle - center) @ normal / (directions @ normal)
    if not ((along > 0.0) & (along < 10.0 * np.median(np.linalg.norm(points - center, axis=1)))).all():
        return None  # the horizon is on it, or its points lie in a line
    return block.on_map(center + along[:, None] * directions)


def _vectors(block: Adjusted, given: Sequence[Document], rows: Numbers) -> Layer:
    """Draw the differences in plan, from each point on in the direction of adjusted minus given."""
    axes = block.document["frame"]["axes"]
    differences = np.nan_to_num(coordinates(tuple(given), DIFFERENCES))
    if "east" in axes:
        differences = differences[:, [axes.index(each) for each in ("east", "north", "up")]]
        level = block.ground.axes_at(block.xyz[rows], block.enu[rows])
        differences[:, 2] = 0.0
    else:
        level = np.broadcast_to(np.eye(3), (len(rows), 3, 3))
    factor = _factor(block, np.linalg.norm(differences, axis=1))
    moved = block.xyz[rows] + factor * np.einsum("nij,ni->nj", level, differences)
    lines = np.stack([block.on_map(block.xyz[rows], block.enu[rows]), block.on_map(moved)], axis=1)
    records = [_columns(each, ("id", "role", "plan", "height")) for each in given]
    return Layer(
        name="error_vectors",
        kind=LINE,
        places=list(lines),
        records=records,
        description=f"adjusted minus given in plan, {factor:g} times as long",
    )


def _ellipses(block: Adjusted) -> Layer:
    """Draw the standard error ellipses of the points in plan."""
    known = [row for row, each in enumerate(block.points) if each.get("ellipse_a") is not None]
    points = tuple(block.points[row] for row in known)
    long, short, azimuth = coordinates(points, ("ellipse_a", "ellipse_b", "ellipse_azimuth_deg")).T
    factor = _factor(block, long)
    sin, cos = np.sin(np.radians(azimuth)), np.cos(np.radians(azimuth))
    level = block.ground.level_axes_at(block.xyz[known], block.enu[known])
    along, across = (
        level[:, :2].transpose(0, 2, 1) @ np.stack(each, -1)[..., None] for each in ((sin, cos), (cos, -sin))
    )
    rings = factor * (
        np.cos(ARC)[:, None] * (long[:, None] * along[..., 0])[:, None]
        + np.sin(ARC)[:, None] * (short[:, None] * across[..., 0])[:, None]
    )
    rings += block.xyz[known][:, None]
    places = block.on_map(rings.reshape(-1, 3)).reshape(len(known), -1, 3)
    records = [_columns(each, ("id", "role", "ellipse_a", "ellipse_b", "ellipse_azimuth_deg")) for each in points]
    return Layer(
        name="error_ellipses",
        kind=POLYGON,
        places=list(places),
        records=records,
        description=f"standard ellipses, {factor:g} times as large",
    )


def _factor(block: Adjusted, lengths: Floats) -> float:
    """Return 1, 2 or 5 times a power of ten by which lengths (m) are drawn larger, so that the largest is seen."""
    extent, largest = float(np.ptp(block.xyz, axis=0).max(initial=0.0)), float(lengths.max(initial=0.0))
    if not (extent > 0.0 and largest > 0.0):
        return 1.0
    power = 10.0 ** math.floor(math.log10(SHARE * extent / largest))
    return max(1.0, next(each * power for each in (5.0, 2.0, 1.0) if each * power * largest <= SHARE * extent))


def _reference_system(base: sqlite3.Connection, block: Adjusted) -> int:
    """Enter the reference system, and those that every file has; return its number."""
    entries = [
        ("undefined Cartesian", CARTESIAN, "NONE", CARTESIAN, "undefined", ""),
        ("undefined geographic", GEOGRAPHIC, "NONE", GEOGRAPHIC, "undefined", ""),
    ]
    number, described = CARTESIAN, block.document["frame"]["description"]
    if block.ground.kind != "local":
        known = map_entry(block.ground.spec)
        number = known.epsg or OWN
        entries.append((known.name, number, "EPSG" if known.epsg else "NONE", number, known.wkt, described))
    if number != 4326:  # which every file has
        geographic = map_entry(type(block.ground.spec)("EPSG:4326", ("east", "north", "up")))
        entries.append((geographic.name, 4326, "EPSG", 4326, geographic.wkt, "longitude, latitude"))
    base.executemany("INSERT INTO gpkg_spatial_ref_sys VALUES (?, ?, ?, ?, ?, ?)", entries)
    return number


def _write(base: sqlite3.Connection, layer: Layer, srs: int) -> None:
    columns = "".join(f', "{name}" {_kind(layer.records, name)}' for name in layer.records[0])
    base.execute(f'CREATE TABLE "{layer.name}" (fid INTEGER PRIMARY KEY, geom {NAMES[layer.kind]} NOT NULL{columns})')
    every = np.concatenate(list(layer.places))
    extent = (*every[:, :2].min(axis=0).tolist(), *every[:, :2].max(axis=0).tolist())
    base.execute(
        "INSERT INTO gpkg_contents (table_name, data_type, identifier, description, min_x, min_y, max_x, max_y, srs_id)"
        " VALUES (?, 'features', ?, ?, ?, ?, ?, ?, ?)",
        (layer.name, layer.name, layer.description, *extent, srs),
    )
    base.execute("INSERT INTO gpkg_geometry_columns VALUES (?, 'geom', ?, ?, 1, 0)",
                 (layer.name, NAMES[layer.kind], srs))  # fmt: skip
    marks = ", ".join("?" * len(layer.records[0]))
    rows: Iterator[tuple[Any, ...]] = (
        (_geometry(layer.kind, place, srs), *record.values())
        for place, record in zip(layer.places, layer.records, strict=True)
    )
    base.executemany(f'INSERT INTO "{layer.name}" VALUES (NULL, ?, {marks})', rows)  # noqa: S608 (names of its own)


def _kind(records: Sequence[Document], name: str) -> str:
    """Return the type of a column: that of the first value, whole numbers among others are numbers."""
    kinds = {type(each[name]) for each in records} - {type(None)}
    return KINDS[float if kinds == {int, float} else min(kinds, key=str, default=float)]


def _geometry(kind: int, place: Floats, srs: int) -> bytes:
    """Return a geometry without an envelope: version 1, little-endian, then well-known binary."""
    head = struct.pack("<2sBBi", b"GP", 0, 1, srs) + struct.pack("<BI", 1, kind)
    counts = {POINT: b"", LINE: struct.pack("<I", len(place)), POLYGON: struct.pack("<II", 1, len(place))}
    return head + counts[kind] + np.ascontiguousarray(place, "<f8").tobytes()
