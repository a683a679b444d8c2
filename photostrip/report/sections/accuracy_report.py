"""The accuracy report: from the document of a result to sections, worst things first. Nothing is computed here."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator

from photostrip.notes import Document
from photostrip.report.page.layout import USUAL
from photostrip.report.page.parts import Part, Section, Words
from photostrip.report.sections import formation, network, points, project, statement, verdict
from photostrip.report.sections.overview import overview

SECTIONS: tuple[tuple[str, str, Callable[[Document], Iterator[Part]]], ...] = (
    ("verdict", "Verdict", verdict.verdict),
    ("findings", "Plausibility of the data", verdict.findings),
    ("check", "Check points", points.check),
    ("cross-validation", "Cross-validation", points.cross_validation),
    ("control", "Control points", points.control),
    ("positions", "Camera positions", points.positions),
    ("marks", "Marks of given points", points.marks),
    ("camera", "Adjusted camera", network.camera),
    ("precision", "Precision", points.precision),
    ("statement", "Accuracy statement", statement.statement),
    ("project", "Project", project.project),
    ("decisions", "Decided automatically", project.decisions),
    ("counts", "Counts", project.counts),
    ("fiducials", "Interior orientation", formation.fiducials),
    ("relative", "Relative orientation", formation.relative),
    ("junctions", "Scale transfer and junctions", formation.junctions),
    ("links", "Links of the models", formation.links),
    ("models", "Models", formation.models),
    ("absolute", "Absolute orientation", formation.absolute),
    ("polynomial", "Polynomial adjustment", formation.polynomials),
    ("bundle", "Bundle adjustment", network.bundle),
    ("bundle", "Network of independent models", network.model_network),
    ("bundle", "Reliability", network.reliability),
    ("bundle", "Variance components", network.variance_components),
    ("bundle", "Parameters that photos share", network.shared_parameters),
    ("classical", "The classical strip adjustment beside it", network.classical),
    ("weights", "Weights of the control", points.weights),
    ("ties", "Ties between strips", points.ties),
    ("images", "Image residuals", points.images),
    ("rejected", "Rejected", points.rejected),
    ("undetermined", "Points without coordinates", points.not_determined),
    ("notes", "Notes", points.notes),
    ("certificate", "Certificate", statement.certificate),
)
"""Name, as ``--section`` has it; title; what gives the parts of a section: nothing where it has nothing to say."""
NAMES = tuple(dict.fromkeys(name for name, *_ in SECTIONS))


def named_sections(document: Document) -> Iterator[tuple[str, Section]]:
    """Give the sections of the report, whole, with their names; those that have nothing to say are left out."""
    for name, title, give in SECTIONS:
        if parts := tuple(give(document)):
            yield name, Section(title, parts)


def sections_of(document: Document) -> tuple[Section, ...]:
    return tuple(section for _, section in named_sections(document))


def chosen_sections(
    document: Document,
    *,
    quiet: bool = False,
    everything: bool = False,
    names: Collection[str] = (),
    width: int = USUAL,
) -> tuple[Section, ...]:
    """Return the sections that are asked for: the verdict alone, some by name as a whole, all, or the overview.

    width: of the page for which the overview is made.
    """
    if names:
        named = [(name, section) for name, section in named_sections(document) if name in names]
        missing = [name for name in NAMES if name in set(names) - dict(named).keys()]
        lacking = [Section("", (Words(f"This result has no section `{each}`."),)) for each in missing]
        return (*(section for _, section in named), *lacking)
    last = Words(verdict.headline(document), document["status"])
    if quiet:
        return (Section("", (last, verdict.accuracy(document))),)
    return (*(sections_of(document) if everything else overview(document, width)), Section("", (last,)))


def title_of(document: Document) -> str:
    return f"Accuracy report: {document['name']}"
