"""docs/errors.md explains codes that the source can tell, each once, with its cure."""

from __future__ import annotations

import re
from collections import Counter

from tests.loops import nonempty
from tests.source_tree import ROOT, modules

ENTRY = re.compile(r"(?ms)^- (`[a-z0-9`, -]+)( \([^)]*\))?: (.*?)(?=^- |^#|\Z)")
PAGE = (ROOT / "docs" / "errors.md").read_text(encoding="utf-8")
ENTRIES = [(re.findall(r"`([^`]+)`", names), kind, " ".join(text.split())) for names, kind, text in ENTRY.findall(PAGE)]


def test_every_code_on_the_page_is_told_and_stands_once() -> None:
    source = "".join(path.read_text(encoding="utf-8") for path in modules().values())
    named = Counter(code for codes, _, _ in ENTRIES for code in codes)
    assert len(named) > 20
    assert len(ENTRIES) == PAGE.count("\n- `")
    assert [code for code, times in named.items() if times > 1 or f'"{code}"' not in source] == []


def test_an_entry_says_cause_and_cure() -> None:
    for codes, kind, text in nonempty(ENTRIES):
        cause, *cures = re.split(r"(?<=[.?]) (?=[A-Z])", text)
        assert len(cause) > 15, codes
        assert cures or kind.startswith(" (remark"), codes
        assert text.endswith((".", "?")), codes
