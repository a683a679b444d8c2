"""Sections on the adjustment of all observations together: tests, reliability, what observations share."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from heapq import nlargest
from itertools import groupby
from math import floor, log10
from operator import itemgetter
from typing import Any

from photostrip.notes import Document, counted, given_in_pixels, in_pixels, listed
from photostrip.report.page.parts import Column, Facts, Part, Table, Words
from photostrip.report.page.tables import (
    Cell,
    Field,
    Rows,
    fixed,
    keyed,
    metres,
    short,
    signed,
    tabulated,
    taken,
    written,
)
from photostrip.report.sections.formation import GROUND_AXES, degrees

ONE = {
    "image": "image coordinate",
    "model": "model coordinate",
    "control": "control coordinate",
    "position": "camera position coordinate",
    "attitude": "attitude angle",
}
AS_STATED = "in units of the stated standard deviations"
ESTIMATED = "with the standard deviations of the variance components"
NAMED = 6
# How a cause is said; any other is that of a camera or of a photo.
SENTENCES = {
    "offset": "offset of the camera positions of {of}",
    "drift": "drift of the camera positions of {of}",
    "order of positions": "camera positions {of}",
    "control list": "without {of}",
}
OF_POSITIONS = {"offset", "drift"}  # each is the other of fewer or more unknowns: no rivals
ORDERS = {
    "reversed": "in reversed order",
    "forwards": "each given to the photo after its own",
    "backwards": "each given to the photo before its own",
    "exchanged": "of two photos exchanged",
}
OF_RELIABILITY = (
    "r: redundancy number, the share of an error that shows in its residual; detectable: the error that is found with "
    "a probability of {:g} % (median, largest); effect: what an error that just escapes detection shifts at most, in "
    "standard deviations of what it shifts (median)"
)
Row = tuple[str, str]


def classical(document: Document) -> Iterator[Part]:
    """Set what polynomials would leave, strip by strip, beside what the bundle leaves."""
    if "classical" not in document:
        return
    block, summary = document["classical"], document["summary"]
    places = [(role, part) for role in ("control", "check") for part in ("plan", "height")]
    columns = (Field("rms"), *(Field(f"{role} {part}", "m 3") for role, part in places))
    rows = (
        ("bundle", *(summary[role][part]["rms"] for role, part in places)),
        ("polynomials", *(block[f"{role}_rms"][part] for role, part in places)),
    )
    note = "the strip method by itself, from which the bundle started; `processing.adjustment: polynomial` takes it"
    yield Words(f"Polynomials: {degrees(block['strips'])}.")
    yield tabulated(columns, rows, note)


def stages(document: Document, most: int) -> Iterator[Row]:
    """Say in a line how the adjustment went, what it took up and estimated, what polynomials would leave."""
    block = document.get("bundle")
    if block is not None:
        test, out = block["sigma0_test"], sum(block["screening"].get("rejected", {}).values())
        said = "no redundancy to test it" if test["passed"] is None else _verdict(test)
        free = "free network, " if block["free_network"] else ""
        of_components = f"; {fixed(block['sigma0'], 3)} {ESTIMATED}" if len(block["variance_components"]) else ""
        text = f"{free}σ0 {fixed(test['sigma0'], 3)}, test {said}{of_components}"
        text += f"; {counted(out, 'observation')} rejected"
        yield "bundle adjustment", text
        yield from taken_up(block, most)
        yield from estimated(document, most)
    if "classical" in document:
        classical = document["classical"]
        left = [
            f"{metres(classical[key]['plan'])}/{metres(classical[key]['height'])} m at {what}"
            for key, what in (("control_rms", "control"), ("check_rms", "check points"))
            if classical[key]["plan"] is not None or classical[key]["height"] is not None
        ]
        yield "by polynomials", f"{degrees(classical['strips'])}; rms in plan/height {', '.join(left)}"


def _verdict(test: Document) -> str:
    return f"{'passed' if test['passed'] else 'NOT PASSED'} ({fixed(test['lower'], 3)} to {fixed(test['upper'], 3)})"


def bundle(document: Document) -> Iterator[Part]:
    return _adjustment(document, "photos")


def model_network(document: Document) -> Iterator[Part]:
    return _adjustment(document, "models")


def _adjustment(document: Document, units: str) -> Iterator[Part]:
    """Give size, convergence and test of the adjustment of photos, or of models."""
    block = document.get("bundle")
    if block is None or units not in block["unknowns"]:
        return
    test, unknowns = block["sigma0_test"], block["unknowns"]
    parts = f"{sum(unknowns.values())}: {unknowns[units]} of {units}, {unknowns['points']} of points"
    parts += f", {unknowns['common']} common" if unknowns["common"] else ""
    free = "free network: inner constraints on the points; positions and scale mean nothing, precision is relative"
    said = "none: no redundancy"
    if test["passed"] is not None:
        wrong = "" if test["passed"] else ": the stated standard deviations are wrong as a whole"
        said = f"{short(test['sigma0'], 5)}, chi-square, {100 * (1 - test['level']):g} %: {_verdict(test)}{wrong}"
    facts = (
        ("datum", free if block["free_network"] else "given by the observations"),
        ("observations", ", ".join(counted(number, ONE[kind]) for kind, number in block["observations"].items())),
        ("unknowns", f"{parts}; redundancy {block['redundancy']}"),
        ("σ0", f"{short(block['sigma0'], 5)} {ESTIMATED if len(block['variance_components']) else AS_STATED}"),
        ("test of σ0", said),
        ("gross errors", _screening(block["screening"])),
    )
    note = "steps of the last adjustment, from the one before it; length: of the step, in standard deviations"
    yield Facts(facts)
    yield keyed(block["convergence"], "chi_square length damping shift turn_deg", note)


def _screening(screening: Document) -> str:
    if screening["method"] == "none":
        return "not searched for"
    out = ", ".join(counted(number, ONE[kind]) for kind, number in screening["rejected"].items() if number)
    test = {"tau": "tau test", "baarda": "Baarda's test"}[screening["test"]]
    limits = "; ".join(
        f"{what} level {screening[f'alpha{of}']:.2g}, limit {fixed(screening[f'limit{of}'], 2)}"
        for of, what in (("", "a ray"), ("_given", "a given coordinate"))
    )
    limits += f"; all over the σ0 found, {fixed(screening['unit'], 3)}" * (screening["unit"] > 1.0)
    return f"{screening['method']}, {test}, {limits}: {out or 'none'} rejected, {screening['readmitted']} re-admitted"


def reliability(document: Document) -> Iterator[Part]:
    if "bundle" not in document:
        return
    block = document["bundle"]["reliability"]
    keys = "group observations redundancy mean smallest uncontrolled detectable detectable_largest unit external"
    yield keyed(block["groups"], keys, OF_RELIABILITY.format(100 * block["power"]))
    for title, rows in (("fit worst", block["worst"][:NAMED]), ("are hardest to check", block["weakest"][:NAMED])):
        if len(rows):
            unit = "model" if "model" in rows.columns else "photo"
            keys = f"kind {unit} point axis redundancy standardised detectable unit effect"
            yield keyed(rows, keys, f"observations that {title}")


def variance_components(document: Document) -> Iterator[Part]:
    rows = document.get("bundle", {}).get("variance_components", ())
    if len(rows):
        yield Words("The stated standard deviations of each group, multiplied by its factor, were used.")
        yield keyed(rows, "group observations redundancy factor sigma estimated")


def shared_parameters(document: Document) -> Iterator[Part]:
    """Give what was taken up, offsets and drifts, and what is hard to tell apart."""
    block = document.get("bundle", {})
    if not any(len(block.get(key, ())) for key in ("calibration", "corrections", "taken_up")):
        return
    if shared := tuple(taken_up(block, NAMED)):
        yield Facts(shared)
    if len(block["corrections"]):
        note = (
            "added to the given positions of a strip; a drift from photo to photo, or for each unit of the given times"
        )
        yield keyed(block["corrections"], "name value sigma", note)
    yield from _highly_correlated(block["correlations"], of_cameras=False)


def camera(document: Document) -> Iterator[Part]:
    """Give each camera as an adjustment estimated it, like the sheet of a calibration."""
    block = document.get("bundle", {})
    rows, pixels, own_unit = block.get("calibration", ()), pixel_sizes(document), given_in_pixels(document)
    names = list(rows.values("camera")) if len(rows) else []
    for name in dict.fromkeys(names):
        own = rows.where(camera=name)
        if name in own_unit:
            own = [in_pixels(row, own_unit[name]) for row in own]
        yield from _calibration(name, own, rows.quantities, names, pixels.get(name))
    if names:
        yield from _highly_correlated(block["correlations"], of_cameras=True)
        yield Words("`photostrip convert RESULT cameras.yaml` writes the adjusted cameras, for a project or a program.")


def _highly_correlated(rows: Rows, *, of_cameras: bool) -> Iterator[Table]:
    """Give the pairs of unknowns with a parameter of a camera, or the others."""
    ends = zip(rows.values("first"), rows.values("second"), strict=True)
    chosen = [n for n, pair in enumerate(ends) if any(each.startswith("camera ") for each in pair) is of_cameras]
    if chosen:
        yield keyed(taken(rows, chosen), "first second value", "unknowns that can hardly be told apart: above 0.95")


def pixel_sizes(document: Document) -> dict[str, float]:
    """Return the sizes of pixels of the cameras that have some, mm."""
    return {camera["id"]: camera["pixel_size_mm"] for camera in document["cameras"] if camera["pixel_size_mm"]}


def _calibration(
    name: str, own: Rows, quantities: Mapping[str, Any], cameras: list[str], pixel: float | None
) -> Iterator[Table]:
    """Give the parameters of a camera, and the correlations between them.

    quantities: what their columns are; cameras: of all parameters.
    """
    corner = "pixels" if own[0]["unit"].startswith("px") else "corner_um pixels" if pixel else "corner_um"
    keys = f"camera parameter given adjusted value sigma unit {corner} p:1 significant"
    adjusted, value = (
        (Field(key, " g4", head), [_to_sigma(row.get(key), row["sigma"]) for row in own])
        for key, head in (("adjusted", "adjusted"), ("value", "difference"))
    )
    moved = [row.get("corner_um") for row in own]
    pixels = [each / (1000.0 * pixel) if pixel and each is not None else None for each in moved]
    note = (name == cameras[-1]) * (
        "difference: adjusted minus given; at the corner: how far it moves an image point in a corner of the photo; p: "
        "probability of a difference this large where the given value is right; k, p, affinity, shear: of what is "
        "added to a measured image point to make it free of distortion"
    )
    alone = "corner_um" not in keys
    of_pixels = Field("pixels", "px 2", "at the corner" * alone, rank=1 - alone), pixels
    yield keyed(own, keys, note, quantities=quantities, adjusted=adjusted, value=value, pixels=of_pixels)
    places = [n for n, each in enumerate(cameras) if each == name]
    lines = [
        (
            f"{number} {row['parameter']}",
            *(written(row["correlations"][other], " +2") for other in places[: number - 1]),
            *[""] * (len(own) - number),
        )
        for number, row in enumerate(own, 1)
    ]
    heads = Column(f"correlations, camera {name}", left=True), *(Column(str(n)) for n in range(1, len(own)))
    if len(own) > 1:
        yield Table(heads, tuple(lines))


def _to_sigma(value: float | None, sigma: float) -> Cell:
    """Write a value up to the second digit of its standard deviation."""
    if not value or not sigma:
        return Cell(short(value), value)
    return Cell(short(value, max(1, floor(log10(abs(value))) - floor(log10(sigma)) + 2)), value)


def taken_up(block: Document, most: int) -> Iterator[Row]:
    """Say in a line for each cause what the project does not state and the adjustment went on with."""
    causes: dict[str, list[Document]] = {}
    for each in block.get("taken_up", ()):
        causes.setdefault(each["cause"], []).append(each)
    for cause, rows in causes.items():
        of = listed(map(_whose, rows), most)
        whose = cause.replace("of a photo", f"of {'photo' if len(rows) == 1 else 'photos'}")
        text = SENTENCES.get(cause, f"{whose} {of}").format(of=of)
        alike = OF_POSITIONS if cause in OF_POSITIONS else set()
        rivals = dict.fromkeys(rival for row in rows for rival in row["rivals"] if rival not in alike)
        others = listed(f"another {rival}" if rival == cause else rival for rival in rivals)
        yield "cause found", f"{text}; {others} would explain it nearly as well" if rivals else text


def _whose(row: Document) -> str:
    if row["cause"] == "control list":
        known = [axis for axis in GROUND_AXES if row[f"shift_{axis}"] is not None]
        steps = (f"{signed(row[f'shift_{axis}'])} m {axis} (σ {metres(row[f'sigma_{axis}'])} m)" for axis in known)
        return f"{row['of']}, which lies {', '.join(steps)} beside all else"
    if row["cause"].endswith("photo"):
        return str(row["of"])
    return ORDERS.get(row["of"], row["of"]) if row["cause"] in SENTENCES else f"of camera {row['of']}"


def estimated(document: Document, most: int) -> Iterator[Row]:
    """Say in a line for each camera and group of positions what was estimated; of many the most significant."""
    block = document["bundle"]
    found = [*_cameras(block, pixel_sizes(document), given_in_pixels(document)), *_positions(block["corrections"])]
    for place in sorted(nlargest(most, range(len(found)), key=lambda place: found[place][1])):
        yield "estimated", found[place][0]
    if len(found) > most:
        more = counted(len(found) - most, "more camera or group of positions", "more cameras or groups of positions")
        yield "estimated", f"{more}, less significant: --section camera, bundle"
    # what is common to many observations and what else could stand for it; not two parameters of cameras
    pairs = [
        f"{row['first']} with {row['second']} {row['value']:+.3f}"
        for row in block["correlations"]
        for ends in [(row["first"], row["second"])]
        if any(end.startswith(("camera ", "positions ")) for end in ends)
        and not all(end.startswith("camera ") for end in ends)
    ]
    if pairs:
        yield "highly correlated", listed(pairs, most)


def _cameras(block: Document, pixels: dict[str, float], own_unit: dict[str, float]) -> Iterator[tuple[str, float]]:
    """Give what was estimated of each camera, and the largest value in units of its standard deviation."""
    for camera, group in groupby(block["calibration"], key=itemgetter("camera")):
        own = [in_pixels(each, own_unit[camera]) if camera in own_unit else each for each in group]
        said = ", ".join(_parameter(each, pixels.get(camera)) for each in own)
        said += "; with correlations: --section camera" * (len(own) > 1)
        yield f"camera {camera}: added {said}", _largest(own, "value", "sigma")


def _name(row: Document) -> str:
    return str(row["parameter"].replace("_", " "))


def _parameter(row: Document, pixel: float | None) -> str:
    """Say a correction with its standard deviation, lengths in pixels too, and whether it could be chance."""
    unit = "" if row["unit"] == "1" else f" {row['unit']}"
    more = f", {short(row['value'] / pixel, 3)} px" if pixel and row["unit"] == "mm" else ""
    more += "" if row["significant"] else ", not significant"
    return f"{short(row['value'])}{unit} to {_name(row)} (σ {short(row['sigma'], 2)}{unit}{more})"


def _positions(rows: Sequence[Document]) -> Iterator[tuple[str, float]]:
    for group, corrections in groupby(rows, key=itemgetter("group")):
        own = list(corrections)
        said = []
        for kind, parts in groupby(own, key=itemgetter("kind")):
            steps = ", ".join(f"{signed(r['whole'])} m {r['axis']} (σ {metres(r['whole_sigma'])} m)" for r in parts)
            said.append(f"from the first to the last {steps} more" if kind == "drift" else steps)
        yield f"camera positions of {group}: added {'; '.join(said)}", _largest(own, "whole", "whole_sigma")


def _largest(rows: Iterable[Document], value: str, sigma: str) -> float:
    return max(abs(row[value]) / row[sigma] if row[sigma] else float("inf") for row in rows)
