"""A comparison as sections: the verdict, each kind of quantity with its worst, what is missing and what is new."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from photostrip.notes import Document, counted, listed
from photostrip.report.page.numbers import short, unit
from photostrip.report.page.parts import DASH, Part, Section, Words
from photostrip.report.page.tables import number, tabulated, words

LEAST_PERCENT = 1e-4  # share; smaller ones are shown in parts per million
SHOWN = 20  # differences; --verbose prints all
NAMES = {
    "plan": "plan",
    "height": "height",
    "rotation": "rotations",
    "sigma0": "sigma0",
    "scale": "scale factors",
    "precision": "precision",
    "statistics": "statistics",
    "counts": "counts",
    "ids": "photos, points, models",
    "choices": "choices and verdicts",
    "rejected": "rejected measurements",
    "findings": "findings",
}
ONE = {"photos": "photo", "points": "point", "models": "model", "strips": "strip", "junctions": "junction at"}


def compare_sections(document: Document, *, quiet: bool = False, everything: bool = False) -> tuple[Section, ...]:
    same = document["status"] == "same"
    verdict = Words(headline(document), "good" if same else "failed")
    if quiet:
        return (Section("", (verdict,)),)
    head: list[Part] = [verdict]
    if "again" in document:
        head += [
            Words(f"{row['name']} is {row['now'] or 'not used'}, it was {row['certificate'] or 'not used'}", mark="-")
            for row in document["again"]["versions"]
        ]
    found = [
        Section("", (*head, tabulated(document["kinds"], KINDS))),
        *_lacking(document, everything=everything),
        *_sets(document["sets"], everything=everything),
    ]
    if document["differences"]:
        found.insert(1, _differences(document["differences"], everything=everything))
    return tuple(found)


def headline(document: Document) -> str:
    """Say in one sentence whether the results agree."""
    names = f"{document['result'] or 'the result'} and {document['baseline'] or 'the baseline'}"
    if document["status"] == "same":
        compared = sum(kind["compared"] for kind in document["kinds"] if not kind["ignored"])
        new = sum(each["numbers"] for each in document["lacking"] if each["file"] == "baseline")
        rest = f" {counted(new, 'number')} could not be compared: the baseline lacks them." if new else ""
        return f"SAME: {counted(compared, 'number')} of {names} agree within the tolerances.{rest}"
    numbers, gone = (
        len(document["differences"]),
        sum(each["numbers"] for each in document["lacking"] if each["differs"]),
    )
    alone = sum(row["difference"] is None for row in document["differences"])
    of_these = f", {alone} of them in one of the two only" if alone else ""
    parts = _since(document["again"]) if "again" in document else []
    parts += [f"{counted(numbers, 'number')} beyond tolerance{of_these}"] if numbers else []
    parts += [f"the result lacks {counted(gone, 'number')} of the baseline"] if gone else []
    parts += [
        f"{NAMES[each['kind']]}: {len(each['missing'])} missing, {len(each['new'])} new"
        for each in document["sets"]
        if each["differs"]
    ]
    return f"DIFFERENT: {names} differ: {'; '.join(parts)}."


def _since(again: Document) -> list[str]:
    """Say what has changed since a result was made: its own numbers, the files that went in."""
    parts = ["the numbers of the result are not those of its certificate: it was edited"] if again["edited"] else []
    states = dict.fromkeys(row["state"] for row in again["files"])
    files = {state: [row["file"] for row in again["files"] if row["state"] == state] for state in states}
    return [*parts, *(f"{state}: {listed(names)}" for state, names in files.items())]


def allowed_words(kind: Document) -> str:
    if kind["ignored"]:
        return "not compared"
    allowed, name = kind["allowed"], unit(kind["unit"])
    parts = [f"{short(allowed['absolute'])} {name}".rstrip()] if allowed["absolute"] else []
    parts += [f"{short(allowed['absolute_um'])} µm"] if allowed.get("absolute_um") else []
    share = allowed["relative"]
    parts += [f"{short(100 * share)} %" if share >= LEAST_PERCENT else f"{short(1e6 * share)} ppm"] if share else []
    return ", ".join(parts) or "none"


def place(row: Document) -> str:
    """Say what a difference is of: the block of the result, the id, the quantity."""
    block = ONE.get(row["block"], str(row["block"]))
    where = f"{block} {row['id']}" if row["id"] else block
    return where if row["name"] in {row["kind"], "rotation"} else f"{where}, {row['name']}"


def _size(row: Document) -> str:
    if row["difference"] is None:
        return "new" if row["before"] is None and row["now"] is not None else "gone"
    return short(row["difference"], 3)


def what(row: Document) -> str:
    """Say what a difference is of, with its kind where a quantity has two: plan and height."""
    return f"{place(row)}, {row['kind']}" if row["kind"] in {"plan", "height"} else place(row)


def _of_worst(write: Callable[[Document], str], nothing: str = "") -> Callable[[Document], str]:
    """Return what writes something of the worst difference of a kind."""
    return lambda kind: nothing if kind["worst"] is None else write(kind["worst"])


KINDS = (
    words("quantity", lambda kind: NAMES[kind["kind"]]),
    number("compared", "compared"),
    number("beyond", "different"),
    number("largest", _of_worst(_size, DASH)),
    words("", _of_worst(lambda worst: unit(worst["unit"]))),
    words("at", _of_worst(place)),
    words("allowed", allowed_words),
)


def _differences(rows: Sequence[Document], *, everything: bool) -> Section:
    """Table of the differences beyond tolerance, worst first."""
    shown = rows if everything else rows[:SHOWN]
    columns = (
        words("of", what),
        number("baseline", "before", partial(short, digits=9)),
        number("now", "now", partial(short, digits=9)),
        number("difference", _size),
        number("allowed", "allowed", partial(short, digits=3)),
        words("", lambda row: unit(row["unit"])),
    )
    rest = len(rows) - len(shown)
    note = f"{rest} more; --verbose prints all" if rest else ""
    return Section("Beyond tolerance", (tabulated(shown, columns, note=note),))


def lacking_words(document: Document, row: Document) -> str:
    """Say which quantity one of the two results does not have."""
    files = {name: document[name] or f"the {name}" for name in ("result", "baseline")}
    lacks, has = files[row["file"]], files["baseline" if row["file"] == "result" else "result"]
    return f"{row['block']}, {row['name']}: {counted(row['numbers'], 'number')} in {has}, none in {lacks}"


def _lacking(document: Document, *, everything: bool) -> list[Section]:
    """Name the quantities that one of the two results does not have."""
    rows = document["lacking"]
    shown = rows if everything else rows[:SHOWN]
    parts: list[Part] = [
        Words(f"{lacking_words(document, row)}{'' if row['differs'] else ' (not compared)'}", mark=" -")
        for row in shown
    ]
    if len(shown) < len(rows):
        parts.append(Words(f"{len(rows) - len(shown)} more; --verbose names all", mark=" -"))
    return [Section("In one of them only", tuple(parts))] if parts else []


def _sets(sets: Sequence[Document], *, everything: bool) -> list[Section]:
    parts: list[Part] = []
    for each in sets:
        if not (each["missing"] or each["new"]):
            continue
        state = "not compared" if each["ignored"] else "more than allowed" if each["differs"] else "allowed"
        parts.append(Words(f"{NAMES[each['kind']]} ({state})", "head"))
        for name in ("missing", "new"):
            shown = each[name] if everything else each[name][:SHOWN]
            parts += [Words(f"{name}: {row['what']}", mark=" -") for row in shown]
            if len(shown) < len(each[name]):
                parts.append(Words(f"{name}: {len(each[name]) - len(shown)} more; --verbose names all", mark=" -"))
    return [Section("Missing and new", tuple(parts))] if parts else []
