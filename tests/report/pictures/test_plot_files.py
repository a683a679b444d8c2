"""Pictures as files: all of the page, the same as shown in the documentation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from photostrip.cli.main import main
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from pathlib import Path

SAMPLE = ROOT / "sample_data" / "simulated-20" / "project.yaml"
POLYNOMIAL = ("--set", "processing.adjustment=polynomial")


@pytest.mark.slow
def test_the_picture_in_the_documentation_is_the_one_that_is_written(tmp_path: Path) -> None:
    plots = tmp_path / "plots"
    assert main(["run", str(SAMPLE), *POLYNOMIAL, "-q", "-o", str(tmp_path), "--plots", str(plots)]) == 0
    assert (plots / "deformation.svg").read_bytes() == (ROOT / "docs" / "pictures" / "deformation.svg").read_bytes()
    table = (ROOT / "docs" / "commands" / "report.md").read_text(encoding="utf-8")
    written = {path.name for path in plots.iterdir()}
    assert len(written) > 10
    assert {name for name in written if f"`{name}`" not in table} == set()
    again = tmp_path / "again"
    assert main(["report", str(tmp_path / "result.json"), "-q", "--plots", str(again)]) == 0
    assert {path.name: path.read_bytes() for path in again.iterdir()} == {
        path.name: path.read_bytes() for path in plots.iterdir()
    }
