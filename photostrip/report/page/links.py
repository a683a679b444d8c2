"""Links of a page: from a finding to the rows and pictures of what it names, and back."""

from __future__ import annotations

from collections.abc import Iterator

from photostrip.notes import Document

Name = tuple[str, str]  # what it is, and its id

MOST_LINKS = 8  # rows, and pictures, to which one finding leads
BETWEEN = " – "  # of the photos of a pair
KINDS = {"point": "point", "photo": "photo", "photos": "photo"}  # heads of first columns


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
        whole = [item for items in findings.values() for item in items] if section["id"] == "pictures" else led
        for picture in section["pictures"]:
            for item in whole:
                if item["number"] not in picture["findings"]:
                    picture["findings"].append(item["number"])
                    _lead(item["pictures"], f"picture-{picture['name']}", picture["title"])


def _lead(links: list[Document], to: str, words: str) -> None:
    if len(links) < MOST_LINKS:
        links.append({"id": to, "words": words})


def _rows(section: Document) -> Iterator[tuple[Document, Name]]:
    """Give the rows of a section with what each is about; a pair is about both of its photos."""
    for part in section["parts"]:
        if part["kind"] == "table" and (kind := KINDS.get(part["columns"][0].name)):
            for row in part["rows"]:
                for name in row["cells"][0].split(BETWEEN):
                    yield row, (kind, name)
