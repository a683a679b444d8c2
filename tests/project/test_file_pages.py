"""The pages about files show what the program reads and what it says."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest

from photostrip.formats.faults import Findings
from photostrip.formats.measured import Manner, read_control, read_measurements
from photostrip.project.keys import ProjectFile
from photostrip.project.reading import checked, parse
from tests.pages import blocks
from tests.project.samples import MARKED_FILES, sample
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


SHOWN = [
    ("fiducials.md", "fiducials.csv", "1001,F1", "1001,F7"),
    ("fiducials.md", "fiducials.csv", "2002,F1,106.1,-106\n2002,F2,-105.9,-106\n", ""),
]


@pytest.mark.parametrize(("page", "file", "old", "new"), SHOWN)
def test_the_faults_that_a_page_shows_are_those_of_the_program(
    tmp_path: Path, page: str, file: str, old: str, new: str
) -> None:
    project = sample(tmp_path, MARKED_FILES)
    project.change(file, old, new)
    (told,) = project.lines()
    words = re.sub(r"^\S+:\d+(:\d+)?: ", "", told).replace("one of F1, F2", "one of F1, F2, F3, F4")
    shown = (PAGES / page).read_text(encoding="utf-8")
    assert words in shown
