"""Whether a result can be used, in a sentence; what to look at; the tolerances."""

from __future__ import annotations

from functools import partial

from photostrip.notes import LOST_SAY, Document, counted
from photostrip.report.page.numbers import fixed, short, unit
from photostrip.report.page.parts import Part, Section, Words
from photostrip.report.page.tables import number, tabulated, words
from photostrip.report.sections.findings import names_of
from photostrip.report.sections.strip import elsewhere

HEADLINES = {
    "good": "GOOD: nothing calls for a second look.",
    "unverified": "UNVERIFIED: nothing calls for a second look, but {unverified}.",
    "look": "LOOK at {number} before you use this.",
    "failed": "FAILED: {failed}.",
}
LOOK_SHOWN = 10
MOST_NAMED = 8  # by one thing to look at: a page leads to their rows


def headline(document: Document) -> str:
    """Say in one sentence whether the result can be used."""
    tolerances = document["tolerances"]
    failed = sum(not each["passed"] for each in tolerances)
    number = counted(len(document["verdict"]["look_at"]), "thing")
    reasons = [f"{failed} of {counted(len(tolerances), 'tolerance')} not kept"] if failed else []
    wrong = sum(each["severity"] == "error" and not each["accepted"] for each in document.get("findings", []))
    if wrong:
        reasons.append(f"the data contradict themselves, {counted(wrong, 'finding')}")
    if not reasons:
        reasons = ["the measurements contradict their stated standard deviations"]
    unverified = document["verdict"].get("verification", "")  # results of older versions have none
    return HEADLINES[document["status"]].format(number=number, failed="; ".join(reasons), unverified=unverified)


def accuracy(document: Document) -> Words:
    """Return the sentence on what is left at the check points, or at the control."""
    verdict = document["verdict"]
    texts = [verdict["accuracy"], *filter(None, [verdict.get("agreement")])]
    if document["status"] != "unverified" and not verdict.get("verified", True):
        texts.append(verdict["verification"])
    return Words(" ".join(f"{text[0].upper()}{text[1:]}." for text in texts))


def verdict_section(document: Document, *, everything: bool = False, most: int = LOOK_SHOWN) -> Section:
    """Whether the result can be used, and what to look at: what was given and lost its say always."""
    look_at = document["verdict"]["look_at"]
    lost = _lost(document)
    shown = [
        (number, text)
        for number, text in enumerate(look_at, 1)
        if everything or number <= most or any(message in text for message in lost)
    ]
    parts: list[Part] = [Words(headline(document), document["status"]), accuracy(document)]
    parts += [Words(text, mark=f"{number}.", names=_named(document, text)) for number, text in shown]
    if len(look_at) > len(shown):
        parts.append(Words(elsewhere(len(look_at) - len(shown), "things", "verdict", "verdict")))
    if document["tolerances"]:
        parts.append(tabulated(document["tolerances"], TOLERANCES))
    return Section("Verdict", tuple(parts))


def _lost(document: Document) -> list[str]:
    """Return what notes and findings say of given points that lost their say."""
    without = {row["id"] for row in document["control"] if row.get("rejected") or not row["measured"]}
    findings = (each for each in document.get("findings", []) if not without.isdisjoint(each["points"]))
    return [each["message"] for each in (*(n for n in document["notes"] if n["code"] in LOST_SAY), *findings)]


def _named(document: Document, text: str) -> tuple[tuple[str, str], ...]:
    """Return what a note names, and the given points that stand out; findings have links of their own."""
    found = [name for each in document["notes"] if each["message"] in text for name in names_of(each)]
    found += [("point", row["id"]) for row in document["control"] if row["stands_out"] and f" {row['id']} (" in text]
    return tuple(found[:MOST_NAMED])


TOLERANCES = (
    words("tolerance", "name"),
    number("found", lambda each: fixed(each["value"], 2 if each["unit"] == "um" else 4)),
    number("allowed", "limit", partial(short, digits=6)),
    words("", lambda each: unit(each["unit"])),
    words("", lambda each: "kept" if each["passed"] else "NOT KEPT"),
)
