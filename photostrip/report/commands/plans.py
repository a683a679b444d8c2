"""Reports of plans: from their documents to sections of sentences, facts and tables."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from photostrip.report.commands.plan_strip import strip_sections
from photostrip.report.page.numbers import counted, fixed, metres, micrometres, short
from photostrip.report.page.parts import Column, Facts, Part, Section, Table, Words

if TYPE_CHECKING:
    from collections.abc import Sequence

Document = dict[str, Any]

USES = {"xyz": "in full", "xy": "in plan", "z": "in height"}


def plan_report(document: Document) -> tuple[str, tuple[Section, ...]]:
    """Make the report of a plan."""
    title, build = BUILDERS[document["kind"]]
    return title, build(document)


# ----------------------------------------------------------------------------------------------------- one model


def _model(document: Document) -> tuple[Section, ...]:
    geometry, worst = document["geometry"], document["worst"]
    sigmas = "; ".join(
        f"{each['element']} {fixed(each['sigma'], 1)}{' µm' if each['unit'] == 'um' else '″'}"
        for each in document["orientation"]["sigmas"]
    )
    facts = Facts(
        (
            ("camera", f"{document['camera']['name']}, f {short(document['camera']['principal_distance_mm'], 9)} mm"),
            (
                "photos",
                (
                    f"1:{geometry['scale']:g}, {fixed(geometry['flying_height_m'], 0)} m above the ground; base"
                    f" {fixed(geometry['base_mm'], 1)} mm, {fixed(geometry['base_m'], 0)} m"
                ),
            ),
            (
                "measuring",
                (
                    f"{micrometres(document['image_sigma_um'])} µm for an image coordinate,"
                    f" {micrometres(document['parallax_sigma_um'])} µm for a y parallax"
                ),
            ),
            ("orientation", f"{counted(document['orientation']['points'], 'point')}: {sigmas}"),
            ("control", _control(document)),
            (
                "worst height",
                f"{metres(worst['sigma_z_m'])} m at x {fixed(worst['x_mm'], 1)}, y {fixed(worst['y_mm'], 1)} mm",
            ),
        )
    )
    return (
        Section("", (facts,)),
        Section("Standard deviation in plan (both coordinates), m", (_grid(document, "sigma_plan_m"),)),
        Section("Standard deviation in height, m", (_grid(document, "sigma_z_m"),)),
        Section("What each source of errors does alone", (_sources(document),)),
        Section("At the control", (_at_control(document),)),
        Section("The simple formulas, relative orientation and measuring only", (_simple(document),)),
    )


def _control(document: Document) -> str:
    points = document["control"]
    kinds = [f"{sum(p['use'] == use for p in points)} {word}" for use, word in USES.items()]
    given = ", ".join(kind for kind in kinds if not kind.startswith("0 "))
    sigma = ", ".join(metres(value) for value in document["control_sigma_m"])
    return f"{given}; given to {sigma} m along, across and in height"


def _grid(document: Document, name: str) -> Table:
    """One quantity over the model: a row for each y, a column for each x."""
    points = document["points"]
    x = sorted({point["x_mm"] for point in points})
    y = sorted({point["y_mm"] for point in points}, reverse=True)
    value = {(point["x_mm"], point["y_mm"]): point[name] for point in points}
    columns = (Column("y \\ x", "mm"), *(Column(fixed(each, 0)) for each in x))
    return Table(columns, tuple((fixed(b, 0), *(metres(value[a, b]) for a in x)) for b in y))


def _sources(document: Document) -> Table:
    columns = (
        Column("source", left=True),
        Column("plan rms", "m"),
        Column("plan max", "m"),
        Column("height rms", "m"),
        Column("height max", "m"),
    )
    names = ("plan_rms_m", "plan_max_m", "z_rms_m", "z_max_m")
    rows = [(row["source"], *(metres(row[name]) for name in names)) for row in document["sources"]]
    return Table(
        columns,
        tuple(rows[:-2]),
        tuple(rows[-2:]),
        "over the points above; dalpha2 is the turn of the right photo against the base",
    )


def _at_control(document: Document) -> Table:
    columns = (
        Column("x", "mm"),
        Column("y", "mm"),
        Column("given", left=True),
        Column("plan", "m"),
        Column("height", "m"),
    )
    rows = (
        (
            fixed(p["x_mm"], 1),
            fixed(p["y_mm"], 1),
            USES[p["use"]],
            metres(p["sigma_plan_m"]),
            metres(p["sigma_z_m"]),
        )
        for p in document["control"]
    )
    return Table(columns, tuple(rows), note="of the adjusted model point; the given coordinates stay what they are")


def _simple(document: Document) -> Table:
    columns = (
        Column("place", left=True),
        Column("plan", "source, m"),
        Column("height", "source, m"),
        Column("plan", "rigorous, m"),
        Column("height", "rigorous, m"),
    )
    names = ("source_plan_m", "source_z_m", "rigorous_plan_m", "rigorous_z_m")
    return Table(columns, tuple((row["place"], *(metres(row[name]) for name in names)) for row in document["simple"]))


# ------------------------------------------------------------------------------------------------------- cameras


def _cameras(document: Document) -> tuple[Section, ...]:
    facts = Facts(
        (
            ("fewest photos", f"{document['fewest_photos']}, at equal standard deviations of heights"),
            ("smallest K", f"{document['smallest_coefficient']}: the order where bases and formats are equal"),
            ("beside", f"{document['reference']}: all ratios are to it"),
        )
    )
    return (Section("", (facts, _camera_table(document["cameras"]))),)


def _camera_table(rows: Sequence[Document]) -> Table:
    columns = (
        Column("camera", left=True),
        Column("f", "mm"),
        Column("m_p", "µm"),
        Column("base", "mm", rank=1),
        Column("K = f m_p", "mm²"),
        Column("H/m_h"),
        Column("m_h", "equal area"),
        Column("scale", "equal m_h"),
        Column("area", "printed"),
        Column("area", "equal m_h"),
        Column("photos", "equal m_h"),
    )
    cells = (
        (
            row["camera"],
            short(row["principal_distance_mm"], 9),
            micrometres(row["sigma_um"]),
            fixed(row["base_mm"], 1),
            fixed(row["coefficient_mm2"], 3),
            fixed(row["height_ratio"], 0),
            *(
                fixed(row[name], 3)
                for name in ("eta_height", "scale_ratio", "eta_area_printed", "eta_area", "photos_ratio")
            ),
        )
        for row in rows
    )
    return Table(columns, tuple(cells))


def _source_table(document: Document) -> tuple[Section, ...]:
    columns = (
        Column("f", "mm"),
        Column("m_p", "mm"),
        Column("K", "mm²"),
        Column("K", "printed"),
        Column("H/m_h", "b = 60 mm"),
        Column("H/m_h", "printed"),
        Column("eta_S", "lengths"),
        Column("eta_S", "printed"),
        Column("area", "true ratio"),
    )
    rows = tuple(
        (
            short(row["principal_distance_mm"]),
            short(row["sigma_um"] / 1000),
            fixed(row["coefficient_mm2"], 3),
            short(row["printed_coefficient_mm2"]),
            fixed(row["height_ratio"], 0),
            fixed(row["printed_height_ratio"], 0),
            fixed(row["eta_area_printed"], 3),
            short(row["printed_eta"]),
            fixed(row["eta_area"], 3),
        )
        for row in document["cameras"]
    )
    return (Section("", (Table(columns, rows),)), Section("What is wrong in print", _misprints(document)))


def _misprints(document: Document) -> tuple[Part, ...]:
    first, last = document["cameras"][0], document["cameras"][-1]
    f = short(last["principal_distance_mm"])
    texts = (
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
    return tuple(Words(text, mark=f"{number}.") for number, text in enumerate(texts, 1))


BUILDERS = {
    "model": ("Expected errors over one model", _model),
    "strip": ("Expected accuracy of a strip", strip_sections),
    "cameras": ("Efficiency of cameras", _cameras),
    "source-table": ("Efficiency of cameras: the table of the source", _source_table),
}
