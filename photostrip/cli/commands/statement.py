"""``photostrip statement``: the accuracy of a result in the words of the norms."""

from __future__ import annotations

from typing import Annotated

import typer

from photostrip.cli.options import Quiet, Saved, Target, Width
from photostrip.cli.stdout import Document, Format, StatementFormat, form_of, print_json, print_sections

HTML = ".html"


def statement(
    result: Saved,
    class_plan: Annotated[
        float | None,
        typer.Option("--class-plan", metavar="CM", min=0.1, max=1e6, help="Class in plan that is asked for, cm."),
    ] = None,
    class_height: Annotated[
        float | None,
        typer.Option("--class-height", metavar="CM", min=0.1, max=1e6, help="Class in height that is asked for, cm."),
    ] = None,
    output: Target = None,
    form: Annotated[
        StatementFormat | None, typer.Option("--format", envvar="PHOTOSTRIP_FORMAT", help="How it is printed.")
    ] = None,
    width: Width = None,
    quiet: Quiet = False,
) -> int:
    """State the accuracy of a result by the norms, to be signed.

    The ASPRS standard (edition 2, 2024) tests with 30 check points and counts their own error; beside it stand the
    measures of ISO 19157, CE90 and LE90, and the NSSDA. The exit code is 1
    when a class that is asked for is not met or the check points are fewer than the standard asks for. Nothing is
    stated, with exit code 2, where the evidence does not carry it: no check points, check points that stand out or are
    not known well enough, a result that FAILED or is UNVERIFIED, a local frame. FILE may end in .txt, .md, .html or
    .json.
    """
    from photostrip.cli.failures import failures_as
    from photostrip.formats.output.result_json import read_result
    from photostrip.result.statement.accuracy_statement import exit_code, statement_document

    page = output is not None and form is None and output.suffix.lower() == HTML
    wanted = form or (form_of(output) if output is not None and not page else "text")
    given = {"plan": class_plan, "height": class_height}
    file = str(result / "result.json" if result.is_dir() else result)
    with failures_as(wanted):
        asked = {part: size for part, size in given.items() if size is not None}
        found = statement_document(read_result(file), file, asked)
        if output is not None:
            from photostrip.formats.text.writing import write_text

            write_text(output, _page(found) if page else _text(found, wanted, width, quiet=quiet))
        elif wanted == "json":
            print_json(found)
        else:
            from photostrip.report.sections.statement import statement_report

            print_sections(*statement_report(found, quiet=quiet), width, markdown=wanted == "md")
    return exit_code(found["status"])


def _page(found: Document) -> str:
    from photostrip.report.html import sections_html
    from photostrip.report.sections.statement import statement_report

    title, sections = statement_report(found)
    return sections_html(title, found["version"], sections)


def _text(found: Document, form: Format, width: int | None, *, quiet: bool) -> str:
    """Return the statement as a file holds it."""
    from photostrip.report.page import layout
    from photostrip.report.sections.statement import statement_report

    if form == "json":
        from photostrip.formats.output.result_json import to_json

        return to_json(found)
    title, sections = statement_report(found, quiet=quiet)
    if form == "md":
        return layout.to_markdown(title, sections)
    return layout.to_text(title, sections, width or layout.USUAL)
