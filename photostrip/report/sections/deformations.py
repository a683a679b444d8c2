"""The section on models that are bent or twisted."""

from __future__ import annotations

from typing import Any

from photostrip.report.page.figures import counted, fixed, metres
from photostrip.report.page.parts import Column, Section, Table, Words

Document = dict[str, Any]


def deformation_section(document: Document) -> Section:
    """Twist and bending of the models that have the height control for it.

    Parameters
    ----------
    document : dict
        The document of a result that has ``deformations``.
    """
    rows = document["deformations"]
    bent = sum(row["significant"] for row in rows)
    verdict = f"{bent} of them deformed" if bent else "none of them deformed"
    words = Words(
        f"{counted(len(rows), 'model')} with height control enough to see twist (x y) and bending (x²), {verdict} by"
        " the t test at 5 % of all together.",
        "look" if bent else "",
    )
    columns = (
        Column("photos", left=True),
        Column("points"),
        Column("twist", "at a corner, m"),
        Column("t"),
        Column("bending", "at a corner, m"),
        Column("t"),
        Column("limit of t"),
        Column("Δω2", "″", rank=2),
        Column("Δα2 – Δα1", "″", rank=2),
        Column("strip", left=True, rank=3),
    )
    cells = tuple(
        (
            f"{row['left']} – {row['right']}",
            str(len(row["points"])),
            metres(row["twist"]["at_corner_m"]),
            fixed(row["twist"]["t"], 1),
            metres(row["bending"]["at_corner_m"]),
            fixed(row["bending"]["t"], 1),
            fixed(row["t_limit"], 1),
            fixed(row["omega2_arcsec"], 1),
            fixed(row["alpha2_minus_alpha1_arcsec"], 1),
            row["strip"],
        )
        for row in rows
    )
    return Section("Deformation of models", (words, Table(columns, cells)))
