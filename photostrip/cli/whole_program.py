"""All commands as one program, for what needs to know them all: completion by the shell and manual pages."""

from __future__ import annotations

from importlib import import_module
from typing import Annotated

import typer

from photostrip.cli.command_table import COMMANDS, HELP_NAMES


def whole_program(*, completing: bool = False) -> typer.Typer:
    """Return one program with every command; each is imported."""
    app = typer.Typer(add_completion=completing, rich_markup_mode=None, no_args_is_help=True)

    @app.callback()
    def photostrip(
        version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
        debug: Annotated[bool, typer.Option("--debug", help="Print the traceback of an error.")] = False,
    ) -> None:
        """Analytical strip phototriangulation.

        From measured image coordinates to adjusted ground coordinates, one shell command per strip.
        """

    for name, entry in COMMANDS.items():
        target = getattr(import_module(entry.module), name.replace("-", "_"))
        if isinstance(target, typer.Typer):
            app.add_typer(target, name=name)
        else:
            app.command(name, context_settings=HELP_NAMES)(target)
    return app
