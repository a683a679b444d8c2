"""What the gate can find: one code for each kind of mistake, and a finding with its evidence.

The causes that compete in an adjustment: how each shows, what tells of it, what cures it, an example.

Single observations first, then what many of them share, in the order of ``network.hypotheses``. The cures are what
findings say; docs/causes.md shows the table.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from photostrip.network.hypotheses import (
    DECENTRED,
    DISTANCE,
    DRIFT,
    EDGE,
    FILM,
    LENS,
    LIST,
    OFFSET,
    ORDER,
    POINT,
    SCALE,
    SHIFT,
    SIGMAS,
)
from photostrip.network.reliability import CONTROL, IMAGE, POSITION
from photostrip.notes import Finding

Evidence = dict[str, float | int | str]  # the numbers behind a finding; names end with the unit
ERROR = "error"
WARNING = "warning"


class Kind(NamedTuple):
    title: str  # what it is, in a few words
    shows: str  # how it shows
    severity: str  # ``"error"``: a result made from such data is wrong as a whole; ``"warning"``: some of it may be


KINDS: dict[str, Kind] = {
    "P101": Kind("image coordinates in another unit, or from another origin",
        "fewer than 98 % of them lie between 0.12 and 1.2 of half the format", ERROR),
    "P102": Kind("one photo in another unit than its neighbours",
        "its common points lie four times farther apart, or more", ERROR),
    "P103": Kind("image coordinates mirrored", "the strip fits its control only so, and the control is right", ERROR),
    "P104": Kind("one photo mirrored against its neighbours", "it fits its neighbours only as a mirror image", ERROR),
    "P105": Kind("principal distance off by a factor", "format, or heights of the control, ask for another one", ERROR),
    "P106": Kind("fiducial marks measured in another unit", "points come out right, their standard deviations do not",
        WARNING),
    "P107": Kind("another principal distance fits better", "all control asks for it, by less than 3 % (more: P105)",
        WARNING),
    "P108": Kind("standard deviations in another unit", "image or check coordinates are 30 times better than stated",
        WARNING),
    "P109": Kind("image coordinates of one photo shifted or enlarged",
        "without that its points agree with the photos beside it", WARNING),
    "P110": Kind("lens distortion that is not stated", "photos and what is given agree only with it", WARNING),
    "P111": Kind("principal point elsewhere",
        "the same, or several photos ask for shifts of their own; in pixels: a tenth of the format from the middle",
        WARNING),
    "P112": Kind("images longer or shorter one way than the other", "the same: film, scanner, pixels", WARNING),
    "P201": Kind("photos out of flight order", "common points put them into another order, which is named", ERROR),
    "P202": Kind("neighbouring photos that do not overlap", "two that follow each other share fewer than two points",
        ERROR),
    "P203": Kind("the same photo twice", "two photos stand at one place, within 3 % of the usual base", ERROR),
    "P204": Kind("perspective centres below the ground", "below its points, or below the control", ERROR),
    "P205": Kind("perspective centre at another height",
        "20 % of the flying height off the line of its neighbours; P205 to P207 only beyond the scatter of the flight",
        WARNING),
    "P206": Kind("base of another length", "1.75 times or half as long as those beside it", WARNING),
    "P207": Kind("base in another direction", "it turns by 30 degrees", WARNING),
    "P208": Kind("camera positions that share an error", "offset, drift, or positions of other photos", WARNING),
    "P209": Kind("standard deviations of camera positions too small",
        "most positions lie farther off than these allow, and nothing else explains it", WARNING),
    "P301": Kind("one id for two points", "its rays, or two strips, put it at two places", WARNING),
    "P302": Kind("two ids for one point", "both lie at one place, and no photo shows them as two", WARNING),
    "P303": Kind("point ids of a photo that do not go with its neighbours",
        "no plane similarity brings them together; a row moved is named", ERROR),
    "P304": Kind("a point at two places in two strips",
        "one strip has two rays only: two points, or an error along the base", WARNING),
    "P401": Kind("axes exchanged, or photos mirrored",
        "the strip fits only so, or the area of the crs, or camera positions, only with exchanged axes", ERROR),
    "P402": Kind("another coordinate reference system",
        "far outside its area, or camera positions away from the control: a digit, a zone, a hemisphere", ERROR),
    "P403": Kind("feet and metres", "in feet it falls into the area, or lists or camera positions differ by 3.28",
        ERROR),
    "P404": Kind("heights of two kinds", "two lists, or full and height points, differ by one height", ERROR),
    "P405": Kind("plan and height in different units",
        "3.28, 0.305, 100, 1000 or 0.001 times the heights of the strip, or of the photos", ERROR),
    "P406": Kind("slip of a digit", "with a digit changed, added, left out or exchanged it fits", WARNING),
    "P407": Kind("control lists in different frames", "one list lies beside the other by one shift", ERROR),
    "P408": Kind("given points exchanged", "two points fit with each other's coordinates", WARNING),
    "P409": Kind("control of other points",
        "half of it is off by a fifth of its spread, however it is read; a row moved is named", ERROR),
    "P410": Kind("the same coordinates for several points", "photos show the points apart, or relief", WARNING),
    "P411": Kind("check points that share a shift", "beside the result by one shift: datum, antenna, kind of height",
        WARNING),
    "P501": Kind("control at one end of the strip", "within 40 % of the length", WARNING),
    "P502": Kind("control on one line", "within 8 % of half the breadth: heights at the edges are twelve times worse",
        WARNING),
    "P503": Kind("points far beyond the control", "by half of what the control spans, and a base", WARNING),
    "P601": Kind("start angles in another unit", "they fit in gons, degrees or radians only", ERROR),
    "P602": Kind("start angles in another system",
        "they fit in another order or sense, turned about the vertical or by 90 degrees, or inverted", ERROR),
}  # fmt: skip
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


class Cause(NamedTuple):
    title: str  # what is wrong
    shows: str  # how it would show in the residuals
    told: tuple[str, ...]  # findings that name it, or notes, or the list of the result
    cure: str
    example: str


_POSITIONS = "look at datum, kind of height and lever arm of the positions, and at the crs of the control"
_LENS = "look at the lens in the calibration certificate of the camera"
CAUSES: dict[str, Cause] = {
    IMAGE: Cause("ray", "the other rays of the point agree without it", ("rejected",), "measure the point there again",
        "a point set on a shadow that moved"),
    CONTROL: Cause("control coordinate or point", "photos and the other control contradict it",
        ("control-rejected", "P406", "P408"), "look at the field sheet, and at the spot",
        "height 331.20 written as 313.20"),
    POSITION: Cause("camera position or attitude", "its photo lies elsewhere, or is turned, by all its rays",
        ("position-rejected",), "look at the log of the receiver at that exposure",
        "one exposure without fixed ambiguities"),
    OFFSET: Cause("offset of camera positions", "those of a strip, or of the block, lie beside by one shift", ("P208",),
        _POSITIONS, "heights above the ellipsoid, control above the geoid"),
    DRIFT: Cause("drift of camera positions", "the shift grows along the strip", ("P208",), _POSITIONS,
        "a receiver without its base station"),
    ORDER: Cause("order of camera positions", "without them, photos lie where other rows say", ("P208",),
        "put the names of the photos and their positions together anew", "a test exposure counted as the first photo"),
    SIGMAS: Cause("standard deviations of camera positions", "most lie farther off than stated, each its own way",
        ("P209",),
        "were ambiguities fixed at the exposures, and is this the accuracy of positions in metres, at one sigma?",
        "3 cm stated for positions of a receiver without corrections"),
    LIST: Cause("control list", "all its points lie beside all else by one shift", ("P404", "P407"),
        "compare the crs, datum and kind of height of both lists", "old benchmarks 0.6 m below points from GNSS"),
    LENS: Cause("lens distortion", "residuals outwards or inwards, by the third power of the radius", ("P110",), _LENS,
        "a drone camera, given as free of distortion"),
    EDGE: Cause("lens distortion at the edge", "the same, by the third and fifth power", ("P110",), _LENS,
        "k2 left out"),
    DECENTRED: Cause("decentred lens", "residuals by the square of the radius, to one side", ("P110",), _LENS,
        "p1 and p2 exchanged"),
    FILM: Cause("film", "images are longer along one axis, or sheared", ("P112",),
        "where film shrank or was scanned, measure the fiducial marks; of a digital one, look at the sides of a pixel",
        "film that dried 0.2 % shorter along x"),
    POINT: Cause("principal point", "all photos of a camera ask for another one", ("P111",),
        "look at the principal point and the origin of the image coordinates", "its sign exchanged"),
    DISTANCE: Cause("principal distance", "heights, or camera positions, are stretched against the plan",
        ("P107", "P105"), "take it from the certificate", "a zoom lens at 24.3 mm, given as 24 mm"),
    SHIFT: Cause("shift of a photo", "all its image coordinates lie beside by one shift", ("P109", "P111"),
        "look at its fiducial marks (order, a turned photo), and at order and signs of its principal point",
        "fiducial marks read in another order"),
    SCALE: Cause("scale of a photo", "they are larger or smaller than its neighbours say", ("P109", "P111"),
        "is it from another flight or scan, or taken with another lens?", "one photo scanned at another resolution"),
}  # fmt: skip
"""Every cause by the kind of its observation or hypothesis."""
