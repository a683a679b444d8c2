"""Tables of docs/ that are made from the package: ``make docs`` writes them, the tests of the pages hold them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from photostrip.plausibility import KINDS
from photostrip.plausibility.finding import CAUSES

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> list[str]:
    return [f"| {' | '.join(row)} |" for row in (head, ("---",) * len(head), *rows)]


def causes() -> list[str]:
    """List what competes in an adjustment."""
    rows, above = [], ""
    for each in CAUSES.values():
        told = ", ".join(name if name in KINDS else f"`{name}`" for name in each.told)
        rows.append((each.title, each.shows, told, "as above" if each.cure == above else each.cure, each.example))
        above = each.cure
    return _table(("cause", "how it shows", "told as", "what cures it", "example"), rows)


def findings() -> list[str]:
    """List every kind of finding."""
    rows = ((code, f"**{kind.title}**" if kind.severity == "error" else kind.title, kind.shows)
            for code, kind in KINDS.items())  # fmt: skip
    return _table(("code", "finding", "how it shows"), rows)


TABLES: dict[str, Callable[[], list[str]]] = {"causes": causes, "findings": findings}
