"""The accuracy at check points as the norms ask for it: figures, the class claimed, sentences, what forbids them.

Sources: docs/commands/statement.md.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import ceil, hypot, isfinite

import numpy as np

from photostrip.arrays import Flags, Floats
from photostrip.errors import EXIT_DONE, EXIT_TOLERANCE, Fault, InputError
from photostrip.notes import Document, listed
from photostrip.pipeline.results import Result
from photostrip.result.certificate import EDITED, is_edited
from photostrip.result.given import Differences
from photostrip.result.numbers import mean, record, rms
from photostrip.result.table import Table
from photostrip.result.verdict import FAILED, UNVERIFIED

# Radii and half widths that hold so many of normal errors, in standard deviations of one coordinate
# (FGDC-STD-007.3-1998, appendix 3-A; the 90 % circle: appendix 3-D).
CIRCLE_90, CIRCLE_95 = 2.1460, 2.4477
LINE_90, LINE_95 = 1.6449, 1.9600
RADIAL_95 = 1.7308  # of the radial rms error, where both coordinates are equally good: CIRCLE_95 / sqrt(2)
LEAST_RATIO = 0.6  # of the smaller to the larger rms error in plan: below, the mean of the two is no circle's radius
SHARE_BEYOND = 10  # one point in so many may lie beyond the 90 % error
CENTIMETRES = 100.0


def figures_of(differences: Floats, sigma: Floats) -> Document:
    """Return the figures of check points, metres.

    differences: (n, 3), tested minus given along east, north, up; NaN where a coordinate is not given.
    sigma: (n, 3), standard deviations of the given coordinates.
    """
    plan = np.hypot(differences[:, 0], differences[:, 1])
    parts = {
        "plan": _part(plan, np.hypot(sigma[:, 0], sigma[:, 1])),
        "height": _part(np.abs(differences[:, 2]), sigma[:, 2]),
    }
    level = np.where(np.isnan(plan)[:, None], np.nan, differences[:, :2])
    columns = (*level.T, differences[:, 2])
    axes = {
        axis: {"rmse": rms(column), "mean": mean(column)}
        for axis, column in zip(("east", "north", "up"), columns, strict=True)
    }
    both = hypot(*(part["accuracy"] for part in parts.values()))
    return {
        **parts,
        "axes": axes,
        "space": {"accuracy": both, "class_cm": class_of(both)},
        "circle": _circle(axes["east"]["rmse"], axes["north"]["rmse"]),
        "line": {"le90": LINE_90 * axes["up"]["rmse"], "le95": LINE_95 * axes["up"]["rmse"]},
    }


def _part(size: Floats, sigma: Floats) -> Document:
    """Return what lengths of differences say in plan or in height."""
    known = ~np.isnan(size)
    size = np.sort(size[known])[::-1]
    rmse, survey = rms(size), rms(sigma[known])
    return {
        "count": len(size),
        "rmse": rmse,
        "survey": survey,
        "accuracy": hypot(rmse, survey),
        "class_cm": class_of(hypot(rmse, survey)),
        "mean": mean(size),
        "p90": float(size[len(size) // SHARE_BEYOND]) if len(size) else float("nan"),
        "largest": float(size[0]) if len(size) else float("nan"),
    }


def _circle(east: float, north: float) -> Document:
    """Return the circles that hold 90 and 95 % of the points in plan; NaN where the errors are too unequal for one."""
    larger = max(east, north)
    ratio = min(east, north) / larger if larger > 0 else 1.0 if larger == 0 else float("nan")
    one = 0.5 * (east + north) if ratio >= LEAST_RATIO else float("nan")
    radial = RADIAL_95 * hypot(east, north) if ratio >= LEAST_RATIO else float("nan")
    return {"ratio": ratio, "ce90": CIRCLE_90 * one, "ce95": CIRCLE_95 * one, "radial95": radial}


def class_of(accuracy: float) -> int | None:
    """Return the narrowest class of whole centimetres that an accuracy in metres keeps."""
    return max(1, ceil(round(CENTIMETRES * accuracy, 2))) if isfinite(accuracy) else None


TESTED, REDUCED, NOT_MET, REFUSED = "tested", "reduced", "not met", "refused"
MINIMUM = 30  # check points: ASPRS, edition 2
NSSDA_MINIMUM = 20  # check points: FGDC-STD-007.3-1998, 3.2.2
SURVEY_SHARE = 0.5  # of the class: check points are surveyed at least twice as well as what they test
BIAS_SHARE = 0.25  # of the rms error: a larger mean points to a systematic error
STANDARD = "ASPRS Positional Accuracy Standards for Digital Geospatial Data, Edition 2, Version 2 (2024)"
PARTS = {"plan": "RMSE_H", "height": "RMSE_V"}
# What the standard calls a class and what was tested, section 7.16. Check points on open ground test the NVA.
CLASSES = {"plan": "Horizontal Positional Accuracy Class", "height": "Vertical Accuracy Class"}
FOUND = {
    "plan": "The tested horizontal positional accuracy was found to be",
    "height": "The Non-Vegetated Vertical Accuracy (NVA) was found to be",
}


def stated(block: Document, wanted: Mapping[str, float] | None = None) -> Document:
    """Return a block ``statement`` with its status and its sentences.

    wanted: classes in centimetres that a contract asks for, by ``plan`` and ``height``; without one the narrowest
        class of whole centimetres is claimed that the check points keep.
    """
    claimed = {part: (wanted or {}).get(part, block[part]["class_cm"]) for part in PARTS}
    reasons = Table.of_rows("statement.reasons", [*block["reasons"], *_survey(block, claimed)])
    block = {**block, "reasons": reasons, "remarks": list(_remarks(block))}
    if reasons:
        return block | {"status": REFUSED, "sentences": []}
    missed = [part for part, size in claimed.items() if not _kept(block, part, size)]
    few = any(block[part]["count"] < MINIMUM for part in PARTS)
    status = NOT_MET if missed else REDUCED if few else TESTED
    sentences = [*_sentences(block, claimed), *_in_space(block, status), *_nssda(block)]
    return block | {"status": status, "sentences": sentences}


def _survey(block: Document, claimed: Mapping[str, float | None]) -> Iterator[Document]:
    """Say where the check points are not good enough to test the class."""
    for part, size in claimed.items():
        survey = block[part]["survey"]
        if survey is None or size is None:
            continue
        if CENTIMETRES * survey > SURVEY_SHARE * size:
            text = (
                f"the check points are known to {CENTIMETRES * survey:.1f} cm in {part}: a class of {size:g} cm needs "
                f"{SURVEY_SHARE * size:g} cm or better"
            )
            yield reason("statement-survey", text, "survey them better, or claim a wider class")


def reason(code: str, message: str, fix: str, points: Sequence[str] = ()) -> Document:
    """Say what forbids a statement."""
    return {"code": code, "message": message, "fix": fix, "points": list(points)}


def _kept(block: Document, part: str, size: float | None) -> bool:
    found = block[part]["accuracy"]
    return found is None or size is None or CENTIMETRES * found <= size


def _sentences(block: Document, claimed: Mapping[str, float | None]) -> Iterator[str]:
    """Give the sentences of the standard, in plan and in height."""
    for part, symbol in PARTS.items():
        count, found, size = block[part]["count"], block[part]["accuracy"], claimed[part]
        if found is None or size is None:
            yield f"Nothing is stated in {part}: no check point tests it."
            continue
        tested, claim = f"{symbol} = {CENTIMETRES * found:.1f} cm", f"a {size:g} cm {symbol} {CLASSES[part]}"
        if not _kept(block, part, size):
            yield f"The result does not meet {claim}: at {count} check points {tested} was found."
        elif count < MINIMUM:
            yield (
                f"The test does not meet the minimum of {MINIMUM} check points in {part}. This data set was tested as "
                f"required by {STANDARD}. Although the Standards call for a minimum of thirty (30) checkpoints, this "
                f"test was performed using ONLY {count} checkpoints. This data set was produced to meet {claim}. "
                f"{FOUND[part]} {tested} using the reduced number of checkpoints."
            )
        else:
            yield f"This data set was tested to meet {STANDARD} for {claim}. {FOUND[part]} {tested}."


def _in_space(block: Document, status: str) -> Iterator[str]:
    """Give the sentence on plan and height together, where both were tested."""
    found = block["space"]["accuracy"]
    if status != TESTED or found is None:
        return
    yield (
        f"This data set was tested to meet {STANDARD} for a {block['space']['class_cm']} cm RMSE_3D Three-Dimensional "
        "Positional Accuracy Class. The tested three-dimensional accuracy was found to be RMSE_3D = "
        f"{CENTIMETRES * found:.1f} cm within the NVA tested area."
    )


def _nssda(block: Document) -> Iterator[str]:
    """Give the sentences of the NSSDA (3.2.3), which does not count the error of the survey."""
    plan, up = block["circle"]["radial95"], block["axes"]["up"]["rmse"]
    if block["plan"]["count"] >= NSSDA_MINIMUM and plan is not None:
        yield f"NSSDA: Tested {plan:.3f} meters horizontal accuracy at 95% confidence level."
    if block["height"]["count"] >= NSSDA_MINIMUM and up is not None:
        yield f"NSSDA: Tested {LINE_95 * up:.3f} meters vertical accuracy at 95% confidence level."


def _remarks(block: Document) -> Iterator[str]:
    """Say what whoever signs should know."""
    for axis, each in block["axes"].items():
        mean, rmse = each["mean"], each["rmse"]
        if mean is not None and rmse and abs(mean) > BIAS_SHARE * rmse:
            yield (
                f"the mean difference {'in height' if axis == 'up' else f'to the {axis}'} is {mean:+.3f} m, "
                f"{100 * abs(mean) / rmse:.0f} % of the rms error: more than {100 * BIAS_SHARE:.0f} % may be systematic"
            )
    if block["plan"]["count"] and block["circle"]["radial95"] is None:
        yield (
            f"the rms errors to the east and to the north are as {block['circle']['ratio']:.2f} to 1: no circle is "
            "stated for errors that unequal"
        )
    if block["not_measured"]:
        yield f"{block['not_measured']} further check points have no coordinates in the result"


def statement_of(result: Result, found: Differences, document: Document) -> Document:
    """Return the block ``statement`` of a document that has its verdict."""
    control = result.inputs.control
    measured = control.check & (result.control_rows >= 0)
    figures = figures_of(found.parts[measured], _sigma(result, measured))
    ids = [name for name, yes in zip(control.ids, control.check.tolist(), strict=True) if yes]
    given = zip(*map(document["control"].values, ("id", "role", "stands_out")), strict=True)
    odd = [name for name, role, parts in given if role == "check" and parts]
    block = {
        "status": "",
        "not_measured": len(ids) - int(measured.sum()),
        "reasons": Table.of_rows("statement.reasons", _reasons(document, figures, ids, odd)),
        **figures,
        "sentences": [],
        "remarks": [],
    }
    return stated(record("statement", block))


def _sigma(result: Result, rows: Flags) -> Floats:
    """Return the standard deviations of given points to the east, to the north and up; shape (n, 3)."""
    control = result.inputs.control
    sigma = control.sigma.copy()
    for number, frame in enumerate(result.frames):
        at = np.flatnonzero(rows & (control.frame == number))
        if frame.kind == "geocentric" and len(at):
            level = frame.level_axes_at(result.points.cartesian[result.control_rows[at]])
            sigma[at] = np.sqrt(np.einsum("nka,nk->na", level**2, control.sigma[at] ** 2))
    found: Floats = sigma[rows]
    return found


def _reasons(document: Document, figures: Document, ids: Sequence[str], odd: Sequence[str]) -> Iterator[Document]:
    """Say what forbids a statement, whatever class is asked for."""
    if not figures["plan"]["count"] and not figures["height"]["count"]:
        text = "there is no check point" if not ids else f"none of the {len(ids)} check points is measured"
        yield reason("statement-no-check-points", text, "measure points that took no part and give them `role: check`")
    if document["frame"]["kind"] == "local":
        text = "the frame is local: accuracy cannot be stated in a reference system that nobody else has"
        yield reason("statement-frame", text, "give the control with its coordinate reference system (`crs`)")
    if document["status"] in {FAILED, UNVERIFIED}:
        text = f"the verdict on the result is {document['status'].upper()}"
        yield reason("statement-verdict", text, "settle what the report names first")
    if odd:
        text = f"{len(odd)} of {len(ids)} check points {'does' if len(odd) == 1 else 'do'} not go with the others"
        yield reason("statement-odd-points", text, "find out what is wrong there; do not leave it out", odd)
    checks = set(ids)
    named = {point for each in document["findings"] if not each["accepted"] for point in each["points"]}
    if blamed := [name for name in ids if name in named & checks and name not in odd]:
        verb = "is" if len(blamed) == 1 else "are"
        text = f"{len(blamed)} of {len(ids)} check points {verb} named by a finding that nobody has accepted"
        yield reason("statement-odd-points", text, "settle the finding, or accept it in the project", blamed)


SCHEMA = 1
# Measures of ISO 19157:2013, annex D: identifier, name, alias, where it stands in the block `statement`.
ISO_MEASURES = (
    (128, "bias of positions", "", "axes.east.mean", "east"),
    (128, "bias of positions", "", "axes.north.mean", "north"),
    (128, "bias of positions", "", "axes.up.mean", "height"),
    (28, "mean value of positional uncertainties", "", "plan.mean", "plan"),
    (28, "mean value of positional uncertainties", "", "height.mean", "height"),
    (47, "root mean square error of planimetry", "RMSEP", "plan.rmse", "plan"),
    (44, "circular error at 90 % significance level", "CE90", "circle.ce90", "plan"),
    (45, "circular error at 95 % significance level", "CE95", "circle.ce95", "plan"),
    (39, "root mean square error", "RMS", "height.rmse", "height"),
    (35, "linear map accuracy at 90 % significance level", "LE90(r)", "line.le90", "height"),
    (36, "linear map accuracy at 95 % significance level", "LE95(r)", "line.le95", "height"),
)


def statement_document(
    document: Document,
    file: str,
    wanted: Mapping[str, float] | None = None,
) -> Document:
    """Return the statement on a result.

    wanted: classes in centimetres that a contract asks for, by ``plan`` and ``height``.
    Raises InputError with every reason why nothing can be stated.
    """
    fix = "run the project again with this version of photostrip"
    if "statement" not in document:
        raise InputError(Fault("holds nothing on its check points", "result-incomplete", file, fix=fix))
    if not document.get("certificate"):
        raise InputError(Fault("has no certificate", "no-certificate", file, fix=fix))
    if is_edited(document):
        raise InputError(Fault(f"no accuracy can be stated: {EDITED}", "result-edited", file, fix=fix))
    # reasons that depend on the class are found anew for the class that is claimed
    reasons = [each for each in document["statement"]["reasons"] if each["code"] != "statement-survey"]
    block = stated({**document["statement"], "reasons": reasons}, wanted)
    if block["status"] == REFUSED:
        raise InputError(_fault(each, file) for each in block["reasons"])
    return {
        "photostrip_statement": SCHEMA,
        "version": document["version"],
        "result": file,
        "result_sha256": document["certificate"]["result_sha256"],
        "name": document["name"],
        "verdict": document["status"],
        "adjustment": document["adjustment"],
        "frame": document["frame"]["description"],
        "standard": STANDARD,
        **{key: block[key] for key in ("status", "sentences", "remarks", *FIGURES)},
        "asked_cm": dict(wanted or {}),
        "iso_19157": [_measure(block, *each) for each in ISO_MEASURES],
        "axes_of_frame": document["frame"]["axes"],
        "check_points": [
            {key: row[key] for key in ("id", "dx", "dy", "dz", "plan", "height")}
            for row in document["control"]
            if row["role"] == "check" and row["measured"]
        ],
    }


FIGURES = ("plan", "height", "space", "axes", "circle", "line", "not_measured")


def exit_code(status: str) -> int:
    """Exit code of a statement: 0 when the class was tested as the standard asks, otherwise 1."""
    return EXIT_DONE if status == TESTED else EXIT_TOLERANCE


def _fault(reason: Document, file: str) -> Fault:
    points = tuple(reason["points"])
    message = f"no accuracy can be stated: {reason['message']}" + (f": {listed(points)}" if points else "")
    return Fault(message, reason["code"], file, fix=reason["fix"], points=points)


def _measure(block: Document, number: int, name: str, alias: str, path: str, part: str) -> Document:
    value = block
    for key in path.split("."):
        value = value[key]
    return {"id": number, "name": name, "alias": alias, "part": part, "value_m": value}
