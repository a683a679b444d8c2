"""The section on models that are bent or twisted."""

from __future__ import annotations

from photostrip.report.page.numbers import counted
from photostrip.report.page.parts import Document, Section, Words
from photostrip.report.page.tables import number, tabulated, words
from photostrip.report.sections.strip import photos_of


def deformation_section(document: Document) -> Section:
    """Twist and bending of the models that have the height control for it."""
    rows = document["deformations"]
    bent = sum(row["significant"] for row in rows)
    verdict = f"{bent} of them deformed" if bent else "none of them deformed"
    text = Words(
        f"{counted(len(rows), 'model')} with height control enough to see twist (x y) and bending (x²), {verdict} by"
        " the t test at 5 % of all together.",
        "look" if bent else "",
    )
    columns = (
        words("photos", photos_of),
        number("points", lambda row: len(row["points"])),
        number("twist", "twist.at_corner_m", 3, "at a corner, m"),
        number("t", "twist.t", 1),
        number("bending", "bending.at_corner_m", 3, "at a corner, m"),
        number("t", "bending.t", 1),
        number("limit of t", "t_limit", 1),
        number("Δω2", "omega2_arcsec", 1, "″", rank=2),
        number("Δα2 – Δα1", "alpha2_minus_alpha1_arcsec", 1, "″", rank=2),
        words("strip", "strip", rank=3),
    )
    return Section("Deformation of models", (text, tabulated(rows, columns)))
