"""The report on a comparison of cameras."""

from __future__ import annotations

from collections.abc import Sequence

from photostrip.notes import Document
from photostrip.report.page.numbers import calibrated, fixed, short
from photostrip.report.page.parts import Facts, Part, Section, Table, numbered
from photostrip.report.page.tables import number, tabulated, words


def camera_sections(document: Document) -> tuple[Section, ...]:
    facts = Facts(
        (
            ("fewest photos", f"{document['fewest_photos']}, at equal standard deviations of heights"),
            ("smallest K", f"{document['smallest_coefficient']}: the order where bases and formats are equal"),
            ("beside", f"{document['reference']}: all ratios are to it"),
        )
    )
    models = tabulated(
        document["cameras"],
        (
            words("camera", "camera"),
            number("base b", "base_mm", 1, "mm"),
            number("useful width", "useful_width_mm", 1, "mm"),
            number("f/b", "base_ratio", 2),
        ),
    )
    sections = [Section("", (facts, _camera_table(document["cameras"]))), Section("Their models", (models,))]
    if "survey" in document:
        sections += _survey(document)
    return tuple(sections)


def _survey(document: Document) -> list[Section]:
    """Show the survey that all cameras are flown for, and what they take of the terrain."""
    rows, terrain = document["survey"], document["terrain"]
    cost = tabulated(
        rows,
        (
            words("camera", "camera"),
            number("scale", lambda row: f"1:{row['scale']:.0f}"),
            number("H", "flying_height_m", 0, "m"),
            number("m_h", "sigma_z_m", 3, "m"),
            number("area S", "area_km2", short, "km²"),
            number("m_h/S", "sigma_z_per_area_m_km2", short, "m/km²"),
            number("photos", "photos_per_100_km2", 0, "per 100 km²"),
        ),
        note="S: what a model covers, of its useful width",
    )
    sections = [Section("What heights and areas cost", (cost,))]
    if terrain["relief_m"] or terrain["slope_deg"]:
        taken = tabulated(
            rows,
            (
                words("camera", "camera"),
                number("overlap", "lap_at_highest_percent", 1, "highest, %"),
                number("relief", "largest_relief_m", 0, "largest, m"),
                number("slope", "steepest_slope_deg", 1, "steepest, °"),
                number("f", "least_principal_distance_mm", calibrated, "least, mm"),
                words("takes it", lambda row: "yes" if row["suits"] else "no"),
            ),
            note="least f: of a camera with this format and base",
        )
        asked = f"relief {fixed(terrain['relief_m'], 0)} m, slopes up to {fixed(terrain['slope_deg'], 0)}°"
        best = document["recommended"]
        chosen = "none of these cameras" if best is None else f"{best}, the most efficient of those that take it"
        facts = Facts((("terrain", asked), ("recommended", chosen)))
        sections.append(Section("What the cameras take of the terrain", (facts, taken)))
    return sections


def _camera_table(rows: Sequence[Document]) -> Table:
    return tabulated(
        rows,
        (
            words("camera", "camera"),
            number("f", "principal_distance_mm", calibrated, "mm"),
            number("m_p", "sigma_um", 1, "µm"),
            number("K = f m_p", "coefficient_mm2", 3, "mm²"),
            number("H/m_h", "height_ratio", 0),
            number("m_h", "eta_height", 3, "equal area"),
            number("scale", "scale_ratio", 3, "equal m_h"),
            number("area", "eta_area_printed", 3, "printed"),
            number("area", "eta_area", 3, "equal m_h"),
            number("photos", "photos_ratio", 3, "equal m_h"),
        ),
    )


def source_table_sections(document: Document) -> tuple[Section, ...]:
    """Show the table of the source, computed again, and what is wrong in print."""
    table = tabulated(
        document["cameras"],
        (
            number("f", "principal_distance_mm", short, "mm"),
            number("m_p", lambda camera: short(camera["sigma_um"] / 1000), str, "mm"),
            number("K", "coefficient_mm2", 3, "mm²"),
            number("K", "printed_coefficient_mm2", short, "printed"),
            number("H/m_h", "height_ratio", 0, "b = 60 mm"),
            number("H/m_h", "printed_height_ratio", 0, "printed"),
            number("eta_S", "eta_area_printed", 3, "lengths"),
            number("eta_S", "printed_eta", short, "printed"),
            number("area", "eta_area", 3, "true ratio"),
        ),
    )
    return (Section("", (table,)), Section("What is wrong in print", _misprints(document)))


def _misprints(document: Document) -> tuple[Part, ...]:
    first, last = document["cameras"][0], document["cameras"][-1]
    f = short(last["principal_distance_mm"])
    return numbered(
        (
            "Eq. 2 gives a ratio of areas with the scale to the first power; an area goes with its square. Between f ="
            f" {short(first['principal_distance_mm'])} and {f} mm the printed form gives"
            f" {fixed(first['eta_area_printed'], 2)}, the areas are as {fixed(first['eta_area'], 2)} to 1. The ranking"
            " by K does not change."
        ),
        "The indices of eq. 5 are garbled; it reads (H1 m_p1 b2) / (b1 H2 m_p2).",
        (
            f"The last heading, sqrt(m_h) = 1/tau_s, is eta_S = 1/eta_mh beside f = {f} mm: for the first camera"
            f" 1/{fixed(first['eta_height'], 3)} = {fixed(1 / first['eta_height'], 2)}."
        ),
        (
            f"H/m_h = {fixed(last['printed_height_ratio'], 0)} for f = {f} mm does not belong to the other rows: a base"
            f" of 60 mm gives {fixed(last['height_ratio'], 0)};"
            f" {fixed(last['printed_height_ratio'], 0)} would need"
            f" {fixed(last['printed_height_ratio'] * last['sigma_um'] / 1000, 0)} mm."
        ),
    )
