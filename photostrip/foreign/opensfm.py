"""Reconstructions of OpenSfM: ``reconstruction.json`` with its cameras and poses, ``tracks.csv`` with the rays.

A pose takes the world to the camera (x right, y down, z ahead), its rotation is angle times axis. The world is
topocentric about ``reference_lla`` as far as positions of the photos said where it is. Image coordinates count from the
middle of the photo, y down, in parts of its larger side. Tracks that are no points of the reconstruction were rejected.

OpenSfM documents the files in opensfm.org/docs/dataset.html, the cameras in geometry.html; the columns of the tracks
are those of its tracks_manager.cc: from version 1 on with the scale, from 2 on with segmentation and instance.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from photostrip.arrays import Floats, Numbers
from photostrip.foreign.gathering import Origin, Photo, checked_camera, gathered
from photostrip.foreign.nodes import Node, read_nodes
from photostrip.foreign.places import Place
from photostrip.foreign.tables import ForeignBlock
from photostrip.formats.faults import LARGEST_NUMBER, shown
from photostrip.formats.files import decode, refuse
from photostrip.formats.tables import unpacked
from photostrip.notes import counted, listed
from photostrip.strip.pixel_cameras import PixelCamera

CAMERAS = {  # focal lengths, principal point, distortion
    "perspective": ("focal focal", "", "k1 k2"),
    "simple_radial": ("focal_x focal_y", "c_x c_y", "k1"),
    "radial": ("focal_x focal_y", "c_x c_y", "k1 k2"),
    "brown": ("focal_x focal_y", "c_x c_y", "k1 k2 k3 p1 p2"),
}
VERSION = "OPENSFM_TRACKS_VERSION_v"
COLUMNS = {"0": 8, "1": 9, "2": 11}  # of the tracks, by version: photo, track, feature, x, y and others
POINT = "opensfm-{}"  # an id that no control point has
CONTROL_FILES = ("ground_control_points.json", "gcp_list.txt")


def is_reconstruction(folder: Path) -> bool:
    return bool(_found(folder, "reconstruction", ".json"))


def _found(folder: Path, name: str, ending: str) -> list[Path]:
    """Find the files of a folder that are called so, packed or not."""
    return sorted(each for end in (ending, f"{ending}.gz") for each in folder.glob(f"{name}*{end}"))


def read(source: Path) -> ForeignBlock:
    """Read a reconstruction from its folder; of several the one with most photos, as OpenSfM's own exports do.

    Raises InputError with file and line, or record, for all that is none or has no counterpart here.
    """
    file, tracks = (_only(source, *name) for name in (("reconstruction", ".json"), ("tracks", ".csv")))
    parts = list(read_nodes(file).items("reconstruction"))
    if not parts:
        refuse(file, "foreign", "has no reconstruction in it")
    sizes = [sum(1 for _ in part.at("shots").entries("shot")) for part in parts]
    part = parts[int(np.argmax(sizes))]
    cameras = {name: _camera(each) for name, each in part.at("cameras").entries("camera")}
    known = {name for name, _ in part.at("points").entries("point")}
    rays, names, left_out = _tracks(tracks, known)
    if others := sum(sizes) - max(sizes):
        left_out.append(f"{counted(len(parts) - 1, 'smaller reconstruction')} of {counted(others, 'photo')}")
    photos = [_photo(name, each, cameras, rays) for name, each in part.at("shots").entries("shot")]
    if lost := sorted(rays.keys() - {each.name for each in photos}):
        left_out.append(f"{counted(len(lost), 'photo')} of the tracks without a pose: {listed(lost, 4)}")
    beside = tuple(str(source / each) for each in CONTROL_FILES if (source / each).is_file())
    block = gathered(
        Origin(
            source="OpenSfM reconstruction",
            files=(file, tracks),
            rays=tracks,
            label=lambda number: POINT.format(names[number]),
            frame=_frame(part.at("reference_lla")),
            left_out=tuple(left_out),
        ),
        cameras,
        photos,
    )
    return replace(block, beside=beside)


def _only(folder: Path, name: str, ending: str) -> str:
    files = _found(folder, name, ending)
    if not files:
        refuse(str(folder), "foreign", f"has no {name}{ending}, which a reconstruction of OpenSfM needs")
    if len(files) > 1:
        message = f"has {listed([each.name for each in files], 4)}: one {name}{ending} is read"
        refuse(str(folder), "foreign", message, fix="leave one of them in the folder")
    return str(files[0])


def _frame(given: Node) -> str:
    if given.value is None:
        return "the model's own, of any place, direction and scale"
    latitude, longitude, height = (given.at(name).number() for name in ("latitude", "longitude", "altitude"))
    return f"east, north, up about latitude {latitude:.7f}, longitude {longitude:.7f}, height {height:.2f}, as roughly \
as positions of the photos gave it"


def _camera(given: Node) -> PixelCamera:
    kind = given.at("projection_type").text()
    if kind not in CAMERAS:
        fix = "undistort the photos (opensfm undistort), or calibrate with brown"
        message = f"the camera type {shown(kind)} has no counterpart"
        raise given.wrong(message, "camera-model", expected=f"one of {', '.join(CAMERAS)}", fix=fix)
    focal, point, distortion = (names.split() for names in CAMERAS[kind])
    width, height = given.at("width").number(), given.at("height").number()
    fx, fy = (given.at(name).number() for name in focal)
    x0, y0 = (given.at(name).number(0.0) for name in point) if point else (0.0, 0.0)
    camera = PixelCamera(
        convention="opensfm",
        image_size=(width, height),
        focal_length=(fx, fy),
        principal_point=(x0, y0),
        distortion={name: given.at(name).number(0.0) for name in distortion},
    )
    return checked_camera(given.place, kind, camera)


def _photo(
    name: str, given: Node, cameras: Mapping[str, PixelCamera], rays: Mapping[str, tuple[Floats, Numbers]]
) -> Photo:
    camera = given.at("camera").text()
    if camera not in cameras:
        raise given.wrong(f"there is no camera {shown(camera)}", "unknown-camera")
    rotation, translation = given.at("rotation").numbers(3), given.at("translation").numbers(3)
    pose = np.concatenate([Rotation.from_rotvec(rotation).as_quat()[[3, 0, 1, 2]], translation])
    xy, points = rays.get(name, (np.zeros((0, 2)), np.zeros(0, np.int64)))
    return Photo(
        place=given.place, pose=pose, camera=camera, name=name, xy=pixels(xy, cameras[camera].image_size), points=points
    )


def pixels(xy: Floats, image_size: tuple[float, float]) -> Floats:
    """Turn parts of the larger side about the middle into pixels from the corner of the first one."""
    size = np.array(image_size)
    return xy * size.max() + size / 2.0


def _tracks(file: str, known: set[str]) -> tuple[dict[str, tuple[Floats, Numbers]], list[str], list[str]]:
    """Give the rays of each photo, the names of the points that they are numbered by, and what was left out."""
    first, *lines = decode(file, unpacked(file))[0].split("\n")
    version, start = "0", 2
    if first.startswith(VERSION):
        version = first.removeprefix(VERSION).strip()
    else:
        lines, start = [first, *lines], 1
    if version not in COLUMNS:
        message = f"version {shown(version)} of the tracks is not known"
        raise Place(file, 1).wrong(message, expected=f"one of {', '.join(COLUMNS)}")
    rows: list[tuple[str, str]] = []
    places: list[tuple[str, str]] = []
    numbers: list[int] = []
    for number, line in enumerate(lines, start):
        words = line.split("\t")
        if len(words) == COLUMNS[version]:
            rows.append((words[0], words[1]))
            places.append((words[3], words[4]))
            numbers.append(number)
        elif line.strip():
            message = f"{counted(len(words), 'value')} in the line"
            expected = f"{COLUMNS[version]} with tabs between them: photo, track, feature, x, y, ..."
            raise Place(file, number).wrong(message, "row-length", expected=expected)
    xy = _places(file, places, numbers)
    index = {name: number for number, name in enumerate(sorted(known))}
    point = np.array([index.get(track, -1) for _, track in rows], dtype=np.int64)
    names = sorted({photo for photo, _ in rows})
    where = {photo: number for number, photo in enumerate(names)}
    photo = np.array([where[photo] for photo, _ in rows], dtype=np.int64)
    rejected = len({track for _, track in rows} - known)
    left_out = [f"{counted(rejected, 'track')} that are no points of the reconstruction"] if rejected else []
    order = np.argsort(photo, kind="stable")
    ends = np.searchsorted(photo[order], np.arange(len(names) + 1))
    parts = (order[ends[each] : ends[each + 1]] for each in range(len(names)))
    return {name: (xy[part], point[part]) for name, part in zip(names, parts, strict=True)}, list(index), left_out


def _places(file: str, words: Sequence[tuple[str, str]], lines: Sequence[int]) -> Floats:
    try:
        found = np.array(words, float).reshape(-1, 2)
    except ValueError:
        found = np.full((1, 2), np.nan)
    if not (np.abs(found) < LARGEST_NUMBER).all():
        for line, pair in zip(lines, words, strict=True):
            for word in pair:
                if not _is_number(word):
                    raise Place(file, line).wrong(f"`{shown(word)}` is no image coordinate", "number")
    return found


def _is_number(word: str) -> bool:
    try:
        return abs(float(word)) < LARGEST_NUMBER
    except ValueError:
        return False
