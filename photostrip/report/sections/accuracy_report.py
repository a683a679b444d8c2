"""The accuracy report: from the document of a result to sections, worst things first. Nothing is computed here."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from enum import StrEnum

from photostrip.notes import Document
from photostrip.report.page.layout import USUAL
from photostrip.report.page.parts import Section, Words
from photostrip.report.sections.check_points import check_section, cross_validation_section
from photostrip.report.sections.decisions import decisions_section, weights_section
from photostrip.report.sections.findings import findings_sections
from photostrip.report.sections.marks import marks_section
from photostrip.report.sections.models import deformation_section, links_section, models_section, of_models
from photostrip.report.sections.overview import overview
from photostrip.report.sections.points import (
    control_section,
    image_section,
    not_determined_section,
    notes_section,
    rejected_section,
    ties_section,
)
from photostrip.report.sections.project import counts_section, fiducials_section, project_section
from photostrip.report.sections.strip import (
    absolute_section,
    junction_section,
    polynomial_section,
    relative_section,
)
from photostrip.report.sections.verdict import accuracy, headline, verdict_section


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
    """Give the sections of a report with their names; a name has several where its stage has."""
    name = SectionName
    yield name.VERDICT, verdict_section(document, everything=everything)
    yield from ((name.FINDINGS, each) for each in findings_sections(document, everything=everything))
    yield name.PROJECT, project_section(document)
    yield name.DECISIONS, decisions_section(document)
    yield name.COUNTS, counts_section(document)
    if document.get("fiducials"):
        yield name.FIDUCIALS, fiducials_section(document, everything=everything)
    yield from _of_the_strips(document, everything=everything)
    yield from _of_the_accuracy(document, everything=everything)
    yield from _of_the_points(document, everything=everything)


def _of_the_strips(document: Document, *, everything: bool) -> Iterator[tuple[SectionName, Section]]:
    if of_models(document):
        yield SectionName.LINKS, links_section(document, everything=everything)
        yield SectionName.MODELS, models_section(document, everything=everything)
    elif len(document["models"]) > 0:  # single photos have none
        yield SectionName.RELATIVE, relative_section(document, everything=everything)
        yield SectionName.JUNCTIONS, junction_section(document, everything=everything)
    if document["absolute"]:
        yield SectionName.ABSOLUTE, absolute_section(document)
    if document.get("polynomials"):
        yield SectionName.POLYNOMIAL, polynomial_section(document, everything=everything)
    from photostrip.report.sections.bundle import bundle_sections, classical_section

    yield from ((SectionName.BUNDLE, each) for each in bundle_sections(document, everything=everything))
    if "classical" in document:
        yield SectionName.CLASSICAL, classical_section(document)


def _of_the_accuracy(document: Document, *, everything: bool) -> Iterator[tuple[SectionName, Section]]:
    if "bundle" not in document:
        yield SectionName.WEIGHTS, weights_section(document, everything=everything)
    if "precision" in document:
        from photostrip.report.sections.precision import precision_section

        yield SectionName.PRECISION, precision_section(document, everything=everything)
    if document.get("deformations"):
        yield SectionName.DEFORMATIONS, deformation_section(document)


def _of_the_points(document: Document, *, everything: bool) -> Iterator[tuple[SectionName, Section]]:
    """Give what is left at points and photos, what was rejected, what is not determined."""
    from photostrip.report.statements.statement import certificate_section, statement_section

    yield SectionName.CONTROL, control_section(document, everything=everything)
    yield SectionName.CHECK, check_section(document, everything=everything)
    marks = marks_section(document, everything=everything)
    if marks.parts:
        yield SectionName.MARKS, marks
    if "statement" in document:
        yield SectionName.STATEMENT, statement_section(document)
    if "cross_validation" in document:
        yield SectionName.CROSS_VALIDATION, cross_validation_section(document, everything=everything)
    if document["counts"]["strips"] > 1 and "bundle" not in document:
        yield SectionName.TIES, ties_section(document, everything=everything)
    if not of_models(document):
        yield SectionName.IMAGES, image_section(document)
    yield SectionName.REJECTED, rejected_section(document, everything=everything)
    yield SectionName.UNDETERMINED, not_determined_section(document, everything=everything)
    yield SectionName.NOTES, notes_section(document, everything=everything)
    if "certificate" in document:
        yield SectionName.CERTIFICATE, certificate_section(document)


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
