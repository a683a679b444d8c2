"""The document of ``photostrip statement``: what is stated, the numbers that went in, the measures of the norms."""

from __future__ import annotations

from collections.abc import Mapping

from photostrip.errors import EXIT_DONE, EXIT_TOLERANCE, Fault, InputError
from photostrip.notes import Document, listed
from photostrip.result.statement.edited import EDITED, is_edited
from photostrip.result.statement.stating import REFUSED, STANDARD, TESTED, stated

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
