"""``photostrip report``: the accuracy report again, from a saved result."""

from __future__ import annotations

from typing import Annotated

import typer

from photostrip.cli.options import Plots, Quiet, Saved, Sections, Strict, Target, Verbose, Width, refuse_sections
from photostrip.cli.stdout import Format, Parts, form_of, print_result, report_text

HTML = ".html"


def report(  # noqa: PLR0913, PLR0917 (an argument for each option)
    result: Saved,
    output: Target = None,
    form: Annotated[
        Format | None, typer.Option("--format", envvar="PHOTOSTRIP_FORMAT", help="How the report is printed.")
    ] = None,
    width: Width = None,
    plots: Plots = None,
    strict: Strict = False,
    section: Sections = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Print the accuracy report of a saved result again.

    It is the report that `photostrip run` printed. FILE may end in .txt, .md, .html or .json. The exit code is 0
    whatever the verdict, as the report of a failed result is a report; with --strict it is 1 unless the verdict is
    GOOD.
    """
    from photostrip.errors import EXIT_DONE
    from photostrip.formats.output.result_json import read_result
    from photostrip.formats.text.writing import write_files, write_text
    from photostrip.report.sections.accuracy_report import sections_of
    from photostrip.result.statement.edited import as_reported, faults_of_edited
    from photostrip.result.verdict import exit_code

    page = output is not None and form is None and output.suffix.lower() == HTML
    wanted = form or (form_of(output) if output is not None and not page else "text")
    parts = Parts(quiet, verbose, section or ())
    refuse_sections(section, "HTML" if page else wanted)
    file = str(result / "result.json" if result.is_dir() else result)
    saved = read_result(file)
    with faults_of_edited("reported", (saved, file)):
        document = as_reported(saved, file)
        sections_of(document, everything=True)  # what is incomplete is refused, whatever is printed
        if plots is not None:
            from photostrip.report.pictures.result import picture_files

            write_files(plots, picture_files(document))
        if output is None:
            print_result(document, wanted, width, parts)
        elif page:
            from photostrip.report.html import to_html

            write_text(output, to_html(document))
        else:
            write_text(output, report_text(document, wanted, width, parts))
    return exit_code(document["status"], strict=True) if strict else EXIT_DONE
