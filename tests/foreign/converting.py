"""``photostrip convert`` as the tests of its formats call it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import photostrip
from photostrip.cli.main import main
from photostrip.notes import Document
from photostrip.project.check import check_project
from tests.calls import Capture
from tests.foreign.colmap_models import name_of
from tests.loops import nonempty


def convert(source: Path, target: Path, *options: str) -> int:
    return main(["convert", str(source), "-o", str(target), "--sigma", "0.5", *options])


def refused(capsys: Capture, source: Path, target: Path, *options: str) -> str:
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


def same_points(
    project: Path, native: Path, kinds: str = "GK", to_map: Callable[..., tuple[float, float]] | None = None
) -> tuple[Document, Document]:
    """Run a converted project and the native one: control and check points come out alike.

    to_map: brings longitude and latitude of the converted one to the map of the native one.
    """
    assert check_project(project).faults == ()
    found, known = photostrip.run(project).document, photostrip.run(native / "project.yaml").document
    at, expected = ({each["id"]: each for each in document["points"]} for document in (found, known))
    for point in nonempty([each for each in expected if each[0] in kinds]):
        x, y, z, *sigmas = (at[point][name] for name in ("x", "y", "z", "sigma_z", "sigma_x"))
        if to_map:
            x, y = to_map(x, y)
            sigmas.pop()
        wanted = [expected[point][name] for name in ("x", "y", "z", "sigma_z", "sigma_x")]
        assert [x, y, z] == pytest.approx(wanted[:3], abs=5e-4)
        assert sigmas == pytest.approx(wanted[3 : 3 + len(sigmas)], abs=3e-4)
    return found, known
