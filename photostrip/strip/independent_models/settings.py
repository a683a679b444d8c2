"""What is asked of the links between independent models."""

from __future__ import annotations

from dataclasses import dataclass

METHODS = ("auto", "none")


@dataclass(frozen=True)
class LinkSettings:
    """How models are joined by similarities."""

    screening: str = "auto"  # ``"auto"`` or ``"none"``
    alpha: float = 0.01  # probability of rejecting anything in the links of a strip without gross errors
    # keep, drop: coordinates, ``model/point`` or ``model/photo``, that take part whatever the test says, or not at all
    keep: tuple[str, ...] = ()
    drop: tuple[str, ...] = ()
