"""``photostrip completion``: what a shell is given to complete commands."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

from photostrip.cli.jobs.completion import answer


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
