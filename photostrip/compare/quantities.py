"""The numbers of a result that are compared, each with its kind, the id of what it belongs to, and its unit."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterator

Document = dict[str, Any]
Number = float | None

ENDINGS = {"_um": "um", "_ppm": "ppm", "_deg": "deg"}
NO_UNIT = {"photo_scale", "model_scale", "normalised"}
DEGREES = {"deg": 1.0, "gon": 0.9, "rad": 57.29577951308232}
ELEMENTS = ("alpha1", "kappa1", "alpha2", "omega2", "kappa2")


class Quantity(NamedTuple):
    """One number of a result."""

    kind: str
    block: str
    id: str  # id of the photo, point, model or strip; empty for the whole project
    name: str
    unit: str  # its unit; empty for ratios and counts
    value: Number  # the number; None where the result has none


def quantities_of(document: Document) -> Iterator[Quantity]:
    """Return all single numbers of a result that are compared; coordinates and rotations are not among them.

    Yields
    ------
    Quantity
        Each number. The combination of block, id and name stands once.
    """
    yield from _leaves("summary", "", document["summary"])
    yield from _leaves("counts", "", document["counts"])
    for strip in document["strips"]:
        yield from _leaves("strips", strip["id"], strip)
    for each in document["absolute"]:
        yield from _absolute(each)
    for each in document.get("polynomials", []):
        yield from _polynomial(each)
    for model in document["models"]:
        yield from _model(model)
    for junction in document["junctions"]:
        yield from _junction(junction)
    for link in document.get("links", []):
        yield from _link(link)
    for photo in document["photos"]:
        yield from _leaves("photos", photo["id"], {key: photo[key] for key in ("image_rms_um", "points")})
        yield from _precisions("photos", photo["id"], "sigma", photo["sigma"])
    for point in document["points"]:
        yield from _leaves("points", point["id"], {key: point[key] for key in ("image_rms_um", "rays")})
        for name in ("sigma_x", "sigma_y", "sigma_z"):
            yield Quantity("precision", "points", point["id"], name, "m", point[name])


def model_id(model: Document) -> str:
    """Return the name of a model; photos may stand in several strips."""
    return f"{model['left']} – {model['right']}"


def _leaves(block: str, name: str, value: object, path: str = "") -> Iterator[Quantity]:
    """Return every number below a value, by its path; texts are left to others."""
    if isinstance(value, dict):
        for key, each in value.items():
            yield from _leaves(block, name, each, f"{path}.{key}" if path else key)
    elif value is None or (isinstance(value, int | float) and not isinstance(value, bool)):
        kind, unit = _nature(path, value)
        yield Quantity(kind, block, name, path, unit, value)


def _nature(path: str, value: object) -> tuple[str, str]:
    """Kind and unit of a number, told by the keys that lead to it."""
    keys = path.split(".")
    if keys[-1] == "sigma0_um":
        return "sigma0", "um"
    if isinstance(value, int):
        return "counts", ""
    for ending, unit in ENDINGS.items():
        if any(key.endswith(ending) for key in keys):
            return ("rotation" if unit == "deg" else "statistics"), unit
    return "statistics", "" if keys[-1] in NO_UNIT else "m"


def _absolute(block: Document) -> Iterator[Quantity]:
    name = block["strip"]
    yield Quantity("scale", "absolute", name, "scale", "", block["scale"])
    yield Quantity("statistics", "absolute", name, "sigma0", "", block["sigma0"])
    yield from _leaves("absolute", name, {key: block[key] for key in ("redundancy", "misclosure_rms")})


def _polynomial(block: Document) -> Iterator[Quantity]:
    """Return the size of each term at the end of the control's range, in metres, rather than its coefficient."""
    name = block["strip"]
    for axis, effects in block["effects"].items():
        for term, effect in zip(block["terms"][axis], effects, strict=True):
            yield Quantity("statistics", "polynomials", name, f"effect {axis} {term}", "m", effect)
    yield from _leaves("polynomials", name, {key: block[key] for key in ("sigma0", "redundancy")})


def _model(model: Document) -> Iterator[Quantity]:
    name = model_id(model)
    elements = model["elements"]  # none where a model was measured as such
    for element in ELEMENTS if elements is not None else ():
        value, unit = elements[element], DEGREES[elements["unit"]]
        yield Quantity("rotation", "models", name, element, "deg", None if value is None else value * unit)
    yield Quantity("scale", "models", name, "scale_factor", "", model["scale_factor"])
    kept = ("sigma0_um", "rms_parallax_um", "max_parallax_um", "points_used", "points_rejected", "redundancy")
    yield from _leaves("models", name, {key: model[key] for key in kept})


def _junction(junction: Document) -> Iterator[Quantity]:
    name = junction["photo"]
    yield Quantity("scale", "junctions", name, "factor", "", junction["factor"])
    kept = ("points_used", "spread_ppm", "discrepancy")
    yield from _leaves("junctions", name, {key: junction[key] for key in kept})


def _link(link: Document) -> Iterator[Quantity]:
    name = f"{link['before']} – {link['after']}"
    yield Quantity("scale", "links", name, "factor", "", link["factor"])
    yield Quantity("statistics", "links", name, "sigma0", "", link["sigma0"])
    kept = ("points_used", "redundancy", "discrepancy")
    yield from _leaves("links", name, {key: link[key] for key in kept})


def _precisions(block: str, name: str, path: str, value: object) -> Iterator[Quantity]:
    """Give standard deviations below a value, whatever they are called."""
    if isinstance(value, dict):
        for key, each in value.items():
            yield from _precisions(block, name, f"{path}.{key}", each)
    elif isinstance(value, list):
        for number, each in enumerate(value):
            yield from _precisions(block, name, f"{path}[{number}]", each)
    elif value is None or (isinstance(value, int | float) and not isinstance(value, bool)):
        yield Quantity("precision", block, name, path, "", value)
