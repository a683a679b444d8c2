"""The report as one HTML file: the sections of the text report and pictures, nothing loaded from elsewhere.

Looks stand in ``templates/report.html`` and ``templates/report.css``.
"""

from __future__ import annotations

import re
from importlib import resources
from importlib.util import find_spec
from typing import TYPE_CHECKING

from photostrip.errors import Fault, InputError
from photostrip.report.commands.methods import methods_sections
from photostrip.report.page.parts import Document, Facts, Part, Section, Table, Words
from photostrip.report.pictures.strip import strip_pictures
from photostrip.report.sections.document import sections_of, title_of
from photostrip.visible import visible

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from photostrip.report.pictures.svg import Picture

INSTALL = "pip install 'photostrip[report]'"


def check_html(key: str = "--html") -> None:
    """Refuse HTML without jinja2, before anything is computed."""
    try:
        found = find_spec("jinja2") is not None
    except ValueError:  # put out of action: sys.modules["jinja2"] is None
        found = False
    if not found:
        message = "a report as HTML needs jinja2, which is not installed"
        raise InputError(Fault(message, "extra", key=key, fix=INSTALL))


def to_html(document: Document, *, everything: bool = False) -> str:
    """Return the report of a result as one HTML file: style and pictures are in it, no script, no link to elsewhere."""
    sections = sections_of(document, everything=everything)
    return _page(title_of(document), document["version"], sections, strip_pictures(document))


def methods_html(document: Document) -> str:
    return _page(f"Methods: {document['name']}", document["version"], methods_sections(document), [])


def _page(title: str, version: str, sections: Iterable[Section], drawn: Iterable[Picture]) -> str:
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    folder = resources.files("photostrip.report") / "templates"
    environment = Environment(autoescape=True, undefined=StrictUndefined, keep_trailing_newline=True)
    template = environment.from_string((folder / "report.html").read_text(encoding="utf-8"))
    pictures = [each._replace(svg=Markup(each.svg)) for each in drawn]  # noqa: S704 (escaped there)
    page: str = template.render(
        title=title,
        version=version,
        style=Markup((folder / "report.css").read_text(encoding="utf-8").strip()),  # noqa: S704 (ours)
        sections=list(_sections(sections)),
        pictures=pictures,
    )
    return visible(page)


def _sections(sections: Iterable[Section]) -> Iterator[Document]:
    """Return the sections as the template takes them; ids are made from their titles."""
    used = {"pictures"}
    for number, section in enumerate(sections):
        name = re.sub(r"[^a-z0-9]+", "-", section.title.lower()).strip("-") or f"section-{number}"
        while name in used:
            name = f"{name}-{number}"
        used.add(name)
        yield {"id": name, "title": section.title, "parts": list(_parts(section.parts))}


def _parts(parts: Iterable[Part]) -> Iterator[Document]:
    """Give parts as the template takes them; words with a mark that follow each other are one list."""
    waiting: list[Words] = []
    for part in parts:
        if isinstance(part, Words) and part.mark:
            waiting.append(part)
            continue
        yield from _list(waiting)
        waiting = []
        if isinstance(part, Words):
            yield {"kind": "words", "text": part.text, "style": part.style}
        elif isinstance(part, Facts):
            yield {"kind": "facts", "rows": part.rows}
        elif isinstance(part, Table):
            table = {"columns": part.columns, "rows": part.rows, "foot": part.foot, "note": part.note}
            yield {"kind": "table", **table}
    yield from _list(waiting)


def _list(items: list[Words]) -> Iterator[Document]:
    if items:
        tag = "ol" if items[0].mark.strip()[0].isdigit() else "ul"
        yield {"kind": "list", "tag": tag, "items_": [item.text for item in items]}
