"""A trace as sections: every stage of every strip with the symbols of the formulas."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from photostrip.notes import Document, counted
from photostrip.report.page.numbers import fixed, power, short
from photostrip.report.page.parts import Facts, Part, Section, Table, Words
from photostrip.report.page.tables import number, tabulated, words

PRIMED = {"alpha1": "α1′", "kappa1": "κ1′", "alpha2": "α2′", "omega2": "ω2′", "kappa2": "κ2′"}
GREEK = {"alpha": "α", "omega": "ω", "kappa": "κ", "tau": "τ", "nu": "ν", "xi": "ξ", "eta": "η", "theta": "θ"}
SOURCE = {
    "pairs": "Relative orientation of {left} – {right}",
    "chain": "Chain of strip {strip}: orientation and base of every photo, eq. 125-136",
    "scale": "Scale transfer at photo {photo}, eq. 139-141",
    "absolute": "Absolute orientation of strip {strip}, eq. 142-149",
    "polynomial": "Polynomials of strip {strip}, eq. 150-151",
}


def trace_title(document: Document) -> str:
    return f"Trace: {document['name']}"


def trace_sections(document: Document) -> tuple[Section, ...]:
    """Return symbols, then for each strip its pairs, the chain, junctions, absolute orientation and polynomials."""
    unit = document["angles"]
    found = [Section("Symbols", (Facts(tuple(document["symbols"].items())), Words(f"Angles in {unit}.")))]
    if document["departures"]:
        departures = tabulated(document["departures"], DEPARTURES)
        found.append(Section("Where this run departs from the textbook", (departures,)))
    for strip in document["strips"]:
        found += [_pair(pair, unit) for pair in strip["pairs"]]
        found.append(_chain(strip, unit))
        found += [_junction(junction) for junction in strip["scale_transfer"]]
        found.append(_absolute(strip, unit))
        if strip["polynomial"] is not None:
            found.append(_polynomial(strip))
    return tuple(found)


DEPARTURES = (
    words("subject", "subject"),
    words("source", "source"),
    words("textbook", "textbook"),
    words("here", "here"),
    words("to follow it", "key"),
)


def _pair(pair: Document, unit: str) -> Section:
    """Show the rounds of one pair: elements before each step and what is added, then rejections and points."""
    parts: list[Part] = []
    for count, each in enumerate(pair["rounds"], 1):
        which = "all points" if count == 1 else "without the rejected points"
        parts.append(Words(f"Round {count}, {which}: {counted(each['points'], 'point')}", "head"))
        parts.append(_iterations(each, unit))
    if pair["rejected"]:
        parts.append(tabulated(pair["rejected"], REJECTED))
    own = pair["photo_system"]
    base = ", ".join(f"{name} {fixed(own[name], 6)}" for name in ("bx", "by", "bz"))
    turns = ", ".join(f"{GREEK[name]} {fixed(own[name], 6)}" for name in ("tau", "nu", "alpha", "omega", "kappa"))
    parts.append(Words(f"In the system of the left photo: {base}; {turns} {unit}."))
    parts.append(Words(f"σ0 of an image coordinate: {fixed(pair['sigma0_um'], 2)} µm. The points, eq. 137-138:"))
    parts.append(tabulated(pair["points"], POINTS))
    return Section(SOURCE["pairs"].format(**pair), tuple(parts))


def _iterations(each: Document, unit: str) -> Table:
    columns = (
        number("step", "iteration"),
        number("[wqq]", "[wqq]", power, "mm²"),
        *(number(symbol, f"elements.{name}", 6, unit) for name, symbol in PRIMED.items()),
        *(number(f"d{symbol}", f"d.{name}", partial(power, digits=1), unit, rank=1) for name, symbol in PRIMED.items()),
    )
    end = ("end", "", *(fixed(each["end"][name], 6) for name in PRIMED), *("" for _ in PRIMED))
    return tabulated(each["steps"], columns, (end,))


def _used(row: Document) -> str:
    return "" if row["used"] else "not used"


REJECTED = (
    words("rejected", "point"),
    words("test", "test"),
    number("value", "value", short),
    number("limit", "limit", short),
    number("q", "q", 4, "mm"),
    words("", lambda row: "taken back" if row["readmitted"] else ""),
)
POINTS = (
    words("point", "point"),
    *(number(name, name, 4, "mm") for name in ("x1", "y1", "x2", "y2", "q")),
    number("N", "N", 7),
    *(number(name, name, 6, "strip") for name in "XYZ"),
    words("", _used),
)


def _component(key: str, place: int) -> Callable[[Document], float | None]:
    """Return what reads one component of a vector; the first photo of a strip has no base."""
    return lambda row: row[key][place] if key in row else None


def _optional(key: str) -> Callable[[Document], float | None]:
    return lambda row: row.get(key)


def _of_base(decimals: int) -> Callable[[float | None], str]:
    return lambda value: "" if value is None else fixed(value, decimals)


def _chain(strip: Document, unit: str) -> Section:
    """Show the orientation and base of every photo, then its rotation matrix as a row."""
    columns = (
        words("photo", "photo"),
        *(number(GREEK[name], _optional(name), _of_base(6), unit) for name in ("tau", "nu")),
        *(number(f"B{axis}", _component("B", n), _of_base(6)) for n, axis in enumerate("XYZ")),
        number("k", _optional("k"), _of_base(7)),
        *(number(GREEK[name], name, 6, unit) for name in ("alpha", "omega", "kappa")),
        *(number(f"{axis}s", _component("S", n), 6) for n, axis in enumerate("XYZ")),
    )
    places = [f"{row}{column}" for row in "abc" for column in "123"]
    matrices = (words("photo", "photo"), *(number(name, _component("A", n), 8) for n, name in enumerate(places)))
    note = "A = A_taunu A(α2′, ω2′, κ2′), eq. 131-133, by rows."
    tables = (tabulated(strip["chain"], columns), tabulated(strip["chain"], matrices, note=note))
    return Section(SOURCE["chain"].format(**strip), tables)


def _junction(junction: Document) -> Section:
    columns = (
        words("point", "point"),
        *(number(name, name, 7) for name in ("D", "D'", "k_t")),
        number("k_t - k", lambda row: row["k_t"] - junction["k"], partial(power, digits=1)),
        words("", _used),
    )
    one = junction["sd_of_one"]
    spread = "" if one is None else f"; standard deviation of one ratio {power(one, 1)}"
    text = f"k = {fixed(junction['k'], 9)} ({junction['form'].replace('_', ' ')}){spread}."
    return Section(SOURCE["scale"].format(**junction), (tabulated(junction["points"], columns), Words(text)))


def _absolute(strip: Document, unit: str) -> Section:
    found = strip["absolute"]
    origin = ", ".join(fixed(value, 4) for value in found["origin"])
    axes = "; ".join(" ".join(fixed(value, 9) for value in found["M"][row : row + 3]) for row in (0, 3, 6))
    facts = Facts((("A0", f"{fixed(found['A0'], 6)} {unit}"), ("origin, m", origin), ("M, by rows", axes)))
    columns = (
        number("step", "iteration"),
        number("[wvv]", "[wvv]", partial(short, digits=6)),
        number("s", "s", 7),
        *(number(GREEK[name], name, 6, unit) for name in ("xi", "eta", "theta")),
        *(number(f"{axis}0", _component("shift", n), 4, "m") for n, axis in enumerate("XYZ")),
        *(
            number(f"d{axis}0", _component("d_shift", n), partial(power, digits=1), "m", rank=1)
            for n, axis in enumerate("XYZ")
        ),
    )
    angles = (fixed(found[name], 6) for name in ("xi", "eta", "theta"))
    end = ("end", "", fixed(found["s"], 7), *angles, *(fixed(value, 4) for value in found["shift"]), "", "", "")
    sigma0 = "no redundancy" if found["sigma0"] is None else f"σ0 = {short(found['sigma0'])}"
    control = tabulated(
        found["control"], CONTROL, note="v: strip minus given after the similarity, in the intermediate frame."
    )
    steps = tabulated(found["steps"], columns, (end,), sigma0)
    return Section(SOURCE["absolute"].format(**strip), (facts, *_approximate(found["approximate"]), steps, control))


def _approximate(found: Document | None) -> tuple[Part, ...]:
    """Show the scales of pairs of control points, r and t."""
    if found is None:
        return ()
    center = ", ".join(fixed(value, 6) for value in found["centroid"])
    r, t = (short(found[name], digits=9) for name in ("r", "t"))
    text = Words(f"r = {r}, t = s/r = {t}; centroid of the strip's control {center}.")
    return (tabulated(found["pairs"], PAIR_SCALES), text) if found["pairs"] else (text,)


def _left_over(place: int) -> Callable[[Document], float]:
    return lambda row: row["oriented"][place] - row["given"][place]


PAIR_SCALES = (
    words("from", "from"),
    words("to", "to"),
    number("D", "D", 6, "strip"),
    number("DG", "DG", 3, "m"),
    number("r", "r", partial(short, digits=9)),
)
CONTROL = (
    words("point", "point"),
    words("use", "use"),
    *(number(axis, _component("strip", n), 6, "strip") for n, axis in enumerate("XYZ")),
    *(number(axis, _component("given", n), 3, "given, m") for n, axis in enumerate("XYZ")),
    *(number(f"v{axis}", _left_over(n), 3, "m") for n, axis in enumerate("XYZ")),
)
EVIDENCE = (
    words("group", "group"),
    number("degree", "degree"),
    number("rms", "rms", 4, "m"),
    number("left out", "left_out", 4, "m"),
    number("F", "F", short),
    number("p", "p", partial(short, digits=3)),
    words("", lambda row: "taken" if row["taken"] else ""),
)
COEFFICIENTS = (
    words("added to", "axis"),
    words("term", "terms"),
    number("coefficient", "coefficients", partial(power, digits=8)),
    number("±", "sigmas", partial(power, digits=2)),
)
POLYNOMIAL_CONTROL = (
    words("point", "point"),
    number("X", "X", 3, "m"),
    number("Y", "Y", 3, "m"),
    *(number(f"l{axis}", _component("l", n), 3, "m") for n, axis in enumerate("XYZ")),
    *(number(f"v{axis}", _component("v", n), 3, "m") for n, axis in enumerate("XYZ")),
)


def _polynomial(strip: Document) -> Section:
    found, keys = strip["polynomial"], ("terms", "coefficients", "sigmas")
    terms = [
        {"axis": axis, **dict(zip(keys, values, strict=True))}
        for axis, fit in found["axes"].items()
        for values in zip(*(fit[key] for key in keys), strict=True)
    ]
    parts = (
        tabulated(found["evidence"], EVIDENCE),
        tabulated(terms, COEFFICIENTS) if terms else Words("No term is taken."),
        tabulated(found["control"], POLYNOMIAL_CONTROL, note="l: given minus strip; v: corrected minus given."),
    )
    return Section(SOURCE["polynomial"].format(**strip), parts)
