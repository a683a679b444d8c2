"""``--help`` of every command in a terminal of 80 characters, compared with how it was when it was last looked at.

``python -m tests.cli.test_help`` writes the texts anew; review the difference.
"""

from __future__ import annotations

import contextlib
import io
import os
from unittest import mock

import pytest

from photostrip.cli.main import COMMANDS, main
from tests.source_tree import ROOT

FOLDER = ROOT / "tests" / "data" / "help"
HELPS = {"photostrip": ["--help"], **{name: [name, "--help"] for name in COMMANDS}}


def shown(arguments: list[str]) -> str:
    """Give what is printed."""
    stream = io.StringIO()
    with mock.patch.dict(os.environ, {"COLUMNS": "80", "NO_COLOR": "1"}), contextlib.redirect_stdout(stream):
        assert main(arguments) == 0
    return stream.getvalue()


@pytest.mark.parametrize("name", sorted(HELPS))
def test_the_help_is_as_it_was(name: str) -> None:
    assert shown(HELPS[name]) == (FOLDER / f"{name}.txt").read_text(encoding="utf-8")


def test_no_help_of_a_command_that_is_gone() -> None:
    assert {path.stem for path in FOLDER.iterdir()} == set(HELPS)


if __name__ == "__main__":
    for command, words in HELPS.items():
        (FOLDER / f"{command}.txt").write_text(shown(words), encoding="utf-8")
