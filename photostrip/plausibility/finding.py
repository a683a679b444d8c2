"""What the gate can find: one code for each kind of mistake, and a finding with its evidence."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from photostrip.notes import Finding

Evidence = dict[str, float | int | str]  # the numbers behind a finding; names end with the unit
ERROR = "error"
WARNING = "warning"


class Kind(NamedTuple):
    title: str  # what it is, in a few words
    severity: str  # ``"error"``: a result made from such data is wrong as a whole; ``"warning"``: some of it may be


KINDS: dict[str, Kind] = {
    "P101": Kind("image coordinates in another unit, or from another origin", ERROR),
    "P102": Kind("one photo in another unit than its neighbours", ERROR),
    "P103": Kind("image coordinates mirrored", ERROR),
    "P104": Kind("one photo mirrored against its neighbours", ERROR),
    "P105": Kind("principal distance off by a factor", ERROR),
    "P106": Kind("fiducial marks measured in another unit", WARNING),
    "P107": Kind("another principal distance fits better", WARNING),
    "P108": Kind("standard deviations in another unit", WARNING),
    "P109": Kind("image coordinates of one photo shifted or enlarged", WARNING),
    "P110": Kind("lens distortion that is not stated", WARNING),
    "P111": Kind("another principal point fits better", WARNING),
    "P112": Kind("images longer or shorter one way than the other", WARNING),
    "P201": Kind("photos out of flight order", ERROR),
    "P202": Kind("neighbouring photos that do not overlap", ERROR),
    "P203": Kind("the same photo twice", ERROR),
    "P204": Kind("perspective centres below the ground", ERROR),
    "P205": Kind("perspective centre at another height", WARNING),
    "P206": Kind("base of another length", WARNING),
    "P207": Kind("base in another direction", WARNING),
    "P208": Kind("camera positions that share an error", WARNING),
    "P301": Kind("one id for two points", WARNING),
    "P302": Kind("two ids for one point", WARNING),
    "P303": Kind("point ids of a photo that do not go with its neighbours", ERROR),
    "P304": Kind("a point at two places in two strips", WARNING),
    "P401": Kind("control axes exchanged or left-handed", ERROR),
    "P402": Kind("control outside its coordinate reference system", ERROR),
    "P403": Kind("control in feet", ERROR),
    "P404": Kind("heights of two kinds", ERROR),
    "P405": Kind("plan and height in different units", ERROR),
    "P406": Kind("slip of a digit", WARNING),
    "P407": Kind("control lists in different frames", ERROR),
    "P408": Kind("given points exchanged", WARNING),
    "P409": Kind("control of other points", ERROR),
    "P410": Kind("the same coordinates for several points", WARNING),
    "P411": Kind("check points that share a shift", WARNING),
    "P501": Kind("control at one end of the strip", WARNING),
    "P502": Kind("control on one line", WARNING),
    "P503": Kind("points far beyond the control", WARNING),
    "P601": Kind("start angles in another unit", ERROR),
    "P602": Kind("start angles in another system", ERROR),
}
"""Every kind of mistake by its code. Codes are never given to another mistake, and never reused."""


def found(
    code: str,
    message: str,
    fix: str,
    evidence: Mapping[str, float | int | str] | None = None,
    *,
    photos: Iterable[str] = (),
    points: Iterable[str] = (),
    strips: Iterable[str] = (),
    key: str = "",
) -> Finding:
    """Make a finding of a known kind, with its title and severity."""
    kind = KINDS[code]
    return Finding(
        code=code,
        title=kind.title,
        severity=kind.severity,
        message=message,
        fix=fix,
        evidence=dict(evidence or {}),
        photos=tuple(photos),
        points=tuple(points),
        strips=tuple(strips),
        key=key,
    )


def accepted(findings: Iterable[Finding], entries: Sequence[str]) -> tuple[Finding, ...]:
    """Mark what the user has accepted, and bring all into the order of the report: every finding once, by code.

    findings: what was found; the same finding may come from two places.
    entries: codes, or ``code/id`` for one photo, point or strip.
    """
    codes = {entry for entry in entries if "/" not in entry}
    single = {(code, name) for code, _, name in (entry.partition("/") for entry in entries) if name}
    once: dict[tuple[str, frozenset[str]], Finding] = {}
    for each in findings:
        is_accepted = each.code in codes or any((each.code, name) in single for name in each.names)
        once.setdefault((each.code, each.names), replace(each, accepted=is_accepted))
    return tuple(sorted(once.values(), key=lambda each: each.code))
