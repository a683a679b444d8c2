"""The house stands on its layers: a module imports from its own layer or from below, never in a circle."""

from __future__ import annotations

from graphlib import CycleError, TopologicalSorter
from typing import TYPE_CHECKING

import pytest

from tests.source_tree import PACKAGE, ROOT, imports, modules, resolve

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

# Bottom to top. A room is a module or a folder directly below photostrip/.
LAYERS = (
    {"arrays", "errors", "notes", "number_columns", "statistics", "threads", "units", "visible"},
    {"points", "camera", "geometry", "geodesy", "rejection"},
    {"strip", "terrestrial"},
    {"network"},
    {"plausibility"},
    {"simulation"},
    {"planning"},
    {"pipeline"},
    {"result"},
    {"comparison"},
    {"formats"},
    {"project"},
    {"foreign"},
    {"report"},
    {"steps"},
    {"sheets"},
    {"library"},
    {"batch"},
    {"cli"},
    {"__main__"},
)
# Rooms that may not use each other although their layers would allow it: (who, not whom).
TAUGHT = {"errors", "notes", "visible"}  # all that a report may know of the program
LEAVES = {"report"}
APART = {("terrestrial", "strip"), ("strip", "terrestrial")}
APART |= {("comparison", room) for room in ("strip", "network", "terrestrial")}


def room(module: str) -> str:
    """Give the room a module stands in; empty for the package itself."""
    return module.partition(".")[2].partition(".")[0]


def violations(root: Path) -> list[str]:
    """Give every import below `root` that the layers forbid, and every module without a layer."""
    level = {name: number for number, names in enumerate(LAYERS) for name in names}
    level[""] = level["threads"]  # photostrip/__init__.py sets up the process, and hands on the public names
    known = modules(root)
    homeless = sorted({room(module) for module in known} - level.keys())
    found = [f"photostrip/{name} belongs to no layer" for name in homeless]
    module_edges: set[tuple[str, str]] = set()
    for each in imports(root):
        target = resolve(each.target, known)
        if not target or {room(each.module), room(target)} & set(homeless):
            continue
        here, there = room(each.module), room(target)
        if level[there] > level[here] and (here, there) not in {("", "library"), ("", "steps")}:
            found.append(f"upward: {each}")
        if (here, there) in APART or (here in LEAVES and there not in {*TAUGHT, here}):
            found.append(f"apart: {each}")
        if target not in {each.module, PACKAGE}:
            module_edges.add((each.module, target))
    found += _circles(sorted(module_edges))
    found += _circles((room(here), room(there)) for here, there in module_edges if room(here) != room(there))
    for depth in (3, 4):  # photostrip.room.folder, photostrip.room.folder.folder: no circle between folders either
        pairs = ([".".join(each.split(".")[:depth]) for each in edge] for edge in sorted(module_edges))
        found += _circles((here, there) for here, there in pairs if here != there)
    return list(dict.fromkeys(found))


def _circles(edges: Iterable[tuple[str, str]]) -> list[str]:
    graph: dict[str, set[str]] = {}
    for here, there in edges:
        graph.setdefault(here, set()).add(there)
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return [f"circle: {' <- '.join(error.args[1])}"]
    return []


@pytest.mark.slow
def test_the_package_keeps_its_layers() -> None:
    assert len(modules()) > len(LAYERS)
    assert violations(ROOT) == []
