"""What verifies a result: given points that it has not seen."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from photostrip.result.numbers import Document


def verification_of(document: Document) -> Document:
    """Return whether the points are verified in plan and in height, and by what; if not, what would verify them."""
    checks, turned = document["summary"]["check"], document.get("cross_validation", {})
    plan, height = (checks[part]["count"] for part in ("plan", "height"))
    if plan and height:
        return {"verified": True, "verification": f"{_points(plan, 'check')} in plan and {height} in height"}
    if turned and turned["plan"]["count"] and turned["height"]["count"]:
        points = _points(turned["plan"]["count"], "control")
        text = f"{points} in plan and {turned['height']['count']} in height, left out in turn"
        return {"verified": True, "verification": text}
    missing = "the heights" if plan else "the plan coordinates" if height else "the result"
    return {"verified": False, "verification": f"no point verifies {missing}: {_cure(document)}"}


def _points(number: int, role: str) -> str:
    return f"{number} {role} point{'' if number == 1 else 's'}"


def _cure(document: Document) -> str:
    folds = document.get("cross_validation", {}).get("folds")
    if folds:
        reason = next((fold["reason"] for fold in folds if fold["reason"]), "it does not give all coordinates")
        return f"the control left out in turn cannot ({reason}); measure check points"
    if document["counts"]["control_points"]:
        return "hold some given points back as check points (`role: check`), or run with --cross-validate"
    return "measure points whose coordinates are known, and give them with `role: check`"
