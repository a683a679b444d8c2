"""The saved result and the printed reports of it that the tests of the report compare with.

``python -m tests.reports`` prints the reports anew, ``python -m tests.reports result`` runs the project anew first;
review the difference before committing it.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

from photostrip.formats.result_json import read_result, to_json
from photostrip.pipeline.inputs import Settings
from photostrip.report.page.layout import to_markdown, to_text
from photostrip.report.sections.accuracy_report import sections_of, title_of
from photostrip.simulation.simulation import simulate
from photostrip.simulation.spec import GrossError
from tests.results import solved, spec
from tests.simulated import inputs_of
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.results import Document

FOLDER = ROOT / "tests/data/report"
RESULT = FOLDER / "result.json"
TOLERANCES = {"check_rms_xy": 0.01, "check_rms_z": 1.0, "sigma0_um": 8.0}


@cache
def saved() -> Document:
    """Give the saved result."""
    return read_result(str(RESULT))


def fresh() -> Document:
    """Run its project: two strips, X to the north, a gross error, a point that was not measured, tolerances."""
    inputs = inputs_of(simulate(spec("north first", 2, 5.0, GrossError("image", axis="y"))))
    control = inputs.control
    inputs = replace(inputs, control=replace(control, ids=(*control.ids[:3], "G4 bis", *control.ids[4:])))
    settings = Settings(
        adjustment="polynomial",
        relative=replace(Settings().relative, screening="parallax+grubbs"),
        polynomial=replace(Settings().polynomial, degree="2"),
        tolerances=TOLERANCES,
    )
    return solved(inputs, settings).document


def text(width: int, *, ascii_only: bool = False) -> str:
    """Print the saved result as text."""
    return to_text(title_of(saved()), sections_of(saved()), width, ascii_only=ascii_only)


SNAPSHOTS: dict[str, Callable[[], str]] = {
    "report-60.txt": lambda: text(60),
    "report-100.txt": lambda: text(100),
    "report-200.txt": lambda: text(200),
    "report-ascii.txt": lambda: text(80, ascii_only=True),
    "report.md": lambda: to_markdown(title_of(saved()), sections_of(saved())),
}


def main() -> None:
    """Renew what stands in the folder."""
    parser = argparse.ArgumentParser(prog="python -m tests.reports", description=__doc__)
    parser.add_argument("what", nargs="?", choices=["result"], help="run the project anew first")
    asked = parser.parse_args()
    FOLDER.mkdir(exist_ok=True)
    if asked.what == "result":
        RESULT.write_text(to_json(fresh()), encoding="utf-8")
    for name, printed in SNAPSHOTS.items():
        (FOLDER / name).write_text(printed(), encoding="utf-8")


if __name__ == "__main__":
    main()
