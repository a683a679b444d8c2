"""The report as one HTML file: the sections of the text report and pictures, nothing loaded from elsewhere.

Looks stand in ``templates``: ``report.html``, ``report.css``, ``pictures.css``; ``report.js`` sorts and filters tables.
Each picture stands in the section it belongs to, those of the ground in one of their own before the others.
"""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Iterable, Iterator, Sequence
from hashlib import sha256
from importlib import resources
from itertools import groupby
from operator import itemgetter

from photostrip.notes import Document
from photostrip.report.commands.batch import batch_sections
from photostrip.report.page.parts import Part, Section, Table, Words
from photostrip.report.page.tables import BETWEEN
from photostrip.report.pictures.commands import batch_maps
from photostrip.report.pictures.result import SECTIONS, pictures_of
from photostrip.report.pictures.svg import Picture
from photostrip.report.sections.accuracy_report import named_sections, title_of
from photostrip.visible import visible

FOREMOST = "verdict", "findings", "check"  # sections before the pictures
Name = tuple[str, str]  # what it is, and its id

MOST_LINKS = 2  # rows, and pictures, to which one finding leads: one line of them
OF_GROUND = {"plan": "", "footprints": "photo", "ties": "photo"}  # what pictures show of findings; "": all
KINDS = {"point": "point", "photo": "photo", "photos": "photo"}  # heads of first columns


def to_html(document: Document) -> str:
    """Return the report of a result as one HTML file: style, pictures and script are in it, no link to elsewhere."""
    named = list(named_sections(document))
    return _page(title_of(document), document["version"], _sections(named, pictures_of(document)))


def batch_html(outcomes: Sequence[Document], version: str) -> str:
    """Return the summary of a batch as a page that leads to the reports."""
    *others, verdict = batch_sections(outcomes, everything=True)
    named = [("verdict", verdict), *(("", section) for section in others)]
    return _page("Batch", version, _sections(named, batch_maps(outcomes)))


def sections_html(title: str, version: str, sections: Iterable[Section], pictures: Sequence[Picture] = ()) -> str:
    """Return sections as a page; pictures stand behind those that have no title."""
    named = [("" if section.title else FOREMOST[0], section) for section in sections]
    return _page(title, version, _sections(named, pictures))


def _page(title: str, version: str, sections: list[Document]) -> str:
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup, escape

    folder = resources.files("photostrip.report") / "templates"

    def template(name: str) -> str:
        return (folder / name).read_text(encoding="utf-8")

    def code(text: str) -> Markup:
        """Mark up what stands between backticks: keys of a project, options."""
        return Markup(re.sub(r"`([^`\n]+)`", r"<code>\1</code>", str(escape(text))))  # noqa: S704 (escaped before)

    environment = Environment(autoescape=True, undefined=StrictUndefined, keep_trailing_newline=True)
    environment.filters["code"] = code
    script = template("report.js").strip()
    digest = sha256(f"\n{script}\n".encode()).digest()
    page: str = environment.from_string(template("report.html")).render(
        title=title,
        version=version,
        style=Markup(f"{template('report.css').strip()}\n{template('pictures.css').strip()}"),  # noqa: S704 (ours)
        script=Markup(script),  # noqa: S704 (ours)
        script_hash=f"sha256-{b64encode(digest).decode()}",
        sections=sections,
    )
    return visible(page)


def _sections(named: Iterable[tuple[str, Section]], pictures: Sequence[Picture]) -> list[Document]:
    """Return the sections as the template takes them; ids are made from their titles."""
    found: list[Document] = []
    used: set[str] = set()
    for number, (name, section) in enumerate(named):
        identity = re.sub(r"[^a-z0-9]+", "-", section.title.lower()).strip("-") or f"section-{number}"
        while identity in used:
            identity = f"{identity}-{number}"
        used.add(identity)
        drawn = {"title": section.title, "parts": list(_parts(section.parts)), "pictures": [], "further": []}
        found.append({"name": name, "id": identity, **drawn})
    _place(found, pictures)
    link(found)
    return found


def _place(sections: list[Document], pictures: Sequence[Picture]) -> None:
    """Give each picture to its section, the last one of that name; others get a section of their own."""
    from markupsafe import Markup

    of_name = {section["name"]: section for section in sections}
    ground: Document = {"name": "", "id": "pictures", "title": "Pictures", "parts": [], "pictures": []}
    for each in pictures:
        names = SECTIONS.get(each.name, "").split()
        section = next((of_name[name] for name in names if name in of_name), ground)
        drawn = each._asdict() | {"svg": Markup(each.svg), "findings": []}  # noqa: S704 (escaped there)
        section["pictures"].append(drawn)
    if pictures:
        first = max((n for n, section in enumerate(sections) if section["name"] in FOREMOST), default=-1)
        sections.insert(first + 1, ground | {"further": [each for each in pictures if each.name in SECTIONS]})


def _parts(parts: Iterable[Part]) -> Iterator[Document]:
    """Give parts as the template takes them; words with a mark that follow each other are one list."""
    for marked, group in groupby(parts, lambda part: isinstance(part, Words) and part.mark != ""):
        if marked:
            yield _list([part for part in group if isinstance(part, Words)])
            continue
        for part in group:
            drawn: Document = {"kind": type(part).__name__.lower(), **vars(part)}
            if isinstance(part, Table):
                pages = part.pages or ("",) * len(part.rows)
                rows = zip(part.rows, pages, strict=True)
                drawn["rows"] = [{"cells": cells, "id": "", "findings": [], "page": page} for cells, page in rows]
            yield drawn


def _list(words: Sequence[Words]) -> Document:
    """Return a list; words marked by a blank go on with the item before them."""
    items: list[Document] = []
    for each in words:
        if each.mark.strip() or not items:
            items.append({"text": each.text, "more": [], "names": each.names, "id": "", "links": [], "pictures": []})
        else:
            items[-1]["more"].append(each.text)
    return {"kind": "list", "tag": "ol" if words[0].mark.strip()[:1].isdigit() else "ul", "items_": items}


def link(sections: list[Document]) -> None:
    """Fill ids and links into the sections as the template takes them.

    A finding is an item of a list that has names; its rows are those of tables whose first cell has one of these.
    """
    findings: dict[Name, list[Document]] = {}
    lists = (part["items_"] for each in sections for part in each["parts"] if part["kind"] == "list")
    for number, item in enumerate((item for items in lists for item in items if item["names"]), 1):
        item.update(id=f"finding-{number}", number=number)
        for name in item["names"]:
            findings.setdefault(name, []).append(item)
    for section in sections:
        led: list[Document] = []  # findings that lead to the section
        for number, (row, name) in enumerate(_rows(section)):
            for item in findings.get(name, []):
                row["id"] = f"{section['id']}-row-{number}"
                if item["number"] not in row["findings"]:
                    row["findings"].append(item["number"])
                    _lead(item["links"], row["id"], f"{row['cells'][0]} in {section['title']}")
                led += [] if item in led else [item]
        for picture in section["pictures"]:
            kind = OF_GROUND.get(picture["name"])
            named = [item for name, items in findings.items() if kind in {"", name[0]} for item in items]
            for item in sorted(led if kind is None else named, key=itemgetter("number")):
                if item["number"] not in picture["findings"]:
                    picture["findings"].append(item["number"])
                    _lead(item["pictures"], f"picture-{picture['name']}", picture["title"])


def _lead(links: list[Document], to: str, words: str) -> None:
    if len(links) < MOST_LINKS and words not in map(itemgetter("words"), links):
        links.append({"id": to, "words": words})


def _rows(section: Document) -> Iterator[tuple[Document, Name]]:
    """Give the rows of a section with what each is about; a pair is about both of its photos."""
    for part in section["parts"]:
        if part["kind"] == "table" and (kind := KINDS.get(part["columns"][0].name)):
            for row in part["rows"]:
                for name in row["cells"][0].split(BETWEEN):
                    yield row, (kind, name)
