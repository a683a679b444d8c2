"""Report of the plan of a survey of displacements."""

from __future__ import annotations

from photostrip.notes import Document
from photostrip.report.page.numbers import calibrated, fixed, short
from photostrip.report.page.parts import Facts, Section
from photostrip.report.page.tables import number, tabulated, words

DECIMALS = 4  # of metres


def displacement_sections(document: Document) -> tuple[Section, ...]:
    camera = document["camera"]
    width, height = (short(size) for size in camera["format_mm"])
    focal = calibrated(camera["principal_distance_mm"])
    stations = "one, distances known"
    if document["base_m"] is not None:
        turned = document["convergence_deg"]
        inwards = f", each camera turned inwards by {short(turned)}°" if turned else ""
        stations = f"two, base {short(document['base_m'])} m{inwards}"
    facts = Facts(
        (
            ("camera", f"{camera['name']}, f {focal} mm, {width} × {height} mm"),
            ("stations", stations),
            ("measuring", f"{fixed(document['change_sigma_um'], 1)} µm for a change of an image coordinate"),
            (
                "test",
                (
                    f"finds a displacement in {100 * document['power']:g} % of cases, and calls"
                    f" {100 * document['significance']:g} % of the points at rest moved"
                ),
            ),
        )
    )
    table = tabulated(
        document["points"],
        (
            number("distance", "distance_m", short, "m"),
            words("place", "place"),
            number("x", "x_m", 1, "m", rank=1),
            number("z", "z_m", 1, "m", rank=1),
            number("± right", "sigma_x_m", DECIMALS, "m"),
            number("± ahead", "sigma_y_m", DECIMALS, "m"),
            number("± up", "sigma_z_m", DECIMALS, "m"),
            number("right", "found_x_m", DECIMALS, "found, m"),
            number("ahead", "found_y_m", DECIMALS, "found, m"),
            number("up", "found_z_m", DECIMALS, "found, m"),
            number("worst", "worst_found_m", DECIMALS, "found, m"),
        ),
        note="side, top: the outermost points that the photos show; found: the smallest displacement in that direction",
    )
    return (Section("", (facts,)), Section("Displacements between two epochs", (table,)))
