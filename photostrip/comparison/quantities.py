"""The numbers of a result that are compared: each with its kind, the id of what it belongs to, and its unit."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from photostrip.notes import Document
from photostrip.result.description import Block, Columns, Quantity, described
from photostrip.result.table import Table

NAME = "name"  # said of the columns that name the rows of a table


class ComparedNumber(NamedTuple):
    """One number of a result."""

    kind: str
    block: str
    id: str  # id of the photo, point, model or strip; empty for the whole project
    name: str
    unit: str  # its unit; empty for ratios and counts
    value: float | None  # the number; None where the result has none


def quantities_of(document: Document) -> Iterator[ComparedNumber]:
    """Return all single numbers of a result whose description has a kind of tolerance.

    The combination of block, id and name stands once.
    """
    for key, block in described().items():
        if isinstance(block, Columns) and key in document:
            yield from _of_table(key, document[key])
        elif isinstance(block, Block) and key in document:
            yield from _of_block(key, "", document[key], block)


def _of_block(block: str, path: str, values: Document, entries: Block) -> Iterator[ComparedNumber]:
    for key, value in values.items():
        entry, name = entries.get(key), f"{path}.{key}" if path else key
        if isinstance(entry, Block) and isinstance(value, dict):
            yield from _of_block(block, name, value, entry)
        elif isinstance(entry, Quantity) and entry.compared:
            yield ComparedNumber(kind=entry.compared, block=block, id="", name=name, unit=entry.unit, value=value)


def _of_table(block: str, table: Table) -> Iterator[ComparedNumber]:
    ids = names_of(table)
    for key in table.columns:
        entry = table.quantities[key]
        if entry.compared and entry.compared != NAME:
            for name, value in zip(ids, table.values(key), strict=True):
                yield ComparedNumber(kind=entry.compared, block=block, id=name, name=key, unit=entry.unit, value=value)


def names_of(table: Table) -> list[str]:
    """Return what the rows of a table are called; a model by its photos, which may stand in several strips."""
    columns = [table.values(key) for key in table.columns if table.quantities[key].compared == NAME]
    return [" – ".join(row) for row in zip(*columns, strict=True)]
