"""Orientations and cameras as orthority reads them, to make orthophotos: CSV or GeoJSON, and cameras beside them.

The table alone, with tabs, is what Metashape and Pix4D import.

Both hold the coordinates of a map and omega, phi, kappa along its axes; who uses them takes the map for Cartesian.
Cameras are those of OpenSfM: a principal point in parts of the larger side, from the middle.

Described by orthority.readthedocs.io, file formats: CSV, exterior and interior parameter files.
"""

from __future__ import annotations

from pathlib import PurePosixPath

import numpy as np

from photostrip.arrays import Floats
from photostrip.errors import Fault, InputError
from photostrip.foreign.adjusted import Adjusted
from photostrip.formats.result_files import to_csv
from photostrip.formats.result_json import on_one_line as text
from photostrip.geodesy.crs import map_entry
from photostrip.geodesy.ground_frame import plural
from photostrip.geometry.rotation import angles
from photostrip.notes import counted

HEADER = ("filename", "x", "y", "z", "omega", "phi", "kappa", "camera")
WITH_TABS = ("label", "X", "Y", "Z", "omega", "phi", "kappa")
DISTORTION = ("k1", "k2", "p1", "p2", "k3")  # as OpenCV has them


def write(block: Adjusted, target: str, form: str) -> tuple[dict[str, str | bytes], list[str]]:
    """Return the table with its reference system, and the cameras beside it; GeoJSON holds the system itself.

    Raises InputError for a frame that is neither a map nor local, and for a map in feet with heights in metres.
    """
    name = "the table" if form == "omega-phi-kappa" else "orthority"
    block.require_photos(name)
    if block.ground.kind not in {"projected", "local"}:
        message = f"{name} takes the coordinates of a map, and these are {block.ground.kind}"
        raise InputError(Fault(message, "export", fix="give output.crs of a map projection, as EPSG:32633"))
    if block.ground.plan_factor != block.ground.height_factor:
        message = f"{name} has one unit, and heights in {plural(block.ground.height_unit)} stand beside a plan in "
        message += plural(block.ground.plan_unit)
        raise InputError(Fault(message, "export", fix="give output.crs with a map in metres"))
    stem = str(PurePosixPath(target).with_suffix(""))
    turned = angles(block.level, "omega-phi-kappa")
    wkt = "" if block.ground.kind == "local" else map_entry(block.ground.spec).wkt
    said = [f"{counted(len(block.photos), 'photo')} of {counted(len(block.cameras), 'camera')}", *block.said_of_map()]
    posed = zip(block.photos, block.enu_centers.tolist(), np.degrees(turned).tolist(), block.camera_of, strict=True)
    rows = [(photo["id"], *center, *opk, camera) for photo, center, opk, camera in posed]
    beside: dict[str, str | bytes] = {f"{stem}.prj": wkt} if wkt else {}
    if form == "omega-phi-kappa":
        lines = (WITH_TABS, *(row[:-1] for row in rows))
        return {target: "".join("\t".join(map(str, line)) + "\n" for line in lines), **beside}, said
    files: dict[str, str | bytes] = {f"{stem}_int_param.yaml": _cameras(block)}
    if form == "orthority":
        files |= {target: to_csv(HEADER, rows), **beside}
    elif not wkt:
        message = "GeoJSON of orthority names the projection of its map, and a local frame has none"
        raise InputError(Fault(message, "export", fix="write CSV (.csv)"))
    else:
        files[target] = _geojson(block, turned, wkt)
    return files, said + block.said_of_cameras()


def _geojson(block: Adjusted, turned: Floats, wkt: str) -> str:
    geodetic = block.ground.geodetic(block.centers)
    places = np.column_stack([np.degrees(geodetic[:, :2]), geodetic[:, 2]]).tolist()
    features = [
        {
            "type": "Feature",
            "properties": {"filename": photo["id"], "camera": camera, "xyz": xyz, "opk": opk},
            "geometry": {"type": "Point", "coordinates": place},
        }
        for photo, camera, xyz, opk, place in zip(
            block.photos, block.camera_of, block.enu_centers.tolist(), turned.tolist(), places, strict=True
        )
    ]
    lines = ",\n".join(text(each) for each in features)
    head = f'{{"type": "FeatureCollection", "world_crs": {text(wkt)}, "features": ['
    return f"{head}\n{lines}\n]}}\n"


def _cameras(block: Adjusted) -> str:
    """Write the interior orientations; JSON of one line each is YAML, too."""
    found = []
    for name, camera in block.cameras.items():
        pixels = camera.pixels
        (width, height), side = camera.size, max(camera.size)
        given = {
            "type": "brown" if any(pixels.distortion.values()) else "pinhole",
            "im_size": [width, height],
            "focal_len": list(pixels.focal_length),
            "sensor_size": [width, height],
            "cx": (pixels.principal_point[0] - width / 2.0) / side,
            "cy": (pixels.principal_point[1] - height / 2.0) / side,
        }
        distortion = {each: pixels.distortion[each] for each in DISTORTION} if given["type"] == "brown" else {}
        found.append(f"{text(name)}: {text(given | distortion)}\n")
    return "".join(found)
