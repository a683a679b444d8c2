"""A folder with projects to stand in, and pools that compute without waiting."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from photostrip.batch import pool
from tests.batch.projects import Alone, write_projects

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> Path:
    """Stand in a folder with good projects (three, or ``PROJECTS``), which are computed in this process."""
    write_projects(tmp_path / "strips", getattr(request.module, "PROJECTS", 3))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(pool, "LocalPool", Alone)
    return tmp_path
