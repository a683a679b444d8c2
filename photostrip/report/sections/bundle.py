"""Sections on the bundle adjustment: convergence, test of sigma0, reliability, variance components, calibration."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from photostrip.report.page.figures import counted, fixed, metres, power, ratio, short, unit
from photostrip.report.page.parts import DASH, Column, Facts, Part, Section, Table, Words

if TYPE_CHECKING:
    from collections.abc import Sequence

Document = dict[str, Any]

NAMES = {"image": "image coordinates", "control": "control", "position": "camera positions", "attitude": "attitudes"}
CORRELATIONS_SHOWN = 12
NAMED = 6


def bundle_sections(document: Document) -> list[Section]:
    """Return the sections of a bundle adjustment.

    Parameters
    ----------
    document : dict
        The document of a result; without the block ``bundle`` there are none.
    """
    block = document.get("bundle")
    if block is None:
        return []
    found = [_adjustment(block), _reliability(block)]
    if block["variance_components"]:
        found.append(_components(block["variance_components"]))
    if block["calibration"] or block["corrections"]:
        found.append(_parameters(block))
    return found


def _adjustment(block: Document) -> Section:
    """Observations, unknowns, sigma0, convergence."""
    test, screening, unknowns = block["sigma0_test"], block["screening"], block["unknowns"]
    observed = ", ".join(f"{number} of {NAMES[kind]}" for kind, number in block["observations"].items())
    parts = f"{sum(unknowns.values())}: {unknowns['photos']} of photos, {unknowns['points']} of points"
    parts += f", {unknowns['common']} common" if unknowns["common"] else ""
    facts = [
        ("datum", _datum(block)),
        ("observations", observed),
        ("unknowns", f"{parts}; redundancy {block['redundancy']}"),
        ("σ0", f"{short(block['sigma0'], 5)} in units of the stated standard deviations"),
        ("test of σ0", _sigma0(test)),
        ("gross errors", _screening(screening)),
    ]
    columns = (
        Column("step"),
        Column("sum of squares"),
        Column("length"),
        Column("damping"),
        Column("largest shift", "m"),
        Column("turn", "deg"),
    )
    rows = tuple(
        (
            str(number),
            short(step["chi_square"], 8),
            short(step["length"], 3),
            short(step["damping"], 2),
            power(step["shift"], 1),
            power(step["turn_deg"], 1),
        )
        for number, step in enumerate(block["convergence"], 1)
    )
    note = "of the last adjustment, from the one before it; length: of the step, in standard deviations"
    return Section("Bundle adjustment", (Facts(tuple(facts)), Table(columns, rows, note=note)))


def _datum(block: Document) -> str:
    if not block["free_network"]:
        return "given by the observations"
    return "free network: inner constraints on the points; positions and scale mean nothing, precision is relative"


def _sigma0(test: Document) -> str:
    if test["passed"] is None:
        return "none: no redundancy"
    limits = f"{fixed(test['lower'], 3)} to {fixed(test['upper'], 3)}"
    said = "passed" if test["passed"] else "NOT PASSED: the stated standard deviations are wrong on the whole"
    return f"{short(test['sigma0'], 5)} against {limits} (chi-square, {100 * (1 - test['level']):g} %): {said}"


def _screening(screening: Document) -> str:
    if screening["method"] == "none":
        return "not searched for"
    out = ", ".join(f"{number} of {NAMES[kind]}" for kind, number in screening["rejected"].items() if number)
    test = {"tau": "tau test", "baarda": "Baarda's test"}[screening["test"]]
    text = f"{screening['method']}, {test}, level {screening['alpha']:g}, limit {fixed(screening['limit'], 2)}: "
    return f"{text}{out or 'none'} rejected, {screening['readmitted']} re-admitted"


def _reliability(block: Document) -> Section:
    """How well the observations check each other."""
    reliable = block["reliability"]
    columns = (
        Column("observations", left=True),
        Column("number"),
        Column("redund."),
        Column("mean r"),
        Column("least r"),
        Column("unchecked"),
        Column("detectable"),
        Column("at most"),
        Column("", left=True),
        Column("effect", "σ"),
    )
    rows = tuple(
        (
            NAMES[each["group"]],
            str(each["observations"]),
            fixed(each["redundancy"], 1),
            ratio(each["mean"]),
            ratio(each["smallest"]),
            str(each["uncontrolled"]),
            short(each["detectable"], 3),
            short(each["detectable_largest"], 3),
            unit(each["unit"]),
            fixed(each["external"], 1),
        )
        for each in reliable["groups"]
    )
    note = (
        "r: redundancy number, the share of an error that shows in its residual; detectable: the error found with a "
        f"probability of {100 * reliable['power']:g} % (median, largest); effect: what an error just not found moves "
        "at most, in standard deviations of what it moves (median)"
    )
    parts: list[Part] = [Table(columns, rows, note=note)]
    parts += _named("fit worst", "test", reliable["worst"])
    parts += _named("hardest to check", "test", reliable["weakest"])
    return Section("Reliability", tuple(parts))


def _named(title: str, test: str, rows: Sequence[Document]) -> list[Part]:
    """Observations by their names."""
    if not rows:
        return []
    columns = (
        Column(title, left=True),
        Column("photo", left=True),
        Column("point", left=True),
        Column("", left=True),
        Column("r"),
        Column(test),
        Column("detectable"),
        Column("", left=True),
        Column("effect", "m"),
    )
    cells = tuple(
        (
            NAMES[each["kind"]],
            each["photo"] or DASH,
            each["point"] or DASH,
            each["axis"],
            ratio(each["redundancy"]),
            fixed(each["standardised"], 1),
            short(each["detectable"], 3),
            unit(each["unit"]),
            metres(each["effect"]),
        )
        for each in rows[:NAMED]
    )
    return [Table(columns, cells)]


def _components(rows: Sequence[Document]) -> Section:
    """Show the standard deviations found by group."""
    columns = (
        Column("group", left=True),
        Column("observations"),
        Column("redund."),
        Column("factor"),
        Column("±"),
        Column("", left=True),
    )
    cells = tuple(
        (
            each["group"],
            str(each["observations"]),
            fixed(each["redundancy"], 1),
            fixed(each["factor"], 3),
            fixed(None if each["sigma"] is None else each["sigma"] * each["factor"], 3),
            "" if each["estimated"] else "not estimated: too little redundancy",
        )
        for each in rows
    )
    text = "Each group's stated standard deviations, multiplied with its factor, were used."
    return Section("Variance components", (Words(text), Table(columns, cells)))


def _parameters(block: Document) -> Section:
    """Calibration parameters, offsets and drifts, and what is hard to tell apart."""
    parts: list[Part] = []
    if block["calibration"]:
        columns = (
            Column("camera", left=True),
            Column("parameter", left=True),
            Column("correction"),
            Column("σ"),
            Column("", left=True),
            Column("p"),
            Column("", left=True),
        )
        rows = tuple(
            (
                each["camera"],
                each["parameter"],
                short(each["value"], 5),
                short(each["sigma"], 2),
                "" if each["unit"] == "1" else each["unit"],
                short(each["p"], 2),
                "significant" if each["significant"] else "not significant",
            )
            for each in block["calibration"]
        )
        parts.append(
            Table(columns, rows, note="corrections of the given calibration; p: of a value as large by chance")
        )
    if block["corrections"]:
        heads = (Column("camera positions", left=True), Column("correction", "m"), Column("σ", "m"))
        cells = tuple((each["name"], short(each["value"], 5), short(each["sigma"], 2)) for each in block["corrections"])
        parts.append(
            Table(heads, cells, note="what is added to the given positions of a strip; a drift: per unit of time")
        )
    if block["correlations"]:
        pair = (Column("highly correlated", left=True), Column("with", left=True), Column("correlation"))
        shown = block["correlations"][:CORRELATIONS_SHOWN]
        more = len(block["correlations"]) - len(shown)
        note = f"{counted(more, 'more pair')} in `bundle.correlations`" if more else ""
        named = tuple((each["first"], each["second"], f"{each['value']:+.3f}") for each in shown)
        parts.append(Table(pair, named, note=note))
    return Section("Parameters that photos share", tuple(parts))
