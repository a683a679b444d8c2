"""Manual pages in the language of man(1), made from the same texts as ``--help``."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import typer

from photostrip import __version__
from photostrip.cli.command_table import COMMANDS, usage
from photostrip.cli.whole_program import whole_program

EXIT_CODES = (
    ("0", "Done."),
    ("1", "Done, but a tolerance or a comparison failed."),
    ("2", "Wrong usage, project file or data."),
    ("3", "The geometry is too weak, singular or did not converge."),
    ("70", "An internal error, a bug."),
)
VARIABLES = (
    ("PHOTOSTRIP_FORMAT, PHOTOSTRIP_WIDTH, PHOTOSTRIP_QUIET, PHOTOSTRIP_VERBOSE, PHOTOSTRIP_DEBUG",
     "Stand in for the options of these names."),
    ("NO_COLOR", "When set, no colours are used."),
    ("OMP_NUM_THREADS", "Threads of the numerical libraries; one when it is not set."),
)  # fmt: skip


def manual_pages() -> dict[str, str]:
    """Return the manual pages by file name: ``photostrip.1``, and one for every command and those below it."""
    pages = {
        f"photostrip-{name.replace(' ', '-')}.1": _command_page(name, command) for name, command in every_command()
    }
    return {"photostrip.1": _main_page(typer.main.get_command(whole_program())), **pages}


def every_command() -> Iterator[tuple[str, Any]]:
    """Return every command with its name, each followed by those below it."""
    root: Any = typer.main.get_command(whole_program())
    waiting = [(name, root.commands[name]) for name in COMMANDS]
    while waiting:
        name, command = waiting.pop(0)
        yield name, command
        below = getattr(command, "commands", {})
        waiting = [*((f"{name} {inner}", each) for inner, each in below.items()), *waiting]


def _main_page(root: Any) -> str:  # noqa: ANN401
    lines = _head("photostrip", "analytical strip phototriangulation")
    lines += [".SH SYNOPSIS", r".B photostrip", r"[\-\-debug] \fICOMMAND\fR [\fIARGUMENTS\fR]..."]
    lines += [".SH DESCRIPTION", *_prose(usage().split("\n\n")[1])]
    lines += [".SH COMMANDS", *_entries((f"photostrip-{name}(1)", entry.help) for name, entry in COMMANDS.items())]
    lines += [".SH OPTIONS", *_entries(records(root, "option"))]
    return _ended([*lines, *_tail(f"photostrip-{name}" for name in COMMANDS)])


def _command_page(name: str, command: Any) -> str:  # noqa: ANN401
    text = (command.help or "").partition("\f")[0].strip()
    first, _, rest = text.partition("\n\n")
    top = name.partition(" ")[0]
    lines = _head(f"photostrip-{name.replace(' ', '-')}", " ".join(first.split()).rstrip("."))
    lines += [".SH SYNOPSIS", f".B photostrip {_safe(name)}", _synopsis(command)]
    lines += [".SH DESCRIPTION", *_prose(f"{first}\n\n{rest}")]
    below = getattr(command, "commands", {})
    if below:
        pages = (
            (
                f"photostrip-{name.replace(' ', '-')}-{inner}(1)",
                " ".join((each.help or "").partition("\n\n")[0].split()),
            )
            for inner, each in below.items()
        )
        lines += [".SH COMMANDS", *_entries(pages)]
    arguments = list(records(command, "argument"))
    if arguments:
        lines += [".SH ARGUMENTS", *_entries(arguments)]
    lines += [".SH OPTIONS", *_entries(records(command, "option"))]
    if name in COMMANDS:
        lines += [".SH EXAMPLE", ".nf", _safe(COMMANDS[name].example), ".fi"]
    return _ended([*lines, *_tail(["photostrip", *([f"photostrip-{top}"] if top != name else [])])])


def _head(page: str, about: str) -> list[str]:
    title = f'.TH "{page.upper()}" "1" "" "photostrip {__version__}" "User commands"'
    return [title.replace("-", r"\-"), ".SH NAME", rf"{_safe(page)} \- {_safe(about)}"]


def _tail(also: Any) -> list[str]:  # noqa: ANN401 (any iterable of names)
    """Write what stands at the end of every page."""
    lines = [".SH EXIT STATUS", *_entries(EXIT_CODES), ".SH ENVIRONMENT", *_entries(VARIABLES)]
    return [*lines, ".SH SEE ALSO", ", ".join(rf"\fB{_safe(name)}\fR(1)" for name in also)]


def _ended(lines: list[str]) -> str:
    return "\n".join(lines) + "\n"


def _synopsis(command: Any) -> str:  # noqa: ANN401
    words = [r"[\fIOPTIONS\fR]"]
    for each in command.params:
        if each.param_type_name == "argument":
            name = rf"\fI{_safe((each.metavar or each.name.upper()).strip('[]'))}\fR"
            words.append(name if each.required else f"[{name}]")
    return " ".join([*words, *([r"\fICOMMAND\fR"] if getattr(command, "commands", {}) else [])])


def records(command: Any, kind: str) -> Iterator[tuple[str, str]]:  # noqa: ANN401
    """Return what ``--help`` says of the arguments, or of the options."""
    with command.make_context(command.name, [], resilient_parsing=True) as context:
        for each in command.get_params(context):
            record = each.get_help_record(context)
            if each.param_type_name == kind and record is not None:
                yield record


def _entries(rows: Any) -> list[str]:  # noqa: ANN401 (any iterable of pairs)
    """Write a list of terms, each with its explanation."""
    lines = []
    for term, text in rows:
        lines += [".TP", rf"\fB{_safe(term)}\fR", *_prose(text)]
    return lines


def _prose(text: str) -> list[str]:
    """Write paragraphs; a line of its own that begins like a command of roff is protected."""
    lines: list[str] = []
    for paragraph in text.replace("\b", "").split("\n\n"):
        words = " ".join(paragraph.split())
        if words:
            lines += [".PP"] if lines else []
            lines.append(_safe(words))
    return lines


def _safe(text: str) -> str:
    """Write signs that roff would read as its own."""
    kept = (
        text.replace("\\", "\\e").replace("-", "\\-").replace("`", "\\(ga").replace("~", "\\(ti").replace("^", "\\(ha")
    )
    return re.sub(r"^([.'])", r"\\&\1", kept)
