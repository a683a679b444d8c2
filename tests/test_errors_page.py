"""docs/errors.md explains every code that the source can tell, and none that it cannot."""

from __future__ import annotations

import re
from functools import cache

import pytest

from tests.codes import codes
from tests.loops import nonempty
from tests.source_tree import ROOT


@cache
def sections() -> dict[str, str]:
    """Give the text of each section of the page by its code."""
    text = (ROOT / "docs" / "errors.md").read_text(encoding="utf-8")
    parts = re.split(r"(?m)^### (.+)\n", text)
    return {code: re.split(r"(?m)^## ", body)[0].strip() for code, body in zip(parts[1::2], parts[2::2], strict=True)}


@pytest.mark.slow
def test_every_code_has_a_section() -> None:
    known = codes()
    assert len(known) > 150
    assert {code: place for code, place in known.items() if code not in sections()} == {}


@pytest.mark.slow
def test_every_section_is_of_a_code() -> None:
    assert sorted(set(sections()) - set(codes())) == []


def test_a_section_says_cause_and_cure() -> None:
    for code, text in nonempty(sections().items()):
        cause, *cures = " ".join(text.split()).split("**Cure:** ")
        assert len(cures) == 1, code
        assert len(cause) > 15, code
        assert cause.rstrip().endswith((".", "?")), code
        assert cures[0].endswith((".", "?")), code


@pytest.mark.slow
def test_codes_are_found_in_all_their_forms() -> None:
    known = codes()
    for code in ("unknown-key", "file-missing", "measured-once", "behind-cameras", "marks-missing", "tag", "no-sigma"):
        assert code in known
