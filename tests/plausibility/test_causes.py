"""Every cause that competes in an adjustment is described, by what can tell of it."""

from __future__ import annotations

from photostrip.network.hypotheses import DRIFT, LIST, OF_CAMERAS, OF_PHOTOS, OFFSET, ORDER
from photostrip.network.reliability import CONTROL, IMAGE, POSITION
from photostrip.plausibility import KINDS
from photostrip.plausibility.finding import CAUSES
from photostrip.result.description import described
from tests.source_tree import modules


def test_every_hypothesis_is_described_in_the_order_of_precedence() -> None:
    """Of those that explain alike the first is taken up."""
    observations = [IMAGE, CONTROL, POSITION]
    assert list(CAUSES) == [*observations, OFFSET, DRIFT, ORDER, LIST, *OF_CAMERAS, *OF_PHOTOS]


def test_a_cause_is_told_by_a_finding_a_note_or_a_key_of_the_result() -> None:
    source = "".join(path.read_text(encoding="utf-8") for path in modules().values())
    told = {code for each in CAUSES.values() for code in each.told} - {*KINDS, *described()}
    assert [code for code in sorted(told) if f'"{code}"' not in source] == []
