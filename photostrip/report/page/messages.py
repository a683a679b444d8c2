"""Faults, findings and notes as they are reported: lines, JSON for programs, annotations, test cases.

Whatever the form, the same findings come out with the same file, line, column, key and code.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import NamedTuple
from xml.sax.saxutils import escape, quoteattr

from photostrip.errors import Fault, GeometryError, InputError
from photostrip.notes import Document, Finding, Note
from photostrip.visible import visible

LEVELS = {"error": "error", "warning": "warning", "note": "notice"}  # ours, and those of GitHub
SCHEMA = 1
ACCEPTED = "accepted: "
EMPTY: Document = {
    "file": "", "line": 0, "column": 0, "key": "", "expected": "", "fix": "", "photos": [], "points": []
}  # fmt: skip
MOST_OF_A_KIND = 5  # faults, findings, or notes, of one kind that are told to people
FORBIDDEN = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")  # what XML 1.0 cannot hold
# causes in the data, and the failures in which they end: control or images misread, control of other points
ENDS = (
    ({"P103", "P401", "P402", "P403", "P405"}, {"left-handed-control", "left-handed-models", "strip-not-tied",
                                                "control-deficient", "bundle-diverged"}),
    ({"P409"}, {"control-of-other-points", "bundle-diverged"}),
)  # fmt: skip
NUMBER = re.compile(r"\d+")  # in the path of a key: which of a list it is


def finding_of(source: Fault | Note | Finding) -> Document:
    """Return a fault, a note or a finding as plain values; 0 and empty texts where nothing is known.

    A finding that the project accepts is no error and needs no cure.
    """
    own = {key: list(value) if isinstance(value, tuple) else value for key, value in vars(source).items()}
    own.pop("strip", None)  # of a note: its message names it
    found: Document = {"severity": "error", "code": "", "message": "", **EMPTY, **own}
    if isinstance(source, Finding):
        found["evidence"] = dict(source.evidence)
        if source.accepted:
            found |= {"severity": "note", "message": f"{ACCEPTED}{source.message}", "fix": ""}
    return found


def findings_of(error: InputError | GeometryError) -> list[Document]:
    """Return what an error carries as plain values: its causes in the data, the failure, and what else they show.

    Nothing is told twice: not the failure that such a cause always ends in, nor one that repeats the words of a cause.
    """
    causes = [finding_of(each) for each in error.findings if each.is_error]
    others = [finding_of(each) for each in error.findings if not each.is_error]
    if isinstance(error, InputError):
        failures = [finding_of(fault) for fault in error.faults]
    else:
        named = {"photos": list(error.photos), "points": list(error.points)}
        failures = [finding_of(Fault(str(error), error.code)) | named]
    explained = [code for kinds, ends in ENDS if any(cause["code"] in kinds for cause in causes) for code in ends]
    failures = [each for each in failures if each["code"] not in explained]
    for cause in causes:
        repeated = [each for each in failures if each["message"].startswith(cause["message"])]
        failures = [each for each in failures if each not in repeated]
        cause["message"] = repeated[0]["message"] if repeated else cause["message"]
    return [*causes, *failures, *others]


def result_findings(document: Document) -> list[Document]:
    """Return tolerances that are not kept, as errors, then the findings and notes of a result."""
    found = [
        {
            **EMPTY,
            "severity": "error",
            "code": "tolerance",
            "key": f"tolerances.{each['name']}",
            "message": f"{each['name']} is {each['value']} {each['unit']}, the limit is {each['limit']} {each['unit']}",
        }
        for each in document["tolerances"]
        if not each["passed"]
    ]
    for each in document.get("findings", []):
        as_note = {"severity": "note", "message": ACCEPTED + each["message"], "fix": ""}
        found.append(EMPTY | each | (as_note if each["accepted"] else {}))
    return found + [EMPTY | note for note in document["notes"]]


def as_document(findings: Sequence[Document], exit_code: int) -> Document:
    """Return the answer with ``--format json`` of a command that came to no result."""
    return {"photostrip_error": SCHEMA, "exit_code": exit_code, "findings": list(findings)}


def line_of(finding: Document) -> str:
    """Return a finding on one line: ``error: file:line:column: key: what; expected ...; what would fix it``."""
    names = ("message", "code", "file", "line", "column", "key", "expected", "fix")
    values = {name: finding[name] for name in names}
    if "evidence" in finding:  # the codes of the gate are for people, too: they can be accepted
        values["message"] = f"{finding['code']} {finding['message']}"
    return visible(f"{finding['severity']}: {Fault(**values)}")


def lines_of(findings: Sequence[Document]) -> list[str]:
    """Return findings one a line; of many of one kind five, and how many more there are."""
    count = Counter(_kind(each) for each in findings)
    told: Counter[tuple[str, ...]] = Counter()
    lines = []
    for each in findings:
        kind = _kind(each)
        told[kind] += 1
        if told[kind] <= MOST_OF_A_KIND:
            lines.append(line_of(each))
        elif told[kind] == count[kind]:
            more = count[kind] - MOST_OF_A_KIND
            place = f"{each['file']}: " if kind[2:] and each["file"] else ""
            lines.append(visible(f"{kind[0]}: {place}{kind[1]} {more} more of this kind; --format json names all"))
    return lines


def _kind(finding: Document) -> tuple[str, ...]:
    """Return what findings share that are told together: faults the column of a table, or the key of a list."""
    kind = finding["severity"], finding["code"]
    if finding["severity"] != "error" or "evidence" in finding:
        return kind
    return *kind, finding["file"], NUMBER.sub("", finding["key"])


def annotated(findings: Iterable[Document]) -> str:
    """Return findings as annotations of GitHub Actions: ``::error file=...,line=...,title=...::what is wrong``."""
    return "".join(f"{visible(_annotation(each))}\n" for each in findings)


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


class Case(NamedTuple):
    name: str
    failure: str = ""  # why it failed, in one line; empty when it passed
    details: str = ""
    skipped: str = ""  # why it was not tested; empty when it was
    error: str = ""  # why it could not be tested, in one line; empty when it could


def to_junit(suite: str, cases: Iterable[Case]) -> str:
    """Return a suite of test cases as JUnit XML, without times."""
    listed = list(cases)
    failed, errors, skipped = (
        sum(bool(getattr(each, key)) for each in listed) for key in ("failure", "error", "skipped")
    )
    counts = f'tests="{len(listed)}" failures="{failed}" errors="{errors}" skipped="{skipped}"'
    body = "".join(_case(suite, case) for case in listed)
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f"<testsuites {counts}>\n"
        f"  <testsuite name={_quoted(suite)} {counts}>\n{body}  </testsuite>\n</testsuites>\n"
    )


def _case(suite: str, case: Case) -> str:
    head = f"    <testcase classname={_quoted(suite)} name={_quoted(case.name)}"
    kind, message = ("error", case.error) if case.error else ("failure", case.failure)
    if message:
        details = escape(_clean(case.details or message))
        return f"{head}>\n      <{kind} message={_quoted(message)}>{details}</{kind}>\n    </testcase>\n"
    if case.skipped:
        return f"{head}>\n      <skipped message={_quoted(case.skipped)}/>\n    </testcase>\n"
    return f"{head}/>\n"


def _quoted(text: str) -> str:
    return quoteattr(_clean(text))


def _clean(text: str) -> str:
    return FORBIDDEN.sub("?", visible(text))
