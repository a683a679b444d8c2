"""Sections on pairs, joints, absolute orientation and polynomials."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from photostrip.report.page.figures import counted, fixed, metres, micrometres, percent, power, ratio, short
from photostrip.report.page.parts import Column, Facts, Part, Section, Table, Words

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

Document = dict[str, Any]

ALL_SHOWN = 24  # rows up to which a table is printed whole
SMALL = 0.001  # probabilities below it are not told apart
HIGH_LEVERAGE = 0.7  # share of a control point in the polynomial at its own place
STRIPS_SHOWN = 3  # strips up to which every polynomial is shown with its evidence
WORST_SHOWN = 12  # rows shown of a longer one
ELEMENTS = (("alpha1", "α1"), ("kappa1", "κ1"), ("alpha2", "α2"), ("omega2", "ω2"), ("kappa2", "κ2"))
DIRECTIONS = ("along", "across", "up")
GROUND_AXES = ("east", "north", "up")


def worst_first(
    rows: Sequence[Document], badness: Callable[[Document], float], where: str, *, everything: bool
) -> tuple[list[Document], str]:
    """Choose the rows of a table that are shown.

    Parameters
    ----------
    where : str
        What the rows are and where all of them stand.

    Returns
    -------
    rows : list of dict
        All in their order, or the worst, worst first.
    note : str
        What is left out; empty when nothing is.
    """
    if everything or len(rows) <= ALL_SHOWN:
        return list(rows), ""
    chosen = sorted(rows, key=badness, reverse=True)[:WORST_SHOWN]
    return chosen, f"worst first; {len(rows) - WORST_SHOWN} more {where} of result.json"


def relative_section(document: Document, *, everything: bool) -> Section:
    """Relative orientation: how good the image coordinates are, pair by pair."""
    summary, models = document["summary"], document["models"]
    shown, note = worst_first(models, lambda m: m["sigma0_um"] or 0.0, "pairs in `models`", everything=everything)
    worst = max(models, key=lambda m: m["max_parallax_um"] or 0.0)
    rejected = sum(m["points_rejected"] for m in models)
    total = rejected + sum(m["points_used"] for m in models)
    sigma0 = (
        f"{micrometres(summary['sigma0_um'])} µm, of an image coordinate, from "
        f"{counted(summary['redundancy'], 'redundant point')}; stated are {micrometres(summary['sigma_given_um'])} µm"
    )
    largest = (
        f"{micrometres(worst['max_parallax_um'])} µm at point {worst['max_parallax_point']} of photos "
        f"{worst['left']} and {worst['right']}"
    )
    gone = f"{rejected} of {counted(total, 'point')} in pairs, {percent(rejected, total)}"
    facts = Facts((("σ0", sigma0), ("largest y parallax", largest), ("rejected", gone)))
    return Section("Relative orientation", (facts, _pairs(shown, note), _elements(shown, note)))


def _pairs(models: Sequence[Document], note: str) -> Table:
    columns = (
        Column("photos", left=True),
        Column("points"),
        Column("rej."),
        Column("σ0", "µm"),
        Column("rms q", "µm"),
        Column("max q", "µm"),
        Column("at point", left=True),
        Column("condition", rank=2),
        Column("base", "m", rank=1),
        Column("direction", "deg", rank=3),
        Column("inclin.", "deg", rank=3),
        Column("strip", left=True, rank=4),
    )
    rows = tuple(
        (
            f"{m['left']} – {m['right']}",
            str(m["points_used"]),
            str(m["points_rejected"]),
            micrometres(m["sigma0_um"]),
            micrometres(m["rms_parallax_um"]),
            micrometres(m["max_parallax_um"]),
            m["max_parallax_point"],
            short(m["condition"], 3),
            fixed(m["base"], 2),
            fixed(m["base_direction_deg"], 3),
            fixed(m["base_inclination_deg"], 3),
            m["strip"],
        )
        for m in models
    )
    return Table(columns, rows, note=note or "q: y parallax of the points used")


def _elements(models: Sequence[Document], note: str) -> Table:
    columns = (
        Column("photos", left=True),
        *(Column(name, "deg") for _, name in ELEMENTS),
        Column("largest σ", "deg", rank=1),
    )
    rows = tuple(
        (
            f"{m['left']} – {m['right']}",
            *(fixed(m["elements"][key], 4) for key, _ in ELEMENTS),
            fixed(max((m["sigmas"][key] for key, _ in ELEMENTS if m["sigmas"][key] is not None), default=None), 4),
        )
        for m in models
    )
    return Table(columns, rows, note=note)


def junction_section(document: Document, *, everything: bool) -> Section:
    """Scale transfer: how well neighbouring models agree, and how the scale drifts."""
    joints = document["junctions"]
    shown, note = worst_first(joints, lambda j: j["spread_ppm"] or 0.0, "joints in `junctions`", everything=everything)
    columns = (
        Column("photo", left=True),
        Column("points"),
        Column("rej."),
        Column("scale ratio", rank=2),
        Column("spread", "ppm"),
        *(Column(name, "m") for name in DIRECTIONS),
        *(Column(name, "µm", rank=1 if name == "up" else 3) for name in DIRECTIONS),
        Column("strip", left=True, rank=4),
    )
    rows = tuple(
        (
            j["photo"],
            str(j["points_used"]),
            str(len(j["points_rejected"])),
            fixed(j["factor"], 6),
            fixed(j["spread_ppm"], 0),
            *(metres(j["discrepancy"][name]) for name in DIRECTIONS),
            *(micrometres(j["discrepancy_um"][name]) for name in DIRECTIONS),
            j["strip"],
        )
        for j in shown
    )
    below = note or "rms differences of the pass points of two models; spread: of the scale ratio of one pass point"
    facts = Facts(tuple((_labelled(document, s["id"], "scale drift"), _drift(s)) for s in document["strips"]))
    table = (Table(columns, rows, note=below),) if rows else (Words("One model: no scale was transferred."),)
    return Section("Scale transfer and junctions", (*table, facts))


def _labelled(document: Document, strip: str, label: str) -> str:
    """Return a label, with the strip where there are several."""
    return label if len(document["strips"]) == 1 else f"{label}, strip {strip}"


def _drift(strip: Document) -> str:
    drift, along = strip["scale_drift"], strip["discrepancy"]
    text = f"{fixed(drift['expected_ppm'], 0)} ppm to be expected over the strip (one standard deviation)"
    if drift["found_ppm"] is not None:
        text += f", {fixed(drift['found_ppm'], 0)} ppm taken out by the polynomial"
    if along["up"] is not None:
        text += f"; models differ by rms {', '.join(f'{metres(along[name])} m {name}' for name in DIRECTIONS)}"
    return text


def absolute_section(document: Document) -> Section:
    """Absolute orientation: the fit of each strip to its control before any polynomial."""
    columns = (
        Column("strip", left=True),
        Column("plan", "points"),
        Column("height", "points"),
        Column("σ0"),
        Column("redund."),
        Column("condition", rank=1),
        *(Column(name, "m") for name in GROUND_AXES),
        Column("scale", "m per mm", rank=3) if "links" in document else Column("base of scale", "m", rank=3),
        *(Column(name, "deg", rank=2) for name in ("α", "ω", "κ")),
    )
    rows = tuple(
        (
            a["strip"],
            str(a["control"]["plan"]),
            str(a["control"]["height"]),
            ratio(a["sigma0"]),
            str(a["redundancy"]),
            short(a["condition"], 3),
            *(metres(a["misclosure_rms"][axis]) for axis in GROUND_AXES),
            metres(a["scale"]),
            *(fixed(a["angles_deg"][key] if a["angles_deg"] else None, 4) for key in ("alpha", "omega", "kappa")),
        )
        for a in document["absolute"]
    )
    note = (
        "east, north, up: rms misclosures of the similarity; σ0: their ratio to what the control and one model let "
        "expect"
    )
    weights = tuple((_labelled(document, s["id"], "weights"), _weights(s["precision"])) for s in document["strips"])
    return Section("Absolute orientation", (Table(columns, rows, note=note), Facts(weights)))


def _weights(precision: Document) -> str:
    return (
        "from the standard deviation of each control coordinate together with that of a point of one model, "
        f"{metres(precision['plan'])} m in plan, {metres(precision['height'])} m in height"
    )


# --------------------------------------------------------------------------------------------------- polynomials


def polynomial_section(document: Document, *, everything: bool) -> Section:
    """Polynomial adjustment: what was chosen, why, and how large it is."""
    blocks = document["polynomials"]
    if len(blocks) > STRIPS_SHOWN and not everything:
        return Section("Polynomial adjustment", (_by_strip(blocks),))
    parts: list[Part] = []
    for block in blocks:
        parts += [Words(_choice(document, block) + _leverage(document, block)), _evidence(block)]
        if block["degree"]:
            parts.append(_coefficients(block))
    return Section("Polynomial adjustment", tuple(parts))


def _leverage(document: Document, block: Document) -> str:
    """Say which control points hold the polynomial almost alone: their own errors hardly show in it."""
    found = []
    for row in document.get("misclosures", ()):
        shares = {axis: row.get("leverage", {}).get(axis) for axis in "xyz"}
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


def _by_strip(blocks: Sequence[Document]) -> Table:
    """Return one line for each of many strips."""
    columns = (
        Column("strip", left=True),
        Column("asked"),
        Column("plan", "degree"),
        Column("height", "degree"),
        Column("plan", "stations"),
        Column("height", "stations"),
        *(Column(f"{axis} effect", "m") for axis in "XYZ"),
    )
    rows = tuple(
        (
            block["strip"],
            block["asked"],
            *(str(_degree(block["terms"][axis])) for axis in "xz"),
            *(str(block["stations"][group]) for group in ("plan", "height")),
            *(metres(max(map(abs, block["effects"][axis]), default=0.0)) for axis in "xyz"),
        )
        for block in blocks
    )
    note = "effect: of the largest term; evidence and coefficients stand in `polynomials` of result.json"
    return Table(columns, rows, note=note)


def _choice(document: Document, block: Document) -> str:
    """Say which degree was taken and on what control."""
    how = "decided by the evidence below" if block["asked"] == "auto" else f"degree {block['asked']} was asked for"
    plan, height = (_degree(block["terms"][axis]) for axis in ("x", "z"))
    what = "no polynomial" if not block["degree"] else f"degree {plan} in plan and {height} in height"
    stations, (low, high) = block["stations"], block["reach"]
    text = (
        f"{what}, {how}. The control stands at {counted(stations['plan'], 'station')} in plan and {stations['height']} "
        f"in height, from X = {low:.0f} m to {high:.0f} m along the strip."
    )
    return text[0].upper() + text[1:] if len(document["strips"]) == 1 else f"Strip {block['strip']}: {text}"


def _degree(terms: Sequence[str]) -> int:
    """Return the highest power of X among the terms."""
    return max((int(t[2:]) if t.startswith("X^") else int("X" in t) for t in terms), default=0)


def _evidence(block: Document) -> Table:
    steps = block["evidence"]
    columns = (
        Column("for", left=True),
        Column("degree"),
        Column("terms", rank=1),
        Column("redund."),
        Column("rms", "m"),
        Column("left out", "m"),
        Column("F"),
        Column("p"),
        Column("taken", left=True),
    )
    rows = tuple(
        (
            step["group"],
            str(step["degree"]),
            str(step["terms"]),
            str(step["redundancy"]),
            metres(step["rms"]),
            metres(step["left_out"]),
            ratio(step["f"]),
            "<0.001" if (step["p"] or 1) < SMALL else fixed(step["p"], 3),
            "yes" if step["accepted"] else "no",
        )
        for step in steps
    )
    by = sorted({step["left_out_by"] for step in steps if step["left_out_by"]})
    note = (
        f"rms: at the control; left out: at control that took no part, one {' or '.join(by) or 'point'} at a time; "
        "F, p: ratio and probability by chance of the gain in all three axes together"
    )
    return Table(columns, rows, note=note)


def _coefficients(block: Document) -> Table:
    columns = (
        Column("axis", left=True),
        Column("term", left=True),
        Column("coefficient"),
        Column("σ"),
        Column("t"),
        Column("effect", "m"),
    )
    rows = tuple(
        (axis.upper(), term, power(value), power(sigma, 1), ratio(t), metres(effect))
        for axis in ("x", "y", "z")
        for term, value, sigma, t, effect in zip(
            *(block[key][axis] for key in ("terms", "coefficients", "sigmas", "t", "effects")), strict=True
        )
    )
    note = (
        "X along the strip, Y to its left, Z up, metres; effect: at the end of the control's range and the edge of the "
        "strip; t: coefficient over its standard deviation σ, 2 and more are hardly chance"
    )
    return Table(columns, rows, note=note)
