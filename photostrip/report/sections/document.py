"""The accuracy report: from the document of a result to sections, worst things first. Nothing is computed here."""

from __future__ import annotations

from typing import TYPE_CHECKING

from photostrip.errors import faults_instead
from photostrip.report.page.parts import Document, Section, Words
from photostrip.report.sections.bundle import bundle_sections
from photostrip.report.sections.covariance import covariance_section
from photostrip.report.sections.decisions import decisions_section, weights_section
from photostrip.report.sections.deformations import deformation_section
from photostrip.report.sections.findings import findings_sections
from photostrip.report.sections.models import links_section, models_section, of_models
from photostrip.report.sections.points import (
    check_section,
    control_section,
    image_section,
    not_determined_section,
    notes_section,
    rejected_section,
    ties_section,
)
from photostrip.report.sections.precision import precision_section
from photostrip.report.sections.project import counts_section, project_section
from photostrip.report.sections.strip import (
    absolute_section,
    junction_section,
    polynomial_section,
    relative_section,
)
from photostrip.report.sections.verdict import accuracy, headline, verdict_section

if TYPE_CHECKING:
    from collections.abc import Iterator


def sections_of(document: Document, *, everything: bool = False) -> tuple[Section, ...]:
    """Return the sections of the accuracy report."""
    several = document["counts"]["strips"] > 1
    return (
        verdict_section(document, everything=everything),
        *findings_sections(document),
        project_section(document),
        decisions_section(document),
        counts_section(document),
        *_of_the_strips(document, everything=everything),
        *_of_the_accuracy(document, everything=everything),
        *_of_the_points(document, several=several, everything=everything),
        Section("", (Words(headline(document), document["status"]), accuracy(document))),
    )


def _of_the_strips(document: Document, *, everything: bool) -> Iterator[Section]:
    """Return how the strips were formed and brought to the ground."""
    if of_models(document):
        yield links_section(document, everything=everything)
        yield models_section(document, everything=everything)
    elif len(document["models"]) > 0:  # single photos have none
        yield relative_section(document, everything=everything)
        yield junction_section(document, everything=everything)
    if document["absolute"]:
        yield absolute_section(document)
    if document.get("polynomials"):
        yield polynomial_section(document, everything=everything)
    if "covariance" in document:
        yield covariance_section(document, everything=everything)
    yield from bundle_sections(document)


def _of_the_accuracy(document: Document, *, everything: bool) -> Iterator[Section]:
    """Return what the control weighed and how precise the results are."""
    if "bundle" not in document:
        yield weights_section(document, everything=everything)
    if "precision" in document:
        yield precision_section(document, everything=everything)
    if document.get("deformations"):
        yield deformation_section(document)


def _of_the_points(document: Document, *, several: bool, everything: bool) -> Iterator[Section]:
    """Return what is left at points and photos, what was rejected, what is not determined."""
    yield control_section(document, everything=everything)
    yield check_section(document, everything=everything)
    if several and "bundle" not in document:
        yield ties_section(document, everything=everything)
    if not of_models(document):
        yield image_section(document)
    yield rejected_section(document, everything=everything)
    yield not_determined_section(document, everything=everything)
    yield notes_section(document, everything=everything)


def chosen_sections(document: Document, *, quiet: bool = False, everything: bool = False) -> tuple[Section, ...]:
    """Return the sections that are wanted: all of them, or the verdict that stands at the end."""
    sections = sections_of(document, everything=everything)
    return sections[-1:] if quiet else sections


def require_complete(document: Document, file: str) -> None:
    """Refuse a document whose file a user has cut or edited so that it cannot be reported."""
    with faults_instead(file, "reported"):
        title_of(document)
        sections_of(document, everything=True)


def title_of(document: Document) -> str:
    """Return the title of the report."""
    return f"Accuracy report: {document['name']}"
