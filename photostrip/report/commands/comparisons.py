"""Comparisons of every kind as a report: with a baseline, with the truth, of whole folders."""

from __future__ import annotations

from photostrip.notes import Document, counted, listed
from photostrip.report.commands.compare import compare_sections, headline
from photostrip.report.commands.compare_truth import truth_headline, truth_sections
from photostrip.report.page.parts import Part, Section, Words
from photostrip.report.page.tables import number, tabulated, words

TRUTH = "photostrip_truth_comparison"
FOLDERS = "photostrip_compare_folders"


def comparison_report(
    document: Document, *, quiet: bool = False, everything: bool = False
) -> tuple[str, tuple[Section, ...]]:
    """Return title and sections of a comparison; with `quiet` the verdict alone."""
    title = "" if quiet else f"Comparison: {document.get('name') or document['result']}"
    if quiet and (TRUTH in document or FOLDERS in document):
        return title, (Section("", (Words(comparison_headline(document)),)),)
    if TRUTH in document:
        return title, truth_sections(document, everything=everything)
    if FOLDERS in document:
        return title, _folders(document, everything=everything)
    return title, compare_sections(document, quiet=quiet, everything=everything)


def comparison_headline(document: Document) -> str:
    """Say the verdict of a comparison in one sentence."""
    if TRUTH in document:
        return truth_headline(document)
    if FOLDERS not in document:
        return headline(document)
    differ = [each["folder"] for each in document["results"] if each["status"] != "same"]
    names = f"{document['result']} and {document['baseline']}"
    if document["status"] == "same":
        return f"SAME: {counted(len(document['results']), 'result')} of {names} agree within the tolerances."
    refused = len({each["folder"] for each in document["refused"]})
    parts = [f"{counted(refused, 'result')} that cannot be compared"] if refused else []
    parts += [f"{counted(len(differ), 'result')} of {len(document['results'])} beyond tolerance"] if differ else []
    parts += [f"no result for {listed(document['missing'])}"] if document["missing"] else []
    parts += [f"no baseline for {listed(document['new'])}"] if document["new"] else []
    return f"{document['status'].upper()}: {names} differ: {'; '.join(parts) or 'nothing is in both'}."


def _folders(document: Document, *, everything: bool) -> tuple[Section, ...]:
    """Return a line for each result, then whatever differs."""
    style = "good" if document["status"] == "same" else "failed"
    columns = [
        words("folder", "folder"),
        words("", "status"),
        number("compared", lambda row: sum(kind["compared"] for kind in row["kinds"])),
        number("beyond", lambda row: len(row["differences"])),
    ]
    head: list[Part] = [Words(comparison_headline(document), style)]
    head += [Words(each["message"], "failed", mark="-") for each in document["refused"]]
    if document["results"]:
        head.append(tabulated(document["results"], columns))
    found = [Section("", tuple(head))]
    for each in document["results"]:
        if each["status"] != "same":
            first, *others = compare_sections(each, everything=everything)
            found += [Section(each["folder"], first.parts), *others]
    return tuple(found)
