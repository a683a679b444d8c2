"""``photostrip run --compare-methods``: one project adjusted in every way, side by side at its check points."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from photostrip.cli.failures import failures_as
from photostrip.cli.sheets import deliver
from photostrip.cli.stderr import Messages
from photostrip.cli.stdout import Document, Format
from photostrip.errors import EXIT_DONE, GeometryError, InputError, PhotostripError
from photostrip.formats.text.writing import write_text
from photostrip.library.project import Project, loaded_from
from photostrip.pipeline.inputs import METHODS
from photostrip.report.page.progress import progress
from photostrip.sheets.methods import methods_sheet


def compare_methods(
    project: Path,
    assignments: Sequence[str],
    output: Path | None,
    form: Format,
    width: int | None,
    messages: Messages,
    *,
    html: bool,
) -> int:
    """Adjust a project in every way there is and print what is left at its check points.

    In the output folder each adjustment gets a folder of its name, with `html` each its report and all of them
    ``methods.html``. An adjustment that refuses the project, or its key in the project file, is named with its reason;
    when none succeeds, the first failure is raised.
    """
    found: dict[str, Document | PhotostripError] = {}
    name = ""
    with failures_as(form), progress(sys.stderr, quiet=messages.quiet) as waiting:
        for adjustment in METHODS:
            waiting.at(f"adjusting: {adjustment}")
            try:
                result = _loaded(project, assignments, adjustment).run()
            except (GeometryError, InputError) as error:
                found[adjustment] = error
                continue
            name = result.name
            found[adjustment] = result.document
            if output is not None:
                result.write(output / adjustment, html=html)
                messages.say(f"wrote the result of {adjustment} to {output / adjustment}")
        refused = [each for each in found.values() if isinstance(each, PhotostripError)]
        if len(refused) == len(found):
            raise refused[0]
        sheet = methods_sheet(name, found)
        if html and output is not None:
            write_text(output / "methods.html", sheet.rendered("html"))
    deliver(sheet, "md" if form == "github" else form, width=width)
    return EXIT_DONE


def _loaded(project: Path, assignments: Sequence[str], adjustment: str) -> Project:
    return loaded_from(project, [*assignments, f"processing.adjustment={adjustment}"])
