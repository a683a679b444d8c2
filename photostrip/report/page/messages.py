"""Faults, findings and notes in the three forms in which they are told: lines, JSON for programs, annotations.

Whatever the form, the same findings come out with the same file, line, column, key and code.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from photostrip.errors import Fault, GeometryError, InputError
from photostrip.notes import Finding

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from photostrip.notes import Note

Document = dict[str, Any]

LEVELS = {"error": "error", "warning": "warning", "note": "notice"}  # ours, and those of GitHub
SCHEMA = 1
ACCEPTED = "accepted: "


def finding_of(told: Fault | Note | Finding) -> Document:
    """Return a fault, a note or a finding as plain values.

    Returns
    -------
    dict
        ``severity`` (``error``, ``warning``, ``note``), ``code``, ``file``, ``line``, ``column``, ``key``,
        ``message``, ``expected``, ``fix``, ``photos``, ``points``; 0 and empty texts where nothing is known.
    """
    found: Document = {
        "severity": "error" if isinstance(told, Fault) else told.severity,
        "code": told.code,
        "file": told.file,
        "line": told.line,
        "column": told.column,
        "key": told.key,
        "message": told.message,
    }
    if isinstance(told, Finding):
        return found | _of_finding(told)
    if isinstance(told, Fault):
        return found | {"expected": told.expected, "fix": told.fix, "photos": [], "points": []}
    return found | {"expected": "", "fix": "", "photos": list(told.photos), "points": list(told.points)}


def _of_finding(told: Finding) -> Document:
    """Return what a finding has beside message and place; an accepted one is no error and needs no cure."""
    return {
        "severity": "note" if told.accepted else told.severity,
        "message": f"{ACCEPTED if told.accepted else ''}{told.message}",
        "expected": "",
        "fix": "" if told.accepted else told.fix,
        "photos": list(told.photos),
        "points": list(told.points),
        "strips": list(told.strips),
        "title": told.title,
        "accepted": told.accepted,
        "evidence": dict(told.evidence),
    }


def findings_of(error: InputError | GeometryError) -> list[Document]:
    """Return what an error carries as plain values: the failure, then what the data say against themselves."""
    causes = [finding_of(each) for each in error.findings]
    if isinstance(error, InputError):
        return [finding_of(fault) for fault in error.faults] + causes
    found = finding_of(Fault(str(error), error.code))
    return [found | {"photos": list(error.photos), "points": list(error.points)}, *causes]


def result_findings(document: Document) -> list[Document]:
    """Return the verdict and the notes of a result as findings.

    Returns
    -------
    list of dict
        Tolerances that are not kept are errors; the rest are warnings and notes.
    """
    empty = {"file": "", "line": 0, "column": 0, "key": "", "expected": "", "fix": "", "photos": [], "points": []}
    found = [
        {
            **empty,
            "severity": "error",
            "code": "tolerance",
            "key": f"tolerances.{each['name']}",
            "message": f"{each['name']} is {each['value']} {each['unit']}, allowed are {each['limit']} {each['unit']}",
        }
        for each in document["tolerances"]
        if not each["passed"]
    ]
    return (
        found
        + [_told(empty, each) for each in document.get("findings", [])]
        + [empty | note for note in document["notes"]]
    )


def _told(empty: Document, finding: Document) -> Document:
    """Return a finding of a result's document in the form of the others."""
    if not finding["accepted"]:
        return empty | finding
    return empty | finding | {"severity": "note", "message": ACCEPTED + finding["message"], "fix": ""}


def as_document(findings: Sequence[Document], exit_code: int) -> Document:
    """Return the answer of a command that came to no result.

    Returns
    -------
    dict
        The content of what is printed with ``--format json``.
    """
    return {"photostrip_error": SCHEMA, "exit_code": exit_code, "findings": list(findings)}


def line_of(finding: Document) -> str:
    """Return a finding on one line: ``error: file:line:column: key: what; expected ...; what would fix it``."""
    names = ("message", "code", "file", "line", "column", "key", "expected", "fix")
    told = {name: finding[name] for name in names}
    if "evidence" in finding:  # the codes of the gate are for people, too: they can be accepted
        told["message"] = f"{finding['code']} {finding['message']}"
    return f"{finding['severity']}: {Fault(**told)}"


def annotated(findings: Iterable[Document]) -> str:
    """Give findings as annotations of GitHub Actions.

    Returns
    -------
    str
        One workflow command a line: ``::error file=...,line=...,col=...,title=...::what is wrong``.
    """
    return "".join(f"{_annotation(each)}\n" for each in findings)


def _annotation(finding: Document) -> str:
    places = {
        "file": finding["file"],
        "line": finding["line"] or "",
        "col": (finding["column"] or "") if finding["line"] else "",
        "title": f"photostrip {finding['code']}",
    }
    if places["file"].startswith("--"):  # the command line is no file
        places["file"] = ""
    properties = ",".join(f"{name}={_escaped(str(value), ':,')}" for name, value in places.items() if value)
    parts = [finding["message"]]
    if finding["expected"]:
        parts.append(f"expected {finding['expected']}")
    if finding["fix"]:
        parts.append(finding["fix"])
    key = f"{finding['key']}: " if finding["key"] else ""
    return f"::{LEVELS[finding['severity']]} {properties}::{_escaped(key + '; '.join(parts))}"


def _escaped(text: str, more: str = "") -> str:
    """Write what would end a workflow command, or one of its properties, as its code."""
    for sign in f"%\r\n{more}":
        text = text.replace(sign, f"%{ord(sign):02X}")
    return text
