"""Cameras of Agisoft Metashape, as "Export Cameras" writes them: XML.

``transform`` of a camera takes it (x right, y down, z ahead) to the chunk, that of its component the chunk to the
Earth: geocentric where the reference system of the chunk is one of the Earth, else to that system. Principal points
count from the middle of the photo, y down. Tie points are not in the file.

Agisoft documents the cameras in the manual of Metashape, appendix D; the elements are those that public readers of the
file name. None of them says about which axes the covariances of rotations are: they are not read.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Floats
from photostrip.foreign.elements import Element, read_elements
from photostrip.foreign.gathering import checked_camera
from photostrip.foreign.places import Place, unique
from photostrip.foreign.tables import WGS84, ForeignBlock
from photostrip.formats.faults import SMALLEST_LENGTH, shown
from photostrip.notes import counted
from photostrip.strip.pixel_cameras import PixelCamera

ENDING = ".xml"
COEFFICIENTS = ("k1", "k2", "k3", "k4", "p1", "p2", "p3", "p4", "b1", "b2")
CODE = re.compile(r'AUTHORITY\["EPSG","(\d{4,6})"\]\]\s*$')
ON_WGS84 = re.compile(r'DATUM\["(World Geodetic System 1984|WGS[ _]1984|WGS[ _]84)"')
NO_ROTATION = 1e-3  # of a product of a matrix's rows


def is_file(source: Path) -> bool:
    return source.suffix.casefold() == ENDING and source.is_file()


class Laid(NamedTuple):
    """How a component lies on the Earth: scale, rotation (3, 3), translation."""

    scale: float
    rotation: Floats
    shift: Floats


@dataclass(frozen=True)
class Chunk:
    """What a file holds: its one chunk."""

    file: str
    element: Element

    @property
    def reference(self) -> str:
        """Its reference system as a project has it; empty where it says none."""
        found = self.element.find("reference")
        text = "" if found is None else found.text
        if text.startswith("LOCAL_CS"):
            return "local"
        code = CODE.search(text)
        return text if code is None else WGS84 if code[1] == "4326" else f"EPSG:{code[1]}"

    @property
    def is_geocentric(self) -> bool:
        """Whether components are laid on the Earth, in WGS 84."""
        found = self.element.find("reference")
        return found is not None and bool(ON_WGS84.search(found.text))

    def cameras(self) -> dict[str, Element]:
        """Give its photos by their ids."""
        cameras = self.element.at("cameras").within("camera")
        return dict(unique("camera", ((each.place, each.attribute("id"), each) for each in cameras)))

    def accuracy(self, name: str) -> float | None:
        """Give what the settings say of the precision of references without their own, metres."""
        settings = self.element.find("settings")
        for each in () if settings is None else settings.within("property"):
            if each.attributes.get("name") == name:
                return each.number("value")
        return None


def read_chunk(file: str) -> Chunk:
    root = read_elements(file)
    chunks = [each for each in root.children if each.name == "chunk"]
    if root.name != "document" or len(chunks) != 1:
        message = f"holds {counted(len(chunks), 'chunk')} of Metashape"
        raise root.wrong(message, expected="one: <document><chunk>", fix="export the cameras of one chunk")
    return Chunk(file, chunks[0])


def read(source: Path) -> ForeignBlock:
    """Read the cameras of a chunk, without any image points.

    Raises InputError with file and line for all that is none or has no counterpart here.
    """
    chunk = read_chunk(str(source))
    cameras = chunk.cameras()
    off = [each for each in cameras.values() if not each.flag("enabled")]
    aligned = [each for each in cameras.values() if each.flag("enabled") and each.find("transform") is not None]
    if not aligned:
        raise chunk.element.wrong("no camera is aligned", "no-points", fix="align the photos, and export the cameras")
    left_out = []
    if off:
        left_out.append(counted(len(off), "photo that is not enabled", "photos that are not enabled"))
    if rest := len(cameras) - len(off) - len(aligned):
        left_out.append(counted(rest, "photo that is not aligned", "photos that are not aligned"))
    of_component: dict[str, list[Element]] = {}
    for each in aligned:
        of_component.setdefault(each.attributes.get("component_id", ""), []).append(each)
    component = max(of_component, key=lambda name: len(of_component[name]))
    if others := len(aligned) - len(of_component[component]):
        left_out.append(f"{counted(len(of_component) - 1, 'smaller component')} of {counted(others, 'photo')}")
    named = ((each.place, label_of(each), each) for each in of_component[component])
    photos = sorted(dict(unique("a photo called", named)).items())
    sensors = dict(unique("sensor", _sensors(chunk, {each.attribute("sensor_id") for _, each in photos})))
    for _, each in photos:
        if each.attribute("sensor_id") not in sensors:
            raise each.wrong(f"there is no sensor {shown(each.attribute('sensor_id'))}", "unknown-camera")
    laid = _laid(chunk, component)
    poses = np.array([_pose(each.at("transform")) for _, each in photos])
    turn = np.eye(3) if laid is None else laid.rotation
    scale, shift = (1.0, np.zeros(3)) if laid is None else (laid.scale, laid.shift)
    geocentric = laid is not None and chunk.is_geocentric
    return ForeignBlock(
        source="Metashape cameras",
        files=(chunk.file,),
        frame="geocentric (WGS 84), as Metashape laid the chunk on the Earth"
        if geocentric
        else "that of the chunk, of any place, direction and scale",
        crs="geocentric" if geocentric else "local",
        cameras={name: camera for name, (camera, _) in sensors.items()},
        photos=tuple(name for name, _ in photos),
        camera_of=tuple(each.attribute("sensor_id") for _, each in photos),
        points=(),
        photo=np.zeros(0, np.int64),
        point=np.zeros(0, np.int64),
        xy=np.zeros((0, 2)),
        centers=scale * poses[:, :3, 3] @ turn.T + shift,
        rotations=turn @ poses[:, :3, :3] * (1.0, -1.0, -1.0),
        center_sigma=np.array([_center_sigma(each, scale * turn) for _, each in photos]),
        calibrated={name: said for name, (_, said) in sensors.items() if said},
        beside=(chunk.file,) if chunk.element.find("markers") is not None else (),
        left_out=tuple(left_out),
    )


def label_of(camera: Element) -> str:
    name = camera.attribute("label").strip()
    if not name or not name.isprintable():
        raise camera.wrong(f"`{shown(name)}` is no name of a photo", expected="a text on one line")
    return name


def _sensors(chunk: Chunk, used: set[str]) -> Iterator[tuple[Place, str, tuple[PixelCamera, str]]]:
    """Give cameras that are used, with what is said of their precision."""
    for sensor in chunk.element.at("sensors").within("sensor"):
        name = sensor.attribute("id")
        if name in used:
            yield sensor.place, name, (_camera(sensor), _precision(sensor))


def _camera(sensor: Element) -> PixelCamera:
    found = [each for each in sensor.children if each.name == "calibration"]
    adjusted = [each for each in found if each.attributes.get("class", "adjusted") == "adjusted"]
    if not found:
        raise sensor.wrong("has no calibration", "camera-model", fix="align the photos, and export the cameras")
    given = (adjusted or found)[0]
    kind = given.attributes.get("type", sensor.attributes.get("type", "frame"))
    if kind != "frame":
        fix = "undistort the photos, and align those"
        raise sensor.wrong(
            f"the camera type {shown(kind)} has no counterpart", "camera-model", expected="frame", fix=fix
        )
    resolution = given.find("resolution") or sensor.at("resolution")
    values = {each.name: each.value() for each in given.children if each.name in {"f", "cx", "cy", *COEFFICIENTS}}
    if "f" not in values:
        raise given.wrong(
            "has no focal length f in pixels", "number", fix="export the cameras with Metashape 1.3 or newer"
        )
    f, cx, cy = (values.pop(name, 0.0) for name in ("f", "cx", "cy"))
    camera = PixelCamera(
        convention="metashape",
        image_size=(resolution.number("width"), resolution.number("height")),
        focal_length=(f, f),
        principal_point=(cx, cy),
        distortion=values,
    )
    return checked_camera(sensor.place, "frame", camera)


def _precision(sensor: Element) -> str:
    """Say how precise the calibration is by its covariances, in the words of Metashape; nothing where it has none."""
    given = sensor.find("covariance") or sensor.find("calibration", "covariance")
    if given is None:
        return ""
    names = given.at("params").text.split()
    coefficients = given.at("coeffs").numbers(len(names) ** 2).reshape(len(names), -1)
    sigmas = np.sqrt(np.maximum(np.diag(coefficients), 0.0)).tolist()
    return ", ".join(f"{name} {sigma:.2g}" for name, sigma in zip(names, sigmas, strict=True))


def _pose(given: Element) -> Floats:
    found = given.numbers(16).reshape(4, 4)
    _require_rotation(given, found[:3, :3])
    return found


def _require_rotation(given: Element, matrix: Floats) -> None:
    if np.abs(matrix @ matrix.T - np.eye(3)).max() > NO_ROTATION or np.linalg.det(matrix) < 0.0:
        raise given.wrong("holds no rotation", "range", expected="a right-handed orthogonal matrix")


def _laid(chunk: Chunk, component: str) -> Laid | None:
    """Find how a component lies; None where it has no transform, as of a chunk without references."""
    components = chunk.element.find("components")
    named = () if components is None else tuple(components.within("component"))
    owner = next((each for each in named if each.attributes.get("id") == component), None)
    given = (owner or chunk.element).find("transform")
    if given is None:
        return None
    rotation, scale = given.find("rotation"), given.find("scale")
    matrix = np.eye(3) if rotation is None else rotation.numbers(9).reshape(3, 3)
    _require_rotation(given, matrix)
    size = 1.0 if scale is None else scale.value()
    if not size > SMALLEST_LENGTH:
        raise given.wrong(f"{size:g} is no scale", "range", expected="a number larger than 0")
    shift = given.find("translation")
    return Laid(size, matrix, np.zeros(3) if shift is None else shift.numbers(3))


def _center_sigma(camera: Element, laid: Floats) -> Floats:
    """Give the standard deviations of a perspective centre along the axes of the frame; NaN where there are none."""
    given = camera.find("location_covariance")
    if given is None:
        return np.full(3, np.nan)
    variances = np.diag(laid @ given.numbers(9).reshape(3, 3) @ laid.T)
    return np.sqrt(variances) if (variances > SMALLEST_LENGTH**2).all() else np.full(3, np.nan)
