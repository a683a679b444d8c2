"""How a report stands on a page of a given width: lines of words with a style each; as Markdown, and on a terminal.

Without colours (a pipe, a file, ``NO_COLOR``, a dumb terminal) the lines go out as they are, and rich is not even
imported: what tests and other programs see does not depend on it.
"""

from __future__ import annotations

import os
import shutil
import unicodedata
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from itertools import pairwise
from typing import NamedTuple, TextIO

from photostrip.report.page.parts import Column, Facts, Part, Section, Table, Words
from photostrip.visible import visible

Plain = Callable[[str], str]

NARROWEST, WIDEST_PAGE, USUAL = 60, 200, 100
GAP = "  "
LONGEST_LABEL = 28
SHORTEST_WORD = 8  # cells that a column of words keeps
TEXT_WIDTH = 120  # sentences do not run wider, however wide the page
ASCII = {
    "µ": "u", "σ": "sigma", "α": "alpha", "ω": "omega", "κ": "kappa", "τ": "tau", "ν": "nu", "±": "+-", "×": "x",
    "–": "-", "—": "-", "…": "...", "─": "-", "²": "2", "°": "deg", "·": "*",
}  # fmt: skip
BEFORE = str.maketrans({sign: f"\\{sign}" for sign in "\\`*_[]<>|#"})
STYLES = {
    "title": "bold cyan",
    "head": "bold",
    "foot": "bold",
    "note": "dim",
    "good": "bold green",
    "look": "bold yellow",
    "unverified": "bold yellow",
    "failed": "bold red",
}


class Line(NamedTuple):
    """One line: its text, and a style for all of it (``title``, ``head``, ``foot``, ``note``, a verdict, or empty)."""

    text: str
    style: str = ""


def plain_ascii(text: str) -> str:
    """Write the report's own signs with ASCII letters; ids keep theirs."""
    return text.translate(str.maketrans(ASCII))


def clamp(width: int) -> int:
    """Bring a width between the narrowest and the widest page."""
    return min(max(width, NARROWEST), WIDEST_PAGE)


def lay_out(title: str, sections: Iterable[Section], width: int, *, ascii_only: bool = False) -> list[Line]:
    """Lay out a report: no line is wider than the page, none ends in a blank; an empty title is not printed."""
    page = clamp(width)
    plain: Plain = (lambda text: visible(plain_ascii(text))) if ascii_only else visible
    lines = [Line(line, "title") for line in wrapped(plain(title), page)] if title else []
    for section in sections:
        if lines:
            lines.append(Line(""))
        if section.title:
            rule = plain("─")
            head = f"{rule * 2} {plain(section.title)} "
            lines.append(Line(head + rule * (min(page, TEXT_WIDTH) - cells(head)), "title"))
        lines += _section(section.parts, page, plain)
    return [Line(line.text.rstrip(), line.style) for line in lines]


def _section(parts: Sequence[Part], width: int, plain: Plain) -> Iterator[Line]:
    """Lay out the parts of a section, a blank line around tables."""
    for before, part in pairwise((None, *parts)):
        if before is not None and (isinstance(part, Table) or isinstance(before, Table)):
            yield Line("")
        if isinstance(part, Words):
            yield from _words(part, width, plain)
        elif isinstance(part, Facts):
            yield from _facts(part, width, plain)
        elif part is not None:
            yield from _table(part, width, plain)


def _words(words: Words, width: int, plain: Plain) -> Iterator[Line]:
    mark = f"{plain(words.mark)} " if words.mark else ""
    first = mark
    for line in wrapped(plain(words.text), min(width, TEXT_WIDTH) - len(mark)):
        yield Line(first + line, words.style)
        first = " " * len(mark)


def _facts(facts: Facts, width: int, plain: Plain) -> Iterator[Line]:
    labels = [cut(plain(label), LONGEST_LABEL, plain("…")) for label, _ in facts.rows]
    column = max(map(cells, labels), default=0)
    for label, (_, value) in zip(labels, facts.rows, strict=True):
        first = pad(label, column, left=True)
        for line in wrapped(plain(value), min(width, TEXT_WIDTH) - column - len(GAP)):
            yield Line(first + GAP + line)
            first = " " * column


def _table(table: Table, width: int, plain: Plain) -> Iterator[Line]:
    """Lay out a table: what is too much for the page goes, columns of the highest rank first, then ends of words."""
    heads = [[plain(column.name), plain(column.unit)] for column in table.columns]
    body = [[plain(cell) for cell in row] for row in (*table.rows, *table.foot)]
    sizes = [max(cells(cell) for cell in column) for column in zip(*zip(*heads, strict=True), *body, strict=True)]
    shown = _fitting(table.columns, sizes, width)
    _shorten(table.columns, sizes, shown, width)
    for number, style in ((0, "head"), (1, "head")):
        if number == 0 or any(heads[column][1] for column in shown):
            yield Line(_row([head[number] for head in heads], table.columns, sizes, shown, plain), style)
    for number, row in enumerate(body):
        style = "foot" if number >= len(table.rows) else ""
        yield Line(_row(row, table.columns, sizes, shown, plain), style)
    for line in wrapped(plain(table.note), min(width, TEXT_WIDTH)):
        yield Line(line, "note")


def _fitting(columns: Sequence[Column], sizes: Sequence[int], width: int) -> list[int]:
    """Choose the columns that fit; those of one rank stay or go together, those of rank 0 as far as they can."""
    shown = list(range(len(columns)))
    while _total(sizes, shown) > width:
        rank = max(columns[column].rank for column in shown)
        fewer = [column for column in shown if columns[column].rank < rank]
        if not fewer:
            break
        shown = fewer
    least = [min(size, SHORTEST_WORD) if column.left else size for column, size in zip(columns, sizes, strict=True)]
    while _total(least, shown) > width and len(shown) > 1:
        shown.pop()
    return shown


def _total(sizes: Sequence[int], shown: Sequence[int]) -> int:
    return sum(sizes[column] for column in shown) + len(GAP) * (len(shown) - 1)


def _shorten(columns: Sequence[Column], sizes: list[int], shown: Sequence[int], width: int) -> None:
    """Take from the widest column of words until the table fits."""
    words = [column for column in shown if columns[column].left]
    while words and (excess := _total(sizes, shown) - width) > 0:
        widest = max(words, key=sizes.__getitem__)
        others = max((sizes[column] for column in words if column != widest), default=0)
        less = min(excess, max(sizes[widest] - others, 1), sizes[widest] - SHORTEST_WORD)
        if less < 1:
            break
        sizes[widest] -= less


def _row(
    row: Sequence[str], columns: Sequence[Column], sizes: Sequence[int], shown: Sequence[int], plain: Plain
) -> str:
    return GAP.join(_filled(row[n], sizes[n], columns[n].left, plain) for n in shown)


def _filled(text: str, width: int, left: bool, plain: Plain) -> str:  # noqa: FBT001 (a cell: one of thousands)
    """Shorten or fill a cell of a table."""
    if not text.isascii() or len(text) > width:
        return pad(cut(text, width, plain("…")), width, left=left)
    return text.ljust(width) if left else text.rjust(width)


def wrapped(text: str, width: int) -> list[str]:
    """Break a text into lines of so many cells; longer words are broken."""
    lines: list[str] = []
    for word in text.split():
        if lines and cells(lines[-1]) + 1 + cells(word) <= width:
            lines[-1] += f" {word}"
            continue
        pieces = list(_broken(word, width))
        lines += pieces
    return lines


def _broken(word: str, width: int) -> Iterator[str]:
    while cells(word) > width:
        piece = cut(word, width, "")
        yield piece
        word = word[len(piece) :]
    yield word


def cells(text: str) -> int:
    """Count the character cells that a text takes: two for wide letters, none for accents that combine."""
    if text.isascii():
        return len(text)
    return sum(map(_cells_of, text))


@cache
def _cells_of(letter: str) -> int:
    if unicodedata.combining(letter) or unicodedata.category(letter) == "Cf":
        return 0
    return 2 if unicodedata.east_asian_width(letter) in "WF" else 1


def cut(text: str, width: int, dots: str) -> str:
    """Shorten a text to a width, with dots where something is missing."""
    if cells(text) <= width:
        return text
    kept = text
    while kept and cells(kept) + len(dots) > width:
        kept = kept[:-1]
    return kept + dots


def pad(text: str, width: int, *, left: bool) -> str:
    """Fill a cell of a table with blanks."""
    blanks = " " * (width - cells(text))
    return text + blanks if left else blanks + text


def to_text(title: str, sections: Iterable[Section], width: int = USUAL, *, ascii_only: bool = False) -> str:
    lines = lay_out(title, sections, width, ascii_only=ascii_only)
    return "".join(f"{line.text}\n" for line in lines)


def to_markdown(title: str, sections: Iterable[Section], *, ascii_only: bool = False) -> str:
    """Return a report as Markdown, all columns of all tables shown."""
    blocks = [f"# {_safe(title)}"] if title else []
    for section in sections:
        blocks += [f"## {_safe(section.title)}"] if section.title else []
        blocks += ["\n".join(_markdown(part)) for part in section.parts]
    page = "\n\n".join(blocks) + "\n"
    return plain_ascii(page) if ascii_only else page


def _safe(text: str) -> str:
    """Keep signs of Markdown in ids and sentences from being read as such."""
    return visible(text).translate(BEFORE)


def _markdown(part: Part) -> Iterator[str]:
    if isinstance(part, Words):
        text = f"**{_safe(part.text)}**" if part.style else _safe(part.text)
        yield f"{part.mark} {text}" if part.mark else text
    elif isinstance(part, Facts):
        yield from (f"- {_safe(label)}: {_safe(value)}" for label, value in part.rows)
    else:
        yield from _markdown_table(part)


def _markdown_table(table: Table) -> Iterator[str]:
    heads = [f"{column.name}, {column.unit}" if column.unit else column.name for column in table.columns]
    yield _markdown_row(heads)
    yield "|" + "|".join(":--" if column.left else "--:" for column in table.columns) + "|"
    yield from map(_markdown_row, (*table.rows, *table.foot))
    if table.note:
        yield f"\n{_safe(table.note)}"


def _markdown_row(cells: Iterable[str]) -> str:
    return f"| {' | '.join(map(_safe, cells))} |"


def print_report(
    title: str, sections: Iterable[Section], stream: TextIO, width: int | None = None, *, colour: bool | None = None
) -> None:
    """Print a report as wide as the terminal, 100 where there is none; in colours where the stream has them."""
    lines = lay_out(
        title, sections, page_width() if width is None else clamp(width), ascii_only=not speaks_unicode(stream)
    )
    if has_colours(stream, os.environ) if colour is None else colour:
        _print_coloured(lines, stream)
    else:
        stream.write("".join(f"{line.text}\n" for line in lines))


def page_width() -> int:
    """Width of the terminal (or of ``COLUMNS``), brought between 60 and 200; 100 where there is none."""
    return clamp(shutil.get_terminal_size((USUAL, 24)).columns)


def speaks_unicode(stream: TextIO) -> bool:
    """Whether a stream can show more than ASCII."""
    encoding = (getattr(stream, "encoding", None) or "utf-8").lower().replace("-", "").replace("_", "")
    return encoding in {"utf8", "utf8sig", "cp65001"} or encoding.startswith(("utf16", "utf32"))


def has_colours(stream: TextIO, environment: Mapping[str, str]) -> bool:
    """Whether to use colours on a stream: ``NO_COLOR``, when it is not empty, and ``TERM=dumb`` forbid them."""
    if environment.get("NO_COLOR") or environment.get("TERM", "") in {"dumb", "unknown"}:
        return False
    return stream.isatty()


def _print_coloured(lines: Iterable[Line], stream: TextIO) -> None:
    from rich.console import Console
    from rich.text import Text

    console = Console(file=stream, force_terminal=True, highlight=False, markup=False, soft_wrap=True)
    for line in lines:
        console.print(Text(line.text, style=STYLES.get(line.style, "")))
