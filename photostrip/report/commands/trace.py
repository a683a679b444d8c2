"""A trace as sections: every stage of every strip with the symbols of the formulas."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from photostrip.report.page.figures import counted, fixed, power, short
from photostrip.report.page.parts import Column, Facts, Part, Section, Table, Words

if TYPE_CHECKING:
    from collections.abc import Sequence

Document = dict[str, Any]

PRIMED = {"alpha1": "α1′", "kappa1": "κ1′", "alpha2": "α2′", "omega2": "ω2′", "kappa2": "κ2′"}
GREEK = {"alpha": "α", "omega": "ω", "kappa": "κ", "tau": "τ", "nu": "ν", "xi": "ξ", "eta": "η", "theta": "θ"}
USED = {True: "", False: "not used"}
SOURCE = {
    "pairs": "Relative orientation of {left} – {right}",
    "chain": "Chain of strip {strip}: orientation and base of every photo, eq. 125-136",
    "scale": "Scale transfer at photo {photo}, eq. 139-141",
    "absolute": "Absolute orientation of strip {strip}, eq. 142-149",
    "polynomial": "Polynomials of strip {strip}, eq. 150-151",
}


def trace_title(document: Document) -> str:
    """Return the title of a trace."""
    return f"Trace: {document['name']}"


def trace_sections(document: Document) -> tuple[Section, ...]:
    """Return the sections of a trace.

    Parameters
    ----------
    document : dict
        The trace, see ``trace.trace_of``.

    Returns
    -------
    tuple of Section
        Symbols, then for each strip its pairs, the chain, joints, absolute orientation and polynomials.
    """
    unit = document["angles"]
    found = [Section("Symbols", (Facts(tuple(document["symbols"].items())), Words(f"Angles in {unit}.")))]
    for strip in document["strips"]:
        found += [_pair(pair, unit) for pair in strip["pairs"]]
        found.append(_chain(strip, unit))
        found += [_joint(joint) for joint in strip["scale_transfer"]]
        found.append(_absolute(strip, unit))
        if strip["polynomial"] is not None:
            found.append(_polynomial(strip))
    return tuple(found)


def _pair(pair: Document, unit: str) -> Section:
    """Show the rounds of one pair: elements before each step and what is added, then rejections and points."""
    parts: list[Part] = []
    for number, each in enumerate(pair["rounds"]):
        which = "all points" if not number else "without the rejected points"
        parts.append(Words(f"Round {number + 1}, {which}: {counted(each['points'], 'point')}", "head"))
        parts.append(_iterations(each, unit))
    if pair["rejected"]:
        parts.append(_rejected(pair["rejected"]))
    parts.append(Words(f"σ0 of an image coordinate: {fixed(pair['sigma0_um'], 2)} µm. The points, eq. 137-138:"))
    parts.append(_points(pair["points"]))
    return Section(SOURCE["pairs"].format(**pair), tuple(parts))


def _iterations(each: Document, unit: str) -> Table:
    columns = (
        Column("step"),
        Column("[wqq]", "mm²"),
        *(Column(symbol, unit) for symbol in PRIMED.values()),
        *(Column(f"d{symbol}", unit, rank=1) for symbol in PRIMED.values()),
    )
    rows = tuple(
        (
            str(step["iteration"]),
            power(step["[wqq]"]),
            *(fixed(step["elements"][name], 6) for name in PRIMED),
            *(power(step["d"][name], 1) for name in PRIMED),
        )
        for step in each["steps"]
    )
    end = ("end", "", *(fixed(each["end"][name], 6) for name in PRIMED), *("" for _ in PRIMED))
    return Table(columns, rows, (end,))


def _rejected(rows: Sequence[Document]) -> Table:
    columns = (
        Column("rejected", left=True),
        Column("test", left=True),
        Column("value"),
        Column("limit"),
        Column("q", "mm"),
        Column("", left=True),
    )
    cells = tuple(
        (
            row["point"],
            row["test"],
            short(row["value"]),
            short(row["limit"]),
            fixed(row["q"], 4),
            "taken back" if row["readmitted"] else "",
        )
        for row in rows
    )
    return Table(columns, cells)


def _points(rows: Sequence[Document]) -> Table:
    columns = (
        Column("point", left=True),
        *(Column(name, "mm") for name in ("x1", "y1", "x2", "y2", "q")),
        Column("N"),
        *(Column(name, "strip") for name in "XYZ"),
        Column("", left=True),
    )
    cells = tuple(
        (
            row["point"],
            *(fixed(row[name], 4) for name in ("x1", "y1", "x2", "y2", "q")),
            fixed(row["N"], 7),
            *(fixed(row[name], 6) for name in "XYZ"),
            USED[row["used"]],
        )
        for row in rows
    )
    return Table(columns, cells)


def _chain(strip: Document, unit: str) -> Section:
    columns = (
        Column("photo", left=True),
        *(Column(GREEK[name], unit) for name in ("tau", "nu")),
        *(Column(f"B{axis}") for axis in "XYZ"),
        Column("k"),
        *(Column(GREEK[name], unit) for name in ("alpha", "omega", "kappa")),
        *(Column(f"{axis}s") for axis in "XYZ"),
    )
    rows = []
    for row in strip["chain"]:
        base = (
            *(fixed(row[name], 6) for name in ("tau", "nu")),
            *(fixed(value, 6) for value in row["B"]),
            fixed(row["k"], 7),
        ) if "B" in row else ("",) * 6  # fmt: skip
        angles = (fixed(row[name], 6) for name in ("alpha", "omega", "kappa"))
        rows.append((row["photo"], *base, *angles, *(fixed(value, 6) for value in row["S"])))
    return Section(SOURCE["chain"].format(**strip), (Table(columns, tuple(rows)), *_matrices(strip)))


def _matrices(strip: Document) -> tuple[Part, ...]:
    """Rotation matrices of the photos, a row each."""
    columns = (Column("photo", left=True), *(Column(f"{row}{column}") for row in "abc" for column in "123"))
    rows = tuple((row["photo"], *(fixed(value, 8) for value in row["A"])) for row in strip["chain"])
    return (Table(columns, rows, note="A = A_taunu A(α2′, ω2′, κ2′), eq. 131-133, by rows."),)


def _joint(joint: Document) -> Section:
    columns = (
        Column("point", left=True),
        Column("D"),
        Column("D'"),
        Column("k_t"),
        Column("k_t - k"),
        Column("", left=True),
    )
    rows = tuple(
        (
            row["point"],
            *(fixed(row[name], 7) for name in ("D", "D'", "k_t")),
            power(row["k_t"] - joint["k"], 1),
            USED[row["used"]],
        )
        for row in joint["points"]
    )
    spread = "" if joint["sd_of_one"] is None else f"; standard deviation of one ratio {power(joint['sd_of_one'], 1)}"
    text = f"k = {fixed(joint['k'], 9)} ({joint['form'].replace('_', ' ')}){spread}."
    return Section(SOURCE["scale"].format(**joint), (Table(columns, rows), Words(text)))


def _absolute(strip: Document, unit: str) -> Section:
    """Frame, steps and control of the absolute orientation."""
    found = strip["absolute"]
    origin = ", ".join(fixed(value, 4) for value in found["origin"])
    axes = "; ".join(" ".join(fixed(value, 9) for value in found["M"][row : row + 3]) for row in (0, 3, 6))
    facts = Facts((("A0", f"{fixed(found['A0'], 6)} {unit}"), ("origin, m", origin), ("M, by rows", axes)))
    columns = (
        Column("step"),
        Column("[wvv]"),
        Column("s"),
        *(Column(GREEK[name], unit) for name in ("xi", "eta", "theta")),
        *(Column(f"{axis}0", "m") for axis in "XYZ"),
        *(Column(f"d{axis}0", "m", rank=1) for axis in "XYZ"),
    )
    rows = tuple(
        (
            str(step["iteration"]),
            short(step["[wvv]"], 6),
            fixed(step["s"], 7),
            *(fixed(step[name], 6) for name in ("xi", "eta", "theta")),
            *(fixed(value, 4) for value in step["shift"]),
            *(power(value, 1) for value in step["d_shift"]),
        )
        for step in found["steps"]
    )
    angles = (fixed(found[name], 6) for name in ("xi", "eta", "theta"))
    end = ("end", "", fixed(found["s"], 7), *angles, *(fixed(value, 4) for value in found["shift"]), "", "", "")
    sigma0 = "no redundancy" if found["sigma0"] is None else f"σ0 = {short(found['sigma0'])}"
    return Section(
        SOURCE["absolute"].format(**strip), (facts, Table(columns, rows, (end,), sigma0), _control(found["control"]))
    )


def _control(rows: Sequence[Document]) -> Table:
    columns = (
        Column("point", left=True),
        Column("use", left=True),
        *(Column(axis, "strip") for axis in "XYZ"),
        *(Column(axis, "given, m") for axis in "XYZ"),
        *(Column(f"v{axis}", "m") for axis in "XYZ"),
    )
    cells = tuple(
        (
            row["point"],
            row["use"],
            *(fixed(value, 6) for value in row["strip"]),
            *(fixed(value, 3) for value in row["given"]),
            *(fixed(moved - given, 3) for moved, given in zip(row["oriented"], row["given"], strict=True)),
        )
        for row in rows
    )
    return Table(columns, cells, note="v: strip minus given after the similarity, in the intermediate frame.")


def _polynomial(strip: Document) -> Section:
    """Evidence, coefficients and control of the polynomials."""
    found = strip["polynomial"]
    weighed = Table(
        (Column("group", left=True), Column("degree"), Column("rms", "m"), Column("left out", "m"), Column("F"),
         Column("p"), Column("", left=True)),
        tuple(
            (row["group"], str(row["degree"]), fixed(row["rms"], 4), fixed(row["left_out"], 4), short(row["F"]),
             short(row["p"], 3), "taken" if row["taken"] else "")
            for row in found["evidence"]
        ),
    )  # fmt: skip
    coefficients = Table(
        (Column("added to", left=True), Column("term", left=True), Column("coefficient"), Column("±")),
        tuple(
            (axis, term, power(value, 8), power(sigma, 2))
            for axis, fit in found["axes"].items()
            for term, value, sigma in zip(fit["terms"], fit["coefficients"], fit["sigmas"], strict=True)
        ),
    )
    control = Table(
        (Column("point", left=True), Column("X", "m"), Column("Y", "m"), *(Column(f"l{axis}", "m") for axis in "XYZ"),
         *(Column(f"v{axis}", "m") for axis in "XYZ")),
        tuple(
            (row["point"], fixed(row["X"], 3), fixed(row["Y"], 3), *(fixed(value, 3) for value in row["l"]),
             *(fixed(value, 3) for value in row["v"]))
            for row in found["control"]
        ),
        note="l: given minus strip; v: corrected minus given.",
    )  # fmt: skip
    parts = (weighed, coefficients, control) if coefficients.rows else (weighed, Words("No term is taken."), control)
    return Section(SOURCE["polynomial"].format(**strip), parts)
