"""What was read of another program as a project: its files, and what was understood in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import isnan

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.camera import Camera
from photostrip.foreign.tables import ForeignBlock, GivenControl, GivenPositions, Wanted
from photostrip.formats.files import Content
from photostrip.formats.result_files import to_csv
from photostrip.geodesy.frame_spec import CARTESIAN_AXES, GROUND_AXES
from photostrip.geometry.rotation import separable_angles
from photostrip.notes import counted
from photostrip.number_columns import as_repr, as_texts, joined, repeated, texts_of
from photostrip.project.resolved import yaml_text
from photostrip.project.sections import Text
from photostrip.strip.corrections import distortion_shift
from photostrip.strip.pixel_cameras import PIXEL_SIZE, PixelCamera, in_millimetres

PIECE = 100_000  # rows that are written at a time
HEADER = "# Written by photostrip convert from a {source}, for you to edit; every key: docs/files/project.md.\n"
OF_MODEL = """\
# Place, direction and scale of its orientations are arbitrary. They are a start: with control the photos are laid on
# it, without any the result is a free network in the frame of the model.
"""
ON_EARTH = "# Its orientations are a start, without influence on the result.\n"
WITHOUT_RAYS = "# Tie points are missing: put their rows into observations.csv, with the columns of its header.\n"


def project_files(name: str, block: ForeignBlock, wanted: Wanted) -> dict[str, Content]:
    """Return the files of a project, ``project.yaml`` last; the same for the same block to the byte."""
    posed, system = _orientations(block)
    rays = [(block.photos, block.photo), (block.points, block.point)]
    project = _project(name, block, wanted, system)
    start = OF_MODEL if block.crs == "local" else ON_EARTH
    header = HEADER.format(source=block.source) + (start if system else WITHOUT_RAYS)
    return {
        "observations.csv": _table("photo,point,x,y", rays, block.xy)
        if block.sigma is None
        else _table("photo,point,x,y,sx,sy", rays, np.column_stack([block.xy, block.sigma, block.sigma])),
        **posed,
        **({} if block.control is None else {"control.csv": _control(block.control)}),
        **({} if block.positions is None else {"positions.csv": _positions(block.photos, block.positions)}),
        "project.yaml": header + yaml_text(project),
    }


def _orientations(block: ForeignBlock) -> tuple[dict[str, Content], str]:
    """Return the table of orientations and the system of its angles; nothing where there are none."""
    if block.centers is None or block.rotations is None:
        return {}, ""
    system, turned = separable_angles(block.rotations)
    posed = np.hstack([block.centers, np.degrees(turned)])
    header = f"photo,x,y,z,{system.replace('-', ',')}"
    if block.center_sigma is not None and np.isfinite(block.center_sigma).any():
        header, posed = f"{header},sx,sy,sz", np.hstack([posed, block.center_sigma])
    return {"orientations.csv": _table(header, [(block.photos, np.arange(len(block.photos)))], posed)}, system


def _project(name: str, block: ForeignBlock, wanted: Wanted, system: str) -> dict[str, object]:
    size = {} if wanted.pixel_size is None else {"pixel_size": wanted.pixel_size}
    owners: dict[str, list[Text]] = {camera: [] for camera in block.cameras}
    for photo, camera in zip(block.photos, block.camera_of, strict=True):
        owners[camera].append(Text(photo))
    return {
        "photostrip": 1,
        "name": Text(name),
        "cameras": {
            Text(camera): camera_in_pixels(given) | size if isinstance(given, PixelCamera) else in_project(given)
            for camera, given in block.cameras.items()
        },
        # photos that have no rays yet are not listed: those that get some are taken, of the one camera
        "photos": [
            {"camera": Text(camera), **({"photos": photos} if system else {})} for camera, photos in owners.items()
        ],
        "observations": {
            "file": "observations.csv",
            "unit": "px",
            "y_axis": "down",
            "origin": "top-left",
            "sigma": wanted.sigma,
        },
        **({} if block.control is None else {"control": [{"file": "control.csv", **_frame(block.control.crs)}]}),
        **(
            {}
            if block.positions is None
            else {"camera_positions": {"file": "positions.csv", **_frame(block.positions.crs)}}
        ),
        **({"orientations": _approximate(system, block.crs)} if system else {}),
    }


def _approximate(system: str, crs: str) -> dict[str, object]:
    angles = {"system": system, "unit": "deg"}
    return {"file": "orientations.csv", **_frame(crs), "angles": angles, "role": "approximate"}


def _positions(photos: Sequence[str], given: GivenPositions) -> Iterator[str]:
    values, known = np.hstack([given.xyz, given.sigma]), np.flatnonzero(np.isfinite(given.xyz[:, 0]))
    return _table("photo,x,y,z,sx,sy,sz", [(photos, known)], values[known])


def _frame(crs: str) -> dict[str, object]:
    return {"crs": Text(crs), "axes": list(CARTESIAN_AXES if crs == "geocentric" else GROUND_AXES)}


def _control(given: GivenControl) -> str:
    rows = zip(given.ids, given.xyz.tolist(), given.sigma.tolist(), given.check, strict=True)
    cells = (
        (name, x, y, "" if isnan(z) else z, "xy" if isnan(z) else "xyz", "check" if check else "control", *sigma)
        for name, (x, y, z), sigma, check in rows
    )
    return to_csv(("point", "x", "y", "z", "use", "role", "sx", "sy", "sz"), cells)


def camera_in_pixels(given: PixelCamera) -> dict[str, object]:
    """Return a camera as the project file has it, by its own convention."""
    fx, fy = given.focal_length
    return {
        "unit": "px",
        "convention": given.convention,
        "image_size": [int(each) if each == int(each) else each for each in given.image_size],
        "focal_length": fx if fx == fy else [fx, fy],
        "principal_point": list(given.principal_point),
        **({"distortion": dict(given.distortion)} if any(given.distortion.values()) else {}),
    }


def in_project(camera: Camera) -> dict[str, object]:
    """Return a camera in millimetres as the project file has it."""
    found: dict[str, object] = {
        "principal_distance": camera.principal_distance,
        "principal_point": list(camera.principal_point),
    }
    if camera.format is not None:
        found["format"] = list(camera.format)
    if camera.pixel_size is not None:
        found["pixel_size"] = camera.pixel_size
    if camera.fiducials:
        found["fiducials"] = {Text(mark): list(place) for mark, place in camera.fiducials.items()}
    lens = camera.distortion
    if lens is None:
        return found
    names = ("radius", "distortion") if lens.model == "radial-table" else ("k", "p", "b")
    values = {name: list(getattr(lens, name)) for name in names}
    return found | {"distortion": {"model": lens.model, "direction": lens.direction, **values}}


def _table(header: str, ids: Sequence[tuple[Sequence[str], Numbers]], values: Floats) -> Iterator[str]:
    """Write a table in pieces: columns of ids by their numbers, then columns of numbers."""
    yield f"{header}\n"
    names = [(texts_of([_quoted(name) for name in every]), number) for every, number in ids]
    for start in range(0, len(values), PIECE):
        rows = slice(start, start + PIECE)
        columns = [as_texts(every[number[rows]]) for every, number in names]
        columns += [as_repr(column, "") for column in values[rows].T]
        comma = repeated(",", columns[0].shape[1])
        cells = [each for column in columns for each in (column, comma)][:-1]
        yield joined(cells, "\n") + "\n"


def _quoted(name: str) -> str:
    return to_csv([name], ())[:-1] if set(name) & set(',"') else name


def understood(block: ForeignBlock, wanted: Wanted) -> Mapping[str, str]:
    """Say what was read in the program's own words, by what it is about."""
    of_control = (0, 0) if block.control is None else (len(block.control.ids), block.control.marks)
    counts = (
        f"{counted(len(block.photos), 'photo')} of {counted(len(block.cameras), 'camera')}, "
        f"{counted(len(block.points) - of_control[0], 'point')}, {counted(len(block.xy) - of_control[1], 'ray')}"
    )
    said = {"read": f"{block.source}: {counts}"}
    said |= {f"camera {name}": _of_camera(name, given) for name, given in list(block.cameras.items())[:5]}
    said |= {f"precision of {name}": text for name, text in list(block.calibrated.items())[:5]}
    if len(block.cameras) > 5:
        said["more"] = counted(len(block.cameras) - 5, "camera")
    said |= _of_photo(block)
    pixel = f"{wanted.pixel_size:g} mm" if wanted.pixel_size is not None else "taken as 1 µm"
    if sizes := [each.pixel_size for each in block.cameras.values() if isinstance(each, Camera)]:
        pixel = f"{sizes[0]:g} mm"
    said["image"] = (
        f"pixels from the corner of the first one, y down; standard deviation {wanted.sigma:g} px; a pixel is {pixel}"
    )
    if block.control is not None:
        said["control"] = _of_control(block.control)
    elif block.beside:
        said["control"] = f"none; to take what lies beside: {' or '.join(f'--control {file}' for file in block.beside)}"
    if block.positions is not None:
        said["positions"] = block.positions.said
    if block.left_out:
        said["left out"] = "; ".join(block.left_out)
    return said


def _of_photo(block: ForeignBlock) -> dict[str, str]:
    """Say where the first photo is, and in what frame."""
    rays = counted(int(np.count_nonzero(block.photo == 0)), "ray")
    name = f"photo {block.photos[0]}"
    if block.centers is None or block.rotations is None:
        at = "" if block.positions is None else "; about {:.6f}, {:.6f}, {:.0f}".format(*block.positions.xyz[0])
        return {name: rays + at, "frame": block.frame}
    x, y, z = block.centers[0] + 0.0
    along, right = -block.rotations[0][:, 2], block.rotations[0][:, 0]
    at = f"perspective center {x:.5g}, {y:.5g}, {z:.5g}, view along {_vector(along)}, its x along {_vector(right)}"
    return {name: f"{rays}; {at}", "frame": f"{block.frame}; the orientations are only a start"}


def _of_control(given: GivenControl) -> str:
    x, y, z = given.xyz[0].tolist()
    height = "not known" if isnan(z) else f"{z:.3f}"
    checks = f", {sum(given.check)} of them check points" if any(given.check) else ""
    return (
        f"{counted(len(given.ids), 'point')}{checks}, {counted(given.marks, 'mark')}; {given.crs}, heights taken as "
        f"ellipsoidal; {given.ids[0]}: east {x:.10g}, north {y:.10g}, up {height}"
    )


def _of_camera(name: str, given: PixelCamera | Camera) -> str:
    if isinstance(given, Camera):
        (width, height), (x0, y0) = given.format or (0.0, 0.0), given.principal_point
        said = (
            f"{width:g} x {height:g} mm, f {given.principal_distance:g} mm, principal point {x0:+g}, {y0:+g} mm, y up"
        )
        return f"{said}, {counted(len(given.fiducials), 'fiducial mark')}, no distortion"
    camera = in_millimetres(name, given)
    (width, height), size = given.image_size, PIXEL_SIZE
    x0, y0 = (each / size for each in camera.principal_point)
    said = (
        f"{width:g} x {height:g} px, f {camera.principal_distance / size:.2f} px, principal point "
        f"{x0:+.2f}, {y0:+.2f} px from the middle, y up"
    )
    if camera.pixel_affinity[0]:
        said += f", pixels {1e6 * camera.pixel_affinity[0]:+.0f} ppm narrower than high"
    if camera.distortion is None:
        return f"{said}, no distortion"
    corner = np.array([[width / 2.0, height / 2.0]]) * size
    moved = float(np.linalg.norm(distortion_shift(corner, camera.distortion))) / size
    return f"{said}, distortion {moved:.1f} px in a corner"


def _vector(direction: Floats) -> str:
    return ", ".join(f"{each:+.2f}" for each in direction)
