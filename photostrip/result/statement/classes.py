"""Classes of a norm that a profile holds: which of them the check points of a result keep."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from photostrip.notes import Document

# What a norm may set a limit to, with the meaning that a statement prints; where it stands in the block `statement`.
MEASURES = {
    "plan": {
        "rmse": "rms error in plan",
        "rmse_axis": "larger rms error of the two coordinates",
        "accuracy": "rms error in plan with that of the survey",
        "mean": "mean error in plan",
        "p90": "error in plan that one point in ten exceeds",
        "largest": "largest error in plan",
        "ce90": "CE90",
        "ce95": "CE95",
        "radial95": "NSSDA, 95 % in plan",
    },
    "height": {
        "rmse": "rms error in height",
        "accuracy": "rms error in height with that of the survey",
        "mean": "mean size of the errors in height",
        "p90": "error in height that one point in ten exceeds",
        "largest": "largest error in height",
        "le90": "LE90",
        "le95": "LE95",
    },
}


@dataclass(frozen=True)
class AccuracyClass:
    """A class of a norm; its limits are in metres, by measure, in plan and in height."""

    name: str
    limits: Mapping[str, Mapping[str, float]]
    source: str = ""


@dataclass(frozen=True)
class ClassProfile:
    """Classes of a norm, the narrowest first."""

    name: str
    source: str  # where the numbers come from
    classes: tuple[AccuracyClass, ...]
    check_points: int = 1  # so many are asked for, in each part that has a limit


def classified(block: Document, profile: ClassProfile) -> Document:
    """Return each class of a profile with what was found and whether it is kept; ``best`` is the first that is."""
    rows = [_class(block, each, profile.check_points) for each in profile.classes]
    return {
        "name": profile.name,
        "source": profile.source,
        "check_points": profile.check_points,
        "classes": rows,
        "best": next((row["name"] for row in rows if row["kept"]), None),
    }


def _class(block: Document, each: AccuracyClass, least: int) -> Document:
    limits = [
        {
            "part": part,
            "measure": measure,
            "meaning": MEASURES[part][measure],
            "found": found,
            "limit": limit,
            "kept": found is not None and found <= limit and block[part]["count"] >= least,
        }
        for part, given in each.limits.items()
        for measure, limit in given.items()
        for found in [_found(block, part, measure)]
    ]
    return {
        "name": each.name,
        "source": each.source,
        "limits": limits,
        "kept": all(limit["kept"] for limit in limits),
    }


def _found(block: Document, part: str, measure: str) -> float | None:
    axes, circle, line = block["axes"], block["circle"], block["line"]
    if measure == "rmse_axis":
        sizes = (axes["east"]["rmse"], axes["north"]["rmse"])
        return None if None in sizes else max(sizes)
    found: float | None = next(each[measure] for each in (block[part], circle, line) if measure in each)
    return found
