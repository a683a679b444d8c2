"""What is asked of the links between independent models."""

from __future__ import annotations

from dataclasses import dataclass

METHODS = ("auto", "none")


@dataclass(frozen=True)
class LinkSettings:
    """How models are joined by similarities."""

    screening: str = "auto"  # ``"auto"`` or ``"none"``
    alpha: float = 0.001  # probability of rejecting a good point of a link without gross errors
    # keep, drop: coordinates, ``model/point`` or ``model/photo``, that take part whatever the test says, or not at all
    keep: tuple[str, ...] = ()
    drop: tuple[str, ...] = ()
