"""A result as HISTORIX takes it: ``NAME_extrinsics.csv``, ``NAME_intrinsics.csv``, ``NAME_sparse_pointcloud.laz``.

Orientations have longitude, latitude and ellipsoidal height and, of a map, its coordinates; omega, phi, kappa along the
axes of the map, else east, north and the normal. The camera is in millimetres, its distortion as OpenCV has it.

The evaluation of HISTORIX, github.com/shippp/history, reads ``image_file_name,lon,lat,alt,x_map,y_map`` and
``focal_length,pixel_pitch,principal_point_x_mm,principal_point_y_mm`` of one camera; it asks for no other columns. LAS
1.4 is ASPRS's.
"""

from __future__ import annotations

from datetime import date
from io import BytesIO

import numpy as np

from photostrip.errors import Fault, InputError
from photostrip.foreign.adjusted import Adjusted, require_squares
from photostrip.formats.result_files import to_csv
from photostrip.geodesy.crs import map_entry
from photostrip.geodesy.ground_frame import plural
from photostrip.geometry.rotation import angles
from photostrip.notes import counted, listed
from photostrip.project.keys import ENDINGS

LENS = ("k1", "k2", "k3", "p1", "p2")
DEGREES, METRES = 1e-9, 1e-4  # steps of the coordinates in a point cloud
MOST_STEPS = 2e9  # from its origin: they are whole numbers of 32 bits
DATED = date(1970, 1, 1)  # the same bytes for the same result


def write(block: Adjusted, target: str, _form: str) -> tuple[dict[str, str | bytes], list[str]]:
    """Return the three files.

    Raises InputError for a local frame, a map in feet, more than one camera, and pixels that are no squares.
    """
    block.require_photos("HISTORIX")
    if block.ground.kind == "local":
        message = "HISTORIX asks for longitude and latitude, which a local frame does not have"
        raise InputError(Fault(message, "export", fix="give control in a reference system"))
    if block.ground.kind == "projected" and {block.ground.plan_factor, block.ground.height_factor} != {1.0}:
        message = f"HISTORIX counts in metres, and the plan is in {plural(block.ground.plan_unit)}"
        raise InputError(Fault(message, "export", fix="give output.crs with a map in metres"))
    if len(block.cameras) > 1:
        message = f"HISTORIX takes one camera, and the photos have {listed(list(block.cameras), 4)}"
        raise InputError(Fault(message, "export", fix="run the photos of each camera alone"))
    if not target.endswith(ENDINGS["historix"]):
        message = f"a submission consists of three files, which are called after one that ends in {ENDINGS['historix']}"
        raise InputError(Fault(message, "export", fix=f"write NAME_{ENDINGS['historix']}"))
    stem = target.removesuffix(ENDINGS["historix"])
    said = [f"{counted(len(block.photos), 'photo')}, {counted(len(block.points), 'point')}; heights over the ellipsoid"]
    files: dict[str, str | bytes] = {
        target: _extrinsics(block),
        f"{stem}intrinsics.csv": _intrinsics(block),
        f"{stem}sparse_pointcloud.laz": _point_cloud(block),
    }
    return files, said + block.said_of_map() + block.said_of_cameras()


def _extrinsics(block: Adjusted) -> str:
    geodetic = block.ground.geodetic(block.centers)
    level = block.ground.level_axes_at(block.centers, block.enu_centers) @ block.rotations
    columns = {
        "lon": np.degrees(geodetic[:, 0]).round(10),
        "lat": np.degrees(geodetic[:, 1]).round(10),
        "alt": geodetic[:, 2].round(5),
        **(
            dict(zip(("x_map", "y_map"), block.enu_centers.T, strict=False)) if block.ground.kind == "projected" else {}
        ),
        **dict(zip(("omega", "phi", "kappa"), np.degrees(angles(level, "omega-phi-kappa")).T, strict=True)),
    }
    rows = np.column_stack(list(columns.values())).tolist()
    return to_csv(
        ("image_file_name", *columns), ((each["id"], *row) for each, row in zip(block.photos, rows, strict=True))
    )


def _intrinsics(block: Adjusted) -> str:
    camera = next(iter(block.cameras.values()))
    require_squares(camera.nearest, "HISTORIX")
    if camera.own.unit == "px" and camera.own.pixel_size is None:
        message = f"HISTORIX counts in millimetres, and nobody knows how large a pixel of camera {camera.own.name} is"
        raise InputError(Fault(message, "export", fix=f"add cameras.{camera.own.name}.pixel_size to the project"))
    found = {
        "focal_length": camera.nearest.principal_distance,
        "pixel_pitch": camera.own.pixel_size if camera.own.pixel_size is not None else "",
        "principal_point_x_mm": camera.nearest.principal_point[0],
        "principal_point_y_mm": camera.nearest.principal_point[1],
        **{name: camera.pixels.distortion[name] for name in LENS},
    }
    return to_csv(tuple(found), [tuple(found.values())])


def _point_cloud(block: Adjusted) -> bytes:
    """Return the adjusted points as LAZ in the reference system of the result, heights over the ellipsoid."""
    import laspy

    place = block.on_map(block.xyz, block.enu)
    place[:, 2] = block.ground.geodetic(block.xyz)[:, 2]
    step = METRES if block.ground.kind == "projected" else DEGREES
    steps, origin = np.array([step, step, METRES]), np.floor(place.mean(axis=0))
    reach = np.maximum(np.abs(place - origin).max(axis=0) / MOST_STEPS, steps)
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.creation_date = DATED
    header.generating_software = "photostrip"
    header.scales, header.offsets = 10.0 ** np.ceil(np.log10(reach)), origin
    header.vlrs.append(laspy.vlrs.known.WktCoordinateSystemVlr(map_entry(block.ground.spec).wkt))
    header.global_encoding.wkt = True
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = place.T
    cloud.return_number = cloud.number_of_returns = np.ones(len(place), np.uint8)
    file = BytesIO()
    cloud.write(file, do_compress=True)
    return file.getvalue()
