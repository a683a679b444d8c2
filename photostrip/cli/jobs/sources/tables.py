"""The document of ``photostrip sources``, from the two CSV files beside it."""

from __future__ import annotations

import csv
import io
from importlib import resources

from photostrip.cli.jobs.sources.worked import worked_numbers
from photostrip.notes import Document
from photostrip.result.numbers import rounded

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
