"""Sections on pairs, junctions, absolute orientation and polynomials."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from heapq import nlargest
from typing import Any

from photostrip.notes import Document, counted
from photostrip.report.page.angles import AngleUnit, angle_unit
from photostrip.report.page.numbers import LEAST_PROBABILITY, fixed, metres, micrometres, percent, power, short
from photostrip.report.page.parts import Facts, Part, Section, Table, Words
from photostrip.report.page.tables import Shown, angle, number, tabulated, words

ALL_SHOWN = 24  # rows up to which a table is printed whole
HIGH_LEVERAGE = 0.7  # share of a control point in the polynomial at its own place
STRIPS_SHOWN = 3  # strips up to which every polynomial is shown with its evidence
WORST_SHOWN = 12  # rows shown of a longer one
ELEMENTS = (("alpha1", "α1"), ("kappa1", "κ1"), ("alpha2", "α2"), ("omega2", "ω2"), ("kappa2", "κ2"))
ANGLES = (("alpha", "α"), ("omega", "ω"), ("kappa", "κ"))
DIRECTIONS = ("along", "across", "up")
GROUND_AXES = ("east", "north", "up")


def worst_first(
    rows: Sequence[Document],
    badness: Callable[[Document], float],
    where: tuple[str, str, str],
    *,
    everything: bool,
    most: int = ALL_SHOWN,
) -> tuple[list[Document], str]:
    """Choose the rows of a table that are shown: all in their order, or the worst, and what to say of the others.

    ``where`` says what the rows are, which section shows all of them and which block of the result holds them;
    ``most`` is how many rows are shown whole.
    """
    if everything or len(rows) <= most:
        return list(rows), ""
    chosen = nlargest(min(most, WORST_SHOWN), rows, key=badness)
    return chosen, f"worst first; {elsewhere(len(rows) - len(chosen), *where)}"


def column_of(rows: Sequence[Document], key: str) -> list[Any]:
    """Return the values of a key; of a table without making its rows."""
    return list(rows.values(key)) if hasattr(rows, "values") else [row[key] for row in rows]


def elsewhere(rest: int, what: str, section: str, block: str) -> str:
    """Say how many things are not shown, and where they are."""
    return f"{rest} more {what}: --section {section}, or `{block}` in result.json"


def relative_section(document: Document, *, everything: bool) -> Section:
    """Relative orientation: how good the image coordinates are, pair by pair."""
    summary, models = document["summary"], list(document["models"])  # gone through many times
    where = ("pairs", "relative", "models")
    shown, note = worst_first(models, lambda m: m["sigma0_um"] or 0.0, where, everything=everything)
    worst = max(models, key=lambda m: m["max_parallax_um"] or 0.0)
    rejected, used = (sum(column_of(models, key)) for key in ("points_rejected", "points_used"))
    total = rejected + used
    sigma0 = (
        f"{micrometres(summary['sigma0_um'])} µm for an image coordinate (stated: "
        f"{micrometres(summary['sigma_given_um'])} µm), {counted(summary['redundancy'], 'redundant point')}"
    )
    largest = (
        f"{micrometres(worst['max_parallax_um'])} µm at point {worst['max_parallax_point']} of photos "
        f"{worst['left']} and {worst['right']}"
    )
    gone = f"{rejected} of {counted(total, 'point')} in pairs, {percent(rejected, total)}"
    facts = Facts((("σ0", sigma0), ("largest y parallax", largest), ("rejected", gone)))
    unit = angle_unit(document)
    pairs = tabulated(shown, _pairs(unit), note=note or "q: y parallax of the points used")
    return Section("Relative orientation", (facts, pairs, tabulated(shown, _elements(unit), note=note)))


def photos_of(row: Document) -> str:
    return f"{row['left']} – {row['right']}"


def _pairs(unit: AngleUnit) -> tuple[Shown, ...]:
    return (
        words("photos", photos_of),
        number("points", "points_used"),
        number("rej.", "points_rejected"),
        number("σ0", "sigma0_um", 1, "µm"),
        number("rms q", "rms_parallax_um", 1, "µm"),
        number("max q", "max_parallax_um", 1, "µm"),
        words("at point", "max_parallax_point"),
        number("condition", "condition", partial(short, digits=3), rank=2),
        number("base", "base", 2, "m", rank=1),
        angle("direction", "base_direction_deg", 3, unit, rank=3),
        angle("inclin.", "base_inclination_deg", 3, unit, rank=3),
        words("strip", "strip", rank=4),
    )


def _largest_sigma(model: Document) -> float | None:
    return max((size for key, _ in ELEMENTS if (size := model[f"sigmas_{key}"]) is not None), default=None)


def _elements(unit: AngleUnit) -> tuple[Shown, ...]:
    return (
        words("photos", photos_of),
        *(angle(name, f"elements_{key}", 4, unit) for key, name in ELEMENTS),
        angle("largest σ", _largest_sigma, 4, unit, rank=1),
    )


def junction_section(document: Document, *, everything: bool) -> Section:
    """Scale transfer: how well neighbouring models agree, and how the scale drifts."""
    junctions = list(document["junctions"])
    shown, note = worst_first(
        junctions, lambda j: j["spread_ppm"] or 0.0, ("junctions", "junctions", "junctions"), everything=everything
    )
    columns = (
        words("photo", "photo"),
        number("points", "points_used"),
        number("rej.", lambda junction: len(junction["points_rejected"])),
        number("scale ratio", "factor", 6, rank=2),
        number("spread", "spread_ppm", 0, "ppm"),
        *(number(name, f"discrepancy_{name}", 3, "m") for name in DIRECTIONS),
        *(number(name, f"discrepancy_um_{name}", 1, "µm", rank=1 if name == "up" else 3) for name in DIRECTIONS),
        words("strip", "strip", rank=4),
    )
    below = note or "rms differences of the pass points of two models; spread: of the scale ratio of one pass point"
    facts = Facts(tuple((_labelled(document, s["id"], "scale drift"), _drift(s)) for s in document["strips"]))
    table = tabulated(shown, columns, note=below) if shown else Words("One model: no scale was transferred.")
    return Section("Scale transfer and junctions", (table, facts))


def _labelled(document: Document, strip: str, label: str) -> str:
    """Return a label, with the strip where there are several."""
    return label if len(document["strips"]) == 1 else f"{label}, strip {strip}"


def _drift(strip: Document) -> str:
    text = f"{fixed(strip['scale_drift_expected_ppm'], 0)} ppm expected over the strip (one standard deviation)"
    if strip["scale_drift_found_ppm"] is not None:
        text += f", {fixed(strip['scale_drift_found_ppm'], 0)} ppm by the polynomial"
    if strip["discrepancy_up"] is not None:
        size = ", ".join(f"{metres(strip[f'discrepancy_{name}'])} m {name}" for name in DIRECTIONS)
        text += f"; rms differences between models {size}"
    return text


def absolute_section(document: Document) -> Section:
    """Absolute orientation: the fit of each strip to its control before any polynomial."""
    columns = (
        words("strip", "strip"),
        number("plan", "control_plan", unit="points"),
        number("height", "control_height", unit="points"),
        number("σ0", "sigma0", 2),
        number("redund.", "redundancy"),
        number("condition", "condition", partial(short, digits=3), rank=1),
        *(number(axis, f"misclosure_rms_{axis}", 3, "m") for axis in GROUND_AXES),
        number("scale", "scale", 3, "m per mm", rank=3)
        if "links" in document
        else number("base of scale", "scale", 3, "m", rank=3),
        *(angle(name, f"angles_deg_{key}", 4, angle_unit(document), rank=2) for key, name in ANGLES),
    )
    note = (
        "east, north, up: rms misclosures of the similarity; σ0: their ratio to what is expected from the "
        "control and one model"
    )
    weights = tuple((_labelled(document, s["id"], "weights"), _weights(s)) for s in document["strips"])
    return Section("Absolute orientation", (tabulated(document["absolute"], columns, note=note), Facts(weights)))


def _weights(strip: Document) -> str:
    return (
        "from the standard deviation of each control coordinate, combined with that of a model point: "
        f"{metres(strip['precision_plan'])} m in plan, {metres(strip['precision_height'])} m in height"
    )


def polynomial_section(document: Document, *, everything: bool) -> Section:
    """Polynomial adjustment: what was chosen, why, and how large it is."""
    blocks = document["polynomials"]
    if len(blocks) > STRIPS_SHOWN and not everything:
        return Section("Polynomial adjustment", (_by_strip(document),))
    parts: list[Part] = []
    for block in blocks:
        evidence, terms = (document[f"polynomial_{name}"].where(strip=block["strip"]) for name in ("evidence", "terms"))
        parts += (Words(_choice(document, block) + _leverage(document, block)), _evidence(evidence))
        if terms:
            parts.append(tabulated(terms, COEFFICIENTS, note=OF_COEFFICIENTS))
    return Section("Polynomial adjustment", tuple(parts))


def _leverage(document: Document, block: Document) -> str:
    """Say which control points hold the polynomial almost alone: their own errors hardly show in it."""
    found = []
    for row in document.get("misclosures", ()):
        shares = {axis: row[f"leverage_{axis}"] for axis in "xyz"}
        known = {axis: share for axis, share in shares.items() if share is not None}
        if row["strip"] == block["strip"] and known:
            axis = max(known, key=lambda name: known[name])
            found.append((known[axis], row["id"], axis))
    if not found:
        return ""
    share, point, axis = max(found, key=lambda each: each[0])
    high = sum(each[0] > HIGH_LEVERAGE for each in found)
    text = f" The largest leverage is {share:.2f}, of control point {point} in {axis.upper()}"
    if high:
        text += f"; {counted(high, 'point')} above {HIGH_LEVERAGE}, where an error hardly shows in the residual"
    return text + "."


def _by_strip(document: Document) -> Table:
    largest: dict[tuple[str, str], float] = {}
    for row in document["polynomial_terms"]:
        place = row["strip"], row["axis"]
        largest[place] = max(largest.get(place, 0.0), abs(row["effect"]))

    def effect(axis: str) -> Callable[[Document], float]:
        return lambda block: largest.get((block["strip"], axis), 0.0)

    columns = (
        words("strip", "strip"),
        number("asked", "asked"),
        number("plan", "degree_plan", unit="degree"),
        number("height", "degree_height", unit="degree"),
        number("plan", "stations_plan", unit="stations"),
        number("height", "stations_height", unit="stations"),
        *(number(f"{axis.upper()} effect", effect(axis), 3, "m") for axis in "xyz"),
    )
    note = "effect: of the largest term; evidence and terms: `polynomial_evidence`, `polynomial_terms` in result.json"
    return tabulated(document["polynomials"], columns, note=note)


def _choice(document: Document, block: Document) -> str:
    how = "chosen on the evidence below" if block["asked"] == "auto" else f"degree {block['asked']} as requested"
    plan, height = block["degree_plan"], block["degree_height"]
    what = "no polynomial" if not block["degree"] else f"degree {plan} in plan and {height} in height"
    text = (
        f"{what}, {how}. The control lies at {counted(block['stations_plan'], 'station')} in plan and "
        f"{block['stations_height']} in height, from X = {block['reach_from']:.0f} m to {block['reach_to']:.0f} m "
        "along the strip."
    )
    return text[0].upper() + text[1:] if len(document["strips"]) == 1 else f"Strip {block['strip']}: {text}"


EVIDENCE = (
    words("for", "group"),
    number("degree", "degree"),
    number("terms", "terms", rank=1),
    number("redund.", "redundancy"),
    number("rms", "rms", 3, "m"),
    number("left out", "left_out", 3, "m"),
    number("F", "f", 2),
    number("p", "p", lambda p: "<0.001" if (p or 1) < LEAST_PROBABILITY else fixed(p, 3)),
    words("taken", lambda step: "yes" if step["accepted"] else "no"),
)


def _evidence(steps: Sequence[Document]) -> Table:
    by = sorted({step["left_out_by"] for step in steps if step["left_out_by"]})
    note = (
        f"rms: at the control; left out: at control held back, one {' or '.join(by) or 'point'} at a time; "
        "F, p: variance ratio of the gain in all three axes together, and its probability by chance"
    )
    return tabulated(steps, EVIDENCE, note=note)


COEFFICIENTS = (
    words("axis", lambda row: row["axis"].upper()),
    words("term", "term"),
    number("coefficient", "coefficient", power),
    number("σ", "sigma", partial(power, digits=1)),
    number("t", "t", 2),
    number("effect", "effect", 3, "m"),
)
OF_COEFFICIENTS = (
    "X along the strip, Y to its left, Z up, metres; effect: at the end of the control's range and the edge of the "
    "strip; t: coefficient over its standard deviation σ; 2 or more is hardly due to chance"
)
