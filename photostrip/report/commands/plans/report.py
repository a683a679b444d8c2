"""Reports of plans: from their documents to sections of sentences, facts and tables."""

from __future__ import annotations

from photostrip.notes import Document
from photostrip.report.commands.plans.cameras import camera_sections, source_table_sections
from photostrip.report.commands.plans.displacement import displacement_sections
from photostrip.report.commands.plans.model import model_sections, source_example_sections
from photostrip.report.commands.plans.screening import screening_sections
from photostrip.report.commands.plans.strip import strip_sections
from photostrip.report.page.parts import Section


def plan_report(document: Document) -> tuple[str, tuple[Section, ...]]:
    title, build = BUILDERS[document["kind"]]
    return title, build(document)


BUILDERS = {
    "model": ("Expected errors over one model", model_sections),
    "model-source-table": ("Accuracy of a model: the worked example of the source", source_example_sections),
    "strip": ("Expected accuracy of a strip", strip_sections),
    "cameras": ("Efficiency of cameras", camera_sections),
    "screening": ("Gross errors in relative orientation: what is found, and what is not", screening_sections),
    "displacement": ("Expected accuracy of displacements", displacement_sections),
    "source-table": ("Efficiency of cameras: the table of the source", source_table_sections),
}
