"""Test results as JUnit XML, which CI servers show as a table of passed and failed cases."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import NamedTuple
from xml.sax.saxutils import escape, quoteattr

from photostrip.visible import visible

FORBIDDEN = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")  # what XML 1.0 cannot hold


class Case(NamedTuple):
    name: str
    failure: str = ""  # why it failed, in one line; empty when it passed
    details: str = ""
    skipped: str = ""  # why it was not tested; empty when it was
    error: str = ""  # why it could not be tested, in one line; empty when it could


def to_junit(suite: str, cases: Iterable[Case]) -> str:
    """Return a suite of test cases as JUnit XML, without times."""
    given = list(cases)
    failed = sum(bool(case.failure) for case in given)
    skipped = sum(bool(case.skipped) for case in given)
    errors = sum(bool(case.error) for case in given)
    counts = f'tests="{len(given)}" failures="{failed}" errors="{errors}" skipped="{skipped}"'
    body = "".join(_case(suite, case) for case in given)
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
