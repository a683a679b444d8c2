"""The programs that write anew what tests compare with: they write when asked to, and not when asked for help."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import pytest

from tests import renew_docs, renew_golden, renew_help, reports

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import ModuleType


def refused(*_: object) -> Iterator[object]:
    raise AssertionError("something would be written")


@pytest.mark.parametrize(("argument", "code"), [("--help", 0), ("--quick", 2), ("README.md", 2)])
@pytest.mark.parametrize(
    ("program", "begins"),
    [(renew_docs, "pages"), (renew_golden, "simulated"), (renew_help, "helps"), (reports, "fresh")],
)
def test_help_and_unknown_options_write_nothing(
    program: ModuleType,
    begins: str,
    argument: str,
    code: int,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(program, begins, refused)
    monkeypatch.setattr(sys, "argv", ["renew", argument])
    with pytest.raises(SystemExit) as end:
        program.main()
    assert end.value.code == code
    assert "usage: python -m tests." in "".join(capsys.readouterr())
