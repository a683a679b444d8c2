"""Sections on how strips were formed and brought to the ground: marks, pairs or models, control, polynomials."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from math import hypot

from photostrip.notes import Document, counted
from photostrip.report.page.parts import Facts, Part, Words
from photostrip.report.page.tables import (
    Field,
    angle_unit,
    column_of,
    fixed,
    keyed,
    metres,
    micrometres,
    percent,
    tabulated,
)
from photostrip.report.sections.project import of_models

HIGH_LEVERAGE = 0.7  # share of a control point in the polynomial at its own place
ELEMENTS = "alpha1", "kappa1", "alpha2", "omega2", "kappa2"
COORDINATES = "x", "y", "divided by"
DIRECTIONS = ("along", "across", "up")
GROUND_AXES = ("east", "north", "up")


def fiducials(document: Document) -> Iterator[Part]:
    """Give the transformation of the marks of each photo, and what is left at them."""
    if not len(document.get("fiducials", ())):
        return
    photos, marks = document["fiducials"], document["fiducial_marks"]
    largest: dict[str, float] = {}
    for mark in marks:
        length = hypot(mark["vx_um"], mark["vy_um"])
        largest[mark["photo"]] = max(largest.get(mark["photo"], 0.0), length)
    of_photos = Field("", "µm 1", "largest"), [largest.get(photo, 0.0) for photo in photos.values("photo")]
    keys = "photo transform marks sigma0_um largest scale_x scale_y rotation_deg:1 shear_deg:1 mirrored:2"
    yield keyed(photos, keys, "scale: photo over measured; turn, shear: counter-clockwise", largest=of_photos)
    terms = (Field("photo"), Field("of"), *(Field(term, " g10") for term in ("x", "y", "xy", "1")))
    coefficients = [
        (row["photo"], of, *line)
        for row in photos
        for of, line in zip(COORDINATES, row["coefficients"], strict=True)
        if of in "xy" or row["transform"] == "projective"
    ]
    yield tabulated(terms, coefficients, "photo coordinates, mm, from the measured ones")
    yield keyed(marks, "photo mark vx_um vy_um", "transformed minus calibrated")


def sigma0_of(summary: Document, key: str = "sigma0_um") -> str:
    return f"σ0 {micrometres(summary[key])} µm, stated {micrometres(summary['sigma_given_um'])} µm"


def pairs_line(document: Document) -> str:
    """Say how good the image coordinates are, by the pairs."""
    summary, models = document["summary"], document["models"]
    out, used = (sum(column_of(models, key)) for key in ("points_rejected", "points_used"))
    sigma0 = sigma0_of(summary, "sigma0_pairs_um" if "sigma0_pairs_um" in summary else "sigma0_um")
    total = f"{counted(out + used, 'point')} in {counted(len(models), 'pair')}"
    return f"{sigma0}; {out} of {total} rejected, {percent(out, out + used)}"


def relative(document: Document) -> Iterator[Part]:
    """Say how good the image coordinates are, pair by pair."""
    models, unit = document["models"], angle_unit(document)
    if of_models(document) or not len(models):  # single photos have none
        return
    worst = max(models, key=lambda m: m["max_parallax_um"] or 0.0)
    largest = (
        f"{micrometres(worst['max_parallax_um'])} µm at point {worst['max_parallax_point']} of photos "
        f"{worst['left']} and {worst['right']}"
    )
    redundant = counted(sum(column_of(models, "redundancy")), "redundant point")
    yield Facts((("image coordinates", f"{pairs_line(document)}; {redundant}"), ("largest y parallax", largest)))
    pairs = (
        "left+right points_used points_rejected sigma0_um rms_parallax_um max_parallax_um max_parallax_point "
        "condition:2 base:1 base_direction_deg:3 base_inclination_deg:3 strip:4"
    )
    note = (
        "q: y parallax of the points used; condition: of the equations, large where the points lie badly; direction, "
        "inclin.: of the base, in the strip"
    )
    yield keyed(models, pairs, note)
    sigmas = zip(*(models.values(f"sigmas_{key}") for key in ELEMENTS), strict=True)
    most = [unit.text(max((each for each in row if each is not None), default=None), 4) for row in sigmas]
    largest_sigma = Field("", f"{unit.name} ", "largest σ", rank=1), most
    yield keyed(models, "left+right elements_* largest", largest=largest_sigma)


def differences(document: Document) -> str:
    """Say by how much neighbouring models differ; in the worst strip, where there are several."""
    strips = [strip for strip in document["strips"] if strip["discrepancy_up"] is not None]
    if not strips:
        return "no common points"
    worst = max(strips, key=lambda strip: strip["discrepancy_up"])
    size = ", ".join(f"{metres(worst[f'discrepancy_{name}'])} m {name}" for name in DIRECTIONS)
    return f"rms {size}{in_strip(worst['id'], strips)}"


def in_strip(strip: str, strips: Sequence[object]) -> str:
    return f", worst in strip {strip}" if len(strips) > 1 else ""


def junctions(document: Document) -> Iterator[Part]:
    """Say how well neighbouring models agree, and how the scale drifts."""
    if of_models(document) or not len(document["models"]):
        return
    if not len(document["junctions"]):
        yield Words("One model: no scale was transferred.")
    else:
        keys = (
            "photo points_used points_rejected factor:2 spread_ppm discrepancy_along discrepancy_across discrepancy_up "
            "discrepancy_um_along:3 discrepancy_um_across:3 discrepancy_um_up:1 strip:4"
        )
        note = "rms differences of the pass points of two models; spread: of the scale ratio of one pass point"
        yield keyed(document["junctions"], keys, note)
    keys = "id discrepancy_along discrepancy_across discrepancy_up scale_drift_expected_ppm scale_drift_found_ppm"
    note = (
        "rms differences between the models of a strip; change of scale from its first model to the last: one standard "
        "deviation, and what the polynomial takes out"
    )
    yield keyed(document["strips"], keys, note)


def links(document: Document) -> Iterator[Part]:
    """Say how good the model coordinates are, link by link."""
    if not of_models(document):
        return
    summary, rows = document["summary"], document["links"]
    if not len(rows):
        yield Words("One model: nothing was linked.")
        return
    worst = max(rows, key=lambda link: (link["largest"] or 0.0) / (link["limit"] or 1.0))
    largest = (
        f"{fixed(worst['largest'], 2)} at {worst['largest_point']} of models {worst['before']} and {worst['after']}, "
        f"limit {fixed(worst['limit'], 2)}"
    )
    out = sum(map(len, rows.values("points_rejected")))
    total = out + sum(rows.values("points_used")) + sum(rows.values("center"))
    facts = (
        ("model coordinates", f"{sigma0_of(summary)}; redundancy {summary['redundancy']}"),
        ("largest test value", largest),
        ("rejected", f"{out} of {counted(total, 'common point')}, {percent(out, total)}"),
    )
    yield Facts(facts)
    keys = (
        "before+after points_used center points_rejected sigma0 discrepancy_along discrepancy_across discrepancy_up "
        "discrepancy_um_*:2 factor:2 far_end:1 detectable_um:3 strip:4"
    )
    note = (
        "σ0: ratio to what is expected from the standard deviations of both models; along, across, up: rms differences "
        "of the common points; far end: uncertainty of the second model's far end, in standard deviations of a "
        "coordinate"
    )
    yield keyed(rows, keys, note)


def models(document: Document) -> Iterator[Part]:
    """Say what each independent model holds, and its scale."""
    if not of_models(document):
        return
    placed = "has one position in the network" if "bundle" in document else "gets the mean of its positions"
    yield Words(
        "The models are independent: each has its own scale, rotation and origin, and is linked to the model before "
        f"it. A point in several models {placed}. The rotations of the photos are not known from model coordinates."
    )
    counts: Counter[int] = Counter(document["points"].values("models"))
    facts = [("points by models", ", ".join(f"{counts[n]} in {counted(n, 'model')}" for n in sorted(counts)))]
    missing = [photo["id"] for photo in document["photos"] if photo["x"] is None]
    yield Facts((*facts, *([("photos without a centre", ", ".join(missing))] if missing else [])))
    yield keyed(document["models"], "id left+right points_used points_rejected centers model_scale base strip:2")


def absolute(document: Document) -> Iterator[Part]:
    """Give the fit of each strip to its control before any polynomial."""
    if not len(document["absolute"]):
        return
    note = (
        "east, north, up: rms misclosures of the similarity; σ0: their ratio to what is expected from the "
        "control and one model; condition: of the equations, 1 where the control holds all movements alike; "
        f"scale: a unit is {'a millimetre' if of_models(document) else 'the first base'}"
    )
    keys = (
        "strip control_plan control_height sigma0 redundancy condition:1 misclosure_rms_east misclosure_rms_north "
        "misclosure_rms_up scale:3 angles_deg_alpha:2 angles_deg_omega:2 angles_deg_kappa:2"
    )
    yield keyed(document["absolute"], keys, note)
    note = "standard deviation of a point of one model, with which that of a control coordinate is combined for weights"
    yield keyed(document["strips"], "id precision_plan precision_height", note)


def degrees(blocks: Sequence[Document]) -> str:
    """Say which degrees polynomials have, of several strips how many have each."""
    number = Counter((each["degree_plan"], each["degree_height"]) for each in blocks)
    return ", ".join(
        (f"degree {plan} in plan and {height} in height" if plan or height else "none, the similarity alone")
        + (f" in {counted(count, 'strip')}" if len(blocks) > 1 else "")
        for (plan, height), count in sorted(number.items())
    )


def polynomials(document: Document) -> Iterator[Part]:
    """Say of each polynomial what was chosen, why, and how large it is."""
    for block in document.get("polynomials", ()):
        evidence, terms = (document[f"polynomial_{name}"].where(strip=block["strip"]) for name in ("evidence", "terms"))
        by = sorted({each for each in evidence.values("left_out_by") if each})
        note = (
            f"rms: at the control; left out: at control held back, one {' or '.join(by) or 'point'} at a time; "
            "F, p: variance ratio of the gain in all three axes together, and its probability by chance"
        )
        yield Words(_choice(document, block) + _leverage(document, block))
        yield keyed(evidence, "group degree terms:1 redundancy rms left_out f p accepted", note)
        if len(terms):
            yield keyed(terms, "axis term coefficient sigma t effect", OF_COEFFICIENTS)


def _leverage(document: Document, block: Document) -> str:
    """Say which control points hold the polynomial almost alone: their own errors hardly show in it."""
    own = [row for row in document.get("misclosures", ()) if row["strip"] == block["strip"]]
    shares = [
        max(known)
        for row in own
        if (known := [(share, row["id"], axis) for axis in "xyz" if (share := row[f"leverage_{axis}"]) is not None])
    ]
    if not shares:
        return ""
    share, point, axis = max(shares)
    high = sum(each[0] > HIGH_LEVERAGE for each in shares)
    text = f" The largest leverage is {share:.2f}, of control point {point} in {axis.upper()}: its share in the "
    text += "polynomial at its own place"
    if high:
        text += f"; {counted(high, 'point')} above {HIGH_LEVERAGE}, where an error hardly shows in the residual"
    return text + "."


def _choice(document: Document, block: Document) -> str:
    how = "chosen on the evidence below" if block["asked"] == "auto" else f"degree {block['asked']} as requested"
    what = degrees([block]) if block["degree"] else "no polynomial"
    text = (
        f"{what}, {how}. The control lies at {counted(block['stations_plan'], 'station')} in plan and "
        f"{block['stations_height']} in height, from X = {block['reach_from']:.0f} m to {block['reach_to']:.0f} m "
        "along the strip."
    )
    return text[0].upper() + text[1:] if len(document["strips"]) == 1 else f"Strip {block['strip']}: {text}"


OF_COEFFICIENTS = (
    "X along the strip, Y to its left, Z up, metres; effect: at the end of the control's range and the edge of the "
    "strip; t: coefficient over its standard deviation σ; 2 or more is hardly due to chance"
)


def stages(document: Document) -> Iterator[tuple[str, str]]:
    """Say in a line for each stage how strips were formed and brought to the ground."""
    if of_models(document):
        if len(document["links"]):
            yield "links of the models", f"{sigma0_of(document['summary'])}; {counted(len(document['links']), 'link')}"
            yield "between models", differences(document)
    elif len(document["models"]):
        yield "relative orientation", pairs_line(document)
        if junctions := len(document["junctions"]):
            counts, for_rays = document["counts"], " for rays that contradict each other"
            out = (counts["rejected_in_scale_transfer"], ""), (counts["rejected_for_rays"], for_rays)
            gone = "".join(f", {counted(number, 'point')} rejected{why}" for number, why in out if number)
            yield "scale transfer", f"{counted(junctions, 'junction')}{gone}; {differences(document)}"
    if len(document["absolute"]):
        worst = max(document["absolute"], key=lambda row: row["sigma0"] or 0.0)
        size = ", ".join(f"{metres(worst[f'misclosure_rms_{axis}'])} m {axis}" for axis in GROUND_AXES)
        yield "absolute orientation", f"misclosure rms {size}{in_strip(worst['strip'], document['absolute'])}"
