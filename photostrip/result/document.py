"""The document of a result: blocks of keys and tables, the content of result.json; everything else comes from it."""

from __future__ import annotations

from collections.abc import Iterable

from photostrip import __version__
from photostrip.notes import Document, Finding, Note
from photostrip.pipeline.results import Result
from photostrip.result import conventions, summary
from photostrip.result.adjustment import (
    bundle,
    classical,
    deformation,
    junctions,
    links,
    pairs,
    rejected,
    strips,
)
from photostrip.result.derived import with_derived
from photostrip.result.description import SCHEMA
from photostrip.result.numbers import natural_rank
from photostrip.result.points import (
    checked,
    cross_validation,
    given,
    ground,
    image_coordinates,
    lost_say,
    photos,
    precision,
)
from photostrip.result.statement.evidence import statement_of
from photostrip.result.table import Table, in_frame
from photostrip.result.verdict import verdict_of


def document_of(result: Result, notes: Iterable[Note] = ()) -> Document:
    """Turn a result into the content of result.json.

    notes: what was noticed before the run, while the project was read; they come first.
    Returns text, numbers, None, lists, dictionaries and tables; the same for the same inputs, without times and paths.
        Numbers are rounded to decimals that lie well below what they are good for.
    """
    rank = natural_rank(result.refined.observations.point_ids)
    images = photos.image_residuals(result, rank)
    found = given.differences(result)
    numbers = summary.summary_of(result, images, found)
    taken_out, said = rejected.rejected_of(result), (*notes, *result.notes)
    counts = summary.counts_of(result, sum(len(image.rows) for image in images))
    points = ground.points_of(result, photos.point_rms(result, images), rank)
    unchecked = checked.unchecked_notes(points, taken_out, counts["image_points"])
    lost = lost_say.lost_say_notes(result, images, taken_out, said)
    body: Document = {
        "adjustment": conventions.adjustment_of(result),
        "frame": ground.frame_of(result),
        "angles": conventions.angles_of(result),
        "summary": numbers,
        "tolerances": summary.tolerances_of(result, numbers),
        "counts": counts | checked.counts_of(points),
        "conventions": conventions.conventions_of(result),
        "settings": conventions.settings_of(result),
        "corrections": conventions.corrections_of(result),
        "cameras": conventions.cameras_of(result),
        **image_coordinates.fiducials_of(result),
        "strips": Table.of_rows("strips", (strips.strip_of(result, each) for each in result.strips)),
        "absolute": Table.of_rows("absolute", map(strips.absolute_of, result.strips)),
        **strips.polynomials_of(result),
        **precision.precision_of(result, found),
        **cross_validation.cross_validation_of(result),
        **bundle.bundle_of(result),
        **classical.classical_of(result),
        "control": given.control_of(result, found),
        "misclosures": given.misclosures_of(result),
        "ties": ground.ties_of(result, rank),
        "rejected": taken_out,
        "not_determined": ground.not_determined_of(result),
        "findings": Table.of_rows("findings", map(_finding, result.findings)),
        "notes": Table.of_rows("notes", map(_note, (*said, *lost, *unchecked))),
        "models": links.models_of(result) if result.model_strips else pairs.models_of(result),
        **({"links": links.links_of(result)} if result.model_strips else {}),
        **deformation.deformations_of(result),
        "junctions": junctions.junctions_of(result),
        **photos.photos_of(result, images),
        "points": points,
        "residuals": bundle.with_reliability(result, images, photos.residuals_of(result, images)),
        **({"link_residuals": links.residuals_of(result, rank)} if result.model_strips else {}),
    }
    body = in_frame(with_derived(body))
    verdict = verdict_of(body)
    head = {
        "photostrip_result": SCHEMA,
        "version": __version__,
        "name": result.inputs.name,
        "status": verdict.pop("status"),
        "verdict": verdict,
    }
    return head | {"statement": statement_of(result, found, head | body)} | body


def _finding(finding: Finding) -> Document:
    """Return a finding with the keys that a note has too; the numbers of its evidence have six digits."""
    return {
        "code": finding.code,
        "title": finding.title,
        "severity": finding.severity,
        "accepted": finding.accepted,
        "message": finding.message,
        "fix": finding.fix,
        "evidence": {
            name: float(f"{value:.6g}") if isinstance(value, float) else value
            for name, value in sorted(finding.evidence.items())
        },
        "strips": list(finding.strips),
        "photos": list(finding.photos),
        "points": list(finding.points),
        **_cause(finding),
    }


def _note(note: Note) -> Document:
    return {
        "code": note.code,
        "severity": note.severity,
        "message": note.message,
        "strip": note.strip,
        "photos": list(note.photos),
        "points": list(note.points),
        **_cause(note),
    }


def _cause(noted: Finding | Note) -> Document:
    return {"file": noted.file, "line": noted.line, "column": noted.column, "key": noted.key}
