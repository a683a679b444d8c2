"""A comparison as findings with a file and a line, and as test cases."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from photostrip.notes import Document
from photostrip.report.commands.compare import NAMES, allowed_words, lacking_words, what
from photostrip.report.page.junit import Case
from photostrip.report.page.messages import EMPTY
from photostrip.report.page.numbers import short, unit

ALONE = {"missing": "there is a baseline and no result", "new": "there is a result and no baseline"}
MOST_ANNOTATIONS = 50  # annotations of one comparison; a server shows no more


def compare_findings(document: Document, lines_of: Callable[[str], Callable[[str, str], int]]) -> list[Document]:
    """Return what differs as findings, worst first, each at the line of the baseline in which the record stands.

    ``lines_of`` gives for a baseline what finds the line of a block and an id, 0 when it is not there. What is too much
    to show is counted in the last finding.
    """
    found = [each for one in document.get("results", [document]) for each in _findings(one, lines_of(one["baseline"]))]
    found += [
        EMPTY | {key: each[key] for key in ("file", "line", "code", "message")} | {"severity": "error"}
        for each in document.get("refused", ())
    ]
    found += [
        EMPTY | {"severity": "error", "code": "different", "file": folder, "message": why}
        for key, why in ALONE.items()
        for folder in document.get(key, ())
    ]
    if len(found) <= MOST_ANNOTATIONS:
        return found
    rest = f"and {len(found) - MOST_ANNOTATIONS} more differences; photostrip compare --verbose lists them"
    return [*found[:MOST_ANNOTATIONS], _finding(document, 0, rest)]


def _findings(document: Document, line_of: Callable[[str, str], int]) -> Iterator[Document]:
    for each in document["sets"]:
        if each["differs"]:
            for name in ("missing", "new"):
                for row in each[name]:
                    line = line_of(row["block"], "id")
                    yield _finding(document, line, f"{NAMES[each['kind']]}: {row['what']} is {name}")
    for row in document["lacking"]:
        if row["differs"]:
            yield _finding(document, line_of(row["block"], ""), lacking_words(document, row))
    for row in document["differences"]:
        yield _finding(document, line_of(row["block"], row["name"].partition(".")[0]), sentence(row))


def _finding(document: Document, line: int, message: str) -> Document:
    place = {"file": document["baseline"], "line": line}
    return EMPTY | place | {"severity": "error", "code": "different", "message": message}


def sentence(row: Document) -> str:
    """Say in a sentence how a number differs."""
    name = unit(row["unit"])
    quantity = what(row)
    if row["difference"] is None:
        before, now = (short(row[key], 9) if row[key] is not None else "nothing" for key in ("before", "now"))
        return f"{quantity}: {now} instead of {before}"
    size = f"differs by {short(row['difference'], 3)} {name}".rstrip()
    allowed = f"allowed {short(row['allowed'], 3)} {name}".rstrip()
    values = "" if row["before"] is None else f" ({short(row['before'], 9)} before, {short(row['now'], 9)} now)"
    return f"{quantity} {size}, {allowed}{values}"


def compare_cases(document: Document) -> Iterator[Case]:
    """Return a comparison as test cases: one for each kind of quantity and each set, of every result in folders."""
    if "results" in document:
        for one in document["results"]:
            yield from (case._replace(name=f"{one['folder']}: {case.name}") for case in compare_cases(one))
        yield from (Case(each["folder"], error=each["message"]) for each in document["refused"])
        yield from (Case(folder, error=why) for key, why in ALONE.items() for folder in document[key])
        return
    for kind in document["kinds"]:
        name = NAMES[kind["kind"]]
        if kind["ignored"]:
            yield Case(name, skipped="not compared")
            continue
        rows = [sentence(row) for row in document["differences"] if row["kind"] == kind["kind"]]
        gone = [row for row in document["lacking"] if row["kind"] == kind["kind"] and row["differs"]]
        parts = [f"{kind['different']} of {kind['compared']} beyond {allowed_words(kind)}"] if kind["different"] else []
        parts += [f"the result lacks {sum(row['numbers'] for row in gone)}"] if gone else []
        rows += [lacking_words(document, row) for row in gone]
        yield Case(name, "; ".join(parts), "\n".join(rows)) if parts else Case(name)
    for each in document["sets"]:
        name = NAMES[each["kind"]]
        if each["ignored"]:
            yield Case(name, skipped="not compared")
            continue
        rows = [f"{key}: {row['what']}" for key in ("missing", "new") for row in each[key]]
        message = f"{len(each['missing'])} missing, {len(each['new'])} new"
        yield Case(name, message, "\n".join(rows)) if each["differs"] else Case(name)
