"""The notebooks run from top to bottom, where they lie."""

from __future__ import annotations

import ast
import json
from typing import TYPE_CHECKING

import pytest

from tests.source_tree import ROOT

if TYPE_CHECKING:
    from pathlib import Path

NOTEBOOKS = sorted((ROOT / "docs/notebooks").glob("*.ipynb"))


def cells(path: Path) -> list[str]:
    """Give the code of a notebook, cell by cell."""
    found = json.loads(path.read_text(encoding="utf-8"))["cells"]
    return ["".join(cell["source"]) for cell in found if cell["cell_type"] == "code"]


def shown(cell: str, names: dict[str, object]) -> str:
    """Run a cell and give what a notebook would show of its last line."""
    tree = ast.parse(cell)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "cell", "exec"), names)  # noqa: S102 (our own notebook)
    if not isinstance(last, ast.Expr):
        return ""
    value = eval(compile(ast.Expression(last.value), "cell", "eval"), names)  # noqa: S307 (our own notebook)
    return str(value._repr_html_()) if hasattr(value, "_repr_html_") else repr(value)


def test_there_is_a_notebook_for_every_user() -> None:
    assert [path.stem for path in NOTEBOOKS] == ["archive", "corridor", "first-strip", "regression"]


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=[path.stem for path in NOTEBOOKS])
def test_a_notebook_runs(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(path.parent)  # as Jupyter does
    names: dict[str, object] = {}
    outputs = [shown(cell, names) for cell in cells(path)]
    assert len(outputs) >= 3
    assert any(each and "object at 0x" not in each for each in outputs)
    stored = [cell for cell in json.loads(path.read_text(encoding="utf-8"))["cells"] if cell.get("outputs")]
    assert stored == [], "outputs are not kept in the repository"
