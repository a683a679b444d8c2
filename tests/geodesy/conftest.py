"""What PROJ makes between two frames is made once for all tests: between two datums that takes up to 0.3 s."""

from __future__ import annotations

from functools import cache
from typing import Any

import pyproj
import pytest

made = cache(pyproj.Transformer.from_crs)


def made_once(*ends: Any, **options: Any) -> pyproj.Transformer:  # noqa: ANN401 (as pyproj takes them)
    """Give the transformer of the same two frames again."""
    return made(*ends, **options)


@pytest.fixture(autouse=True)
def _operations_made_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pyproj.Transformer, "from_crs", made_once)
