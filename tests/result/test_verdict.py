"""The verdict: what verifies a result, what contradicts it, and the exit codes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from photostrip.report import chosen_sections
from photostrip.report.page.text import to_text
from photostrip.result.verdict import FAILED, GOOD, LOOK, UNVERIFIED, exit_code
from tests.results import Document, case, solved


def with_checks(plan: int, height: int) -> Document:
    """Solve a sound project with the first so many check points in plan, and in height."""
    inputs = case("projected", 2).inputs
    control = inputs.control
    use, order = control.use.copy(), np.cumsum(control.check) - 1
    use[control.check & (order >= plan), :2] = False
    use[control.check & (order >= height), 2] = False
    enu = np.where(control.check[:, None] & ~use, np.nan, control.enu)
    return solved(replace(inputs, control=replace(control, use=use, enu=enu))).document


def quiet(document: Document) -> str:
    return to_text("", chosen_sections(document, quiet=True), 200)


@pytest.mark.parametrize(
    ("plan", "height", "missing"),
    [(0, 0, "the result"), (2, 0, "the heights"), (0, 2, "the plan coordinates")],
)
def test_what_nothing_verifies_is_not_good(plan: int, height: int, missing: str) -> None:
    document = with_checks(plan, height)
    assert (document["status"], document["verdict"]["look_at"]) == (UNVERIFIED, [])
    assert document["verdict"]["verified"] is False
    assert document["verdict"]["verification"].startswith(f"no point verifies {missing}: hold some given points back")
    text = quiet(document)
    assert text.startswith(f"UNVERIFIED: nothing calls for a second look, but no point verifies {missing}: hold some ")
    assert text.count("no point verifies") == 1


def test_check_points_verify() -> None:
    document = with_checks(2, 1)
    assert (document["status"], document["verdict"]["verified"]) == (GOOD, True)
    assert document["verdict"]["verification"] == "2 check points in plan and 1 in height"


def test_what_is_to_be_looked_at_can_be_unverified_too() -> None:
    document = case("projected", 2).document
    verdict = {**document["verdict"], "verified": False, "verification": "no point verifies the result: do this"}
    text = quiet({**document, "status": LOOK, "verdict": {**verdict, "look_at": ["a thing"]}})
    assert text.count("No point verifies the result: do this.") == 1


@pytest.mark.parametrize(("status", "code", "strict"), [(GOOD, 0, 0), (UNVERIFIED, 0, 1), (LOOK, 0, 1), (FAILED, 1, 1)])
def test_exit_codes(status: str, code: int, strict: int) -> None:
    assert exit_code(status, strict=False) == code
    assert exit_code(status, strict=True) == strict
