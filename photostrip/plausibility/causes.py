"""The causes that compete in an adjustment: how each shows, what tells of it, what cures it, an example.

Single observations first, then what many of them share, in the order of ``network.hypotheses``. The cures are what
findings say; docs/causes.md shows the table.
"""

from __future__ import annotations

from typing import NamedTuple

from photostrip.network.hypotheses import (
    DISTANCE,
    DRIFT,
    FILM,
    LENS,
    LIST,
    OFFSET,
    ORDER,
    POINT,
    SCALE,
    SHIFT,
)
from photostrip.network.reliability import CONTROL, IMAGE, POSITION


class Cause(NamedTuple):
    title: str  # what is wrong
    shows: str  # how it would show in the residuals
    told: tuple[str, ...]  # findings that name it, or notes, or the list of the result
    cure: str
    example: str


_POSITIONS = "look at datum, kind of height and lever arm of the positions, and at the crs of the control"
CAUSES: dict[str, Cause] = {
    IMAGE: Cause(
        "ray",
        "the other rays of the point agree without it",
        ("rejected",),
        "measure the point there again",
        "a point set on a shadow that moved",
    ),
    CONTROL: Cause(
        "control coordinate or point",
        "photos and the other control contradict it",
        ("control-rejected", "P406", "P408"),
        "look at the field sheet, and at the spot",
        "height 331.20 written as 313.20",
    ),
    POSITION: Cause(
        "camera position or attitude",
        "its photo lies elsewhere, or is turned, by all its rays",
        ("position-rejected",),
        "look at the log of the receiver at that exposure",
        "one exposure without fixed ambiguities",
    ),
    OFFSET: Cause(
        "offset of camera positions",
        "those of a strip, or of the block, lie beside by one shift",
        ("P208",),
        _POSITIONS,
        "heights above the ellipsoid, control above the geoid",
    ),
    DRIFT: Cause(
        "drift of camera positions",
        "the shift grows along the strip",
        ("P208",),
        _POSITIONS,
        "a receiver without its base station",
    ),
    ORDER: Cause(
        "order of camera positions",
        "without them, photos lie where other rows say",
        ("P208",),
        "put the names of the photos and their positions together anew",
        "a test exposure counted as the first photo",
    ),
    LIST: Cause(
        "control list",
        "all its points lie beside all else by one shift",
        ("P404", "P407"),
        "compare the crs, datum and kind of height of both lists",
        "old benchmarks 0.6 m below points from GNSS",
    ),
    LENS: Cause(
        "lens distortion",
        "residuals outwards or inwards, by the third power of the radius",
        ("P110",),
        "look at the lens in the calibration certificate of the camera",
        "a drone camera, given as free of distortion",
    ),
    FILM: Cause(
        "film",
        "images are longer along one axis, or sheared",
        ("P112",),
        "where film shrank or was scanned, measure the fiducial marks; of a digital one, look at the sides of a pixel",
        "film that dried 0.2 % shorter along x",
    ),
    POINT: Cause(
        "principal point",
        "all photos of a camera ask for another one",
        ("P111",),
        "look at the principal point and the origin of the image coordinates",
        "its sign exchanged",
    ),
    DISTANCE: Cause(
        "principal distance",
        "heights, or camera positions, are stretched against the plan",
        ("P107", "P105"),
        "take it from the certificate",
        "a zoom lens at 24.3 mm, given as 24 mm",
    ),
    SHIFT: Cause(
        "shift of a photo",
        "all its image coordinates lie beside by one shift",
        ("P109", "P111"),
        "look at its fiducial marks (order, a turned photo), and at order and signs of its principal point",
        "fiducial marks read in another order",
    ),
    SCALE: Cause(
        "scale of a photo",
        "they are larger or smaller than its neighbours say",
        ("P109", "P111"),
        "is it from another flight or scan, or taken with another lens?",
        "one photo scanned at another resolution",
    ),
}
"""Every cause by the kind of its observation or hypothesis."""
