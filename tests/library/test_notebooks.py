"""The notebooks run from top to bottom, where they lie, and show what is stored in them."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from tests.renew_notebooks import NOTEBOOKS, page, run

if TYPE_CHECKING:
    from pathlib import Path


def test_there_is_a_notebook_for_every_user() -> None:
    assert [path.stem for path in NOTEBOOKS] == ["archive", "corridor", "first-strip", "regression"]


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=[path.stem for path in NOTEBOOKS])
def test_a_notebook_shows_what_is_stored(path: Path) -> None:
    """Renew them with ``python -m tests.renew_notebooks``."""
    stored = json.loads(path.read_text(encoding="utf-8"))
    assert run(path) == stored
    outputs = [output for cell in stored["cells"] for output in cell.get("outputs", [])]
    assert len(outputs) >= 3
    assert "object at 0x" not in json.dumps(outputs)


def test_pages_of_the_site_have_text_and_figures() -> None:
    pages = {path.stem: page(json.loads(path.read_text(encoding="utf-8"))) for path in NOTEBOOKS}
    assert all(text.startswith("# ") and "```python\nimport photostrip" in text for text in pages.values())
    assert [name for name, text in pages.items() if "<svg" in text] == ["archive", "corridor", "first-strip"]
    assert "redundancy 12" in pages["archive"]
