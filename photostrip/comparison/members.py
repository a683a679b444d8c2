"""What of a result is compared as a set: ids, choices, rejected measurements, findings."""

from __future__ import annotations

from collections.abc import Iterator

from photostrip.comparison.quantities import names_of
from photostrip.notes import Document

WORDS = {"photos": "photo", "points": "point", "control": "given point", "strips": "strip", "models": "model"}
Member = tuple[str, str, str]  # block, id, what it is


def members_of(document: Document, kind: str) -> set[Member]:
    """Return the members of one set of a result: ``ids``, ``choices``, ``rejected`` or ``findings``."""
    return set(MEMBERS[kind](document))


def missing_and_new(now: set[Member], before: set[Member]) -> tuple[list[Document], list[Document]]:
    """Return what stands in the baseline only, and what in the result only, in order."""
    return [_plain(each) for each in sorted(before - now)], [_plain(each) for each in sorted(now - before)]


def _plain(member: Member) -> Document:
    block, name, what = member
    return {"block": block, "id": name, "what": what}


def _ids(document: Document) -> Iterator[Member]:
    for block, word in WORDS.items():
        for name in names_of(document[block]):
            yield block, name, f"{word} {name}"


def _choices(document: Document) -> Iterator[Member]:
    """Return what is neither a number nor an id, but decides what the numbers are."""
    yield "status", "", f"status {document['status']}"
    yield "adjustment", "", f"adjustment {document['adjustment']}"
    for block in document.get("polynomials", []):
        yield "polynomials", block["strip"], f"degree {block['degree']} of strip {block['strip']}"
        for axis in "xyz":
            terms = " ".join(document["polynomial_terms"].where(strip=block["strip"], axis=axis)["term"]) or "none"
            yield "polynomials", block["strip"], f"terms of {axis}, strip {block['strip']}: {terms}"
    for row in document["points"]:
        if row["role"] != "new":
            yield "points", row["id"], f"{row['id']} is {row['role']}"
    for row in document["control"]:
        yield "control", row["id"], f"{row['id']} counts as {row['role']} in {row['use']}"
    for each in document["tolerances"]:
        yield "tolerances", each["name"], f"tolerance {each['name']} {'kept' if each['passed'] else 'NOT KEPT'}"


def _rejected(document: Document) -> Iterator[Member]:
    for row in document["rejected"]:
        if not row["readmitted"]:
            photos = " – ".join(photo for photo in (row["photo"], row["other_photo"]) if photo)
            where = f" on {photos}" if photos else ""
            yield "rejected", row["point"], f"{row['point']}{where}, {row['stage'].replace('_', ' ')}"


def _findings(document: Document) -> Iterator[Member]:
    """Return notes by their code and what they are about; their words hold numbers that are compared elsewhere."""
    for note in document["notes"]:
        about = [f"strip {note['strip']}"] if note["strip"] else []
        about += [f"photo {photo}" for photo in note["photos"]] + [f"point {point}" for point in note["points"]]
        yield "notes", note["code"], f"{note['severity']} {note['code']}{': ' if about else ''}{', '.join(about)}"
    for each in document.get("findings", []):
        about = [f"{one} {name}" for one in ("strip", "photo", "point") for name in each[f"{one}s"]]
        words = f"{each['severity']} {each['code']}, {each['title']}{': ' if about else ''}{', '.join(about)}"
        yield "findings", each["code"], words
    for row in document["not_determined"]:
        yield "not_determined", row["id"], f"point {row['id']} has no coordinates"


MEMBERS = {"ids": _ids, "choices": _choices, "rejected": _rejected, "findings": _findings}
