"""The document of ``photostrip sources`` from the two CSV files beside it, and the errata of docs/sources.md."""

from __future__ import annotations

import csv
import io
import re
from importlib import resources
from typing import TYPE_CHECKING

from photostrip.cli.jobs.sources.worked import worked_numbers
from photostrip.errors import Fault, InputError
from photostrip.result.numbers import rounded

if TYPE_CHECKING:
    from photostrip.result.numbers import Document

TABLE = re.compile(r"(?:^\|.*\n)+", re.MULTILINE)
DIGITS = 3  # decimals


def rows_of(name: str) -> list[dict[str, str]]:
    """Read ``equations`` or ``misprints``."""
    text = resources.files("photostrip.cli.jobs.sources").joinpath(f"{name}.csv").read_text(encoding="utf-8")
    return list(csv.DictReader(io.StringIO(text)))


def sources_document() -> Document:
    """Return worked numbers, misprints and equations as a plain document."""
    return {
        "kind": "sources",
        "worked": [
            {
                **each._asdict(),
                "printed": rounded(each.printed, DIGITS),
                "formula": rounded(each.formula, DIGITS),
                "correct": rounded(each.correct, DIGITS),
            }
            for each in worked_numbers()
        ],
        "misprints": rows_of("misprints"),
        "equations": rows_of("equations"),
    }


def with_tables(page: str, name: str) -> str:
    """Return a page with the tables of the errata of each source made anew."""
    misprints = rows_of("misprints")
    explained = {row["source"] for row in misprints if row["shows"]}  # these tables say how a misprint shows
    tables: dict[str, list[tuple[str, ...]]] = {}
    for row in misprints:
        shows = (row["shows"],) if row["source"] in explained else ()
        cells = (row["place"], row["printed"], row["correct"], *shows)
        tables.setdefault(f"## Errata of {row['source']}", []).append(cells)
    for heading, rows in tables.items():
        before, found, after = page.partition(f"\n{heading}")
        table = TABLE.search(after)
        if not found or table is None:
            message = f"{name} has no table below the heading {heading}"
            raise InputError(Fault(message, "page", file=name, fix="write into docs/sources.md"))
        head = "".join(table[0].splitlines(keepends=True)[:2])
        lines = "".join(f"| {' | '.join(cells)} |\n" for cells in rows)
        page = before + found + after[: table.start()] + head + lines + after[table.end() :]
    return page
