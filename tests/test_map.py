"""Files that docs/design.md names, and constants that pages name, are there."""

from __future__ import annotations

import re

from tests.loops import nonempty
from tests.source_tree import PACKAGE, ROOT, modules

DESIGN = (ROOT / "docs/design.md").read_text(encoding="utf-8")


def test_every_file_that_the_map_names_is_there() -> None:
    named: set[str] = set(nonempty(re.findall(r"`([\w./-]+\.(?:py|md|yaml|json|toml|html))`", DESIGN)))
    known = {path.name for folder in (PACKAGE, "tests", "docs") for path in (ROOT / folder).rglob("*.*")}
    roots = (ROOT, ROOT / PACKAGE, ROOT / "docs")
    assert [
        name
        for name in sorted(named)
        if not any((root / name).exists() for root in roots) and ("/" in name or name not in known)
    ] == []


def test_every_constant_that_a_page_names_is_there() -> None:
    texts: dict[str, str] = {}
    for path in modules().values():
        texts[path.stem] = texts.get(path.stem, "") + path.read_text(encoding="utf-8")
    every = [ROOT / "benchmarks" / "README.md", *(ROOT / "docs").rglob("*.md")]
    pages = "".join(page.read_text(encoding="utf-8") for page in every)
    named: set[tuple[str, str]] = set(nonempty(re.findall(r"`([a-z]\w+)\.([A-Z][A-Z_0-9]+)`", pages)))
    assert [each for each in sorted(named) if not re.search(rf"\b{each[1]}\b", texts.get(each[0], ""))] == []
