"""Faults and notes in the three forms in which they are told: lines for people, JSON for programs, annotations.

Whatever the form, the same findings come out with the same file, line, column, key and code.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from photostrip.errors import Fault, GeometryError, InputError

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from photostrip.notes import Note

Document = dict[str, Any]

LEVELS = {"error": "error", "warning": "warning", "note": "notice"}  # ours, and those of GitHub
SCHEMA = 1


def finding_of(told: Fault | Note) -> Document:
    """Give a fault or a note as plain values.

    Parameters
    ----------
    told : Fault or Note
        What was found.

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
    if isinstance(told, Fault):
        return found | {"expected": told.expected, "fix": told.fix, "photos": [], "points": []}
    return found | {"expected": "", "fix": "", "photos": list(told.photos), "points": list(told.points)}


def findings_of(error: InputError | GeometryError) -> list[Document]:
    """Give what an error carries as plain values."""
    if isinstance(error, InputError):
        return [finding_of(fault) for fault in error.faults]
    found = finding_of(Fault(str(error), error.code))
    return [found | {"photos": list(error.photos), "points": list(error.points)}]


def result_findings(document: Document) -> list[Document]:
    """Give the verdict and the notes of a result as findings.

    Parameters
    ----------
    document : dict
        The document of a result.

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
    return found + [empty | note for note in document["notes"]]


def as_document(findings: Sequence[Document], exit_code: int) -> Document:
    """Give the answer of a command that came to no result.

    Parameters
    ----------
    findings : sequence of dict
        What was found.
    exit_code : int
        How the command ends.

    Returns
    -------
    dict
        The content of what is printed with ``--format json``.
    """
    return {"photostrip_error": SCHEMA, "exit_code": exit_code, "findings": list(findings)}


def line_of(finding: Document) -> str:
    """Give a finding on one line: ``error: file:line:column: key: what; expected ...; what would fix it``."""
    names = ("message", "code", "file", "line", "column", "key", "expected", "fix")
    fault = Fault(**{name: finding[name] for name in names})
    return f"{finding['severity']}: {fault}"


def annotated(findings: Iterable[Document]) -> str:
    """Give findings as annotations of GitHub Actions.

    Parameters
    ----------
    findings : iterable of dict
        What was found.

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
