"""The numbers of a result that are compared, each with its kind, the id of what it belongs to, and its unit."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, TypeGuard

from photostrip.notes import Document
from photostrip.result.description import quantity_at

Number = float | None

ELEMENTS = ("alpha1", "kappa1", "alpha2", "omega2", "kappa2")
DISCREPANCY = tuple(f"discrepancy_{direction}" for direction in ("along", "across", "up"))
SCALES = {"scale", "scale_factor", "factor"}
# Keys that name the records of a list, where it is not their id.
NAMES = {
    "absolute": ("strip",),
    "polynomials": ("strip",),
    "polynomial_terms": ("strip", "axis", "term"),
    "models": ("left", "right"),
    "junctions": ("photo",),
    "links": ("before", "after"),
}
# What is compared of a record.
KEPT = {
    "absolute": ("scale", "sigma0", "redundancy", *(f"misclosure_rms_{axis}" for axis in ("east", "north", "up"))),
    "polynomials": tuple(f"{name}_{axis}" for name in ("sigma0", "redundancy") for axis in "xyz"),
    "polynomial_terms": ("effect",),
    "models": (
        "scale_factor",
        "sigma0_um",
        "rms_parallax_um",
        "max_parallax_um",
        "points_used",
        "points_rejected",
        "redundancy",
        *(f"elements_{name}" for name in ELEMENTS),
    ),
    "junctions": ("factor", "points_used", "spread_ppm", *DISCREPANCY),
    "links": ("factor", "sigma0", "points_used", "redundancy", *DISCREPANCY),
    "photos": ("image_rms_um", "points"),
    "points": ("image_rms_um", "rays"),
}


SIGMAS = {
    "points": ("sigma_x", "sigma_y", "sigma_z"),
    "photos": ("sigma_x", "sigma_y", "sigma_z", "sigma_angle_1", "sigma_angle_2", "sigma_angle_3"),
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
        for row in document.get(block, []):
            name = name_of(block, row)
            yield from _numbers(block, name, {key: row[key] for key in keys if key in row})
            for key in SIGMAS.get(block, ()):
                unit = "" if block == "photos" else "m"
                yield ComparedNumber(kind="precision", block=block, id=name, name=key, unit=unit, value=row[key])


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
