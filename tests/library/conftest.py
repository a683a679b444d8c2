"""Steps of the method as commands."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tests.library.alone import Alone

if TYPE_CHECKING:
    from pathlib import Path

    from tests.calls import Call


@pytest.fixture
def alone(call: Call, tmp_path: Path) -> Alone:
    return Alone(call, tmp_path)
