"""The accuracy report: from the document of a result to sections, worst things first. Nothing is computed here."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from enum import StrEnum

from photostrip.notes import Document
from photostrip.report.page.layout import USUAL
from photostrip.report.page.parts import Section, Words
from photostrip.report.sections import formation, points, project
from photostrip.report.sections.network import bundle_sections, classical_section
from photostrip.report.sections.overview import overview
from photostrip.report.sections.statement import certificate_section, statement_section
from photostrip.report.sections.verdict import accuracy, findings_sections, headline, verdict_section


class SectionName(StrEnum):
    """Sections of the report, as ``--section`` names them, in their order."""

    VERDICT = "verdict"
    FINDINGS = "findings"
    PROJECT = "project"
    DECISIONS = "decisions"
    COUNTS = "counts"
    FIDUCIALS = "fiducials"
    RELATIVE = "relative"
    JUNCTIONS = "junctions"
    LINKS = "links"
    MODELS = "models"
    ABSOLUTE = "absolute"
    POLYNOMIAL = "polynomial"
    BUNDLE = "bundle"
    CLASSICAL = "classical"
    WEIGHTS = "weights"
    PRECISION = "precision"
    DEFORMATIONS = "deformations"
    CONTROL = "control"
    CHECK = "check"
    MARKS = "marks"
    STATEMENT = "statement"
    CROSS_VALIDATION = "cross-validation"
    TIES = "ties"
    IMAGES = "images"
    REJECTED = "rejected"
    UNDETERMINED = "undetermined"
    NOTES = "notes"
    CERTIFICATE = "certificate"


def sections_of(document: Document, *, everything: bool = False) -> tuple[Section, ...]:
    return tuple(section for _, section in named_sections(document, everything=everything))


def named_sections(document: Document, *, everything: bool) -> Iterator[tuple[SectionName, Section]]:
    """Give the sections of a report with their names, the worst first; a name has several where its stage has."""
    name = SectionName
    yield name.VERDICT, verdict_section(document, everything=everything)
    yield from ((name.FINDINGS, each) for each in findings_sections(document, everything=everything))
    yield name.PROJECT, project.project_section(document)
    yield name.DECISIONS, project.decisions_section(document)
    yield name.COUNTS, project.counts_section(document)
    if len(document.get("fiducials", ())):
        yield name.FIDUCIALS, formation.fiducials_section(document, everything=everything)
    yield from _of_the_strips(document, everything=everything)
    yield from _of_the_points(document, everything=everything)


def _of_the_strips(document: Document, *, everything: bool) -> Iterator[tuple[SectionName, Section]]:
    name = SectionName
    if project.of_models(document):
        yield name.LINKS, formation.links_section(document, everything=everything)
        yield name.MODELS, formation.models_section(document, everything=everything)
    elif len(document["models"]):  # single photos have none
        yield name.RELATIVE, formation.relative_section(document, everything=everything)
        yield name.JUNCTIONS, formation.junction_section(document, everything=everything)
    if len(document["absolute"]):
        yield name.ABSOLUTE, formation.absolute_section(document)
    if len(document.get("polynomials", ())):
        yield name.POLYNOMIAL, formation.polynomial_section(document, everything=everything)
    yield from ((name.BUNDLE, each) for each in bundle_sections(document, everything=everything))
    if "classical" in document:
        yield name.CLASSICAL, classical_section(document)


def _of_the_points(document: Document, *, everything: bool) -> Iterator[tuple[SectionName, Section]]:
    name = SectionName
    if "bundle" not in document:
        yield name.WEIGHTS, points.weights_section(document, everything=everything)
    if "precision" in document:
        yield name.PRECISION, points.precision_section(document, everything=everything)
    if len(document.get("deformations", ())):
        yield name.DEFORMATIONS, formation.deformation_section(document)
    yield name.CONTROL, points.control_section(document, everything=everything)
    yield name.CHECK, points.check_section(document, everything=everything)
    marks = points.marks_section(document, everything=everything)
    if marks.parts:
        yield name.MARKS, marks
    if "statement" in document:
        yield name.STATEMENT, statement_section(document)
    if "cross_validation" in document:
        yield name.CROSS_VALIDATION, points.cross_validation_section(document, everything=everything)
    if document["counts"]["strips"] > 1 and "bundle" not in document:
        yield name.TIES, points.ties_section(document, everything=everything)
    if not project.of_models(document):
        yield name.IMAGES, points.image_section(document)
    yield name.REJECTED, points.rejected_section(document, everything=everything)
    yield name.UNDETERMINED, points.not_determined_section(document, everything=everything)
    yield name.NOTES, points.notes_section(document, everything=everything)
    if "certificate" in document:
        yield name.CERTIFICATE, certificate_section(document)


def chosen_sections(
    document: Document,
    *,
    quiet: bool = False,
    everything: bool = False,
    names: Collection[SectionName] = (),
    width: int = USUAL,
) -> tuple[Section, ...]:
    """Return the sections that are wanted: the verdict alone, some by name as a whole, all, or the overview.

    width: of the page for which the overview is made.
    """
    last = headline(document)
    end = Section("", (Words(last, document["status"]),))
    if names:
        named = list(named_sections(document, everything=True))
        missing = [each for each in SectionName if each in names and each not in {name for name, _ in named}]
        lacking = [Section("", (Words(f"This result has no section `{each}`."),)) for each in missing]
        return (*(section for name, section in named if name in names), *lacking)
    if quiet:
        return (Section("", (Words(last, document["status"]), accuracy(document))),)
    return (*(sections_of(document, everything=True) if everything else overview(document, width)), end)


def title_of(document: Document) -> str:
    return f"Accuracy report: {document['name']}"
