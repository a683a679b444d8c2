"""The baseline of ``photostrip compare``: written anew, or missing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import typer

from photostrip.comparison import Tolerances, baseline_of, compare_results
from photostrip.errors import InputError
from photostrip.formats.output.result_json import read_baseline, read_result, to_json
from photostrip.formats.text.writing import write_text
from photostrip.library.comparison import BASELINE, place_of, results_below
from photostrip.report.commands.compare import headline


@contextmanager
def told_how_to_write(baseline: Path) -> Iterator[None]:
    """Where there is no baseline, or none that is whole, let the fault say how it comes to be."""
    place = str(place_of(baseline))
    try:
        yield
    except InputError as error:
        raise InputError(
            replace(fault, fix=f"{fault.fix + '; ' if fault.fix else ''}--update writes it")
            if fault.code in {"file-missing", "result-incomplete"} and fault.file == place
            else fault
            for fault in error.faults
        ) from None


def updates(result: Path, baseline: Path, allowed: Tolerances | None) -> Iterator[str]:
    """Write a result, or all of a folder, as baselines; return what changes by each."""
    for name, file in (results_below(result) or {"": result}).items():
        yield update(file, baseline / name / BASELINE if name else baseline, allowed)


def update(result: Path, baseline: Path, allowed: Tolerances | None) -> str:
    """Write a result as the baseline; return what changes by it."""
    file, place = place_of(result), place_of(baseline, update=True)
    document = read_result(str(file))
    if place.exists() and file.samefile(place):
        message = f"{place} is the result itself: the baseline would take its place"
        raise typer.BadParameter(message, param_hint="--update")
    compare_results(document, document, allowed, (str(file), str(file)))  # refuses one that could never be compared
    text = f"wrote {place}"
    if place.exists():
        try:
            found = compare_results(document, read_baseline(str(place)), allowed, (str(file), "the baseline before"))
            text += f"; {headline(found)}"
        except InputError:
            text += "; what stood there could not be compared with it"
    write_text(place, to_json(baseline_of(document)))
    return text
