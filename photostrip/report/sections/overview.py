"""The report on a page and a half: what a surveyor needs first, one line for each stage, the worst of long tables.

Everything else stands in the sections, which ``--verbose`` prints all and ``--section`` one by one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from photostrip.notes import Document, counted, listed
from photostrip.report.page.layout import lay_out
from photostrip.report.page.parts import Facts, Part, Section, Words
from photostrip.report.page.tables import BETWEEN, elsewhere, largest_of, micrometres, taken
from photostrip.report.sections import formation, network
from photostrip.report.sections.points import (
    check,
    control,
    cross_validation,
    marks,
    missing_points,
    positions,
    precision_lines,
    sentence_of,
    standing_rejections,
)
from photostrip.report.sections.project import adjustment_of, camera_line, chosen_degrees, counts_rows, interior_line
from photostrip.report.sections.verdict import cures, verdict

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
    help_text = "--verbose prints all sections, --section NAME a single one; --help lists the names."
    shown: tuple[tuple[str, Iterable[Part]], ...] = (
        ("Verdict", verdict(document, most)),
        ("Plausibility of the data", cures(document, most)),
        ("Project", _facts(_project(document, min(most, NAMED)))),
        ("Stages", _facts(_stages(document, min(most, NAMED)))),
        ("Control points", control(document, most)),
        ("Check points", check(document, most)),
        ("Camera positions", positions(document, min(most, NAMED))),
        ("Marks of given points", marks(document, min(most, 2 * NAMED))),
        ("Cross-validation", cross_validation(document, most)),
        ("Worst", _facts(_worst(document))),
        ("Notes", _notes(remarks, most)),
        ("", [Words(help_text)]),
    )
    return tuple(Section(title, parts) for title, given in shown if (parts := tuple(given)))


def _facts(rows: Rows) -> Iterator[Part]:
    if facts := tuple(rows):
        yield Facts(facts)


def _project(document: Document, most: int) -> Rows:
    """Say what was adjusted, and how much of it there is."""
    yield "adjustment", adjustment_of(document)
    yield "ground frame", document["frame"]["description"]
    cameras = list(document["cameras"])
    for camera in cameras[:most]:
        yield f"camera {camera['id']}", camera_line(camera)
    if len(cameras) > most:
        yield "more cameras", listed((camera["id"] for camera in cameras[most:]), NAMED)
    yield from (row for row in counts_rows(document) if row[0] not in SAID_BY_THE_WORST)


def _stages(document: Document, most: int) -> Rows:
    """Say in a line for each stage how it went, and for each cause that the adjustment took up what it is."""
    interior, rms = document["corrections"]["interior"], document["summary"]["image_rms_um"]
    if interior:
        yield "interior orientation", interior_line(interior)
    yield from formation.stages(document)
    blocks = document.get("polynomials", [])
    if len(blocks) == 1:
        yield "polynomial", chosen_degrees(document["polynomial_evidence"])
    elif len(blocks):
        yield "polynomials", formation.degrees(blocks)
    yield from network.stages(document, most)
    if rms is not None:
        yield "image residuals", f"rms {micrometres(rms)} µm"
    if "precision" in document:
        yield from precision_lines(document["precision"], "precision in {}")
    checked = document["counts"]["points_checked"]
    if checked["across"] or checked["none"]:  # an error along the base would not show
        text = f"{counted(checked['across'], 'point')} checked only across the base, {checked['none']} not at all"
        yield "unchecked", f"{text}; {counted(checked['along'], 'point')} along it too"


def _worst(document: Document) -> Rows:
    """Name the worst pairs, photos and points, what was rejected and what has no coordinates."""
    kinds = (
        ("pairs, σ0", "models", "sigma0_um", ("left", "right")),
        ("photos, rms residual", "photos", "image_rms_um", ("id",)),
        ("points, rms residual", "points", "image_rms_um", ("id",)),
    )
    for label, block, key, names in kinds:
        rows = taken(document[block], largest_of(document[block], key, NAMED))
        if len(rows):
            yield label, ", ".join(f"{BETWEEN.join(map(row.get, names))} {micrometres(row[key])} µm" for row in rows)
    if rejected := list(standing_rejections(document)):
        yield "rejected", _and_more(list(map(_rejection, rejected[:NAMED])), len(rejected), "rejected")
    if missing := missing_points(document):
        said = [f"{counted(len(ids), 'point')} ({why})" for why, ids in missing[:NAMED]]
        yield "without coordinates", _and_more(said, len(missing), "undetermined")


def _rejection(row: Document) -> str:
    photos = BETWEEN.join(row[key] for key in ("photo", "other_photo") if row[key] is not None)
    return " on ".join(part for part in (row["point"], photos) if part)


def _and_more(said: Iterable[str], number: int, section: str) -> str:
    """Say the first of some things, and where the others stand."""
    return ", ".join(said) + (f" and {number - NAMED} more: --section {section}" if number > NAMED else "")


def _notes(notes: Iterable[Document], most: int) -> Iterator[Part]:
    """Give the first note of each kind, and how many more there are of it."""
    kinds: dict[str, list[Document]] = {}
    for note in notes:
        kinds.setdefault(note["code"], []).append(note)
    for first, *rest in list(kinds.values())[:most]:
        yield Words(sentence_of(first) + _likewise(rest), mark="-")
    if len(kinds) > most:
        yield Words(elsewhere(len(kinds) - most, "kind of notes", "notes", "notes"))


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
