"""The verdict on a result: good, not verified, worth a look, or failed; and what to look at, worst first.

It is made from the finished document, so that a saved result has the same verdict; its limits stand first.
"""

from __future__ import annotations

from itertools import groupby
from operator import itemgetter
from typing import TYPE_CHECKING

from photostrip.errors import EXIT_DONE, EXIT_TOLERANCE
from photostrip.notes import before
from photostrip.result.verification import verification_of
from photostrip.statistics import chi2_quantile

if TYPE_CHECKING:
    from collections.abc import Iterator

    from photostrip.result.numbers import Document

VERDICTS = GOOD, UNVERIFIED, LOOK, FAILED = "good", "unverified", "look", "failed"

SIGMA0_RATIO = 1.5  # of sigma0 to the stated standard deviation
PAIR_RATIO = 1.5  # of a pair's sigma0 to that of the project, when chance does not explain it
PAIR_LEVEL = 0.01  # probability that any sound pair of the project is named
PHOTO_RATIO = 3.0  # of a photo's image residuals to those of the project
# Rms of the control's residuals in units of their standard deviation; a long strip bends by that much.
POOR_CONTROL = 5.0
ODD_POINT = 4.0  # difference at a given point against the rms of the others
ODD_RATIO = 3.0  # and against its standard deviation: a few good points can be better than they should be
FEW = 4  # given points below which none can stand out
MANY_REJECTED = 0.05  # share of the points in pairs
NAMED = 3  # pairs, photos, findings or notes of one kind that are named


def verdict_of(document: Document) -> Document:
    """Return status, accuracy in a sentence and what to look at, from a document that has no verdict yet."""
    failed = [*_tolerances(document), *_findings(document, "error")]
    look_at = [
        *failed,
        *_findings(document, "warning"),
        *_control(document),
        *_odd(document, "control"),
        *_odd(document, "check"),
        *_sigma0(document),
        *_pairs(document),
        *_photos(document),
        *_rejected(document),
        *_notes(document),
    ]
    verification = verification_of(document)
    status = FAILED if failed else LOOK if look_at else GOOD if verification["verified"] else UNVERIFIED
    return {"status": status, "accuracy": accuracy(document["summary"]), **verification, "look_at": look_at}


def exit_code(status: str, *, strict: bool) -> int:
    """Exit code of a result: 1 when a tolerance is not kept; with `strict` of every verdict but good."""
    return EXIT_TOLERANCE if status == FAILED or (strict and status != GOOD) else EXIT_DONE


def accuracy(summary: Document) -> str:
    """Say in one sentence how good the points are, and from what that is known."""
    scale = "model" if summary.get("model_scale") else "photo"
    for role, words in (("check", "check points, which took no part"), ("control", "control points")):
        plan, height = summary[role]["plan"], summary[role]["height"]
        if plan["count"] or height["count"]:
            parts = [
                f"{part['rms']:.3f} m in {name} ({part['rms_um']:.1f} µm at {scale} scale, {part['count']} points)"
                for name, part in (("plan", plan), ("height", height))
                if part["count"]
            ]
            return f"rms {' and '.join(parts)} at {words}"
    return "no given point was measured"


def _tolerances(document: Document) -> Iterator[str]:
    for each in document["tolerances"]:
        unit = each["unit"].replace("um", "µm")
        if each["value"] is None:
            yield f"{each['name']} cannot be tested against {each['limit']:g} {unit}: there is no such point"
        elif not each["passed"]:
            value = f"{each['value']:.{2 if each['unit'] == 'um' else 4}f}"
            yield f"{each['name']} is {value} {unit}, allowed are {each['limit']:g} {unit}"


def _control(document: Document) -> Iterator[str]:
    ratio = document["summary"]["control"]["normalised"]
    if ratio is not None and ratio > POOR_CONTROL:
        yield (
            f"the control points fit {ratio:.1f} times worse than their standard deviations and the precision of one "
            "model let expect: control that is not as good as stated, or a deformation of the strip that is left"
        )


def _without_rejected(row: Document) -> Document:
    """Return a control point without what was rejected, which has a note of its own."""
    out = row.get("rejected", "")
    plan = None if "x" in out or "y" in out else row["plan"]
    return row | {"plan": plan, "height": None if "z" in out else row["height"]}


def _odd(document: Document, role: str) -> Iterator[str]:
    """Name the point that does not go with the others, in plan and in height."""
    rows = [_without_rejected(row) for row in document["control"] if row["role"] == role]
    for name in ("plan", "height"):
        known = sorted((row for row in rows if row[name] is not None), key=lambda row: abs(row[name]), reverse=True)
        if len(known) < FEW:
            continue
        worst, rest = known[0], known[1:]
        others = (sum(row[name] ** 2 for row in rest) / len(rest)) ** 0.5
        if abs(worst[name]) > ODD_POINT * others and (worst["normalised"] or 0.0) > ODD_RATIO:
            yield (
                f"{role} point {worst['id']} stands out: {abs(worst[name]):.3f} m in {name}, "
                f"the others have an rms of {others:.3f} m"
            )


def _sigma0(document: Document) -> Iterator[str]:
    summary = document["summary"]
    found, given = summary["sigma0_um"], summary["sigma_given_um"]
    if found is None or not given or found <= SIGMA0_RATIO * given:
        return
    if (found / given) ** 2 > chi2_quantile(1 - PAIR_LEVEL, summary["redundancy"]) / summary["redundancy"]:
        kind = "model" if summary.get("model_scale") else "image"
        yield (
            f"the {kind} coordinates are {found / given:.1f} times worse than stated: sigma0 {found:.1f} µm, "
            f"stated {given:.1f} µm"
        )


def _pairs(document: Document) -> Iterator[str]:
    whole, models = document["summary"]["sigma0_um"], document["models"]
    odd = [model for model in models if _stands_out(model, whole, len(models))]
    odd.sort(key=itemgetter("sigma0_um"), reverse=True)
    for model in odd[:NAMED]:
        yield (
            f"photos {model['left']} and {model['right']}: sigma0 {model['sigma0_um']:.1f} µm, that of the project is "
            f"{whole:.1f} µm; the largest y parallax is at point {model['max_parallax_point']}"
        )
    yield from _more(len(odd), "pairs")


def _stands_out(model: Document, whole: float, models: int) -> bool:
    """Whether a pair is worse than the project by more than chance."""
    found = model["sigma0_um"]
    if found is None or found <= PAIR_RATIO * whole:
        return False
    limit = chi2_quantile(1 - PAIR_LEVEL / models, model["redundancy"]) / model["redundancy"]
    return bool((found / whole) ** 2 > limit)


def _more(number: int, what: str) -> Iterator[str]:
    if number > NAMED:
        yield f"{number - NAMED} more {what} like these"


def _photos(document: Document) -> Iterator[str]:
    whole = document["summary"]["image_rms_um"]
    odd = [photo for photo in document["photos"] if whole and (photo["image_rms_um"] or 0) > PHOTO_RATIO * whole]
    odd.sort(key=itemgetter("image_rms_um"), reverse=True)
    for photo in odd[:NAMED]:
        yield (
            f"photo {photo['id']}: image residuals of {photo['image_rms_um']:.1f} µm under the final orientation, "
            f"{whole:.1f} µm in the whole project"
        )
    yield from _more(len(odd), "photos")


def _rejected(document: Document) -> Iterator[str]:
    used = sum(model["points_used"] for model in document["models"])
    gone = sum(model["points_rejected"] for model in document["models"])
    if gone > MANY_REJECTED * (used + gone):
        yield f"{gone} of {used + gone} points in pairs were rejected, {100 * gone / (used + gone):.0f} %"


def _findings(document: Document, severity: str) -> Iterator[str]:
    """Name what the data say against themselves and nobody has accepted."""
    open_ones = [each for each in document["findings"] if each["severity"] == severity and not each["accepted"]]
    for _, group in groupby(open_ones, key=itemgetter("code")):
        kind = list(group)
        yield from (f"{each['code']} {each['message']}" for each in kind[:NAMED])
        yield from _more(len(kind), "findings")


def _notes(document: Document) -> Iterator[str]:
    """Warnings, the first of each kind."""
    warnings = sorted((n for n in document["notes"] if n["severity"] == "warning"), key=itemgetter("code"))
    for _, group in groupby(warnings, key=itemgetter("code")):
        kind = list(group)
        yield from (before(n["file"], n["line"], n["column"]) + n["message"] for n in kind[:NAMED])
        yield from _more(len(kind), "notes")
