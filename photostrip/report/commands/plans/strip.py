"""Report of the plan of a strip: from its document to sections of facts and tables."""

from __future__ import annotations

from collections.abc import Sequence

from photostrip.notes import Document, counted, listed
from photostrip.report.page.numbers import fixed, metres, micrometres, short
from photostrip.report.page.parts import DASH, Column, Facts, Part, Section, Table, Words
from photostrip.report.page.tables import number, tabulated, words

Detected = tuple[float | None, bool | None]  # size in metres, whether anything checks the coordinate

PHOTOS_SHOWN = 11  # columns of the tables along a strip
PLACES_SHOWN = 6
LAYOUT_AND_METHOD = (words("layout", "layout"), words("method", "method"))
MEETS = {True: "yes", False: "no", None: DASH}


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
                f"{micrometres(document['image_sigma_um'])} µm; {counted(geometry['points'], 'point')},"
                f" {counted(geometry['rows'], 'row')} at each nadir"
            ),
        ),
    ]
    if any(required.values()):
        parts = [f"{metres(required[key])} m in {key}" for key in ("plan", "height") if required[key] is not None]
        facts.append(("required", ", ".join(parts)))
    return tuple(facts)


def _layouts(document: Document) -> Table:
    return tabulated(
        document["layouts"],
        (
            words("layout", "name"),
            number("points", lambda layout: len(layout["points"])),
            words("σ of control", lambda layout: _three(layout["sigma_m"]), "along, across, up, m"),
            words("σ of perspective centres", _gnss, "m"),
            words("at photo/row", lambda layout: listed(map(_at, layout["points"]), PLACES_SHOWN), rank=1),
        ),
    )


def _gnss(layout: Document) -> str:
    offset = ", offset free" if layout["gnss_offset"] else ""
    return f"{_three(layout['gnss_sigma_m'])}{offset}" if layout["gnss_sigma_m"] else "not measured"


def _three(values: Sequence[float]) -> str:
    return " ".join(metres(value) for value in values)


def _at(point: Document) -> str:
    use = "" if point["use"] == "xyz" else f" {point['use']}"
    return f"{point['photo']}/{point['row']}{use}"


def _accuracy(document: Document) -> Part:
    required = any(document["required_m"].values())
    nothing = dict.fromkeys(("rms_plan_m", "worst_plan_m", "rms_z_m", "worst_z_m", "meets"))
    columns = (
        *LAYOUT_AND_METHOD,
        number("plan rms", "rms_plan_m", 3, "m"),
        number("worst", "worst_plan_m", 3, "m"),
        number("height rms", "rms_z_m", 3, "m"),
        number("worst", "worst_z_m", 3, "m"),
        number("at photo", "worst_z_at.photo"),
        *((words("meets", lambda row: MEETS[row["meets"]]),) if required else ()),
        words("the control carries", _carried, rank=1),
    )
    rows = [{**nothing, "worst_z_at": {"photo": DASH}, **row} for row in document["accuracy"]]
    return tabulated(rows, columns, note="plan: both coordinates together; photo: nearest to the worst height")


def _carried(row: Document) -> str:
    if row["used"] is None:
        return "too little"
    return "" if row["used"] == row["method"] else str(row["used"])


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
    rows = [
        {**row, "along": {str(photo): row["along"][photo][name] for photo in shown}}
        for row in document["accuracy"]
        if row["used"] is not None
    ]
    return tabulated(rows, (*LAYOUT_AND_METHOD, *(number(str(photo + 1), f"along.{photo}", 2) for photo in shown)))


def _detectable(document: Document) -> Table:
    rows = []
    for row in document["accuracy"]:
        if row["used"] is not None and row["detectable"]:
            plan = max(row["detectable"], key=lambda each: max(map(_size, _in_plan(each))))
            height = max(row["detectable"], key=lambda each: _size(_in_height(each)))
            rows.append({**row, "plan": plan, "height": height})
    columns = (
        *LAYOUT_AND_METHOD,
        number("plan", lambda row: _largest(_in_plan(row["plan"])), str, "m"),
        number("height", lambda row: _largest([_in_height(row["height"])]), str, "m"),
        words("worst at photo/row", lambda row: f"{_at(row['plan'])} in plan, {_at(row['height'])} in height"),
    )
    return tabulated(rows, columns, note="found in 80 % of cases by a test at 0.1 %, at the worst control point")


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
    return Words(text), Table(columns, rows, note=f"{placed['layouts_tried']} layouts tried")
