"""Sections on the bundle adjustment: convergence, test of sigma0, reliability, variance components, calibration."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from functools import partial

from photostrip.notes import Document, counted
from photostrip.report.page.angles import AngleUnit, angle_unit
from photostrip.report.page.numbers import fixed, metres, power, short, unit
from photostrip.report.page.parts import DASH, Column, Facts, Part, Section, Table, Words
from photostrip.report.page.tables import Shown, number, tabulated, words
from photostrip.report.sections import common_causes
from photostrip.report.sections.strip import column_of

NAMES = {
    "image": "image coordinates",
    "model": "model coordinates",
    "control": "control",
    "position": "camera positions",
    "attitude": "attitudes",
}
ONE = {
    "image": "image coordinate",
    "model": "model coordinate",
    "control": "control coordinate",
    "position": "camera position coordinate",
    "attitude": "attitude angle",
}
CORRELATIONS_SHOWN = 12
NAMED = 6


def bundle_sections(document: Document, *, everything: bool) -> list[Section]:
    """Return the sections of a bundle adjustment; none without the block ``bundle``."""
    block = document.get("bundle")
    if block is None:
        return []
    found = [_adjustment(block, angle_unit(document)), _reliability(block)]
    if block["variance_components"]:
        found.append(_components(block["variance_components"]))
    if block["calibration"] or block["corrections"] or block.get("taken_up"):
        found.append(_parameters(document, everything=everything))
    return found


def classical_section(document: Document) -> Section:
    """Set what polynomials would leave, strip by strip, beside what the bundle leaves."""
    block = document["classical"]
    left = {
        f"{role}_rms": {part: document["summary"][role][part]["rms"] for part in ("plan", "height")}
        for role in ("control", "check")
    }
    rows = [{"by": "bundle", **left}, {"by": "polynomials", **block}]
    columns = (
        words("rms", "by"),
        *(
            number(f"{role} {part}", f"{role}_rms.{part}", 3, "m")
            for role in ("control", "check")
            for part in ("plan", "height")
        ),
    )
    note = "the strip method by itself, from which the bundle started; `processing.adjustment: polynomial` takes it"
    parts = (Words(f"Polynomials: {_degrees(block)}."), tabulated(rows, columns, note=note))
    return Section("The classical strip adjustment beside it", parts)


def classical_line(block: Document) -> str:
    """Say in a line what polynomials would leave."""
    left = [
        f"{metres(block[key]['plan'])}/{metres(block[key]['height'])} m at {what}"
        for key, what in (("control_rms", "control"), ("check_rms", "check points"))
        if block[key]["plan"] is not None or block[key]["height"] is not None
    ]
    return f"{_degrees(block)}; rms in plan/height {', '.join(left)}"


def _degrees(block: Document) -> str:
    """Say which degrees the polynomials have, of several strips how many have each."""
    number = Counter((each["degree_plan"], each["degree_height"]) for each in block["strips"])
    several = len(block["strips"]) > 1
    return ", ".join(
        (f"degree {plan} in plan and {height} in height" if plan or height else "none, the similarity alone")
        + (f" in {counted(count, 'strip')}" if several else "")
        for (plan, height), count in sorted(number.items())
    )


def _adjustment(block: Document, angles: AngleUnit) -> Section:
    test, screening, unknowns = block["sigma0_test"], block["screening"], block["unknowns"]
    observed = ", ".join(counted(number, ONE[kind]) for kind, number in block["observations"].items())
    units = "models" if "models" in unknowns else "photos"
    parts = f"{sum(unknowns.values())}: {unknowns[units]} of {units}, {unknowns['points']} of points"
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
        number("step", "count"),
        number("sum of squares", "chi_square", partial(short, digits=8)),
        number("length", "length", partial(short, digits=3)),
        number("damping", "damping", partial(short, digits=2)),
        number("largest shift", "shift", partial(power, digits=1), "m"),
        number("turn", lambda step: power(angles.of(step["turn_deg"]), digits=1), unit=angles.name),
    )
    steps = [{"count": count, **step} for count, step in enumerate(block["convergence"], 1)]
    note = "of the last adjustment, from the one before it; length: of the step, in standard deviations"
    title = "Network of independent models" if units == "models" else "Bundle adjustment"
    return Section(title, (Facts(tuple(facts)), tabulated(steps, columns, note=note)))


def _datum(block: Document) -> str:
    if not block["free_network"]:
        return "given by the observations"
    return "free network: inner constraints on the points; positions and scale mean nothing, precision is relative"


def _sigma0(test: Document) -> str:
    if test["passed"] is None:
        return "none: no redundancy"
    limits = f"{fixed(test['lower'], 3)} to {fixed(test['upper'], 3)}"
    said = "passed" if test["passed"] else "NOT PASSED: the stated standard deviations are wrong as a whole"
    return f"{short(test['sigma0'], 5)} against {limits} (chi-square, {100 * (1 - test['level']):g} %): {said}"


def _screening(screening: Document) -> str:
    if screening["method"] == "none":
        return "not searched for"
    out = ", ".join(counted(number, ONE[kind]) for kind, number in screening["rejected"].items() if number)
    test = {"tau": "tau test", "baarda": "Baarda's test"}[screening["test"]]
    level = f"level {screening['alpha']:.2g} for one ray"
    text = f"{screening['method']}, {test}, {level}, limit {fixed(screening['limit'], 2)}: "
    return f"{text}{out or 'none'} rejected, {screening['readmitted']} re-admitted"


def _reliability(block: Document) -> Section:
    reliable = block["reliability"]
    columns = (
        words("observations", _name),
        number("number", "observations"),
        number("redund.", "redundancy", 1),
        number("mean r", "mean", 2),
        number("least r", "smallest", 2),
        number("unchecked", "uncontrolled"),
        number("detectable", "detectable", partial(short, digits=3)),
        number("at most", "detectable_largest", partial(short, digits=3)),
        words("", lambda each: unit(each["unit"])),
        number("effect", "external", 1, "σ"),
    )
    note = (
        "r: redundancy number, the share of an error that shows in its residual; detectable: the error that is found "
        f"with a probability of {100 * reliable['power']:g} % (median, largest); effect: what an error that just "
        "escapes detection shifts at most, in standard deviations of what it shifts (median)"
    )
    parts: list[Part] = [tabulated(reliable["groups"], columns, note=note)]
    parts += _named("fit worst", reliable["worst"])
    parts += _named("hardest to check", reliable["weakest"])
    return Section("Reliability", tuple(parts))


def _name(row: Document) -> str:
    return NAMES[row.get("group") or row["kind"]]


def _named(title: str, rows: Sequence[Document]) -> list[Part]:
    if not rows:
        return []
    columns = (
        words(title, _name),
        words("model" if "model" in rows[0] else "photo", lambda each: each.get("model", each["photo"]) or DASH),
        words("point", lambda each: each["point"] or DASH),
        words("", "axis"),
        number("r", "redundancy", 2),
        number("test", "standardised", 1),
        number("detectable", "detectable", partial(short, digits=3)),
        words("", lambda each: unit(each["unit"])),
        number("effect", "effect", 3, "m"),
    )
    return [tabulated(rows[:NAMED], columns)]


def _components(rows: Sequence[Document]) -> Section:
    columns = (
        words("group", "group"),
        number("observations", "observations"),
        number("redund.", "redundancy", 1),
        number("factor", "factor", 3),
        number("±", lambda each: None if each["sigma"] is None else each["sigma"] * each["factor"], 3),
        words("", lambda each: "" if each["estimated"] else "not estimated: too little redundancy"),
    )
    text = "The stated standard deviations of each group, multiplied by its factor, were used."
    return Section("Variance components", (Words(text), tabulated(rows, columns)))


CORRECTIONS = (
    words("camera positions", "name"),
    number("correction", "value", partial(short, digits=5), "m"),
    number("σ", "sigma", partial(short, digits=2), "m"),
)
CORRELATIONS = (
    words("highly correlated", "first"),
    words("with", "second"),
    number("correlation", "value", lambda value: f"{value:+.3f}"),
)


def _calibration(document: Document) -> tuple[Shown, ...]:
    """Columns of the parameters of cameras: lengths also in pixels, where cameras have some."""
    pixels = {camera["id"]: camera["pixel_size_mm"] for camera in document["cameras"] if camera["pixel_size_mm"]}

    def in_pixels(row: Document) -> str:
        pixel = pixels.get(row["camera"])
        return short(row["value"] / pixel, 4) if pixel and row["unit"] == "mm" else ""

    return (
        words("camera", "camera"),
        words("parameter", "parameter"),
        number("correction", "value", partial(short, digits=5)),
        number("σ", "sigma", partial(short, digits=2)),
        words("", lambda each: "" if each["unit"] == "1" else each["unit"]),
        *((number("pixels", in_pixels, rank=1),) if pixels else ()),
        number("p", "p", partial(short, digits=2)),
        words("", lambda each: "significant" if each["significant"] else "not significant"),
    )


def _correlated(rows: Sequence[Document]) -> Iterator[Table]:
    """Give the correlations of the parameters of each camera, below the diagonal."""
    places = {
        camera: [n for n, row in enumerate(rows) if row["camera"] == camera] for camera in column_of(rows, "camera")
    }
    for camera, own in places.items():
        if len(own) < 2:
            continue
        heads = [str(number) for number in range(1, len(own))]
        lines = tuple(
            (
                f"{number} {rows[place]['parameter']}",
                *(_correlation(rows[place], other) for other in own[: number - 1]),
                *[""] * (len(own) - number),
            )
            for number, place in enumerate(own, 1)
        )
        yield Table((Column(f"correlations, camera {camera}", left=True), *map(Column, heads)), lines)


def _correlation(row: Document, place: int) -> str:
    value = row["correlations"][place]
    return DASH if value is None else f"{value:+z.2f}"


def _parameters(document: Document, *, everything: bool) -> Section:
    """Calibration parameters, offsets and drifts, and what is hard to tell apart."""
    block = document["bundle"]
    shared = tuple(common_causes.taken_up(block, NAMED))
    parts: list[Part] = [Facts(shared)] if shared else []
    if block["calibration"]:
        note = "corrections to the given calibration; p: probability of a value this large by chance"
        parts.append(tabulated(block["calibration"], _calibration(document), note=note))
        parts.extend(_correlated(block["calibration"]))
    if block["corrections"]:
        note = "added to the given positions of a strip; a drift is per unit of time"
        parts.append(tabulated(block["corrections"], CORRECTIONS, note=note))
    if block["correlations"]:
        shown = block["correlations"] if everything else block["correlations"][:CORRELATIONS_SHOWN]
        more = len(block["correlations"]) - len(shown)
        note = f"{counted(more, 'more pair')} in `bundle.correlations`" if more > 0 else ""
        parts.append(tabulated(shown, CORRELATIONS, note=note))
    return Section("Parameters that photos share", tuple(parts))
