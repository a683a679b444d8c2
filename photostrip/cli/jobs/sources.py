"""What the sources print: every worked number computed again, every misprint, and where each equation is computed.

The tables stand in ``equations.csv`` and ``misprints.csv``; docs/sources.md is made from them.
"""

from __future__ import annotations

import csv
import io
import re
from importlib import resources
from typing import TYPE_CHECKING, Any, NamedTuple

from photostrip.errors import Fault, InputError
from photostrip.planning.camera_efficiency import PRINTED_TABLE, compare, source_cameras
from photostrip.planning.model.plan import source_example
from photostrip.result.numbers import rounded
from photostrip.terrestrial.accuracy import EXAMPLES, worked

if TYPE_CHECKING:
    from collections.abc import Iterator

TABLE = re.compile(r"(?:^\|.*\n)+", re.MULTILINE)
EQUATIONS = "## From an equation to a command"
DIGITS = 3  # decimals
# [004a]: errors that were put in, found by the residual parallax, found by Grubbs' test, missed; good points rejected
# and good points altogether
COUNTS = {"errors": 44, "parallax": 21, "Grubbs": 20, "missed": 3, "rejected": 8, "good": 500}


class Worked(NamedTuple):
    """A number that a source works out."""

    source: str
    what: str
    printed: float
    formula: float  # by the formula of the source, not rounded
    correct: float  # by what the formula should be
    unit: str = ""
    remark: str = ""


def _model() -> Iterator[Worked]:
    """Give the accuracy of a model, [003]; correct is the worse of the left and the right end of the base."""
    for row in source_example():
        wrong = abs(row.printed - row.formula) > 1 / 2
        yield Worked(
            source="[003]",
            what=f"{row.quantity}, {row.place} points",
            printed=row.printed,
            formula=row.formula,
            correct=max(row.left, row.right),
            unit="µm",
            remark="its own constant gives 21" if wrong else "six points do better",
        )


def _directions() -> Iterator[Worked]:
    """Give the required accuracy of directions, [002]."""
    for example in EXAMPLES:
        found = worked(example)
        far = abs(example.factor - found.factor) > 1 / 100
        yield Worked(
            source="[002]",
            what=f"m_lambda, {example.camera}",
            printed=example.horizontal,
            formula=found.horizontal,
            correct=found.horizontal,
            unit="″",
            remark="rounded to 0.5",
        )
        yield Worked(
            source="[002]",
            what=f"m_beta, {example.camera}",
            printed=example.vertical,
            formula=found.eq6,
            correct=found.vertical,
            unit="″",
            remark=f"with {example.factor:g} of the other" if far else "sec for cos in eq. 3",
        )
        yield Worked(
            source="[002]",
            what=f"1 + x²/f², {example.camera}",
            printed=example.factor,
            formula=found.factor,
            correct=found.factor,
            remark="belongs to the other camera" if far else "",
        )


def _cameras() -> Iterator[Worked]:
    """Give the table of cameras, [004b]."""
    cameras = source_cameras()
    for camera, row in zip(cameras, PRINTED_TABLE, strict=True):
        beside = compare(camera, cameras[-1])
        yield Worked(
            source="[004b]",
            what=f"K, {camera.name}",
            printed=row.coefficient,
            formula=camera.coefficient,
            correct=camera.coefficient,
            unit="mm²",
        )
        yield Worked(
            source="[004b]",
            what=f"H/m_h, {camera.name}",
            printed=row.height_ratio,
            formula=camera.height_ratio,
            correct=camera.height_ratio,
            remark="" if abs(row.height_ratio / camera.height_ratio - 1) < 1 / 50 else "needs a base of 55 mm",
        )
        yield Worked(
            source="[004b]",
            what=f"eta_S, {camera.name}",
            printed=row.area,
            formula=beside.printed_area,
            correct=beside.area,
            remark="" if camera is cameras[-1] else "a ratio of lengths",
        )


def _screening() -> Iterator[Worked]:
    """Give the percentages of the experiment, [004a]."""
    errors = COUNTS["errors"]
    for what, printed in (("parallax", 48.0), ("Grubbs", 45.0), ("missed", 7.0)):
        share = 100 * COUNTS[what] / errors
        yield Worked(source="[004a]", what=f"errors, {what}", printed=printed, formula=share, correct=share, unit="%")
    yield Worked(
        source="[004a]",
        what="good points rejected",
        printed=18.0,
        formula=100 * COUNTS["rejected"] / errors,
        correct=100 * COUNTS["rejected"] / COUNTS["good"],
        unit="%",
        remark="relative to the errors",
    )


def worked_numbers() -> list[Worked]:
    """Compute every worked number of every source again; [000], [001] and [004c] have none."""
    return [*_directions(), *_model(), *_screening(), *_cameras()]


def rows_of(name: str) -> list[dict[str, str]]:
    """Read ``equations`` or ``misprints``."""
    text = resources.files("photostrip.cli.jobs").joinpath(f"{name}.csv").read_text(encoding="utf-8")
    return list(csv.DictReader(io.StringIO(text)))


def sources_document() -> dict[str, Any]:
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
    """Return a page with the tables below its headings made anew: of equations, and of the errata of each source."""
    equations = [
        (row["equation"], row["what"], f"`{row['command']}`", f"`{row['function']}`") for row in rows_of("equations")
    ]
    tables: dict[str, list[tuple[str, ...]]] = {EQUATIONS: [*equations]}
    for row in rows_of("misprints"):
        cells = (row["place"], row["printed"], row["correct"], *([row["shows"]] if _is_long(row["source"]) else []))
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


def _is_long(source: str) -> bool:
    """Whether the table of a source has a column that says how a misprint shows."""
    return any(row["shows"] for row in rows_of("misprints") if row["source"] == source)
