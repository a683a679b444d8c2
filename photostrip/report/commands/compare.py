"""Comparisons with a baseline, with the truth, of whole folders: sections, findings with a line, test cases."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from photostrip.notes import Document, counted, listed
from photostrip.report.page.messages import EMPTY, Case
from photostrip.report.page.parts import DASH, Part, Section, Words
from photostrip.report.page.tables import Field, fixed, short, tabulated, unit_of, with_unit

TRUTH = "photostrip_truth_comparison"
FOLDERS = "photostrip_compare_folders"
LEAST_PERCENT = 1e-4  # share; smaller ones are shown in parts per million
SHOWN = 20  # differences; --verbose prints all
MOST_ANNOTATIONS = 50  # of one comparison; a server shows no more
NAMES = {
    "rotation": "rotations",
    "scale": "scale factors",
    "ids": "photos, points, models",
    "choices": "choices and verdicts",
    "rejected": "rejected measurements",
}  # of kinds that have another name than their key
ONE = {"photos": "photo", "points": "point", "models": "model", "strips": "strip", "junctions": "junction at"}
ALONE = {"missing": "there is a baseline and no result", "new": "there is a result and no baseline"}


def comparison_report(
    document: Document, *, quiet: bool = False, everything: bool = False
) -> tuple[str, tuple[Section, ...]]:
    """Return title and sections of a comparison; with `quiet` the verdict alone."""
    if quiet:
        return "", (Section("", (_verdict(document),)),)
    sections = _truth if TRUTH in document else _folders if FOLDERS in document else _one
    title = f"Comparison: {document.get('name') or document['result']}"
    return title, tuple(sections(document, None if everything else SHOWN))


def headline(document: Document) -> str:
    """Say the verdict of a comparison in one sentence."""
    return (_of_truth if TRUTH in document else _of_folders if FOLDERS in document else _of_one)(document)


def _verdict(document: Document) -> Words:
    style = "" if TRUTH in document else "good" if document["status"] == "same" else "failed"
    return Words(headline(document), style)


# ------------------------------------------------------------------------------------------------- with a baseline


def _name(kind: Document) -> str:
    return NAMES.get(kind["kind"], str(kind["kind"]))


def _one(document: Document, most: int | None) -> Iterator[Section]:
    head: list[Part] = [_verdict(document)]
    for row in document.get("again", {}).get("versions", ()):
        text = f"{row['name']} is {row['now'] or 'not used'}, it was {row['certificate'] or 'not used'}"
        head.append(Words(text, mark="-"))
    kinds = Field("quantity"), Field("compared", "count"), Field("beyond", "count"), Field("largest", "count")
    rows = []
    for kind in document["kinds"]:
        worst = kind["worst"]
        at = (_size(worst), unit_of(worst["unit"]), place(worst)) if worst else (DASH, "", "")
        rows.append((_name(kind), kind["compared"], kind["different"], *at, _allowed(kind)))
    yield Section("", (*head, tabulated((*kinds, Field("unit", head=""), Field("at"), Field("allowed")), rows)))
    if differences := document["differences"]:
        columns = (
            *(Field("of"), Field("baseline", " g9"), Field("now", " g9"), Field("difference", "count")),
            *(Field("allowed", " g3"), Field("unit", head="")),
        )
        cells = [
            (what(row), row["before"], row["now"], _size(row), row["allowed"], unit_of(row["unit"]))
            for row in differences[:most]
        ]
        yield Section("Beyond tolerance", (tabulated(columns, cells, _rest(differences, most)),))
    lacking = [f"{_lacking(document, row)}{'' if row['differs'] else ' (not compared)'}" for row in document["lacking"]]
    yield from _listed("In one of them only", [("", lacking)], most)
    sets = []
    for each in document["sets"]:
        state = "not compared" if each["ignored"] else "more than allowed" if each["differs"] else "allowed"
        texts = [f"{name}: {row['what']}" for name in ALONE for row in each[name]]
        sets += [(f"{_name(each)} ({state})", texts)] if texts else []
    yield from _listed("Missing and new", sets, most)


def _rest(rows: Sequence[object], most: int | None) -> str:
    """Say how many are not shown."""
    return f"{len(rows) - most} more; --verbose prints all" if most is not None and len(rows) > most else ""


def _listed(title: str, groups: Sequence[tuple[str, list[str]]], most: int | None) -> Iterator[Section]:
    """Give a section of lists, each below its head; none without any."""
    parts: list[Part] = []
    for head, texts in groups:
        parts += [Words(head, "head")] if head else []
        parts += [Words(text, mark=" -") for text in (*texts[:most], _rest(texts, most)) if text]
    if parts:
        yield Section(title, tuple(parts))


def _of_one(document: Document) -> str:
    """Say in one sentence whether the results agree."""
    names = f"{document['result'] or 'the result'} and {document['baseline'] or 'the baseline'}"
    if document["status"] == "same":
        compared = sum(kind["compared"] for kind in document["kinds"] if not kind["ignored"])
        new = sum(each["numbers"] for each in document["lacking"] if each["file"] == "baseline")
        rest = f" {counted(new, 'number')} could not be compared: the baseline lacks them." if new else ""
        return f"SAME: {counted(compared, 'number')} of {names} agree within the tolerances.{rest}"
    rows, gone = document["differences"], sum(each["numbers"] for each in document["lacking"] if each["differs"])
    alone = sum(row["difference"] is None for row in rows)
    of_these = f", {alone} of them in one of the two only" if alone else ""
    parts = _since(document["again"]) if "again" in document else []
    parts += [f"{counted(len(rows), 'number')} beyond tolerance{of_these}"] if rows else []
    parts += [f"the result lacks {counted(gone, 'number')} of the baseline"] if gone else []
    parts += [f"{_name(each)}: {_missing(each)}" for each in document["sets"] if each["differs"]]
    return f"DIFFERENT: {names} differ: {'; '.join(parts)}."


def _since(again: Document) -> list[str]:
    """Say what has changed since a result was made: its own numbers, the files that went in."""
    parts = ["the numbers of the result are not those of its certificate: it was edited"] if again["edited"] else []
    states = dict.fromkeys(row["state"] for row in again["files"])
    files = {state: [row["file"] for row in again["files"] if row["state"] == state] for state in states}
    return [*parts, *(f"{state}: {listed(names)}" for state, names in files.items())]


def _missing(each: Document) -> str:
    return f"{len(each['missing'])} missing, {len(each['new'])} new"


def _allowed(kind: Document) -> str:
    if kind["ignored"]:
        return "not compared"
    allowed, share = kind["allowed"], kind["allowed"]["relative"]
    parts = [with_unit(allowed["absolute"], f"{kind['unit']} g4")] if allowed["absolute"] else []
    parts += [f"{short(allowed['absolute_um'])} µm"] if allowed.get("absolute_um") else []
    parts += [f"{short(100 * share)} %" if share >= LEAST_PERCENT else f"{short(1e6 * share)} ppm"] if share else []
    return ", ".join(parts) or "none"


def place(row: Document) -> str:
    """Say what a difference is of: the block of the result, the id, the quantity."""
    block = ONE.get(row["block"], str(row["block"]))
    where = f"{block} {row['id']}" if row["id"] else block
    return where if row["name"] in {row["kind"], "rotation"} else f"{where}, {row['name']}"


def what(row: Document) -> str:
    """Say what a difference is of, with its kind where a quantity has two: plan and height."""
    return f"{place(row)}, {row['kind']}" if row["kind"] in {"plan", "height"} else place(row)


def _size(row: Document) -> str:
    if row["difference"] is None:
        return "new" if row["before"] is None and row["now"] is not None else "gone"
    return short(row["difference"], 3)


def _lacking(document: Document, row: Document) -> str:
    """Say which quantity one of the two results does not have."""
    files = {name: document[name] or f"the {name}" for name in ("result", "baseline")}
    lacks, has = files[row["file"]], files["baseline" if row["file"] == "result" else "result"]
    return f"{row['block']}, {row['name']}: {counted(row['numbers'], 'number')} in {has}, none in {lacks}"


# -------------------------------------------------------------------------------------------------- with the truth


def _truth(document: Document, most: int | None) -> Iterator[Section]:
    columns = [Field("true errors of"), Field("number", "count", "")]
    rows = [[row["role"], row["count"]] for row in (*document["points"], {"role": "photos", **document["photos"]})]
    for part in ("plan", "height"):
        columns += [Field(part, "m 3"), Field("largest", "m 3"), Field("at", rank=1), Field("e/σ", "count")]
        columns.append(Field("in 95 %", "count", rank=1))
        for cells, row in zip(rows, (*document["points"], document["photos"]), strict=True):
            each = row[part]
            known = "normalised" in each
            cells += [each["rms"], each["max"], each["worst"], fixed(each["normalised"], 2) if known else DASH]
            cells.append(f"{each['inside']} of {each['known']}" if known else DASH)
    note = "e/σ: rms of the errors over their standard deviations"
    parts: list[Part] = [_verdict(document), tabulated(columns, rows, note)]
    turned = document["photos"]["rotation"]
    if turned["rms"] is not None:
        worst = f"largest {turned['max']:.4f} deg, photo {turned['worst']}"
        parts.append(Words(f"Orientation of the photos: rms {turned['rms']:.4f} deg, {worst}."))
    missed = document["errors"]["missed"]
    parts += [Words(_missed(each), mark="-") for each in missed[:most]]
    parts += [Words(rest)] if (rest := _rest(missed, most)) else []
    yield Section("", tuple(parts))


def _of_truth(document: Document) -> str:
    """Say in one sentence what came of the gross errors that were put in."""
    errors = document["errors"]
    planted, missed = errors["planted"], len(errors["missed"])
    seen = f"{planted - missed} of {counted(planted, 'gross error')} found" if planted else "no gross errors put in"
    sound = counted(errors["sound_rejected"], "sound measurement")
    return f"{document['name']} against its truth: {seen}, {sound} rejected."


def _missed(error: Document) -> str:
    """Say which gross error was not found."""
    point = f"points {error['point']} and {error['other']}" if error["other"] else f"point {error['point']}"
    where = f"photo {error['photo']}, {point}" if error["photo"] else point
    axis = f" in {error['axis']}" if error["axis"] else ""
    known = ((error[key], form) for key, form in (("size_um", "um 1"), ("size_m", "m 3")) if error[key] is not None)
    return ", ".join([f"not found: {error['kind']}", where + axis, *(with_unit(*each) for each in known)])


# ------------------------------------------------------------------------------------------------------ of folders


def _folders(document: Document, most: int | None) -> Iterator[Section]:
    """Give a line for each result, then whatever differs."""
    columns = Field("folder"), Field("status", head=""), Field("compared", "count"), Field("beyond", "count")
    rows = [
        (each["folder"], each["status"], sum(kind["compared"] for kind in each["kinds"]), len(each["differences"]))
        for each in document["results"]
    ]
    parts: list[Part] = [_verdict(document)]
    parts += [Words(each["message"], "failed", mark="-") for each in document["refused"]]
    parts += [tabulated(columns, rows)] if rows else []
    yield Section("", tuple(parts))
    for each in document["results"]:
        if each["status"] != "same":
            first, *others = _one(each, most)
            yield from (Section(each["folder"], first.parts), *others)


def _of_folders(document: Document) -> str:
    differ = [each["folder"] for each in document["results"] if each["status"] != "same"]
    names = f"{document['result']} and {document['baseline']}"
    if document["status"] == "same":
        return f"SAME: {counted(len(document['results']), 'result')} of {names} agree within the tolerances."
    refused = len({each["folder"] for each in document["refused"]})
    parts = [f"{counted(refused, 'result')} that cannot be compared"] if refused else []
    parts += [f"{counted(len(differ), 'result')} of {len(document['results'])} beyond tolerance"] if differ else []
    parts += [f"no result for {listed(document['missing'])}"] if document["missing"] else []
    parts += [f"no baseline for {listed(document['new'])}"] if document["new"] else []
    return f"{document['status'].upper()}: {names} differ: {'; '.join(parts) or 'nothing is in both'}."


# ----------------------------------------------------------------------------------------- as findings, as test cases


def compare_findings(document: Document, lines_of: Callable[[str], Callable[[str, str], int]]) -> list[Document]:
    """Return what differs as findings, worst first, each at the line of the baseline in which the record stands.

    ``lines_of`` gives for a baseline what finds the line of a block and an id, 0 when it is not there. What is too much
    to show is counted in the last finding.
    """
    found = [
        _finding(one["baseline"], lines_of(one["baseline"])(*place), text)
        for one in document.get("results", [document])
        for _, place, text in _texts(one)
    ]
    found += [
        EMPTY | {key: each[key] for key in ("file", "line", "code", "message")} | {"severity": "error"}
        for each in document.get("refused", ())
    ]
    found += [_finding(folder, 0, why) for key, why in ALONE.items() for folder in document.get(key, ())]
    if len(found) <= MOST_ANNOTATIONS:
        return found
    rest = f"and {len(found) - MOST_ANNOTATIONS} more differences; photostrip compare --verbose lists them"
    return [*found[:MOST_ANNOTATIONS], _finding(document["baseline"], 0, rest)]


def _texts(document: Document) -> Iterator[tuple[str, tuple[str, str], str]]:
    """Say each difference in a sentence, with its kind, and with block and key of the record of the baseline."""
    for each in document["sets"]:
        differ = [(name, row) for name in ALONE for row in each[name] if each["differs"]]
        for name, row in differ:
            yield each["kind"], (row["block"], "id"), f"{_name(each)}: {row['what']} is {name}"
    for row in document["lacking"]:
        if row["differs"]:
            yield row["kind"], (row["block"], ""), _lacking(document, row)
    for row in document["differences"]:
        yield row["kind"], (row["block"], row["name"].partition(".")[0]), sentence(row)


def _finding(file: str, line: int, message: str) -> Document:
    return EMPTY | {"severity": "error", "code": "different", "file": file, "line": line, "message": message}


def sentence(row: Document) -> str:
    """Say in a sentence how a number differs."""
    before, now = (short(row[key], 9) if row[key] is not None else "nothing" for key in ("before", "now"))
    if row["difference"] is None:
        return f"{what(row)}: {now} instead of {before}"
    size, allowed = (with_unit(row[key], f"{row['unit']} g3") for key in ("difference", "allowed"))
    values = "" if row["before"] is None else f" ({before} before, {now} now)"
    return f"{what(row)} differs by {size}, allowed {allowed}{values}"


def compare_cases(document: Document) -> Iterator[Case]:
    """Return a comparison as test cases: one for each kind of quantity and each set, of every result in folders."""
    if FOLDERS in document:
        for one in document["results"]:
            yield from (case._replace(name=f"{one['folder']}: {case.name}") for case in compare_cases(one))
        yield from (Case(each["folder"], error=each["message"]) for each in document["refused"])
        yield from (Case(folder, error=why) for key, why in ALONE.items() for folder in document[key])
        return
    texts: dict[str, list[str]] = {}
    for name, _, text in _texts(document):
        texts.setdefault(name, []).append(text)
    for kind in (*document["kinds"], *document["sets"]):
        own = texts.get(kind["kind"], [])
        allowed = f" beyond {_allowed(kind)}" if "relative" in kind["allowed"] else ""
        failure = f"{counted(len(own), 'difference')}{allowed}" if own else ""
        skipped = "not compared" if kind["ignored"] else ""
        yield Case(_name(kind), "" if skipped else failure, "\n".join(own), skipped)
