"""Options that several commands share: one name, one help text, one environment variable each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Literal, NoReturn

import typer

from photostrip.report.sections.accuracy_report import NAMES

Format = Literal["text", "json", "md", "github"]
StatementFormat = Literal["text", "json", "md"]
BatchFormat = Literal["text", "csv", "json", "junit", "md", "github"]
CompareFormat = Literal["text", "json", "md", "junit", "github"]
SheetFormat = Literal["text", "md", "json", "csv"]
FILE_FORMS = {".txt": "text", ".md": "md", ".html": "html", ".json": "json"}  # of a report, by the ending of its file
SHEET_FORMS = FILE_FORMS | {".csv": "csv"}


def _keys(incomplete: str) -> list[str]:
    """Return the keys of the project file that an assignment may begin with, each with ``=`` behind it."""
    from photostrip.project.editors import single_keys

    return [f"{path}=" for path in single_keys() if path.startswith(incomplete)]


def _sections(names: list[str] | None) -> list[str] | None:
    for name in names or ():
        if name not in NAMES:
            refuse("--section", f"the report has no section '{name}', but {', '.join(NAMES)}")
    return names


def _page(width: int | None) -> int | None:
    from photostrip.report.page.layout import NARROWEST, WIDEST_PAGE

    if width is not None and not NARROWEST <= width <= WIDEST_PAGE:
        msg = f"{width} characters; the text is {NARROWEST} to {WIDEST_PAGE} wide"
        raise typer.BadParameter(msg)
    return width


FORMAT = typer.Option("--format", envvar="PHOTOSTRIP_FORMAT", help="How the answer is printed.")
Shape = Annotated[Format, FORMAT]
Printed = Annotated[SheetFormat, typer.Option("--format", help="How the answer is printed.")]
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
Verbose = Annotated[
    bool,
    typer.Option(
        "--verbose", "-v", envvar="PHOTOSTRIP_VERBOSE", help="Print whole tables, and say what is being done."
    ),
]
Strict = Annotated[bool, typer.Option("--strict", help="End with exit code 1 unless the verdict is GOOD.")]
Sections = Annotated[
    list[str] | None,
    typer.Option(
        "--section",
        metavar="NAME",
        callback=_sections,
        autocompletion=lambda: list(NAMES),
        help=f"Print this section, with whole tables; may be repeated. NAME: {', '.join(NAMES)}.",
    ),
]
Assignments = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Override a key of the project file; may be repeated.",
        autocompletion=_keys,
    ),
]
Assigned = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Set a key of the file; may be repeated."),
]
Saved = Annotated[Path, typer.Argument(metavar="RESULT", help="A result.json, or the folder that holds it.")]
Folder = Annotated[Path | None, typer.Option("--output", "-o", metavar="DIR", help="Folder to write into.")]
Target = Annotated[
    Path | None, typer.Option("--output", "-o", metavar="FILE", help="File to write; its ending gives the format.")
]
Written = Annotated[
    Path | None,
    typer.Option(
        "--output", "-o", metavar="FILE", help=f"Write it: {', '.join(SHEET_FORMS)}, or a picture where it has one."
    ),
]
Rule = Annotated[Path | None, typer.Option("--depfile", metavar="FILE", help="Write a rule for make; needs -o.")]
Plots = Annotated[
    Path | None, typer.Option("--plots", metavar="DIR", help="Write the pictures of the report into DIR, as SVG.")
]


def refuse(option: str, message: str) -> NoReturn:
    """Refuse an option as wrong usage, before anything is computed."""
    raise typer.BadParameter(message, param_hint=option)


def require_target(depfile: Path | None, output: Path | None) -> None:
    """Refuse a rule for make without a file to make."""
    if depfile is not None and output is None:
        refuse("--depfile", "a rule for make needs a target: give --output as well")


def refuse_sections(names: Sequence[str] | None, answer: str) -> None:
    """Refuse sections where the answer (a format, or what it is) has none."""
    if names and answer not in {"text", "md"}:
        refuse("--section", f"only a report as text or Markdown has sections, not {answer}")


def form_of(path: Path, option: str, forms: Mapping[str, str] = FILE_FORMS) -> str:
    """Return the form that the ending of a file name asks for; text for a name without one."""
    ending = path.suffix.lower()
    if ending not in {*forms, ""}:
        rather = ", or give --format" if option == "--output" else ""
        refuse(option, f"nothing is written as '{path.suffix}': the name may end in {', '.join(forms)}{rather}")
    return forms.get(ending, "text")
