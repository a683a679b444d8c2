"""Every key of result.json described once, in ``quantities.txt``: what stands there, its unit and its decimals."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from pathlib import Path

LIST = " list"
KINDS = {"text", "word", "count", "flag", "any"}
BRACES = re.compile(r"\{([^}]*)\}")


@dataclass(frozen=True)
class Quantity:
    """The value of a key, or each number of the list that stands there."""

    meaning: str
    kind: str  # text, word (one of a few), count, flag, number, any (described elsewhere)
    unit: str = ""  # m, um, deg, ...; empty for ratios; frame: that of its coordinates; angle: that of its angles
    decimals: int | None = None
    digits: int | None = None  # significant ones, where a number has no natural size
    unit_key: str = ""  # key of the same record that names the unit
    many: bool = False  # whether a list of such values stands there

    @classmethod
    def of(cls, form: str, meaning: str) -> Quantity:
        """Read a form, as ``um 2``, ``ratio 4 digits``, ``by unit``, ``any m``, ``text`` or ``text list``."""
        if form.endswith(LIST):
            return replace(cls.of(form.removesuffix(LIST), meaning), many=True)
        kind, *rest = form.split()
        if kind in KINDS:
            return cls(meaning, kind, "".join(rest))
        if kind == "by":
            return cls(meaning, "number", unit_key=rest[0])
        places, unit = int(rest[0]), "" if kind == "ratio" else kind
        if rest[1:]:
            return cls(meaning, "number", unit, digits=places)
        return cls(meaning, "number", unit, decimals=places)


Table = dict[str, "Quantity | Table"]


@cache
def described() -> Table:
    """Read the description: what stands under each key of a result; the records of a list are described once."""
    found: Table = {}
    blocks = [found]
    for line in Path(__file__).with_name("quantities.txt").read_text(encoding="utf-8").splitlines():
        if line.startswith("["):
            blocks = [table_at(path, found) for path in _expanded(line.strip("[]"))]
        elif line and not line.startswith("#"):
            key, form, meaning = line.split(" | ")
            entry = Quantity.of(form, meaning)
            for path in _expanded(key) if "{" in key else (key,):
                above, _, last = path.rpartition(".")
                for block in blocks:
                    table_at(above, block)[last] = entry
    return found


@cache
def lists() -> frozenset[str]:
    """Return the blocks that are lists of records, by the keys that lead to them."""
    lines = Path(__file__).with_name("quantities.txt").read_text(encoding="utf-8").splitlines()
    return frozenset(path for line in lines if line.startswith("[[") for path in _expanded(line.strip("[]")))


def _expanded(path: str) -> Iterator[str]:
    """Write ``{a b}.c`` out as ``a.c`` and ``b.c``."""
    fixed = BRACES.split(path)
    for names in product(*(choice.split() for choice in fixed[1::2])):
        yield "".join(part for pair in zip(fixed[::2], (*names, ""), strict=True) for part in pair)


def table_at(path: str, within: Table | None = None) -> Table:
    """Return what is described below a block, as ``strips`` or ``precision.along``; empty when nothing is."""
    found = described() if within is None else within
    for key in path.split(".") if path else ():
        below = found.setdefault(key, {})
        if isinstance(below, Quantity):
            raise KeyError(path)
        found = below
    return found


def quantity_at(path: str) -> Quantity | None:
    """Find a key by the keys that lead to it; what stands below a key that is described as a whole belongs to it."""
    found: Quantity | Table | None = described()
    for key in path.split("."):
        found = found.get(key) if isinstance(found, dict) else found
    return found if isinstance(found, Quantity) else None
