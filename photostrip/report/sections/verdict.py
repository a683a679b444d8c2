"""Whether a result can be used, in a sentence; what to look at; the tolerances."""

from __future__ import annotations

from functools import partial

from photostrip.notes import counted
from photostrip.report.page.numbers import fixed, short, unit
from photostrip.report.page.parts import Document, Part, Section, Words
from photostrip.report.page.tables import number, tabulated, words
from photostrip.report.sections.strip import elsewhere

HEADLINES = {
    "good": "GOOD: nothing calls for a second look.",
    "unverified": "UNVERIFIED: nothing calls for a second look, but {unverified}.",
    "look": "LOOK at {number} before you use this.",
    "failed": "FAILED: {failed}.",
}
LOOK_SHOWN = 10


def headline(document: Document) -> str:
    """Say in one sentence whether the result can be used."""
    tolerances = document["tolerances"]
    failed = sum(not each["passed"] for each in tolerances)
    number = counted(len(document["verdict"]["look_at"]), "thing")
    reasons = [f"{failed} of {counted(len(tolerances), 'tolerance')} not kept"] if failed else []
    wrong = sum(each["severity"] == "error" and not each["accepted"] for each in document.get("findings", []))
    if wrong:
        reasons.append(f"the data contradict themselves, {counted(wrong, 'finding')}")
    unverified = document["verdict"].get("verification", "")  # results of older versions have none
    return HEADLINES[document["status"]].format(number=number, failed="; ".join(reasons), unverified=unverified)


def accuracy(document: Document) -> Words:
    """Return the sentence on what is left at the check points, or at the control."""
    verdict = document["verdict"]
    texts = [verdict["accuracy"]]
    if document["status"] != "unverified" and not verdict.get("verified", True):
        texts.append(verdict["verification"])
    return Words(" ".join(f"{text[0].upper()}{text[1:]}." for text in texts))


def verdict_section(document: Document, *, everything: bool = False, most: int = LOOK_SHOWN) -> Section:
    """Whether the result can be used, and what to look at."""
    look_at = document["verdict"]["look_at"]
    shown = look_at if everything else look_at[:most]
    parts: list[Part] = [Words(headline(document), document["status"]), accuracy(document)]
    parts += [Words(text, "", f"{number}.") for number, text in enumerate(shown, 1)]
    if len(look_at) > len(shown):
        parts.append(Words(elsewhere(len(look_at) - len(shown), "things", "verdict", "verdict")))
    if document["tolerances"]:
        parts.append(tabulated(document["tolerances"], TOLERANCES))
    return Section("Verdict", tuple(parts))


TOLERANCES = (
    words("tolerance", "name"),
    number("found", lambda each: fixed(each["value"], 2 if each["unit"] == "um" else 4)),
    number("allowed", "limit", partial(short, digits=6)),
    words("", lambda each: unit(each["unit"])),
    words("", lambda each: "kept" if each["passed"] else "NOT KEPT"),
)
