"""The summary of a batch as sections and tables: every project on a line, then what is wrong with which."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from urllib.parse import quote

from photostrip.notes import Document, counted
from photostrip.report.page.messages import Case, to_junit
from photostrip.report.page.parts import Section, Table, Words
from photostrip.report.page.tables import Field, fields, metres, tabulated

COLUMNS = (
    Field("project"),
    Field("status"),
    Field("photos", "count", rank=1),
    *fields("points rejected", "count", rank=2),
    Field("sigma0_um", "µm 1", "σ0", rank=1),
    Field("rms_at", head="at", rank=1),
    Field("rms_plan_m", "m 3", "plan"),
    Field("rms_height_m", "m 3", "height"),
)
MOST_ROWS = 60  # projects that are shown; more stand in summary.csv
MESSAGES = 3  # of one project that are shown
# How bad each status is, and the style in which it is shown.
ORDER = (
    "crashed", "timeout", "memory", "weak", "faulty", "unwritten", "failed", "not run", "look", "unverified", "good"
)  # fmt: skip
STYLES = {"good": "good", "unverified": "look", "look": "look", "not run": "look"}


def batch_sections(outcomes: Sequence[Document], *, quiet: bool = False, everything: bool = False) -> list[Section]:
    """Return projects, what is wrong (with everything also what is to be looked at), and last the verdict."""
    sections = [] if quiet else [Section("Projects", (_table(outcomes, everything=everything),))]
    wrong = [each for each in _worst_first(outcomes) if each["exit_code"] or (everything and each["messages"])]
    if wrong:
        sections.append(Section("What is wrong", tuple(_messages(wrong, everything=everything))))
    return [*sections, Section("Verdict" if sections else "", (Words(counts(outcomes), _style(outcomes)),))]


def _worst_first(outcomes: Sequence[Document]) -> list[Document]:
    return sorted(outcomes, key=lambda each: ORDER.index(each["status"]))


def _table(outcomes: Sequence[Document], *, everything: bool) -> Table:
    """Return the table of the projects, on a page with links to their reports; of too many, the worst."""
    shown = outcomes if everything or len(outcomes) <= MOST_ROWS else _worst_first(outcomes)[:MOST_ROWS]
    more = counted(len(outcomes) - len(shown), "more project")
    note = f"{more} not shown, none of them worse: see --verbose or summary.csv" if len(shown) < len(outcomes) else ""
    table = tabulated(COLUMNS, ([each[column.key] for column in COLUMNS] for each in shown), note)
    return replace(
        table, pages=tuple(f"{quote(each['output'])}/report.html" if each["output"] else "" for each in shown)
    )


def _messages(wrong: Sequence[Document], *, everything: bool) -> list[Words]:
    shown = wrong if everything else wrong[:MOST_ROWS]
    found = []
    for each in shown:
        messages = each["messages"] if everything else each["messages"][:MESSAGES]
        found.append(Words(f"{each['project']}: {each['status']}", STYLES.get(each["status"], "failed")))
        found += [Words(message, mark="-") for message in messages]
        if len(each["messages"]) > len(messages):
            found.append(Words(f"and {len(each['messages']) - len(messages)} more", mark="-"))
    if len(wrong) > len(shown):
        found.append(Words(f"and {counted(len(wrong) - len(shown), 'more project')}: --verbose, or summary.json"))
    return found


def counts(outcomes: Sequence[Document]) -> str:
    """Say how many projects ended in which way: ``12 projects: 1 faulty, 11 good``."""
    numbers = {status: sum(each["status"] == status for each in outcomes) for status in ORDER}
    parts = [f"{number} {status}" for status, number in numbers.items() if number]
    return f"{counted(len(outcomes), 'project')}: {', '.join(parts)}"


def _style(outcomes: Sequence[Document]) -> str:
    styles = {STYLES.get(each["status"], "failed") for each in outcomes}
    return next((style for style in ("failed", "look", "good") if style in styles), "")


def outcome_line(outcome: Document) -> str:
    """Say in one line what became of a project: for logs, and above a table that moves."""
    head = f"{outcome['project']}: {outcome['status']}"
    if outcome["rms_at"] is None or outcome["status"] == "failed":
        messages = outcome["messages"]
        more = f" (and {len(messages) - 1} more)" if len(messages) > 1 else ""
        return f"{head}: {messages[0]}{more}" if messages else head
    parts = [
        f"{metres(outcome[f'rms_{part}_m'])} m in {part}"
        for part in ("plan", "height")
        if outcome[f"rms_{part}_m"] is not None
    ]
    return f"{head}, rms {', '.join(parts)} at {outcome['rms_at']} points" if parts else head


def batch_junit(outcomes: Sequence[Document]) -> str:
    """Return the summary as JUnit XML.

    A tolerance that is not kept is a failure; a project without a result is an error.
    """
    return to_junit("photostrip batch", map(_case, outcomes))


def _case(outcome: Document) -> Case:
    name, status = outcome["project"], outcome["status"]
    if status == "not run":
        return Case(name, skipped=status)
    if not outcome["exit_code"]:
        return Case(name)
    message, details = outcome["messages"][0], "\n".join(outcome["messages"])
    return (
        Case(name, message, details)
        if status in {"failed", "look", "unverified"}
        else Case(name, details=details, error=message)
    )
