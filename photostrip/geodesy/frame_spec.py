"""What the user says about a ground frame, and what contradicts itself in it.

Heights are where ground frames go wrong silently: a geoid left out, or applied twice, moves everything by forty
metres and fits perfectly. So there must be one statement about them, and one only.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from photostrip.errors import Fault
from photostrip.geodesy.local_frame import Ellipsoid

Kind = Literal["projected", "geographic", "geocentric", "local"]

GROUND_AXES = ("east", "north", "up")
CARTESIAN_AXES = ("x", "y", "z")

_LARGEST_FLATTENING = 0.5  # an (a, b) beyond this is (a, 1/f) or another slip
_LONGEST_NAME = 60


@dataclass(frozen=True)
class FrameSpec:
    """What the project file says about the frame of one control list, or of the output."""

    crs: str  # authority code, PROJ string, WKT, ``geocentric`` or ``local``
    # the user's order of columns: a permutation of (east, north, up); for geocentric frames also of (x, y, z)
    axes: tuple[str, str, str]
    height: str = "ellipsoidal"  # ``ellipsoidal`` or ``orthometric``
    # constant undulation N of the geoid above the ellipsoid of `crs`, metres: h = H + N. Only with orthometric heights
    geoid_undulation: float | None = None
    # semi-axes (a, b), metres, for ``geocentric`` on another body or ellipsoid; None: WGS 84
    ellipsoid: Ellipsoid | None = None
    # radius R of the curvature correction (eq. 153), metres. Only for ``local``; None: no correction
    curvature_radius: float | None = None
    # decimal year of the coordinates, for frames in which the ground moves (ITRF, WGS 84)
    epoch: float | None = None

    def __post_init__(self) -> None:
        """Turn lists, as a project file has them, into tuples."""
        object.__setattr__(self, "axes", tuple(self.axes))
        if self.ellipsoid is not None:
            object.__setattr__(self, "ellipsoid", tuple(self.ellipsoid))

    @property
    def name(self) -> str:
        """The CRS as the user wrote it; a long WKT by its title, ``geocentric`` with its ellipsoid."""
        if self.crs == "geocentric":
            shape = "WGS 84" if self.ellipsoid is None else f"a = {self.ellipsoid[0]} m, b = {self.ellipsoid[1]} m"
            return f"geocentric ({shape})"
        text = " ".join(self.crs.split())
        title = re.search(r'"([^"]+)"', text)
        if len(text) > _LONGEST_NAME and "[" in text and title:
            return f'WKT "{title[1]}"'
        return text


class Refusal(Exception):  # noqa: N818 (not an error of its own: it carries one fault to where faults are collected)
    """One fault of one frame, on its way to the list of all faults; `key` is that of the control list at fault."""

    def __init__(self, message: str, *, code: str, key: str = "crs", expected: str = "", fix: str = "") -> None:
        super().__init__(message)
        self.message, self.code, self.key, self.expected, self.fix = message, code, key, expected, fix

    def at(self, path: str) -> Fault:
        return Fault(self.message, code=self.code, key=f"{path}.{self.key}", expected=self.expected, fix=self.fix)


def contradictions(spec: FrameSpec, kind: Kind, vertical: str, *, three_dimensional: bool) -> Iterator[Refusal]:
    """Find what does not fit together in the description of one frame; the rest as in ``CrsParts``."""
    yield from _axes(spec, kind)
    yield from _curvature(spec, kind)
    yield from _ellipsoid(spec)
    if spec.height not in {"ellipsoidal", "orthometric"}:
        expected = "ellipsoidal or orthometric"
        yield Refusal(f"height: {spec.height} is not understood", code="height", key="height", expected=expected)
    elif kind in {"local", "geocentric"}:
        yield from _heights_without_geoid(spec, kind)
    elif spec.height == "ellipsoidal":
        yield from _ellipsoidal_heights(spec, vertical)
    else:
        yield from _orthometric_heights(spec, vertical, three_dimensional=three_dimensional)


def _axes(spec: FrameSpec, kind: Kind) -> Iterator[Refusal]:
    """Refuse an order of columns that is not one."""
    allowed = [CARTESIAN_AXES, GROUND_AXES] if kind == "geocentric" else [GROUND_AXES]
    if not any(sorted(map(str, spec.axes)) == sorted(names) for names in allowed):
        yield Refusal(
            f"axes [{', '.join(map(str, spec.axes))}] of {spec.name} are not understood",
            code="axes",
            key="axes",
            expected="a permutation of " + " or of ".join(f"[{', '.join(names)}]" for names in allowed),
            fix="longitude is east, latitude is north" if kind == "geographic" else "",
        )


def _curvature(spec: FrameSpec, kind: Kind) -> Iterator[Refusal]:
    """Refuse to count the Earth's curvature twice."""
    radius = spec.curvature_radius
    if radius is None:
        return
    if kind != "local":
        yield Refusal(
            f"the curvature correction of eq. 153 is asked for, but {spec.name} carries the curvature already:"
            " it would count twice",
            code="curvature-twice",
            fix="drop `earth_curvature: model`, or give plane coordinates of an unknown projection as `crs: local`",
        )
    elif not (math.isfinite(radius) and radius > 0.0):
        message = f"the radius of curvature {radius} m is not a positive length"
        yield Refusal(message, code="curvature-radius", key="curvature_radius")


def _ellipsoid(spec: FrameSpec) -> Iterator[Refusal]:
    """Refuse an ellipsoid where it does not belong, and one that is none."""
    if spec.ellipsoid is None:
        return
    if spec.crs != "geocentric":
        message = f"`ellipsoid` belongs to `crs: geocentric`; {spec.name} has its own or none"
        fix = "drop `ellipsoid`, or write the radii into a PROJ string (+a=... +b=...)"
        yield Refusal(message, code="ellipsoid", key="ellipsoid", fix=fix)
    a, b = spec.ellipsoid
    if not (math.isfinite(a) and math.isfinite(b) and a > 0.0 and abs(a - b) <= _LARGEST_FLATTENING * a):
        message = f"a = {a}, b = {b} are not the semi-axes of an ellipsoid"
        expected = "both semi-axes in metres, for example a: 6378245, b: 6356863.019"
        yield Refusal(message, code="ellipsoid", key="ellipsoid", expected=expected)


def _heights_without_geoid(spec: FrameSpec, kind: Kind) -> Iterator[Refusal]:
    """Refuse a geoid in a frame that has no ellipsoid under its heights."""
    if spec.geoid_undulation is not None:
        message = f"geoid_undulation is given for {spec.name}, but a {kind} frame has no geoid"
        yield Refusal(message, code="height-undulation", key="geoid_undulation", fix="drop it")
    if kind == "geocentric" and spec.height == "orthometric":
        message = f"{spec.name} has no heights that could be orthometric"
        yield Refusal(message, code="height", key="height", fix="drop `height`")


def _ellipsoidal_heights(spec: FrameSpec, vertical: str) -> Iterator[Refusal]:
    """Refuse a geoid beside ellipsoidal heights."""
    if spec.geoid_undulation is not None:
        message = f"geoid_undulation is given for {spec.name}, but its heights are said to be ellipsoidal"
        fix = "drop it, or say `height: orthometric`"
        yield Refusal(message, code="height-undulation", key="geoid_undulation", fix=fix)
    if vertical:
        message = f"{spec.name} brings heights above a geoid ({vertical}), but they are said to be ellipsoidal"
        fix = "say `height: orthometric`, or leave the vertical part out of `crs`"
        yield Refusal(message, code="height-compound", key="height", fix=fix)


def _orthometric_heights(spec: FrameSpec, vertical: str, *, three_dimensional: bool) -> Iterator[Refusal]:
    """Ask for exactly one geoid under orthometric heights."""
    undulation = spec.geoid_undulation
    if three_dimensional:
        message = f"the heights of {spec.name} are ellipsoidal by definition, but they are said to be orthometric"
        fix = "use the two-dimensional CRS with `geoid_undulation`, or a compound CRS"
        yield Refusal(message, code="height-compound", key="height", fix=fix)
    elif undulation is None and not vertical:
        message = f"{spec.name} with orthometric heights does not say how high the geoid lies above the ellipsoid"
        expected = "geoid_undulation: metres, or a vertical CRS in `crs` (such as EPSG:32633+5773)"
        fix = "a constant undulation does for a strip of a few kilometres"
        yield Refusal(message, code="height-geoid", key="height", expected=expected, fix=fix)
    elif undulation is not None and vertical:
        message = f"{spec.name} brings its own geoid ({vertical}), and geoid_undulation is given as well"
        fix = "drop `geoid_undulation`, or the vertical part of `crs`"
        yield Refusal(message, code="height-undulation", key="geoid_undulation", fix=fix)
    elif undulation is not None and not math.isfinite(undulation):
        message = f"geoid_undulation {undulation} is not a length in metres"
        yield Refusal(message, code="height-undulation", key="geoid_undulation")
