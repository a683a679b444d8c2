"""Report of the plan of a strip: from its document to sections of facts and tables."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from photostrip.report.page.numbers import counted, fixed, listed, metres, micrometres, short
from photostrip.report.page.parts import DASH, Column, Facts, Part, Section, Table, Words
from photostrip.report.page.tables import number, tabulated, words

if TYPE_CHECKING:
    from collections.abc import Sequence

Document = dict[str, Any]
Detected = tuple[float | None, bool | None]  # size in metres, whether anything checks the coordinate

PHOTOS_SHOWN = 11  # columns of the tables along a strip
PLACES_SHOWN = 6


def strip_sections(document: Document) -> tuple[Section, ...]:
    """Make the report of the plan of a strip, with bands needed and best places when asked for."""
    near = "near each photo, m"
    sections = [
        Section("", (Facts(_facts(document)), _layouts(document))),
        Section("Expected standard deviations of new points", (_accuracy(document), *_reasons(document))),
        Section(f"Along the strip: worst standard deviation in height {near}", (_along(document, "z_m"),)),
        Section(f"Along the strip: worst standard deviation in plan {near}", (_along(document, "plan_m"),)),
        Section("Smallest control error that is found", (_detectable(document),)),
    ]
    if document["needed"]:
        sections.append(Section("Bands of control that the required accuracy needs", (_needed(document),)))
    if document["placed"] is not None:
        sections.append(Section("Best places for further control points", _placed(document)))
    return tuple(sections)


def _facts(document: Document) -> tuple[tuple[str, str], ...]:
    geometry, required = document["geometry"], document["required_m"]
    facts = [
        ("camera", f"{document['camera']['name']}, f {short(document['camera']['principal_distance_mm'], 9)} mm"),
        (
            "strip",
            (
                f"{geometry['photos']} photos, 1:{geometry['scale']:g}, {short(geometry['end_lap_percent'])} % overlap;"
                f" {fixed(geometry['flying_height_m'], 0)} m above the ground, base {fixed(geometry['base_m'], 0)} m"
            ),
        ),
        (
            "measuring",
            (
                f"{micrometres(document['image_sigma_um'])} µm; {counted(geometry['points'], 'point')}, at each nadir"
                f" {counted(geometry['rows'], 'row')}"
            ),
        ),
    ]
    if any(required.values()):
        parts = [f"{metres(required[key])} m in {key}" for key in ("plan", "height") if required[key] is not None]
        facts.append(("required", ", ".join(parts)))
    return tuple(facts)


def _layouts(document: Document) -> Table:
    columns = (
        Column("layout", left=True),
        Column("points"),
        Column("σ of control", "along, across, up, m", left=True),
        Column("σ of perspective centres", "m", left=True),
        Column("at photo/row", left=True, rank=1),
    )
    rows = []
    for layout in document["layouts"]:
        gnss = layout["gnss_sigma_m"]
        offset = ", offset free" if layout["gnss_offset"] else ""
        rows.append(
            (
                layout["name"],
                str(len(layout["points"])),
                _three(layout["sigma_m"]),
                f"{_three(gnss)}{offset}" if gnss else "not measured",
                listed((_at(point) for point in layout["points"]), PLACES_SHOWN),
            )
        )
    return Table(columns, tuple(rows))


def _three(values: Sequence[float]) -> str:
    return " ".join(metres(value) for value in values)


def _at(point: Document) -> str:
    use = "" if point["use"] == "xyz" else f" {point['use']}"
    return f"{point['photo']}/{point['row']}{use}"


def _accuracy(document: Document) -> Table:
    required = any(document["required_m"].values())
    columns = (
        Column("layout", left=True),
        Column("method", left=True),
        Column("plan rms", "m"),
        Column("worst", "m"),
        Column("height rms", "m"),
        Column("worst", "m"),
        Column("at photo"),
        *((Column("meets", left=True),) if required else ()),
        Column("the control carries", left=True, rank=1),
    )
    rows = []
    for row in document["accuracy"]:
        head = (row["layout"], row["method"])
        if row["used"] is None:
            rows.append((*head, *[DASH] * (6 if required else 5), "too little"))
            continue
        names = ("rms_plan_m", "worst_plan_m", "rms_z_m", "worst_z_m")
        rows.append(
            (
                *head,
                *(metres(row[name]) for name in names),
                str(row["worst_z_at"]["photo"]),
                *(("yes" if row["meets"] else "no",) if required else ()),
                "" if row["used"] == row["method"] else row["used"],
            )
        )
    return Table(columns, tuple(rows), note="plan: both coordinates together; photo: nearest to the worst height")


def _reasons(document: Document) -> tuple[Words, ...]:
    """Say why a layout determines no strip."""
    return tuple(
        Words(f"{row['layout']}, {row['method']}: {row['reason']}.", "look", mark="-")
        for row in document["accuracy"]
        if row["used"] is None
    )


def _along(document: Document, name: str) -> Table:
    """One row for each layout and method; photos of a long strip are thinned out."""
    photos = document["geometry"]["photos"]
    shown = sorted({*range(0, photos, -(-photos // PHOTOS_SHOWN)), photos - 1})
    columns = (
        Column("layout", left=True),
        Column("method", left=True),
        *(Column(str(photo + 1)) for photo in shown),
    )
    rows = tuple(
        (row["layout"], row["method"], *(fixed(row["along"][photo][name], 2) for photo in shown))
        for row in document["accuracy"]
        if row["used"] is not None
    )
    return Table(columns, rows)


# --------------------------------------------------------------------------------------------------- reliability


def _detectable(document: Document) -> Table:
    columns = (
        Column("layout", left=True),
        Column("method", left=True),
        Column("plan", "m"),
        Column("height", "m"),
        Column("worst at photo/row", left=True),
    )
    rows = []
    for row in document["accuracy"]:
        if row["used"] is None or not row["detectable"]:
            continue
        plan = max(row["detectable"], key=lambda each: max(map(_size, _in_plan(each))))
        height = max(row["detectable"], key=lambda each: _size(_in_height(each)))
        rows.append(
            (
                row["layout"],
                row["method"],
                _largest(_in_plan(plan)),
                _largest([_in_height(height)]),
                f"{_at(plan)} in plan, {_at(height)} in height",
            )
        )
    return Table(columns, tuple(rows), note="found in 80 % of cases by a test at 0.1 %, at the worst control point")


def _in_plan(each: Document) -> list[Detected]:
    return [(each["x_m"], each["checked"][0]), (each["y_m"], each["checked"][1])]


def _in_height(each: Document) -> Detected:
    return each["z_m"], each["checked"][2]


def _size(value: Detected) -> float:
    """Order of detectable errors: not given, found, never found."""
    size, checked = value
    if checked is False:
        return float("inf")
    return -1.0 if size is None else size


def _largest(values: Sequence[Detected]) -> str:
    size = max(map(_size, values))
    if size == float("inf"):
        return "never"
    return DASH if size < 0 else metres(size)


# ---------------------------------------------------------------------------------------------- needed and placed


def _needed(document: Document) -> Table:
    return tabulated(
        document["needed"],
        (
            words("method", "method"),
            number("bands", "bands", lambda bands: "not reached" if bands is None else str(bands)),
            number("points", "points", lambda points: DASH if points is None else str(points)),
            number("worst plan", "worst_plan_m", 3, "m"),
            number("worst height", "worst_z_m", 3, "m"),
        ),
        note="evenly spread from the first to the last photo, at most one at every photo",
    )


def _placed(document: Document) -> tuple[Part, ...]:
    placed = document["placed"]
    head = f"{counted(len(placed['points']), 'point')} added to `{placed['into']}`, adjusted by {placed['method']}: the"
    if placed["gain_percent"]:
        text = f"{head} search beats equal spacing by {fixed(placed['gain_percent'], 1)} % at the worst points."
    else:
        text = f"{head} search finds no places that beat equal spacing by 1 % or more."
    columns = (
        Column("control", left=True),
        Column("worst plan", "m"),
        Column("worst height", "m"),
        Column("further points at photo/row", left=True),
    )
    kinds: tuple[tuple[str, str, list[Document]], ...] = (
        (placed["into"], "worst_before", []),
        ("equal spacing", "worst_equally_spaced", placed["equally_spaced"]),
        ("places found", "worst", placed["points"]),
    )
    rows = tuple(
        (name, metres(placed[key]["plan_m"]), metres(placed[key]["z_m"]), ", ".join(map(_at, spots)))
        for name, key, spots in kinds
    )
    return Words(text), Table(columns, rows, note=f"{placed['layouts_tried']} layouts looked at")
