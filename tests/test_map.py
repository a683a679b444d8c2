"""docs/design.md is the map of the package: its folders, its files and its layers are those that there are."""

from __future__ import annotations

import re

from tests.loops import nonempty
from tests.source_tree import PACKAGE, ROOT, modules
from tests.test_layers import LAYERS

DESIGN = (ROOT / "docs/design.md").read_text(encoding="utf-8")


def folders() -> dict[str, list[str]]:
    """Give every folder of the package that holds modules beside its ``__init__.py``, with their names."""
    found: dict[str, list[str]] = {}
    for path in modules().values():
        if path.name != "__init__.py":
            found.setdefault(path.parent.relative_to(ROOT / PACKAGE).as_posix(), []).append(path.name)
    return found


def test_the_map_names_every_folder_and_no_other() -> None:
    rows: list[str] = nonempty(re.findall(r"^\| `([\w/]+)/` \|", DESIGN, re.MULTILINE))
    assert len(rows) == len(set(rows))
    assert sorted(folders().keys() - {"."} - set(rows)) == []
    assert [row for row in rows if not (ROOT / PACKAGE / row / "__init__.py").exists()] == []


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


def test_the_map_lists_the_layers() -> None:
    (text,) = re.findall(r"Layers, lowest first: (.*?)\n\n", DESIGN, re.DOTALL)
    listed = [set(names.split()) for names in re.findall(r"`([^`]+)`", text.partition(". ")[0])]
    assert listed == list(LAYERS)
