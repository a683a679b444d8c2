"""The report as plain text and as Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from photostrip.report.page.layout import USUAL, lay_out, plain_ascii
from photostrip.report.page.parts import Facts, Part, Section, Table, Words
from photostrip.visible import visible

BEFORE = str.maketrans({sign: f"\\{sign}" for sign in "\\`*_[]<>|#"})


def to_text(title: str, sections: Iterable[Section], width: int = USUAL, *, ascii_only: bool = False) -> str:
    lines = lay_out(title, sections, width, ascii_only=ascii_only)
    return "".join(f"{line.text}\n" for line in lines)


def to_markdown(title: str, sections: Iterable[Section], *, ascii_only: bool = False) -> str:
    """Return a report as Markdown, all columns of all tables shown."""
    blocks = [f"# {_safe(title)}"] if title else []
    for section in sections:
        blocks += [f"## {_safe(section.title)}"] if section.title else []
        blocks += ["\n".join(_block(part)) for part in section.parts]
    page = "\n\n".join(blocks) + "\n"
    return plain_ascii(page) if ascii_only else page


def _safe(text: str) -> str:
    """Keep signs of Markdown in ids and sentences from being read as such."""
    return visible(text).translate(BEFORE)


def _block(part: Part) -> Iterator[str]:
    if isinstance(part, Words):
        text = f"**{_safe(part.text)}**" if part.style else _safe(part.text)
        yield f"{part.mark} {text}" if part.mark else text
    elif isinstance(part, Facts):
        yield from (f"- {_safe(label)}: {_safe(value)}" for label, value in part.rows)
    else:
        yield from _table(part)


def _table(table: Table) -> Iterator[str]:
    heads = [f"{column.name}, {column.unit}" if column.unit else column.name for column in table.columns]
    yield _row(heads)
    yield "|" + "|".join(":--" if column.left else "--:" for column in table.columns) + "|"
    yield from map(_row, (*table.rows, *table.foot))
    if table.note:
        yield f"\n{_safe(table.note)}"


def _row(cells: Iterable[str]) -> str:
    return f"| {' | '.join(map(_safe, cells))} |"
