"""Whether a result can be used, in a sentence; what to look at; tolerances; what the data say against themselves."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby, islice
from operator import itemgetter

from photostrip.notes import LOST_SAY, Document, before, counted
from photostrip.report.page.messages import MOST_OF_A_KIND
from photostrip.report.page.parts import Part, Section, Words
from photostrip.report.page.tables import elsewhere, keyed

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
    if len(document["tolerances"]):
        parts.append(keyed(document["tolerances"], "name value limit unit passed"))
    return Section("Verdict", tuple(parts))


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


def findings_sections(document: Document, *, everything: bool) -> tuple[Section, ...]:
    """Return the section of the findings: each with its numbers and its cure; none when there are none."""
    findings = document.get("findings", [])
    if not len(findings):
        return ()
    parts: list[Part] = []
    for _, group in groupby(findings, key=itemgetter("code")):
        kind = list(group)
        shown = kind if everything else kind[:MOST_OF_A_KIND]
        parts += [part for each in shown for part in _paragraphs(each)]
        if len(kind) > len(shown):
            text = f"{_title(kind[0])}: {len(kind) - len(shown)} more in `findings` of result.json."
            parts.append(Words(text, _colour(kind[0]), "-"))
    return (Section("Plausibility of the data", tuple(parts)),)


def cures_section(document: Document, most: int) -> Section:
    """Say what would put the findings right, and which of them are accepted; what they say stands in the verdict."""
    findings = list(document.get("findings", []))
    kinds = len({each["code"] for each in findings})
    of_a_kind = min(max(most // max(kinds, 1), 1), MOST_OF_A_KIND)
    shown = [each for _, kind in groupby(findings, key=itemgetter("code")) for each in islice(kind, of_a_kind)][:most]
    parts = [Words(f"{_title(each)} ({_word(each)}). {_cure(each)}".strip(), _colour(each), "-") for each in shown]
    if len(findings) > len(shown):
        parts.append(Words(elsewhere(len(findings) - len(shown), "findings", "findings", "findings")))
    return Section("Plausibility of the data", tuple(parts))


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


def _paragraphs(finding: Document) -> Iterator[Part]:
    place = before(finding["file"], finding["line"], finding["column"])
    text = f"{_title(finding)} ({_word(finding)}): {place}{finding['message']}."
    yield Words(text, _colour(finding), mark="-", names=names_of(finding))
    if finding["evidence"]:
        numbers = ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in finding["evidence"].items())
        yield Words(f"Evidence: {numbers}.", "", " ")
    if _cure(finding):
        yield Words(_cure(finding), "", " ")
