"""``--help`` of every command, compared with how it was when it was last looked at."""

from __future__ import annotations

import pytest

from tests.cli.helps import FOLDER, helps, shown


@pytest.mark.parametrize("name", sorted(helps()))
def test_the_help_is_as_it_was(name: str) -> None:
    assert shown(helps()[name]) == (FOLDER / f"{name}.txt").read_text(encoding="utf-8"), "python -m tests.renew_help"


def test_no_help_of_a_command_that_is_gone() -> None:
    assert {path.stem for path in FOLDER.iterdir()} == set(helps())
