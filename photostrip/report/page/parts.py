"""What a report is made of: sections of sentences, facts and tables. How they look is decided elsewhere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

DASH = "–"  # stands where there is no value


class Column(NamedTuple):
    name: str
    unit: str = ""  # unit of its numbers, in the second line of the head
    left: bool = False
    rank: int = 0  # 0: always shown; where the page is too narrow, columns of the highest rank are left out first


@dataclass(frozen=True)
class Table:
    columns: tuple[Column, ...]
    rows: tuple[tuple[str, ...], ...]
    foot: tuple[tuple[str, ...], ...] = ()
    note: str = ""  # a sentence below: what is not shown, and where it is
    pages: tuple[str, ...] = ()  # of each row, the page to which it leads, or empty; where a page is shown


@dataclass(frozen=True)
class Facts:
    """Labels with a value each."""

    rows: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Words:
    text: str
    style: str = ""  # ``"good"``, ``"unverified"``, ``"look"``, ``"failed"`` or empty
    mark: str = ""  # what stands before it: a number or a bullet; lines after the first are indented below the text
    names: tuple[tuple[str, str], ...] = ()  # what it speaks of, ``("point", "K01")``: a page links its rows


Part = Table | Facts | Words


@dataclass(frozen=True)
class Section:
    title: str
    parts: tuple[Part, ...]
