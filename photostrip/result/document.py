"""The document of a result: blocks of keys and tables, the content of result.json; everything else comes from it."""

from __future__ import annotations

from collections.abc import Iterable

from photostrip import __version__
from photostrip.notes import Document, Finding, Note
from photostrip.pipeline.results import Result
from photostrip.result import bundle, given, points, precision, rejected, strips, summary
from photostrip.result.derived import with_derived
from photostrip.result.description import SCHEMA
from photostrip.result.numbers import attributes, natural_rank
from photostrip.result.statement import statement_of
from photostrip.result.table import Table, in_frame
from photostrip.result.verdict import verdict_of

CONCERNED = "photos points file line column key"  # of findings and notes: whom, and the cause
OF_NOTES = f"code severity message strip {CONCERNED}"


def document_of(result: Result, notes: Iterable[Note] = ()) -> Document:
    """Turn a result into the content of result.json.

    notes: what was noticed before the run, while the project was read; they come first.
    Returns text, numbers, None, lists, dictionaries and tables; the same for the same inputs, without times and paths.
        Numbers are rounded to decimals that lie well below what they are good for.
    """
    rank = natural_rank(result.refined.observations.point_ids)
    images = points.image_residuals(result, rank)
    found = given.differences(result)
    numbers = summary.summary_of(result, images, found)
    taken_out, said = rejected.rejected_of(result), (*notes, *result.notes)
    counts = summary.counts_of(result, sum(len(image.rows) for image in images))
    table = points.points_of(result, points.point_rms(result, images), rank)
    unchecked = points.unchecked_notes(table, taken_out)
    lost = rejected.lost_say_notes(result, images, taken_out, said)
    body: Document = {
        "adjustment": summary.adjustment_of(result),
        "frame": points.frame_of(result),
        "angles": summary.angles_of(result),
        "summary": numbers,
        "tolerances": summary.tolerances_of(result, numbers),
        "counts": counts | points.counts_of(table),
        "conventions": summary.conventions_of(result),
        "settings": summary.settings_of(result),
        "corrections": summary.corrections_of(result),
        "cameras": summary.cameras_of(result),
        **points.fiducials_of(result),
        "strips": Table.of_rows("strips", (strips.strip_of(result, each) for each in result.strips)),
        "absolute": Table.of_rows("absolute", map(strips.absolute_of, result.strips)),
        **strips.polynomials_of(result),
        **precision.precision_of(result, found),
        **precision.cross_validation_of(result),
        **bundle.bundle_of(result),
        **strips.classical_of(result),
        "control": given.control_of(result, found),
        **bundle.positions_of(result),
        "misclosures": given.misclosures_of(result),
        "ties": points.ties_of(result, rank),
        "rejected": taken_out,
        "not_determined": points.not_determined_of(result),
        "findings": Table.of_rows("findings", map(_finding, result.findings)),
        "notes": Table.of_rows("notes", (attributes(note, OF_NOTES) for note in (*said, *lost, *unchecked))),
        "models": strips.independent_models_of(result) if result.model_strips else strips.models_of(result),
        **({"links": strips.links_of(result)} if result.model_strips else {}),
        "junctions": strips.junctions_of(result),
        **points.photos_of(result, images),
        "points": table,
        "residuals": bundle.with_reliability(result, images, points.residuals_of(result, images)),
        **({"link_residuals": strips.residuals_of(result, rank)} if result.model_strips else {}),
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
    """Return a finding; the numbers of its evidence have six digits, coordinates three decimals."""
    evidence = {
        name: (round(value, 3) if abs(value) > 1000 else float(f"{value:.6g}")) if isinstance(value, float) else value
        for name, value in sorted(finding.evidence.items())
    }
    said = attributes(finding, f"code title severity accepted message fix evidence strips {CONCERNED}")
    return said | {"evidence": evidence}
