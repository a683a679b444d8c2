"""What ``photostrip verify`` found: the files, the versions, the numbers."""

from __future__ import annotations

from photostrip.notes import Document, counted, listed
from photostrip.report.commands.compare import NAMES, compare_sections
from photostrip.report.page.parts import DASH, Facts, Part, Section, Words

DIFFERENT = "different"


def verification_report(document: Document, *, quiet: bool = False) -> tuple[str, tuple[Section, ...]]:
    """Return title and sections; with `quiet` the verdict alone."""
    verdict = Words(verification_headline(document), "failed" if document["status"] == DIFFERENT else "good")
    if quiet:
        return "", (Section("", (verdict,)),)
    hashes = document["result_sha256"]
    facts = Facts(
        (
            ("Result", document["result"]),
            ("Project", document["project"]),
            ("Hash then", hashes["certificate"]),
            ("Hash now", hashes["now"] or DASH),
        )
    )
    parts: list[Part] = [verdict, facts, *(Words(text, mark="-") for text in _remarks(document))]
    found = [Section("Verification", tuple(parts))]
    if document["numbers"] is not None and document["numbers"]["status"] == DIFFERENT:
        found += compare_sections(document["numbers"])
    return f"Verification: {document['name']}", tuple(found)


def verification_headline(document: Document) -> str:
    """Say in one sentence whether the result came out again."""
    if document["status"] != DIFFERENT:
        files = len(document["inputs"]) + len(document["grids"])
        return f"SAME: made again from {counted(files, 'file')}, the result is what its certificate says."
    return f"DIFFERENT: {'; '.join(_differences(document))}."


def _differences(document: Document) -> list[str]:
    found = ["the numbers of the result are not those of its certificate: it was edited"] if document["edited"] else []
    for state in ("changed", "missing", "not read", "not in the certificate"):
        names = [each["file"] for each in (*document["inputs"], *document["grids"]) if each["state"] == state]
        found += [f"{state}: {listed(names)}"] if names else []
    if document["refused"]:
        found.append(f"the project cannot be adjusted any more: {document['refused']}")
    elif document["numbers"]["status"] == DIFFERENT:
        numbers = document["numbers"]
        parts = [counted(len(numbers["differences"]), "number")] if numbers["differences"] else []
        parts += [NAMES[each["kind"]] for each in numbers["sets"] if each["differs"]]
        found.append(f"the result made again differs in {listed(parts)}")
    elif document["words"]:
        found.append(f"the result made again differs in {listed(document['words'])}")
    return found


def _remarks(document: Document) -> list[str]:
    return [
        f"{each['name']} is {each['now'] or 'not used'}, it was {each['certificate'] or 'not used'}"
        for each in document["versions"]
    ]
