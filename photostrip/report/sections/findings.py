"""What the data say against themselves, at the top of the report: each finding, its numbers and its cure."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby, islice
from operator import itemgetter

from photostrip.notes import Document, before
from photostrip.report.page.messages import MOST_OF_A_KIND
from photostrip.report.page.parts import Part, Section, Words
from photostrip.report.sections.strip import elsewhere


def findings_sections(document: Document, *, everything: bool) -> tuple[Section, ...]:
    """Return the section of the findings; none when there are none."""
    findings = document.get("findings", [])
    if not findings:
        return ()
    parts: list[Part] = []
    for _, group in groupby(findings, key=itemgetter("code")):
        kind = list(group)
        shown = kind if everything else kind[:MOST_OF_A_KIND]
        parts += [part for each in shown for part in _paragraphs(each)]
        parts += _rest(len(kind) - len(shown), kind[0])
    return (Section("Plausibility of the data", tuple(parts)),)


def _rest(number: int, one: Document) -> list[Part]:
    """Count the findings of a kind that are not shown."""
    text = f"{one['code']} {one['title']}: {number} more in `findings` of result.json."
    return [Words(text, _colour(one), "-")] if number > 0 else []


def cures_section(document: Document, most: int) -> Section:
    """Say what would put the findings right, and which of them are accepted; what they say stands in the verdict."""
    findings = document.get("findings", [])
    kinds = len({each["code"] for each in findings})
    of_a_kind = min(max(most // max(kinds, 1), 1), MOST_OF_A_KIND)
    shown = [each for _, kind in groupby(findings, key=itemgetter("code")) for each in islice(kind, of_a_kind)][:most]
    parts = [
        Words(f"{each['code']} {each['title']} ({_word(each)}). {_cure(each)}".strip(), _colour(each), "-")
        for each in shown
    ]
    if len(findings) > len(shown):
        parts.append(Words(elsewhere(len(findings) - len(shown), "findings", "findings", "findings")))
    return Section("Plausibility of the data", tuple(parts))


def names_of(said: Document) -> tuple[tuple[str, str], ...]:
    """Return the points and photos that a finding or a note names."""
    return tuple((kind, name) for kind in ("point", "photo") for name in said.get(f"{kind}s") or ())


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
    text = f"{finding['code']} {finding['title']} ({_word(finding)}): {place}{finding['message']}."
    yield Words(text, _colour(finding), mark="-", names=names_of(finding))
    if finding["evidence"]:
        numbers = ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in finding["evidence"].items())
        yield Words(f"Evidence: {numbers}.", "", " ")
    if _cure(finding):
        yield Words(_cure(finding), "", " ")
