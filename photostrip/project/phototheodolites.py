"""Phototheodolites by name or by their numbers, and what numbers of terrestrial surveys can be."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import resources
from typing import Annotated

import numpy as np

from photostrip.formats.text.findings import Findings, suggestion
from photostrip.formats.text.tables import Table
from photostrip.project.sections import (
    After,
    Before,
    FirstSchema,
    Id,
    Number,
    Range,
    Section,
    Words,
    bounded,
    key,
    length,
    rule,
    wrong,
)
from photostrip.project.yaml.reading import Reading, checked
from photostrip.project.yaml.tree import Node, Path, parse, read_document
from photostrip.terrestrial.normal_case import Phototheodolite

MILLIMETRES = {"mm": 1.0, "um": 1e-3}  # in a unit of image coordinates
RADIANS = {"deg": np.pi / 180, "gon": np.pi / 200}  # in a unit of angles

PRINCIPAL_DISTANCE = Range(1.0, 1e5, "mm")
FORMAT = Range(1.0, 1e4, "mm")
STEP = Range(1e-3, 1e5, "mm")
COORDINATE = Range(-1e4, 1e4, "mm")
IMAGE_SIGMA = Range(1e-6, 10.0, "mm")
IMAGE_SIGMA_UM = Range(1e-3, 1e4, "µm")
DIRECTION_SIGMA = Range(1e-4, 36_000.0, "″")
DEGREES = Range(-1000.0, 1000.0, "deg")
POSITION = Range(-1e8, 1e8, "m")
BASE = Range(1e-3, 1e6, "m")
DISTANCE = Range(1e-2, 1e6, "m")
ECCENTRICITY = Range(-10.0, 10.0, "m")
REFRACTION = Range(-10.0, 10.0, "")
TIME = Range(-1e9, 1e9, "")
SIGNIFICANCE = Range(1e-6, 0.5, "")


def refuse_outside(
    table: Table, columns: Sequence[str], limits: Range, findings: Findings, *, scale: float = 1.0, unit: str = ""
) -> None:
    """Refuse numbers of a table outside limits in its unit; empty cells do not count."""
    bounds = limits.scaled(scale, unit)
    for name in columns:
        values = table.column(name)
        for row in np.flatnonzero(~np.isnan(values) & ~((values >= bounds.least) & (values <= bounds.most))):
            message = f"{values[row]:g} is out of range"
            findings.add(table.fault(int(row), name, message, "range", expected=str(bounds)))


OWN_LIST = "phototheodolites.yaml"

Distance = Annotated[Number, After(bounded(PRINCIPAL_DISTANCE))]
Place = tuple[Annotated[Number, After(bounded(COORDINATE))], Annotated[Number, After(bounded(COORDINATE))]]
Size = tuple[Annotated[Number, After(bounded(FORMAT))], Annotated[Number, After(bounded(FORMAT))]]


class Preset(Section):
    """One camera of a list."""

    principal_distance: Distance = key("Principal distance", unit="mm")
    principal_point: Place = key("Principal point x0, z0 in the system of the image coordinates", (0.0, 0.0), unit="mm")
    format: Size | None = key("Width and height of the field in which points are measured", None, unit="mm")


class PresetFile(Section):
    """A list of cameras."""

    photostrip_cameras: FirstSchema = key("Number of this schema: 1")
    cameras: Annotated[dict[Id, Preset], length(1)] = key("Cameras by name")


class Camera(Section):
    """One camera: a preset, or its own numbers, or a preset and what is different from it."""

    preset: Words | None = key("Name of a camera of the list that comes with the program, or of `presets`", None)
    principal_distance: Distance | None = key("Principal distance; default: that of the preset", None, unit="mm")
    principal_point: Place | None = key(
        "Principal point x0, z0 in the system of the image coordinates; default: that of the preset, or 0, 0",
        None,
        unit="mm",
    )
    format: Size | None = key("Width and height of the field in which points are measured", None, unit="mm")

    @rule
    def _has_a_principal_distance(self) -> None:
        if self.preset is None and self.principal_distance is None:
            expected = "`preset`, or `principal_distance` in mm"
            raise wrong("nothing says what the camera is", code="missing-key", expected=expected)


def _named(value: object) -> object:
    """Let a name stand for a camera of a list."""
    return {"preset": value} if isinstance(value, str) and value else value


CameraOrName = Annotated[Camera, Before(_named)]


def own_presets() -> dict[str, Phototheodolite]:
    """Return the cameras that come with the program."""
    text = resources.files("photostrip.terrestrial").joinpath(OWN_LIST).read_text(encoding="utf-8")
    findings = Findings()
    found = _listed(parse(text, OWN_LIST, findings), findings)
    findings.stop()
    return found


def known_presets(reading: Reading) -> dict[str, Phototheodolite]:
    """Return all cameras that can be named; those of the user's list come before those of the program."""
    known = own_presets()
    for path, findings in reading.named(("presets",)):
        known |= _listed(read_document(path, findings), reading.findings)
    return known


def _listed(root: Node | None, findings: Findings) -> dict[str, Phototheodolite]:
    """Return the cameras of a list; none when it is at fault."""
    given = checked(PresetFile, root, findings) if root is not None else None
    return {} if given is None else {name: _camera(name, each) for name, each in given.cameras.items()}


def _camera(name: str, given: Preset) -> Phototheodolite:
    return Phototheodolite(
        str(name),
        principal_distance=given.principal_distance,
        principal_point=given.principal_point,
        format=given.format,
    )


def phototheodolite(
    name: str, given: Camera, known: dict[str, Phototheodolite], reading: Reading, path: Path
) -> Phototheodolite | None:
    """Return a camera: its preset with what is different; None where there is no such preset."""
    if given.preset is not None and given.preset not in known:
        message = f"there is no preset `{given.preset}`"
        expected, fix = f"one of {', '.join(known)}", suggestion(given.preset, known)
        reading.refuse((*path, "preset"), message, "unknown-camera", expected=expected, fix=fix)
        return None
    base = known[given.preset] if given.preset is not None else Phototheodolite(name, given.principal_distance or 0.0)
    return Phototheodolite(
        name=name,
        principal_distance=given.principal_distance or base.principal_distance,
        principal_point=given.principal_point or base.principal_point,
        format=given.format or base.format,
    )


def only_camera(given: Camera, reading: Reading, *, whole: bool = False) -> Phototheodolite:
    """Return the camera under the key ``camera``, or raise every fault; `whole`: one that has a format."""
    name = "camera" if given.preset is None else str(given.preset)
    found = phototheodolite(name, given, known_presets(reading), reading, ("camera",))
    if whole and found is not None and found.format is None:
        message = f"the camera {name} has no format"
        reading.refuse(("camera", "format"), message, "no-format", expected="[width, height] in mm")
    return reading.complete(found)
