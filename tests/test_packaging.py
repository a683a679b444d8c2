"""What a user installs: the package with its marker for types, nothing of the tests."""

from __future__ import annotations

import email
import subprocess
import sys
import tarfile
import zipfile
from typing import TYPE_CHECKING

import pytest

import photostrip
from tests.loops import nonempty
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.slow


def build(kind: str, folder: Path) -> Path:
    """Build one archive of the project without the network and give its path."""
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", kind, "-d", str(folder)],
        cwd=ROOT,
        check=True,
        capture_output=True,
    )
    (archive,) = folder.iterdir()
    return archive


def test_the_wheel_holds_the_package_and_nothing_else(tmp_path: Path) -> None:
    with zipfile.ZipFile(build("wheel", tmp_path)) as wheel:
        names = wheel.namelist()
        info = f"photostrip-{photostrip.__version__}.dist-info"
        metadata = email.message_from_bytes(wheel.read(f"{info}/METADATA"))
        entry_points = wheel.read(f"{info}/entry_points.txt").decode()
    assert {name.partition("/")[0] for name in names} == {"photostrip", info}
    assert "photostrip/py.typed" in names
    assert {"photostrip/report/templates/report.html", "photostrip/report/templates/report.css"} <= set(names)
    source = {path.relative_to(ROOT).as_posix() for path in (ROOT / "photostrip").rglob("*.py")}
    assert source == {name for name in names if name.endswith(".py")}
    assert entry_points.split() == ["[console_scripts]", "photostrip", "=", "photostrip.cli.main:main"]
    core = [line for line in metadata.get_all("Requires-Dist", []) if "extra ==" not in line]
    assert all(">=" in line for line in nonempty(core))


def test_the_source_archive_holds_what_builds_the_wheel(tmp_path: Path) -> None:
    with tarfile.open(build("sdist", tmp_path)) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert {"pyproject.toml", "README.md", "LICENSE", "photostrip/__init__.py"} <= names
    assert {name.partition("/")[0] for name in names} <= {
        "photostrip",
        "pyproject.toml",
        "README.md",
        "CHANGELOG.md",
        "LICENSE",
        "PKG-INFO",
        ".gitignore",  # hatchling always adds it
    }
