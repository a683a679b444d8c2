"""What verifies a result: given points that took no part in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from photostrip.result.numbers import Document


def verification_of(document: Document) -> Document:
    """Return whether the points are verified in plan and in height, and by what; if not, what would verify them."""
    checks = document["summary"]["check"]
    plan, height = (checks[part]["count"] for part in ("plan", "height"))
    if plan and height:
        points = "check point" if plan == 1 else "check points"
        return {"verified": True, "verification": f"{plan} {points} in plan and {height} in height"}
    missing = "the heights" if plan else "the plan coordinates" if height else "the result"
    return {"verified": False, "verification": f"no point verifies {missing}: {_cure(document)}"}


def _cure(document: Document) -> str:
    if document["counts"]["control_points"]:
        return "hold some given points back as check points (`role: check`)"
    return "measure points whose coordinates are known, and give them with `role: check`"
