"""The causes that compete in an adjustment: how each shows, what tells of it, what cures it, an example.

Single observations first, then what many of them share, in the order of ``network.hypotheses``. The cures are what
findings say; docs/causes.md shows the table.
"""

from __future__ import annotations

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
)
from photostrip.network.reliability import CONTROL, IMAGE, POSITION


class Cause(NamedTuple):
    title: str  # what is wrong
    shows: str  # how it would show in the residuals
    told: tuple[str, ...]  # findings that name it, or notes, or the list of the result
    cure: str
    example: str


_POSITIONS = "look at datum, kind of height and lever arm of the positions, and at the crs of the control"
_LENS = "look at the lens in the calibration certificate of the camera"
CAUSES: dict[str, Cause] = {
    IMAGE: Cause(
        title="ray",
        shows="the other rays of the point agree without it",
        told=("rejected",),
        cure="measure the point there again",
        example="a point set on a shadow that moved",
    ),
    CONTROL: Cause(
        title="control coordinate or point",
        shows="photos and the other control contradict it",
        told=("control-rejected", "P406", "P408"),
        cure="look at the field sheet, and at the spot",
        example="height 331.20 written as 313.20",
    ),
    POSITION: Cause(
        title="camera position or attitude",
        shows="its photo lies elsewhere, or is turned, by all its rays",
        told=("position-rejected",),
        cure="look at the log of the receiver at that exposure",
        example="one exposure without fixed ambiguities",
    ),
    OFFSET: Cause(
        title="offset of camera positions",
        shows="those of a strip, or of the block, lie beside by one shift",
        told=("P208",),
        cure=_POSITIONS,
        example="heights above the ellipsoid, control above the geoid",
    ),
    DRIFT: Cause(
        title="drift of camera positions",
        shows="the shift grows along the strip",
        told=("P208",),
        cure=_POSITIONS,
        example="a receiver without its base station",
    ),
    ORDER: Cause(
        title="order of camera positions",
        shows="without them, photos lie where other rows say",
        told=("P208",),
        cure="put the names of the photos and their positions together anew",
        example="a test exposure counted as the first photo",
    ),
    LIST: Cause(
        title="control list",
        shows="all its points lie beside all else by one shift",
        told=("P404", "P407"),
        cure="compare the crs, datum and kind of height of both lists",
        example="old benchmarks 0.6 m below points from GNSS",
    ),
    LENS: Cause(
        title="lens distortion",
        shows="residuals outwards or inwards, by the third power of the radius",
        told=("P110",),
        cure=_LENS,
        example="a drone camera, given as free of distortion",
    ),
    EDGE: Cause(
        title="lens distortion at the edge",
        shows="the same, by the third and fifth power",
        told=("P110",),
        cure=_LENS,
        example="k2 left out",
    ),
    DECENTRED: Cause(
        title="decentred lens",
        shows="residuals by the square of the radius, to one side",
        told=("P110",),
        cure=_LENS,
        example="p1 and p2 exchanged",
    ),
    FILM: Cause(
        title="film",
        shows="images are longer along one axis, or sheared",
        told=("P112",),
        cure="where film shrank or was scanned, measure the fiducial marks; of a digital one, look at the sides of a "
        "pixel",
        example="film that dried 0.2 % shorter along x",
    ),
    POINT: Cause(
        title="principal point",
        shows="all photos of a camera ask for another one",
        told=("P111",),
        cure="look at the principal point and the origin of the image coordinates",
        example="its sign exchanged",
    ),
    DISTANCE: Cause(
        title="principal distance",
        shows="heights, or camera positions, are stretched against the plan",
        told=("P107", "P105"),
        cure="take it from the certificate",
        example="a zoom lens at 24.3 mm, given as 24 mm",
    ),
    SHIFT: Cause(
        title="shift of a photo",
        shows="all its image coordinates lie beside by one shift",
        told=("P109", "P111"),
        cure="look at its fiducial marks (order, a turned photo), and at order and signs of its principal point",
        example="fiducial marks read in another order",
    ),
    SCALE: Cause(
        title="scale of a photo",
        shows="they are larger or smaller than its neighbours say",
        told=("P109", "P111"),
        cure="is it from another flight or scan, or taken with another lens?",
        example="one photo scanned at another resolution",
    ),
}
"""Every cause by the kind of its observation or hypothesis."""
