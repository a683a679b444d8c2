"""What the gate can find: one code for each kind of mistake, and a finding with its evidence."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from photostrip.notes import Finding

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

ERROR = "error"
WARNING = "warning"


class Kind(NamedTuple):
    """A kind of mistake.

    Parameters
    ----------
    title : str
        What it is, in a few words.
    severity : str
        ``"error"``: a result made from such data is wrong as a whole; ``"warning"``: some of it may be.
    """

    title: str
    severity: str


KINDS: dict[str, Kind] = {
    "P101": Kind("image coordinates in another unit", ERROR),
    "P102": Kind("one photo in another unit than its neighbours", ERROR),
    "P104": Kind("one photo mirrored against its neighbours", ERROR),
    "P105": Kind("principal distance off by a factor", ERROR),
    "P201": Kind("photos out of flight order", ERROR),
    "P202": Kind("neighbouring photos that do not overlap", ERROR),
    "P203": Kind("the same photo twice", ERROR),
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
    """Make a finding of a known kind.

    Parameters
    ----------
    code : str
        Its kind, a key of :data:`KINDS`.
    message, fix, evidence, photos, points, strips, key
        As for :class:`photostrip.notes.Finding`.

    Returns
    -------
    Finding
        With the title and the severity of its kind.
    """
    kind = KINDS[code]
    names = (tuple(photos), tuple(points), tuple(strips))
    return Finding(code, kind.title, kind.severity, message, fix, dict(evidence or {}), *names, key)


def accepted(findings: Iterable[Finding], entries: Sequence[str]) -> tuple[Finding, ...]:
    """Mark what the user has accepted, and bring all into the order in which they are told.

    Parameters
    ----------
    findings : iterable of Finding
        What was found; the same finding may come from two places.
    entries : sequence of str
        Codes, or ``code/id`` for one photo, point or strip.

    Returns
    -------
    tuple of Finding
        Every finding once, by code, in the order found.
    """
    codes = {entry for entry in entries if "/" not in entry}
    single = {(code, name) for code, _, name in (entry.partition("/") for entry in entries) if name}
    told: dict[tuple[str, frozenset[str]], Finding] = {}
    for each in findings:
        taken = each.code in codes or any((each.code, name) in single for name in each.names)
        told.setdefault((each.code, each.names), replace(each, accepted=taken))
    return tuple(sorted(told.values(), key=lambda each: each.code))
