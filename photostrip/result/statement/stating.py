"""From figures to words: the class that is claimed, whether the check points carry it, the sentences of the norms."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from photostrip.notes import Document
from photostrip.result.statement.figures import CENTIMETRES, LINE_95
from photostrip.result.table import Table

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
