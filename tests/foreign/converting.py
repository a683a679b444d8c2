"""``photostrip convert`` as the tests of its formats call it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from photostrip.cli.main import main
from tests.foreign.colmap_models import name_of

if TYPE_CHECKING:
    from pathlib import Path

    import pytest


def convert(source: Path, target: Path, *options: str) -> int:
    return main(["convert", str(source), "-o", str(target), "--sigma", "0.5", *options])


def refused(capsys: pytest.CaptureFixture[str], source: Path, target: Path, *options: str) -> str:
    """Give what is said of a source that is refused; nothing is written then."""
    assert convert(source, target, *options) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert not target.exists()
    return captured.err


def with_control(native: Path, converted: Path) -> Path:
    """Give a converted project the control of the native one, and its measurements."""
    rows = [line.split(",") for line in (native / "observations.csv").read_text(encoding="utf-8").splitlines()[1:]]
    with (converted / "observations.csv").open("a", encoding="utf-8") as file:
        file.writelines(",".join([name_of(row[0]), *row[1:]]) + "\n" for row in rows if row[1][0] in "GK")
    (converted / "control.csv").write_bytes((native / "control.csv").read_bytes())
    text = (native / "project.yaml").read_text(encoding="utf-8")
    with (converted / "project.yaml").open("a", encoding="utf-8") as file:
        file.write(text[text.index("control:") :])
    return converted / "project.yaml"
