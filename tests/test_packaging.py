"""What a user installs: the package with its marker for types, nothing of the tests."""

from __future__ import annotations

import email
import os
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from typing import TYPE_CHECKING

import pytest
import yaml

import photostrip
from tests.loops import nonempty
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.slow


def build(kind: str, folder: Path, source: Path = ROOT) -> Path:
    """Build one archive of the project without the network and give its path."""
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", kind, "-d", str(folder)],
        cwd=source,
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
    source = {path.relative_to(ROOT).as_posix() for path in (ROOT / "photostrip").rglob("*") if path.is_file()}
    source = {name for name in source if "__pycache__" not in name}
    assert source == {name for name in names if name.startswith("photostrip/")}
    assert {name.rpartition(".")[2] for name in source} >= {"py", "csv", "txt", "yaml", "html", "css", "typed"}
    assert entry_points.split() == ["[console_scripts]", "photostrip", "=", "photostrip.cli.main:main"]
    core = [line for line in metadata.get_all("Requires-Dist", []) if "extra ==" not in line]
    assert all(">=" in line for line in nonempty(core))


@pytest.fixture(scope="module")
def source_archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build("sdist", tmp_path_factory.mktemp("sdist"))


def test_the_source_archive_holds_what_builds_the_wheel(source_archive: Path) -> None:
    with tarfile.open(source_archive) as archive:
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


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory, source_archive: Path) -> Path:
    """Build the wheel from the source archive, away from the clone."""
    folder = tmp_path_factory.mktemp("wheel")
    with tarfile.open(source_archive) as archive:
        archive.extractall(folder, filter="data")
    (source,) = folder.glob("photostrip-*")
    return build("wheel", folder / "built", source)


def assert_runs(python: str, folder: Path, installed: Path, environment: dict[str, str], *form: str) -> None:
    """Import the installed package, adjust a sample by its command, and print a table of its own."""

    def run(*command: str) -> str:
        done = subprocess.run(
            [python, *command], cwd=folder, env=environment, capture_output=True, text=True, check=True
        )
        return done.stdout

    where = run("-c", "import photostrip; print(len(photostrip.__all__), photostrip.__file__)")
    assert where.strip() == f"{len(photostrip.__all__)} {installed / 'photostrip/__init__.py'}"
    sample = str(ROOT / "sample_data/simulated-20")
    run("-m", "photostrip", "run", f"{sample}/project.yaml", "-o", "result", "-q", *form)
    assert "SAME" in run("-m", "photostrip", "compare", "result", f"{sample}/baseline.json")
    assert "[001]" in run("-m", "photostrip", "sources")


def test_the_wheel_runs_beside_the_libraries_that_are_here(tmp_path: Path, wheel: Path) -> None:
    installed = tmp_path / "installed"
    shutil.unpack_archive(wheel, installed, "zip")
    assert_runs(sys.executable, tmp_path, installed, os.environ | {"PYTHONPATH": str(installed)}, "--html")


def test_the_wheel_brings_what_it_needs_into_an_empty_environment(tmp_path: Path, wheel: Path) -> None:
    empty = tmp_path / "empty"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(empty)], check=True, capture_output=True)
    python = str(empty / "bin/python")
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "COVERAGE"))}

    def pip(*command: str) -> subprocess.CompletedProcess[str]:
        options = ["--quiet", "--disable-pip-version-check", "--no-compile", "--retries", "1", "--timeout", "20"]
        return subprocess.run(
            [sys.executable, "-m", "pip", "--python", python, "install", *options, *command],
            cwd=tmp_path, env=environment, capture_output=True, text=True, check=False,
        )  # fmt: skip

    installed = pip(str(wheel))
    if installed.returncode and pip("--dry-run", "--no-deps", "typer").returncode:
        pytest.skip(f"no package index is reachable: {installed.stderr.strip().splitlines()[-1]}")
    assert installed.returncode == 0, installed.stderr
    (packages,) = empty.glob("lib/python3.*/site-packages")
    assert_runs(python, tmp_path, packages, environment)
    version = subprocess.run([empty / "bin/photostrip", "--version"], capture_output=True, text=True, check=True)
    assert photostrip.__version__ in version.stdout


def needs() -> dict[str, str]:
    """Give the libraries that pyproject.toml asks for, with their lower bounds."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return dict(each.split(">=") for each in nonempty(project["dependencies"]))


def test_the_recipe_asks_for_the_same_libraries() -> None:
    recipe = yaml.safe_load((ROOT / "conda.recipe/meta.yaml").read_text(encoding="utf-8"))
    listed = dict(each.split(" >=") for each in recipe["requirements"]["run"])
    assert listed.pop("python") == "3.11"
    assert listed == needs()
    assert recipe["package"]["version"] == photostrip.__version__
    assert recipe["build"]["entry_points"] == ["photostrip = photostrip.cli.main:main"]


def test_the_image_is_made_of_what_builds_the_package() -> None:
    lines = (ROOT / "Dockerfile").read_text(encoding="utf-8").splitlines()
    copied = [name for line in lines if line.startswith("COPY") for name in line.split()[1:-1]]
    assert nonempty(copied) == ["pyproject.toml", "README.md", "LICENSE", "photostrip"]
    assert [name for name in copied if not (ROOT / name).exists()] == []
    assert 'RUN pip install --no-cache-dir "/source[report]"' in lines  # the libraries are those of pyproject.toml


def test_the_citation_is_of_this_version() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert (citation["title"], citation["version"]) == ("photostrip", photostrip.__version__)
