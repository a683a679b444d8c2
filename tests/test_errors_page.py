"""docs/errors.md explains every code that the source can tell, and none that it cannot."""

from __future__ import annotations

import re
from collections import Counter
from functools import cache

import pytest

from tests.codes import codes
from tests.loops import nonempty
from tests.source_tree import ROOT

ENTRY = re.compile(r"(?ms)^- (`[a-z0-9`, -]+)( \([^)]*\))?: (.*?)(?=^- |^#|\Z)")
SAYS_ALL = re.compile(r"(?s)^The message says all: (.*?)\.[ \n]", re.MULTILINE)


@cache
def page() -> str:
    return (ROOT / "docs" / "errors.md").read_text(encoding="utf-8")


@cache
def entries() -> dict[str, tuple[str, str]]:
    """Give the severity and the text of each entry of the page by its code; codes may share an entry."""
    found = ENTRY.findall(page())
    return {code: (kind, " ".join(text.split())) for names, kind, text in found for code in _names(names)}


@cache
def said_by_messages() -> list[str]:
    return [code for names in SAYS_ALL.findall(page()) for code in _names(names)]


def _names(text: str) -> list[str]:
    return re.findall(r"`([^`]+)`", text)


@pytest.mark.slow
def test_every_code_is_on_the_page_and_no_other() -> None:
    known = codes()
    assert len(known) > 150
    named = {*entries(), *said_by_messages()}
    assert {code: place for code, place in known.items() if code not in named} == {}
    assert sorted(named - set(known)) == []


def test_every_code_stands_once() -> None:
    every = Counter([code for names, _, _ in ENTRY.findall(page()) for code in _names(names)] + said_by_messages())
    assert {code: times for code, times in every.items() if times > 1} == {}
    assert len(entries()) > 25
    assert len(entries()) == page().count("\n- `") + sum(len(_names(each[0])) - 1 for each in ENTRY.findall(page()))


def test_an_entry_says_cause_and_cure() -> None:
    for code, (kind, text) in nonempty(entries().items()):
        cause, *cures = re.split(r"(?<=[.?]) (?=[A-Z])", text)
        assert len(cause) > 15, code
        assert cures or kind.startswith(" (remark"), code
        assert text.endswith((".", "?")), code
