"""The help of every command, as a terminal of 80 characters shows it."""

from __future__ import annotations

import contextlib
import io
import os
from unittest import mock

from photostrip.cli.main import COMMANDS, main
from tests.source_tree import ROOT

FOLDER = ROOT / "tests" / "data" / "help"


def helps() -> dict[str, list[str]]:
    """Give the arguments that ask for each help text, by the name of its file."""
    return {"photostrip": ["--help"], **{name: [name, "--help"] for name in COMMANDS}}


def shown(arguments: list[str]) -> str:
    """Give what is printed."""
    stream = io.StringIO()
    with mock.patch.dict(os.environ, {"COLUMNS": "80", "NO_COLOR": "1"}), contextlib.redirect_stdout(stream):
        assert main(arguments) == 0
    return stream.getvalue()
