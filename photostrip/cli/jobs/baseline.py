"""The baseline of ``photostrip compare``: where it stands, and how it is written anew."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import typer

from photostrip.comparison import Tolerances, baseline_of, compare_results
from photostrip.errors import InputError
from photostrip.formats.output.result_json import read_result, to_json
from photostrip.formats.text.writing import write_text
from photostrip.report.commands.compare import headline

if TYPE_CHECKING:
    from pathlib import Path

    from photostrip.report.page.parts import Document

BASELINE = "baseline.json"


def place_of(baseline: Path, *, update: bool) -> Path:
    """Return the file of a baseline; in a folder it is baseline.json, or else, to be read, result.json."""
    if not baseline.is_dir():
        return baseline
    whole = baseline / "result.json"
    return whole if whole.exists() and not update and not (baseline / BASELINE).exists() else baseline / BASELINE


def read(place: Path) -> Document:
    """Read the baseline; where there is none, the fault says how it comes to be."""
    try:
        return read_result(str(place))
    except InputError as error:
        faults = [
            replace(fault, fix=f"{fault.fix + '; ' if fault.fix else ''}--update writes it")
            if fault.code == "file-missing"
            else fault
            for fault in error.faults
        ]
        raise InputError(faults) from None


def update(document: Document, file: Path, place: Path, allowed: Tolerances) -> str:
    """Write a result, read from a file, as the baseline; return what changes by it."""
    if place.exists() and file.samefile(place):
        message = f"{place} is the result itself: the baseline would take its place"
        raise typer.BadParameter(message, param_hint="--update")
    compare_results(document, document, allowed, (str(file), str(file)))  # refuses one that could never be compared
    text = f"wrote {place}"
    if place.exists():
        try:
            found = compare_results(document, read_result(str(place)), allowed, (str(file), "the baseline before"))
            text += f"; {headline(found)}"
        except InputError:
            text += "; what stood there could not be compared with it"
    write_text(place, to_json(baseline_of(document)))
    return text
