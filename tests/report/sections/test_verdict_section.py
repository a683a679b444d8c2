"""The verdict: how much of what to look at is shown."""

from __future__ import annotations

import copy

import pytest

from photostrip.report.page.parts import Words
from photostrip.report.sections.verdict import LOOK_SHOWN, verdict_section
from photostrip.result.verdict import POOR_CONTROL, _control
from tests.reports import saved


@pytest.mark.parametrize(("count", "more"), [(LOOK_SHOWN, 0), (LOOK_SHOWN + 1, 1), (LOOK_SHOWN + 7, 7)])
def test_what_is_not_shown_is_counted(count: int, more: int) -> None:
    document = copy.deepcopy(saved())
    document["verdict"]["look_at"] = [f"reason {number}" for number in range(count)]
    said = [part.text for part in verdict_section(document).parts if isinstance(part, Words)]
    rest = f"{more} more things: --section verdict, or `verdict` in result.json"
    assert [text for text in said if "`verdict`" in text] == [rest] * (more > 0)
    assert sum(text.startswith("reason ") for text in said) == LOOK_SHOWN


@pytest.mark.parametrize(("ratio", "reasons"), [(None, 0), (POOR_CONTROL, 0), (POOR_CONTROL + 0.01, 1)])
def test_control_is_poor_beyond_the_limit(ratio: float | None, reasons: int) -> None:
    assert len(list(_control({"summary": {"control": {"normalised": ratio}}, "control": []}))) == reasons
