"""Whether a result can be used, in a sentence; what to look at; tolerances; what the data say against themselves."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby, islice
from operator import itemgetter

from photostrip.notes import LOST_SAY, Document, before, counted
from photostrip.report.page.messages import MOST_OF_A_KIND
from photostrip.report.page.parts import Part, Words
from photostrip.report.page.tables import elsewhere, keyed

HEADLINES = {
    "good": "GOOD: nothing calls for a second look.",
    "unverified": "UNVERIFIED: nothing calls for a second look, but {unverified}.",
    "look": "LOOK at {number} before you use this.",
    "failed": "FAILED: {failed}.",
}
MOST_NAMED = 8  # by one thing to look at: a page leads to their rows


def headline(document: Document) -> str:
    """Say in one sentence whether the result can be used."""
    tolerances = document["tolerances"]
    failed = sum(not passed for passed in tolerances.values("passed"))
    number = counted(len(document["verdict"]["look_at"]), "thing")
    reasons = [f"{failed} of {counted(len(tolerances), 'tolerance')} not kept"] if failed else []
    wrong = sum(each["severity"] == "error" and not each["accepted"] for each in document.get("findings", []))
    if wrong:
        reasons.append(f"the data contradict themselves, {counted(wrong, 'finding')}")
    reasons = reasons or ["the measurements contradict their stated standard deviations"]
    unverified = document["verdict"].get("verification", "")  # results of older versions have none
    return HEADLINES[document["status"]].format(number=number, failed="; ".join(reasons), unverified=unverified)


def accuracy(document: Document) -> Words:
    """Return the sentence on what is left at the check points, or at the control."""
    verdict = document["verdict"]
    texts = [verdict["accuracy"], *filter(None, [verdict.get("agreement")])]
    if document["status"] != "unverified" and not verdict.get("verified", True):
        texts.append(verdict["verification"])
    return Words(" ".join(f"{text[0].upper()}{text[1:]}." for text in texts))


def verdict(document: Document, most: int | None = None) -> Iterator[Part]:
    """Say whether the result can be used, and what to look at: what was given and lost its say always."""
    look_at = document["verdict"]["look_at"]
    lost = _lost(document)
    shown = [
        (number, text)
        for number, text in enumerate(look_at, 1)
        if most is None or number <= most or any(message in text for message in lost)
    ]
    yield Words(headline(document), document["status"])
    yield accuracy(document)
    for number, text in shown:
        yield Words(text, mark=f"{number}.", names=_named(document, text))
    if len(look_at) > len(shown):
        yield Words(elsewhere(len(look_at) - len(shown), "thing", "verdict", "verdict"))
    if len(document["tolerances"]):
        yield keyed(document["tolerances"], "name value limit unit passed")


def _lost(document: Document) -> list[str]:
    """Return what notes and findings say of given points that lost their say."""
    without = {row["id"] for row in document["control"] if row.get("rejected") or not row["measured"]}
    findings = (each for each in document.get("findings", []) if not without.isdisjoint(each["points"]))
    return [each["message"] for each in (*(n for n in document["notes"] if n["code"] in LOST_SAY), *findings)]


def _named(document: Document, text: str) -> tuple[tuple[str, str], ...]:
    """Return what a note names, and the given points that stand out; findings have links of their own."""
    names = [name for each in document["notes"] if each["message"] in text for name in names_of(each)]
    names += [("point", row["id"]) for row in document["control"] if row["stands_out"] and f" {row['id']} (" in text]
    return tuple(names[:MOST_NAMED])


def names_of(said: Document) -> tuple[tuple[str, str], ...]:
    """Return the points and photos that a finding or a note names."""
    return tuple((kind, name) for kind in ("point", "photo") for name in said.get(f"{kind}s") or ())


def findings(document: Document) -> Iterator[Part]:
    """Give each finding with its cure; its numbers by themselves stand in result.json."""
    for each in document.get("findings", ()):
        place = before(each["file"], each["line"], each["column"])
        text = f"{_title(each)} ({_word(each)}): {place}{each['message']}."
        yield Words(text, _colour(each), mark="-", names=names_of(each))
        if _cure(each):
            yield Words(_cure(each), "", " ")


def cures(document: Document, most: int) -> Iterator[Part]:
    """Say what would put the findings right, and which of them are accepted; what they say stands in the verdict."""
    rows = list(document.get("findings", []))
    of_a_kind = min(max(most // max(len({each["code"] for each in rows}), 1), 1), MOST_OF_A_KIND)
    shown = [each for _, kind in groupby(rows, key=itemgetter("code")) for each in islice(kind, of_a_kind)][:most]
    for each in shown:
        yield Words(f"{_title(each)} ({_word(each)}). {_cure(each)}".strip(), _colour(each), "-")
    if len(rows) > len(shown):
        yield Words(elsewhere(len(rows) - len(shown), "finding", "findings", "findings"))


def _title(finding: Document) -> str:
    return f"{finding['code']} {finding['title']}"


def _word(finding: Document) -> str:
    return "accepted" if finding["accepted"] else str(finding["severity"])


def _colour(finding: Document) -> str:
    return "" if finding["accepted"] else "failed" if finding["severity"] == "error" else "look"


def _cure(finding: Document) -> str:
    """Return what would put a finding right; nothing for one that is accepted."""
    cure = "" if finding["accepted"] else str(finding["fix"])
    return cure and f"To put it right: {cure}{'' if cure.endswith('?') else '.'}"
