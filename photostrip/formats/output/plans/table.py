"""The main table of a plan."""

from __future__ import annotations

from photostrip.formats.output.csv_text import to_csv
from photostrip.formats.output.plans.strip import along_rows
from photostrip.notes import Document

TABLES = {
    "displacement": "points",
    "screening": "detection",
    "model": "points",
    "model-source-table": "rows",
    "cameras": "cameras",
    "source-table": "cameras",
}


def plan_csv(document: Document) -> str:
    """Return the main table of a plan as CSV; its columns are the keys of the document's rows."""
    kind = document["kind"]
    rows = along_rows(document) if kind == "strip" else document[TABLES[kind]]
    return to_csv(list(rows[0]), (row.values() for row in rows))
