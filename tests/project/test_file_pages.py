"""The pages about files show what the program reads and what it says."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from photostrip.formats.faults import Findings
from photostrip.formats.measured import Manner, read_control, read_measurements
from photostrip.project.keys import ProjectFile
from photostrip.project.reading import checked, parse
from tests.pages import blocks
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from pathlib import Path

PAGES = ROOT / "docs" / "files"


def block(page: str, kind: str, number: int = 0) -> str:
    """Give the content of a block of a page."""
    found = [each for each in blocks(PAGES / page) if each.kind == kind]
    return "\n".join(found[number].lines) + "\n"


def test_the_whole_example_of_a_project_is_right() -> None:
    findings = Findings()
    root = parse(block("project.md", "yaml"), "project.yaml", findings)
    assert root is not None
    root.entries.pop("extends")
    assert checked(ProjectFile, root, findings) is not None
    assert findings.faults == ()


@pytest.mark.parametrize(("page", "rows"), [("observations.md", 4), ("fiducials.md", 4), ("control.md", 4)])
def test_the_example_of_a_table_is_right(tmp_path: Path, page: str, rows: int) -> None:
    path, findings = tmp_path / "table.csv", Findings()
    path.write_text(block(page, "text"), encoding="utf-8")
    if page == "control.md":
        control = read_control(str(path), 2, findings)
        assert control is not None
        assert len(control.table) == rows
    else:
        read = read_measurements([str(path)], findings, Manner(marks=page == "fiducials.md"))
        assert read is not None
        assert len(read.table) == rows
    assert (findings.faults, findings.notes) == ((), [])
