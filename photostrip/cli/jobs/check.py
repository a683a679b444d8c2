"""How ``photostrip check`` prints what it found."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from typing import Any

from photostrip import __version__
from photostrip.cli.stdout import Format, ascii_only, print_sections
from photostrip.project.check import Checked
from photostrip.report.commands.check import check_sections, verdict
from photostrip.report.page import messages
from photostrip.report.page.layout import to_markdown
from photostrip.visible import visible, visible_json

SCHEMA = 1


def print_checked(found: Sequence[Checked], form: Format, width: int | None, *, quiet: bool, verbose: bool) -> None:
    """Print what was found in some projects, in the order in which the user named them."""
    if form == "json":
        text = json.dumps(document_of(found), ensure_ascii=ascii_only(), indent=1)
        sys.stdout.write(f"{visible_json(text)}\n")
    elif form == "github":
        sys.stdout.write(messages.annotated(finding for each in found for finding in findings_of(each)))
    else:
        for number, each in enumerate(found):
            if number and not quiet:
                sys.stdout.write("\n")
            _print_one(each, form, width, quiet=quiet, verbose=verbose)
        if len(found) > 1:
            faulty = sum(bool(each.wrong) for each in found)
            sys.stdout.write(f"\n{len(found)} projects: {len(found) - faulty} OK, {faulty} faulty\n")


def findings_of(checked: Checked) -> list[dict[str, Any]]:
    """Give faults, findings and notes as plain values."""
    return [messages.finding_of(each) for each in checked.everything]


def document_of(found: Sequence[Checked]) -> dict[str, Any]:
    """Return all that was found as plain values: the content of ``--format json``."""
    projects = [
        {
            "project": each.path,
            "status": "faulty" if each.wrong else "ok",
            "findings": findings_of(each),
            **each.document,
        }
        for each in found
    ]
    return {"photostrip_check": SCHEMA, "version": __version__, "projects": projects}


def _print_one(checked: Checked, form: Format, width: int | None, *, quiet: bool, verbose: bool) -> None:
    findings = findings_of(checked)
    head = verdict(checked.path, checked.wrong, checked.remarks)
    lines = messages.lines_of(findings)
    sections = () if quiet or not checked.document else check_sections(checked.document, everything=verbose)
    if form == "md":
        marked = "".join(f"- {line}\n" for line in lines)
        page = to_markdown("", sections) if sections else ""
        sys.stdout.write(visible(f"# {head}\n\n{marked}\n{page}"))
        return
    # not wrapped: an editor or grep finds `file:line:column:` at the beginning of a line
    sys.stdout.write(visible("".join(f"{line}\n" for line in (head, *lines))))
    if sections:
        sys.stdout.write("\n")
        print_sections("", sections, width, markdown=False)
