"""docs/plausibility.md has one section for each kind of finding."""

from __future__ import annotations

import re

import pytest

from photostrip.plausibility import KINDS
from tests.source_tree import ROOT

PAGE = (ROOT / "docs" / "plausibility.md").read_text(encoding="utf-8")
PARTS = re.split(r"(?m)^### (P\d+)\n", PAGE)
SECTIONS = {code: re.split(r"(?m)^## ", text)[0] for code, text in zip(PARTS[1::2], PARTS[2::2], strict=True)}


def test_every_kind_has_a_section_in_order() -> None:
    assert list(SECTIONS) == sorted(KINDS)


@pytest.mark.parametrize("code", sorted(KINDS))
def test_a_section_says_severity(code: str) -> None:
    assert SECTIONS[code].lstrip().startswith(f"{KINDS[code].severity.capitalize()}: ")
