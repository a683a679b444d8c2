"""Section on the precision that error propagation gives to points and photos."""

from __future__ import annotations

from collections.abc import Sequence

from photostrip.notes import Document, counted
from photostrip.report.page.angles import angle_unit
from photostrip.report.page.numbers import fixed, metres, micrometres, ratio
from photostrip.report.page.parts import Facts, Part, Section, Table, Words
from photostrip.report.page.tables import angle, number, tabulated, words
from photostrip.report.sections.strip import ALL_SHOWN, elsewhere

WORST_POINTS = 8
STATIONS_SHOWN = 12
BASES = {"a-priori": "as stated", "a-posteriori": "found by the adjustment"}
PARTS = (("plan", "east and north together"), ("height", "up"))


def precision_section(document: Document, *, everything: bool) -> Section:
    """Show standard deviations carried from the image coordinates and the control to points and photos."""
    block = document["precision"]
    measured = "model" if "links" in document else "image"
    text = (
        f"Standard deviations propagated from the {measured} coordinates and the control through every step of the "
        "adjustment. They cover random errors: what a lens, the film or refraction does to a whole strip is "
        "not included."
    )
    facts = [(f"{measured} coordinates", _basis(block["basis"] if document["strips"] else block["basis"][:1]))]
    for name, meaning in PARTS:
        part = block["points"][name]
        facts.append(
            (
                f"points, {name}",
                f"rms {metres(part['rms'])} m ({meaning}), largest {metres(part['max'])} m at point {part['worst']}",
            )
        )
    facts += _check(block.get("check"))
    parts: list[Part] = [Words(text), Facts(tuple(facts)), _worst(document)]
    parts += [_along(document, block["along"], everything=everything)] if block["along"] else []
    return Section("Precision", tuple(parts))


def _basis(rows: Sequence[Document]) -> str:
    if len(rows) == 1:
        return f"{micrometres(rows[0]['sigma_um'])} µm, {BASES[rows[0]['basis']]}"
    return ", ".join(f"strip {r['strip']} {micrometres(r['sigma_um'])} µm, {BASES[r['basis']]}" for r in rows)


def _check(check: Document | None) -> list[tuple[str, str]]:
    """Say how the errors at check points go with the standard deviations."""
    if not check:
        return []
    parts = [
        f"{check[name]['inside_95']} of {check[name]['count']} inside the 95 % {what}, rms {ratio(check[name]['rms'])}"
        for name, what in (("plan", "ellipse in plan"), ("height", "interval in height"))
        if check[name]["count"]
    ]
    rows = [("check points", f"{'; '.join(parts)} in units of their standard deviations")]
    for test in check["tests"]:
        name = "all together" if len(check["tests"]) == 1 else f"together, strip {test['strip']}"
        text = (
            f"sum of squares {fixed(test['squares'], 1)} of {counted(test['coordinates'], 'coordinate')}, probability "
            f"of a larger one by chance {fixed(100 * test['p'], 1)} %"
        )
        rows.append((name, text))
    return rows


def _worst(document: Document) -> Table:
    """Points with the largest error ellipse, and with the largest standard deviation in height."""
    known = [point for point in document["points"] if point["sigma_x"] is not None]
    by_plan = sorted(known, key=lambda p: p["ellipse_a"], reverse=True)[: WORST_POINTS // 2]
    by_height = [p for p in sorted(known, key=lambda p: p["sigma_z"], reverse=True) if p not in by_plan]
    axes = document["frame"]["axes"]
    columns = (
        words("least precise points", "id"),
        *(number(f"σ {axis}", f"sigma_{key}", 3, "m") for key, axis in zip("xyz", axes, strict=True)),
        number("ellipse a", "ellipse_a", 3, "m"),
        number("b", "ellipse_b", 3, "m"),
        angle("azimuth", "ellipse_azimuth_deg", 0, angle_unit(document), rank=1),
        number("photos", "rays", rank=2),
        words("role", "role", rank=3),
    )
    note = "the worst in plan, then in height; a, b: semi-axes of the standard error ellipse in plan (39 %)"
    return tabulated((*by_plan, *by_height[: WORST_POINTS - len(by_plan)]), columns, note=note)


def _along(document: Document, rows: Sequence[Document], *, everything: bool) -> Table:
    several = len(document["strips"]) > 1
    shown, left_out = list(rows), 0
    if not everything and len(rows) > ALL_SHOWN:
        step = (len(rows) - 1) / (STATIONS_SHOWN - 1)
        shown = [rows[round(number * step)] for number in range(STATIONS_SHOWN)]
        left_out = len(rows) - STATIONS_SHOWN
    columns = (
        words("at photo", "photo"),
        number("distance", "distance", 0, "m"),
        number("points", "points"),
        number("σ plan", "plan", 3, "m"),
        number("σ height", "height", 3, "m"),
        number("centre plan", "centre_plan", 3, "m", rank=1),
        number("height", "centre_height", 3, "m", rank=1),
        *([words("strip", "strip", rank=2)] if several else []),
    )
    note = "rms of the points nearest to each photo, and its perspective centre"
    if left_out:
        note += f"; {elsewhere(left_out, 'photos', 'precision', 'precision')}"
    return tabulated(shown, columns, note=note)
