"""Phototheodolites by name: the list that comes with the program, and lists of the user."""

from __future__ import annotations

from importlib import resources
from typing import Annotated

from photostrip.errors import Fault, InputError
from photostrip.formats.text.findings import Findings, suggestion
from photostrip.formats.text.numbers import shown
from photostrip.project.schema.sections import After, Section, key, length
from photostrip.project.schema.values import Id, Number, Words, bounded, one_of
from photostrip.project.terrestrial.ranges import COORDINATE, FORMAT, PRINCIPAL_DISTANCE
from photostrip.project.yaml.parsing import parse, read_document
from photostrip.project.yaml.tree import Node
from photostrip.project.yaml.validation import checked
from photostrip.terrestrial.frame import Phototheodolite

OWN_LIST = "phototheodolites.yaml"
SCHEMA_NUMBER = "1"


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

    photostrip_cameras: Annotated[Words, After(one_of(SCHEMA_NUMBER))] = key("Number of this schema: 1")
    cameras: Annotated[dict[Id, Preset], length(1)] = key("Cameras by name")


def own_presets() -> dict[str, Phototheodolite]:
    """Return the cameras that come with the program."""
    text = resources.files("photostrip.terrestrial").joinpath(OWN_LIST).read_text(encoding="utf-8")
    findings = Findings()
    found = listed_cameras(parse(text, OWN_LIST, findings), findings)
    findings.stop()
    return found


def read_presets(file: str | None) -> dict[str, Phototheodolite]:
    """Return all cameras that can be named; those of the user's list come before those of the program."""
    if file is None:
        return own_presets()
    findings = Findings()
    found = listed_cameras(read_document(file, findings), findings)
    findings.stop()
    return own_presets() | found


def listed_cameras(root: Node | None, findings: Findings) -> dict[str, Phototheodolite]:
    """Return the cameras of a list; none when it is at fault."""
    given = checked(PresetFile, root, findings) if root is not None else None
    if given is None:
        return {}
    return {
        str(name): Phototheodolite(
            name=str(name),
            principal_distance=each.principal_distance,
            principal_point=each.principal_point,
            format=each.format,
        )
        for name, each in given.cameras.items()
    }


def preset(name: str, known: dict[str, Phototheodolite], where: str) -> Phototheodolite:
    """Return a camera by name, or refuse a name that no camera has; `where` is the option or key of it."""
    if name not in known:
        fix = suggestion(name, known) or "give --principal-distance, or a list of your own with --presets"
        message = f"there is no camera `{shown(name)}`"
        raise InputError(Fault(message, "unknown-camera", key=where, expected=f"one of {', '.join(known)}", fix=fix))
    return known[name]
