"""The numbers of a result that are compared, each with its kind, the id of what it belongs to, and its unit."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, TypeGuard

from photostrip.notes import Document
from photostrip.result.description import quantity_at

Number = float | None

DEGREES = {"deg": 1.0, "gon": 0.9, "rad": 57.29577951308232}
ELEMENTS = ("alpha1", "kappa1", "alpha2", "omega2", "kappa2")
SCALES = {"scale", "scale_factor", "factor"}
# Keys that name the records of a list, where it is not their id.
NAMES = {
    "absolute": ("strip",),
    "polynomials": ("strip",),
    "models": ("left", "right"),
    "junctions": ("photo",),
    "links": ("before", "after"),
}
# What is compared of a record.
KEPT = {
    "absolute": ("scale", "sigma0", "redundancy", "misclosure_rms"),
    "polynomials": ("sigma0", "redundancy"),
    "models": (
        "scale_factor",
        "sigma0_um",
        "rms_parallax_um",
        "max_parallax_um",
        "points_used",
        "points_rejected",
        "redundancy",
    ),
    "junctions": ("factor", "points_used", "spread_ppm", "discrepancy"),
    "links": ("factor", "sigma0", "points_used", "redundancy", "discrepancy"),
    "photos": ("image_rms_um", "points"),
    "points": ("image_rms_um", "rays"),
}


class ComparedNumber(NamedTuple):
    """One number of a result."""

    kind: str
    block: str
    id: str  # id of the photo, point, model or strip; empty for the whole project
    name: str
    unit: str  # its unit; empty for ratios and counts
    value: Number  # the number; None where the result has none


def quantities_of(document: Document) -> Iterator[ComparedNumber]:
    """Return all single numbers of a result that are compared; coordinates and rotations are not among them.

    The combination of block, id and name stands once.
    """
    yield from _numbers("summary", "", document["summary"])
    yield from _numbers("counts", "", document["counts"])
    for strip in document["strips"]:
        yield from _numbers("strips", strip["id"], strip)
    for block, keys in KEPT.items():
        for row in document.get(block, []) if block in {"polynomials", "links"} else document[block]:
            name = name_of(block, row)
            yield from SPECIAL[block](name, row) if block in SPECIAL else ()
            yield from _numbers(block, name, {key: row[key] for key in keys})
            if block == "photos":
                yield from _precisions(name, "sigma", row["sigma"])
            elif block == "points":
                for key in ("sigma_x", "sigma_y", "sigma_z"):
                    yield ComparedNumber(kind="precision", block="points", id=name, name=key, unit="m", value=row[key])


def name_of(block: str, row: Document) -> str:
    """Return what a record is called; that of a model are its photos, which may stand in several strips."""
    return " – ".join(row[key] for key in NAMES.get(block, ("id",)))


def _numbers(block: str, name: str, value: object, path: str = "") -> Iterator[ComparedNumber]:
    """Return every number below a value, by its path; texts are left to others."""
    if isinstance(value, dict):
        for key, each in value.items():
            yield from _numbers(block, name, each, f"{path}.{key}" if path else key)
    elif _is_number(value):
        kind, unit = _kind_and_unit(block, path, value)
        yield ComparedNumber(kind=kind, block=block, id=name, name=path, unit=unit, value=value)


def _is_number(value: object) -> TypeGuard[Number]:
    return value is None or (isinstance(value, int | float) and not isinstance(value, bool))


def _kind_and_unit(block: str, path: str, value: object) -> tuple[str, str]:
    """Return the kind of tolerance that holds for a number, and its unit."""
    if path in SCALES:
        return "scale", ""
    described = quantity_at(f"{block}.{path}")
    unit = described.unit if described else ""
    if path.endswith("sigma0_um"):
        return "sigma0", unit
    if isinstance(value, int):
        return "counts", ""
    return "rotation" if unit == "deg" else "statistics", unit


def _effects(name: str, block: Document) -> Iterator[ComparedNumber]:
    """Return the size of each term at the end of the control's range, in metres, rather than its coefficient."""
    for axis, effects in block["effects"].items():
        for term, effect in zip(block["terms"][axis], effects, strict=True):
            yield ComparedNumber(
                kind="statistics", block="polynomials", id=name, name=f"effect {axis} {term}", unit="m", value=effect
            )


def _elements(name: str, model: Document) -> Iterator[ComparedNumber]:
    """Return the elements of relative orientation in degrees; none where a model was measured as such."""
    elements = model["elements"]
    for element in ELEMENTS if elements is not None else ():
        value, unit = elements[element], DEGREES[elements["unit"]]
        yield ComparedNumber(
            kind="rotation",
            block="models",
            id=name,
            name=element,
            unit="deg",
            value=None if value is None else value * unit,
        )


def _precisions(name: str, path: str, value: object) -> Iterator[ComparedNumber]:
    """Return the standard deviations of a photo, whatever they are called."""
    if isinstance(value, dict | list):
        for key, each in value.items() if isinstance(value, dict) else enumerate(value):
            yield from _precisions(name, f"{path}.{key}" if isinstance(value, dict) else f"{path}[{key}]", each)
    elif _is_number(value):
        yield ComparedNumber(kind="precision", block="photos", id=name, name=path, unit="", value=value)


SPECIAL = {"polynomials": _effects, "models": _elements}
