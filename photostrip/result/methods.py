"""One project adjusted in several ways, side by side: the document of ``photostrip run --compare-methods``."""

from __future__ import annotations

from collections.abc import Mapping

from photostrip import __version__
from photostrip.errors import PhotostripError
from photostrip.notes import Document

SCHEMA = 1
PARTS = ("count", "rms", "max", "worst", "rms_um")


def methods_document(name: str, methods: Mapping[str, Document]) -> Document:
    """Put what several adjustments of one project leave side by side.

    methods: by adjustment what ``method_of`` and ``refused_method`` give.
    ``methods`` says what is left at check and at control points, ``best`` which adjustment has the smallest rms at
    check points, None without these.
    """
    rows = [{"adjustment": adjustment} | each for adjustment, each in methods.items()]
    return {
        "photostrip_methods": SCHEMA,
        "version": __version__,
        "name": name,
        "methods": rows,
        "best": {part: _best(rows, part) for part in ("plan", "height")},
    }


def refused_method(error: PhotostripError) -> Document:
    return {"status": "refused", "reason": str(error)}


def method_of(found: Document) -> Document:
    """Return what is compared of the document of a result."""
    summary, precision = found["summary"], found.get("precision")
    return {
        "status": found["status"],
        "points": found["counts"]["points"],
        "sigma0_um": summary["sigma0_um"],
        "redundancy": summary["redundancy"],
        **{
            role: {part: {key: summary[role][part][key] for key in PARTS} for part in ("plan", "height")}
            for role in ("check", "control")
        },
        "precision": None
        if precision is None
        else {part: precision["points"][part]["rms"] for part in ("plan", "height")},
    }


def _best(rows: list[Document], part: str) -> str | None:
    known = [row for row in rows if row["status"] != "refused" and row["check"][part]["rms"] is not None]
    return min(known, key=lambda row: float(row["check"][part]["rms"]))["adjustment"] if known else None
