"""The report on a page and a half: what a surveyor needs first, one line for each stage, the worst of long tables.

Everything else stands in the sections, which ``--verbose`` prints all and ``--section`` one by one.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from heapq import nlargest

from photostrip.notes import Document, counted, listed
from photostrip.report.page.layout import lay_out
from photostrip.report.page.numbers import fixed, metres, micrometres, percent
from photostrip.report.page.parts import Facts, Section, Words
from photostrip.report.sections import common_causes
from photostrip.report.sections.bundle import classical_line
from photostrip.report.sections.check_points import check_section, cross_validation_section
from photostrip.report.sections.decisions import chosen_degrees
from photostrip.report.sections.findings import cures_section
from photostrip.report.sections.marks import marks_section
from photostrip.report.sections.models import of_models
from photostrip.report.sections.points import (
    control_section,
    missing_points,
    sentence_of,
    standing_rejections,
)
from photostrip.report.sections.project import adjustment_of, camera_line, counts_rows, interior_line
from photostrip.report.sections.strip import (
    DIRECTIONS,
    GROUND_AXES,
    column_of,
    elsewhere,
    photos_of,
)
from photostrip.report.sections.verdict import verdict_section

Rows = Iterator[tuple[str, str]]

MOST_LINES = 120  # of a report, its title and its last line included
# Points, reasons, findings, notes that are shown: as many as leave the report short.
MOST_OF_A_KIND = (12, 8, 6, 4, 2, 1)
NAMED = 3  # worst pairs, photos and points; cameras
SAID_BY_THE_WORST = {"rejected", "without coordinates"}
AROUND = 4  # lines of the title and of the end


def overview(document: Document, width: int) -> tuple[Section, ...]:
    """Return the sections of the short report for a page of a width."""
    for most in MOST_OF_A_KIND:
        sections = _overview(document, most)
        if len(lay_out("", sections, width)) <= MOST_LINES - AROUND:
            break
    return sections


def _overview(document: Document, most: int) -> tuple[Section, ...]:
    remarks = [note for note in document["notes"] if note["severity"] != "warning"]  # warnings stand in the verdict
    found = (
        verdict_section(document, most=most),
        cures_section(document, most),
        _facts("Project", _project(document, min(most, NAMED))),
        _facts("Stages", _stages(document, min(most, NAMED))),
        control_section(document, everything=False, most=most),
        check_section(document, everything=False, most=most),
        marks_section(document, everything=False, most=min(most, 2 * NAMED)),
        *_left_out(document, most),
        _facts("Worst", _worst(document)),
        _notes(remarks, most),
        Section("", (Words("--verbose prints all sections, --section NAME a single one; --help lists the names."),)),
    )
    return tuple(section for section in found if section.parts)


def _facts(title: str, rows: Rows) -> Section:
    facts = tuple(rows)
    return Section(title, (Facts(facts),) if facts else ())


def _left_out(document: Document, most: int) -> Iterator[Section]:
    if "cross_validation" in document:
        yield cross_validation_section(document, everything=False, most=most)


def _project(document: Document, most: int) -> Rows:
    """Say what was adjusted, and how much of it there is."""
    yield "adjustment", adjustment_of(document)
    yield "ground frame", document["frame"]["description"]
    cameras = document["cameras"]
    for camera in cameras[:most]:
        yield f"camera {camera['id']}", camera_line(camera)
    if len(cameras) > most:
        yield "more cameras", listed((camera["id"] for camera in cameras[most:]), NAMED)
    yield from (row for row in counts_rows(document) if row[0] not in SAID_BY_THE_WORST)


def _stages(document: Document, most: int) -> Rows:
    """Say in a line for each stage how it went, and for each cause that the adjustment took up what it is."""
    interior, summary = document["corrections"]["interior"], document["summary"]
    if interior:
        yield "interior orientation", interior_line(interior)
    if of_models(document):
        yield from _links(document)
    elif document["models"]:
        yield from _pairs(document)
    yield from _absolute(document["absolute"])
    yield from _degrees(document)
    if "bundle" in document:
        yield "bundle adjustment", _bundle(document["bundle"])
        yield from common_causes.taken_up(document["bundle"], most)
        yield from common_causes.estimated(document, most)
    if "classical" in document:
        yield "polynomials instead", classical_line(document["classical"])
    if summary["image_rms_um"] is not None:
        yield "image residuals", f"rms {micrometres(summary['image_rms_um'])} µm"
    if "precision" in document:
        yield from _precision(document["precision"])
    yield from _checked(document["counts"]["points_checked"])


def _pairs(document: Document) -> Rows:
    summary, models = document["summary"], document["models"]
    out, used = (sum(column_of(models, key)) for key in ("points_rejected", "points_used"))
    total = out + used
    sigma0 = summary.get("sigma0_pairs_um", summary["sigma0_um"])
    text = (
        f"σ0 {micrometres(sigma0)} µm, stated {micrometres(summary['sigma_given_um'])} µm; {out} of "
        f"{counted(total, 'point')} in {counted(len(models), 'pair')} rejected, {percent(out, total)}"
    )
    yield "relative orientation", text
    junctions = document["junctions"]
    if junctions:
        yield (
            "scale transfer",
            f"{counted(len(junctions), 'junction')}{_rejected_in(document)}; {_differences(document)}",
        )


def _rejected_in(document: Document) -> str:
    """Say how many points the scale transfer rejected, and how many for rays that contradict each other."""
    counts = document["counts"]
    parts = [
        f"{counted(number, 'point')} rejected{why}"
        for number, why in (
            (counts["rejected_in_scale_transfer"], ""),
            (counts["rejected_for_rays"], " for rays that contradict each other"),
        )
        if number
    ]
    return "".join(f", {part}" for part in parts)


def _links(document: Document) -> Rows:
    summary, links = document["summary"], document["links"]
    if links:
        sigma0 = f"σ0 {micrometres(summary['sigma0_um'])} µm, stated {micrometres(summary['sigma_given_um'])} µm"
        yield "links of the models", f"{sigma0}; {counted(len(links), 'link')}"
        yield "between models", _differences(document)


def _differences(document: Document) -> str:
    """Say by how much neighbouring models differ; in the worst strip, where there are several."""
    strips = [strip for strip in document["strips"] if strip["discrepancy_up"] is not None]
    if not strips:
        return "no common points"
    worst = max(strips, key=lambda strip: strip["discrepancy_up"])
    size = ", ".join(f"{metres(worst[f'discrepancy_{name}'])} m {name}" for name in DIRECTIONS)
    return f"rms {size}{_in_strip(worst['id'], strips)}"


def _in_strip(strip: str, strips: Sequence[object]) -> str:
    return f", worst in strip {strip}" if len(strips) > 1 else ""


def _absolute(rows: Sequence[Document]) -> Rows:
    for row in _worst_of(rows, "sigma0", 1):
        size = ", ".join(f"{metres(row[f'misclosure_rms_{axis}'])} m {axis}" for axis in GROUND_AXES)
        yield "absolute orientation", f"misclosure rms {size}{_in_strip(row['strip'], rows)}"


def _degrees(document: Document) -> Rows:
    """Say of which degree the polynomials are; of several, how many strips have each."""
    blocks = document.get("polynomials", [])
    if len(blocks) == 1:
        yield "polynomial", chosen_degrees(document["polynomial_evidence"])
    elif blocks:
        number = Counter((block["degree_plan"], block["degree_height"]) for block in blocks)
        found = (f"{plan} and {height} in {counted(number[plan, height], 'strip')}" for plan, height in sorted(number))
        yield "polynomials", f"degrees in plan and height: {', '.join(found)}"


def _bundle(block: Document) -> str:
    test, out = block["sigma0_test"], sum(block["screening"].get("rejected", {}).values())
    said = "no redundancy to test it"
    if test["passed"] is not None:
        said = (
            f"{'passed' if test['passed'] else 'NOT PASSED'} ({fixed(test['lower'], 3)} to {fixed(test['upper'], 3)})"
        )
    free = "free network, " if block["free_network"] else ""
    return f"{free}σ0 {fixed(block['sigma0'], 3)}, test {said}; {counted(out, 'observation')} rejected"


def _checked(number: Document) -> Rows:
    """Say of how many points an error along the base would not show."""
    if number["across"] or number["none"]:
        text = f"{counted(number['across'], 'point')} checked only across the base, {number['none']} not at all"
        yield "unchecked", f"{text}; {number['along']} along it too"


def _precision(block: Document) -> Rows:
    for name, part in block["points"].items():
        yield f"precision in {name}", f"rms {metres(part['rms'])} m, largest {metres(part['max'])} m at {part['worst']}"


def _worst(document: Document) -> Rows:
    """Name the worst pairs, photos and points, what was rejected and what has no coordinates."""
    kinds: tuple[tuple[str, str, str, Callable[[Document], str]], ...] = (
        ("pairs, σ0", "models", "sigma0_um", photos_of),
        ("photos, rms residual", "photos", "image_rms_um", lambda row: str(row["id"])),
        ("points, rms residual", "points", "image_rms_um", lambda row: str(row["id"])),
    )
    for label, block, key, name in kinds:
        rows = _worst_of(document[block], key, NAMED)
        if rows:
            yield label, ", ".join(f"{name(row)} {micrometres(row[key])} µm" for row in rows)
    rejected = standing_rejections(document)
    if rejected:
        yield "rejected", _and_more((_rejection(row) for row in rejected), len(rejected), "rejected")
    missing = missing_points(document)
    if missing:
        text = _and_more(
            (f"{counted(len(ids), 'point')} ({why})" for why, ids in missing), len(missing), "undetermined"
        )
        yield "without coordinates", text


def _notes(notes: Iterable[Document], most: int) -> Section:
    """Return the first note of each kind, and how many more there are of it."""
    kinds: dict[str, list[Document]] = {}
    for note in notes:
        kinds.setdefault(note["code"], []).append(note)
    parts = [Words(sentence_of(first) + _likewise(rest), mark="-") for first, *rest in list(kinds.values())[:most]]
    if len(kinds) > most:
        parts.append(Words(elsewhere(len(kinds) - most, "kinds of notes", "notes", "notes")))
    return Section("Notes", tuple(parts))


def _likewise(rest: Sequence[Document]) -> str:
    """Say for what else a note holds, in other words: strips or keys, where it is about them."""
    if not rest:
        return ""
    strips = [note["strip"] for note in rest if note["strip"]]
    if len(strips) == len(rest):
        return f" (and the same for {'strip' if len(strips) == 1 else 'strips'} {listed(strips)})"
    keys = [note["key"] for note in rest if "." in note["key"]]
    which = f", {listed(keys)}" if len(keys) == len(rest) else ""
    return f" (and {len(rest)} more like this{which}: --section notes)"


def _worst_of(rows: Sequence[Document], key: str, most: int) -> list[Document]:
    """Return the rows with the largest values of a key, where it is known."""
    values = column_of(rows, key)
    known = (place for place, value in enumerate(values) if value is not None)
    return [rows[place] for place in nlargest(most, known, key=lambda place: float(values[place]))]


def _rejection(row: Document) -> str:
    photos = " – ".join(row[key] for key in ("photo", "other_photo") if row[key] is not None)
    return " on ".join(part for part in (row["point"], photos) if part)


def _and_more(said: Iterable[str], number: int, section: str) -> str:
    """Say the first of some things, and where the others stand."""
    head = ", ".join([text for text, _ in zip(said, range(NAMED), strict=False)])
    return head if number <= NAMED else f"{head} and {number - NAMED} more: --section {section}"
