"""Tables of a result: columns by name, read from the records of its document."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from photostrip.notes import Document
from photostrip.result import columns
from photostrip.result.description import Quantity, Table, table_at

# The tables that have records of their own in the document, by the name of their block; a block that a result does not
# have is an empty table.
BLOCKS = {
    "points": "points",
    "photos": "photos",
    "pairs": "models",
    "strips": "strips",
    "junctions": "junctions",
    "control": "control",
    "ties": "ties",
    "residuals": "residuals",
    "parallaxes": "parallaxes",
    "link_residuals": "link_residuals",
    "rejected": "rejected",
    "findings": "findings",
    "notes": "notes",
}
AXES = ("x", "y", "z")
SHORT = {"metre": "m", "degree": "deg"}


class ResultColumn(NamedTuple):
    """A column of a table: a value of each row, and what it is."""

    name: str
    quantity: Quantity  # its unit and its meaning
    values: list[Any]  # None where there is no value


def table_of(document: Document, name: str) -> list[ResultColumn]:
    """Return the columns of a table of `BLOCKS`.

    A block inside a record is as many columns, their names joined by an underscore (``elements_kappa1``); three numbers
    along the axes are three columns (``sigma_x``); the points of a photo or a pair are a row each.
    """
    block = BLOCKS[name]
    records = list(document.get(block) or ())
    units = _ground_units(document)
    if name == "photos" and records:
        listed = columns.photos_csv(records[0]["angles"])
        flat = columns.flat_photos(records, listed).columns
        found = [
            ResultColumn("id" if each.key == "id" else each.name, each.quantity, list(flat[each.key]))
            for each in listed
        ]
        return [_in_frame(each, units) for each in found]
    if records and "points" in records[0] and isinstance(records[0].get("used"), list):
        records = list(_one_by_one(records))
    described = table_at(block)
    if "point" not in described and "points" in described:
        described = {**described, "point": described["points"]}
    keys = dict.fromkeys(key for record in records for key in record) if records else described
    found = [
        column for key in keys for column in _columns(key, described.get(key), [each.get(key) for each in records])
    ]
    return [_in_frame(each, units) for each in found]


def _ground_units(document: Document) -> dict[tuple[str, str], str]:
    """Return the units of the coordinates of the frame: by the axis and what the description says of it."""
    frame = document["frame"]
    names = [SHORT.get(frame[key], frame[key]) for key in ("plan_unit", "plan_unit", "height_unit")]
    return {(axis, "frame"): unit for axis, unit in zip(AXES, names, strict=True)}


def _in_frame(column: ResultColumn, units: dict[tuple[str, str], str]) -> ResultColumn:
    unit = units.get((column.name, column.quantity.unit), column.quantity.unit)
    return column._replace(quantity=replace(column.quantity, unit=unit))


def _one_by_one(groups: Iterable[Document]) -> Iterator[Document]:
    """Return a record for each point that stands under a photo or a pair."""
    for group in groups:
        listed = {key: value for key, value in group.items() if isinstance(value, list)}
        heads = {key: value for key, value in group.items() if key not in listed}
        for row in zip(*listed.values(), strict=True):
            values = dict(zip(listed, row, strict=True))
            yield {**heads, "point": values.pop("points"), **values}


def _columns(name: str, entry: Quantity | Table | None, values: Sequence[Any]) -> Iterator[ResultColumn]:
    if isinstance(entry, Mapping) and all(value is None or isinstance(value, Mapping) for value in values):
        for key, part in entry.items():
            below = [None if value is None else value.get(key) for value in values]
            if any(each is not None for each in below) or not values:
                yield from _columns(f"{name}_{key}", part, below)
        return
    quantity = entry if isinstance(entry, Quantity) else Quantity(meaning="", kind="any")
    if quantity.many and quantity.kind == "number" and _along_axes(values):
        for number, axis in enumerate(AXES):
            along = [None if value is None else value[number] for value in values]
            yield ResultColumn(f"{name}_{axis}", quantity, along)
        return
    yield ResultColumn(name, quantity, list(values))


def _along_axes(values: Iterable[Any]) -> bool:
    """Whether three numbers along the axes stand in every row."""
    found = [value for value in values if value is not None]
    return bool(found) and all(isinstance(value, Sequence) and len(value) == len(AXES) for value in found)
