"""Options that several commands share: one name, one help text, one environment variable each."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from photostrip.cli.stdout import Format
from photostrip.report.sections.accuracy_report import SectionName


def _keys(incomplete: str) -> list[str]:
    """Return the keys of the project file that an assignment may begin with, each with ``=`` behind it."""
    from photostrip.project.editors import single_keys

    return [f"{path}=" for path in single_keys() if path.startswith(incomplete)]


def _page(width: int | None) -> int | None:
    from photostrip.report.page.layout import NARROWEST, WIDEST_PAGE

    if width is not None and not NARROWEST <= width <= WIDEST_PAGE:
        msg = f"{width} characters; the text is {NARROWEST} to {WIDEST_PAGE} wide"
        raise typer.BadParameter(msg)
    return width


Saved = Annotated[Path, typer.Argument(metavar="RESULT", help="A result.json, or the folder that holds it.")]
Target = Annotated[
    Path | None, typer.Option("--output", "-o", metavar="FILE", help="File to write; its ending gives the format.")
]
Rule = Annotated[Path | None, typer.Option(metavar="FILE", help="Write a rule for make.")]
RuleOfOutput = Annotated[Path | None, typer.Option(metavar="FILE", help="Write a rule for make; needs -o.")]
Assignments = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Override a key of the project file; may be repeated.",
        autocompletion=_keys,
    ),
]
Shape = Annotated[Format, typer.Option("--format", envvar="PHOTOSTRIP_FORMAT", help="How the answer is printed.")]
Width = Annotated[
    int | None,
    typer.Option(
        "--width",
        metavar="N",
        envvar="PHOTOSTRIP_WIDTH",
        callback=_page,
        help="Width of the text, 60 to 200; default: that of the terminal.",
    ),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", envvar="PHOTOSTRIP_QUIET", help="Print the verdict only.")]
Silent = Annotated[bool, typer.Option("--quiet", "-q", envvar="PHOTOSTRIP_QUIET", help="Say nothing but errors.")]
Plots = Annotated[
    Path | None, typer.Option("--plots", metavar="DIR", help="Write the pictures of the report into DIR, as SVG.")
]
Strict = Annotated[bool, typer.Option("--strict", help="End with exit code 1 unless the verdict is GOOD.")]
Verbose = Annotated[
    bool,
    typer.Option(
        "--verbose", "-v", envvar="PHOTOSTRIP_VERBOSE", help="Print whole tables, and say what is being done."
    ),
]


Sections = Annotated[
    list[SectionName] | None,
    typer.Option(
        "--section",
        metavar="NAME",
        help=f"Print this section, with whole tables; may be repeated. NAME: {', '.join(SectionName)}.",
    ),
]


def require_target(depfile: Path | None, output: Path | None) -> None:
    """Refuse a rule for make without a file to make."""
    if depfile is not None and output is None:
        message = "a rule for make needs a target: give --output as well"
        raise typer.BadParameter(message, param_hint="--depfile")


def refuse_sections(names: Sequence[SectionName] | None, answer: str) -> None:
    """Refuse sections where the answer (a format, or what it is) has none."""
    if names and answer not in {"text", "md"}:
        raise typer.BadParameter(
            f"only a report as text or Markdown has sections, not {answer}", param_hint="--section"
        )
