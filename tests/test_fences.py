"""A library that shapes a program stays behind the door of its room: what is listed here is imported nowhere else."""

from __future__ import annotations

import tomllib
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

import pytest

from tests.source_tree import PACKAGE, ROOT, imports, modules

if TYPE_CHECKING:
    from pathlib import Path

FILES = ("formats/*", "project/*", "report/*", "sheets/*", "cli/*")
# Library: the files below photostrip/ that may import it.
FENCES = {
    "csv": FILES,
    "dask": ("batch/*",),
    "distributed": ("batch/*",),
    "gzip": FILES,
    "jinja2": ("report/*",),
    "json": FILES,
    "laspy": ("foreign/historix_submission.py",),
    "pebble": ("batch/*",),
    "pydantic": ("project/*",),
    "pyproj": ("geodesy/crs.py", "geodesy/proj_operation.py"),
    "rich": ("report/page/layout.py", "report/page/progress.py"),
    "typer": ("cli/*",),
    "yaml": ("project/*",),
}


def trespasses(root: Path) -> list[str]:
    """Give every import below `root` that climbs over a fence."""
    known = modules(root)
    found = []
    for each in imports(root):
        library = each.target.partition(".")[0]
        file = known[each.module].relative_to(root / PACKAGE).as_posix()
        if not any(fnmatchcase(file, pattern) for pattern in FENCES.get(library, ("*",))):
            found.append(str(each))
    return found


@pytest.mark.slow
def test_the_package_keeps_its_fences() -> None:
    assert trespasses(ROOT) == []


def test_the_linter_knows_the_same_fences() -> None:
    ruff = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["ruff"]
    assert ruff["lint"]["flake8-tidy-imports"]["banned-api"].keys() == FENCES.keys()
