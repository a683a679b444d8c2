"""What a user installs: the package with its marker for types, nothing of the tests."""

from __future__ import annotations

import email
import os
import shutil
import subprocess
import sys
import tarfile
import tomllib
import venv
import zipfile
from importlib.metadata import Distribution, distribution, distributions
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import yaml
from packaging.requirements import Requirement

import photostrip
from tests.loops import nonempty
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from collections.abc import Iterable

pytestmark = pytest.mark.slow


def build(kind: str, folder: Path, source: Path = ROOT) -> Path:
    """Build one archive of the project without the network and give its path."""
    command = [sys.executable, "-m", "hatchling", "build", "-t", kind, "-d", str(folder)]
    subprocess.run(command, cwd=source, check=True, capture_output=True)
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


def installed(requirements: Iterable[str], extras: Iterable[str]) -> dict[str, Distribution]:
    """Give what is installed here of all that is required, directly or not: each must be of a version that will do."""
    found: dict[str, Distribution] = {}
    for each in map(Requirement, requirements):
        if each.marker is None or any(each.marker.evaluate({"extra": extra}) for extra in ("", *extras)):
            found[each.name] = distribution(each.name)
            assert each.specifier.contains(found[each.name].version), each
            found |= installed(found[each.name].requires or (), each.extras)
    return found


def link(found: Iterable[Distribution], packages: Path) -> None:
    """Put distributions that are installed here into another environment, too."""
    for each in nonempty(found):
        for top in {file.parts[0] for file in nonempty(each.files or ())} - {"..", "__pycache__"}:
            if not (packages / top).exists():
                (packages / top).symlink_to(Path(str(each.locate_file(top))).resolve())


def test_the_wheel_runs_in_an_environment_that_has_what_it_asks_for_and_nothing_else(tmp_path: Path) -> None:
    """The wheel that is built from the source archive, away from the clone."""
    with tarfile.open(build("sdist", tmp_path / "sdist")) as archive:
        archive.extractall(tmp_path, filter="data")
    (source,) = tmp_path.glob("photostrip-*/")
    wheel = build("wheel", tmp_path / "built", source)
    venv.create(tmp_path / "empty", symlinks=True)
    python, command = (str(tmp_path / "empty/bin" / name) for name in ("python", "photostrip"))
    (packages,) = tmp_path.glob("empty/lib/python3.*/site-packages")
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "COVERAGE"))}
    sample = ROOT / "sample_data/simulated-20"

    def run(*arguments: str) -> str:
        done = subprocess.run(arguments, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
        return done.stdout

    install = ["install", "--quiet", "--no-deps", "--no-index", "--no-compile", "--disable-pip-version-check"]
    run(sys.executable, "-m", "pip", "--python", python, *install, str(wheel))
    (this,) = distributions(path=[str(packages)])
    needed = installed(this.requires or (), ())
    link(needed.values(), packages)
    where = run(python, "-c", "import photostrip; print(len(photostrip.__all__), photostrip.__file__)")
    assert where.strip() == f"{len(photostrip.__all__)} {packages / 'photostrip/__init__.py'}"
    run(command, "run", str(sample / "project.yaml"), "-o", "result", "-q")
    assert "SAME" in run(command, "compare", "result", str(sample / "baseline.json"))
    assert "[001]" in run(command, "sources")
    assert photostrip.__version__ in run(python, "-m", "photostrip", "--version")
    run(command, "report", "result", "-o", "page.html")
    assert (tmp_path / "page.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


def test_the_recipe_asks_for_the_same_libraries_and_the_citation_is_of_this_version() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    recipe = yaml.safe_load((ROOT / "conda.recipe/meta.yaml").read_text(encoding="utf-8"))
    listed = dict(each.split(" >=") for each in recipe["requirements"]["run"])
    assert listed.pop("python") == "3.11"
    assert listed == dict(each.split(">=") for each in nonempty(project["dependencies"]))
    assert recipe["package"]["version"] == photostrip.__version__
    assert recipe["build"]["entry_points"] == ["photostrip = photostrip.cli.main:main"]
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert (citation["title"], citation["version"]) == ("photostrip", photostrip.__version__)


def test_a_release_asks_for_one_version_and_hands_out_no_secret(tmp_path: Path) -> None:
    """The step that compares the tag runs here as it will there: with this tree it stops at the changelog only."""
    workflow = yaml.safe_load((ROOT / ".github/workflows/release.yml").read_text(encoding="utf-8"))
    (step,) = [each for each in workflow["jobs"]["build"]["steps"] if "CITATION" in each.get("name", "")]
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").replace(" (not released)", "")
    shutil.copy(ROOT / "CITATION.cff", tmp_path)
    (tmp_path / "CHANGELOG.md").write_text(changelog, encoding="utf-8")

    def stops(tag: str) -> bool:
        script = step["run"].replace("python -c", f"PYTHONPATH={ROOT} {sys.executable} -c")
        environment = os.environ | {"GITHUB_REF_NAME": tag}
        ended = subprocess.run(["bash", "-eo", "pipefail", "-c", script], cwd=tmp_path, env=environment, check=False)
        return ended.returncode != 0

    assert not stops(f"v{photostrip.__version__}")
    assert stops("v9.9.9")
    for other in (changelog.replace("## 0", "## 9"), f"{changelog}(not released)\n"):
        (tmp_path / "CHANGELOG.md").write_text(other, encoding="utf-8")
        assert stops(f"v{photostrip.__version__}")
    assert workflow["permissions"] == {"contents": "read"}
    assert "secrets." not in (ROOT / ".github/workflows/release.yml").read_text(encoding="utf-8")
