"""Compute the baselines of every project in sample_data anew (``make golden``); review the diff.

Simulated projects are written anew first, so that they are always those of the present program.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from photostrip.comparison import baseline_of
from photostrip.foreign.simulated import project_files
from photostrip.formats.result_json import to_json
from photostrip.pipeline.run import triangulate
from photostrip.project.loading import load_project
from photostrip.project.simulation import load_specification
from photostrip.result.document import document_of
from tests.source_tree import ROOT

SAMPLES = tuple(sorted(path.parent.name for path in (ROOT / "sample_data").glob("*/project.yaml")))


def baseline(name: str) -> Path:
    """Give the file that keeps the result of a sample."""
    return ROOT / "sample_data" / name / "baseline.json"


def kept(name: str) -> dict[str, object]:
    """Run a sample project and give what is kept of its result."""
    project = load_project(Path("sample_data") / name / "project.yaml")
    return baseline_of(document_of(triangulate(project.inputs, project.settings), project.remarks))


def simulated(name: str) -> dict[str, str]:
    """Simulate a sample from its specification: content by file name; nothing for a real strip."""
    specification = ROOT / "sample_data" / name / "spec.yaml"
    return project_files(load_specification(specification).simulate()) if specification.exists() else {}


def renew(path: Path, text: str) -> None:
    """Write a file when its content has changed."""
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8", newline="\n")
        print(f"renewed {path.relative_to(ROOT)}")  # noqa: T201


def main() -> None:
    argparse.ArgumentParser(prog="python -m tests.renew_golden", description=__doc__).parse_args()
    os.chdir(ROOT)
    for name in SAMPLES:
        for file, text in simulated(name).items():
            renew(ROOT / "sample_data" / name / file, text)
        renew(baseline(name), to_json(kept(name)))


if __name__ == "__main__":
    main()
