"""How a project of a batch can end: its status, its exit code, and its line in the summary."""

from __future__ import annotations

from photostrip.errors import EXIT_GEOMETRY, EXIT_INPUT, EXIT_INTERNAL, Fault, GeometryError, InputError
from photostrip.notes import Document
from photostrip.report.page.messages import findings_of, line_of
from photostrip.result.verdict import FAILED, GOOD, LOOK, UNVERIFIED, exit_code, headline_rms, seen_at

# How a project can end beside the verdicts of a result (good, unverified, look, failed), and the exit code of each.
FAULTY, UNWRITTEN, WEAK = "faulty", "unwritten", "weak"
BROKEN, TIMEOUT, MEMORY, NOT_RUN = "crashed", "timeout", "memory", "not run"
EXIT_CODES = {
    **{status: exit_code(status, strict=False) for status in (GOOD, UNVERIFIED, LOOK, FAILED)},
    FAULTY: EXIT_INPUT,
    UNWRITTEN: EXIT_INPUT,
    WEAK: EXIT_GEOMETRY,
    BROKEN: EXIT_INTERNAL,
    TIMEOUT: EXIT_INTERNAL,
    MEMORY: EXIT_INTERNAL,
    NOT_RUN: 0,
}


def outcome_of(document: Document, findings: list[Document]) -> Document:
    """Return the line of the summary for a result with its findings.

    The rms are those at check points, at control left out in turn, or at control points; ``rms_at`` says which. Points
    that stand out are left out. ``messages`` are
    sentences, worst first.
    """
    summary, status = document["summary"], document["status"]
    role = seen_at(document)
    return {
        "status": status,
        "exit_code": EXIT_CODES[status],
        "adjustment": document["adjustment"],
        "strips": len(document["strips"]),
        "photos": len(document["photos"]),
        "points": len(document["points"]),
        "rejected": len(document["rejected"]),
        "sigma0_um": summary["sigma0_um"],
        "rms_at": "left-out" if role == "cross_validation" else role,
        "rms_plan_m": headline_rms(document, role, "plan")["rms"],
        "rms_height_m": headline_rms(document, role, "height")["rms"],
        "messages": [document["verdict"]["verification"]] if status == UNVERIFIED else document["verdict"]["look_at"],
        "findings": [each for each in findings if each["severity"] == "error"],
    }


def failure(status: str, error: InputError | GeometryError | Fault) -> Document:
    """Return the line of the summary for a project without a result: the keys of a result, without numbers."""
    findings = findings_of(InputError(error) if isinstance(error, Fault) else error)
    nothing = dict.fromkeys(
        ("strips", "photos", "points", "rejected", "sigma0_um", "rms_at", "rms_plan_m", "rms_height_m")
    )
    return {
        "status": status,
        "exit_code": EXIT_CODES[status],
        "adjustment": None,
        **nothing,
        "messages": [line_of(each).removeprefix("error: ") for each in findings],
        "findings": findings,
        "body": None,
        "track": None,
    }


def not_run() -> Document:
    """Return the line of the summary for a project that was not reached."""
    return failure(NOT_RUN, InputError(()))


def out_of_memory() -> Document:
    """Return the line of the summary for a project that needs more memory than it may have."""
    fix = "give more with --memory, with fewer processes (-j) if need be"
    return failure(MEMORY, Fault("needs more memory than a worker may have", "memory", fix=fix))
