"""The option ``--section``, with the names of the report's sections; loaded only by the commands that print them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import typer

from photostrip.cli.stdout import Format
from photostrip.report.sections.accuracy_report import SectionName

Sections = Annotated[
    list[SectionName] | None,
    typer.Option(
        "--section",
        metavar="NAME",
        help=f"Print this section, with whole tables; may be repeated. NAME: {', '.join(SectionName)}.",
    ),
]
Verbose = Annotated[
    bool,
    typer.Option(
        "--verbose",
        "-v",
        envvar="PHOTOSTRIP_VERBOSE",
        help="Print every section with whole tables, and say what is being done.",
    ),
]


def refuse_sections(names: Sequence[SectionName] | None, answer: str) -> None:
    """Refuse sections where the answer (a format, or what it is) has none."""
    if names and answer not in {Format.TEXT, Format.MD}:
        raise typer.BadParameter(
            f"only a report as text or Markdown has sections, not {answer}", param_hint="--section"
        )
