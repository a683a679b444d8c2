"""``photostrip completion`` and ``photostrip man``: what a shell is given to complete commands and to explain them."""

from __future__ import annotations

import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from photostrip.cli.jobs.completion import answer
from photostrip.cli.options import Silent


class Shell(StrEnum):
    """Shells that typer has a script for."""

    BASH = "bash"
    ZSH = "zsh"
    FISH = "fish"
    POWERSHELL = "powershell"


def completion(
    shell: Annotated[Shell, typer.Argument(metavar="SHELL", help="bash, zsh, fish or powershell.")],
) -> int:
    """Print the script that makes a shell complete commands, options and keys of the project.

    For bash put `eval "$(photostrip completion bash)"` into ~/.bashrc, for zsh the same with zsh into ~/.zshrc; for
    fish write the script to ~/.config/fish/completions/photostrip.fish.
    """
    return answer(f"source_{shell}")


def man(
    command: Annotated[
        str, typer.Argument(metavar="[COMMAND]", help="Page of one command; default: that of photostrip itself.")
    ] = "",
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="DIR", help="Write all pages into DIR, as photostrip*.1.")
    ] = None,
    quiet: Silent = False,
) -> None:
    """Print a manual page, or write all of them.

    With a pager: photostrip man run | man -l -
    """
    from photostrip.cli.jobs.manual import manual_pages
    from photostrip.formats.text.writing import write_files

    pages = manual_pages()
    if output is not None:
        write_files(output, pages)
        if not quiet:
            typer.echo(f"wrote {len(pages)} pages to {output}", err=True)
        return
    name = f"photostrip-{command.replace(' ', '-')}.1" if command else "photostrip.1"
    if name not in pages:
        known = ", ".join(sorted(page.removeprefix("photostrip-").removesuffix(".1") for page in pages if "-" in page))
        raise typer.BadParameter(f"there is no page of '{command}'; there are {known}", param_hint="COMMAND")
    sys.stdout.write(pages[name])
