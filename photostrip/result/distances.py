"""How far two ground points are apart, in metres in plan and in height, whatever the frame of their coordinates."""

from __future__ import annotations

import numpy as np

from photostrip.arrays import Floats
from photostrip.geodesy.frame_spec import CARTESIAN_AXES, GROUND_AXES
from photostrip.geodesy.local_frame import meridian_radius, prime_vertical_radius
from photostrip.notes import Document


def plan_and_height(frame: Document, now: Floats, before: Floats) -> tuple[Floats, Floats]:
    """Return the distance of points (n, 3) from where they were, in plan and in height, metres.

    Coordinates are in the order and the units of the frame, the block ``frame`` of a result. In a geocentric frame up
    is the normal of the ellipsoid.
    """
    parts = east_north_up(frame, now, before)
    return np.hypot(parts[:, 0], parts[:, 1]), np.abs(parts[:, 2])


def east_north_up(frame: Document, now: Floats, before: Floats) -> Floats:
    """Return how far points (n, 3) lie east, north and up of where they were, metres."""
    if frame["kind"] == "geocentric":
        return _along(level(frame, before), now - before)
    order = [list(frame["axes"]).index(axis) for axis in GROUND_AXES]
    return _in_metres(frame, now[:, order], before[:, order])


def difference_in_plan_and_height(frame: Document, delta: Floats, at: Floats) -> tuple[Floats, Floats]:
    """Return the same of differences that are in metres already, at points `at`; both in the order of the axes."""
    if frame["kind"] == "geocentric":
        parts = _along(level(frame, at), delta)
    else:  # a part that does not count stays alone without a number
        parts = delta[:, [list(frame["axes"]).index(axis) for axis in GROUND_AXES]]
    return np.hypot(parts[:, 0], parts[:, 1]), np.abs(parts[:, 2])


def _in_metres(frame: Document, now: Floats, before: Floats) -> Floats:
    """Differences of east, north, up in metres; of degrees by the radii of curvature in between."""
    plan, height = frame["plan_factor"], frame["height_factor"]
    delta = (now - before) * (plan, plan, height)
    if frame["kind"] == "geographic":
        a, b = frame["ellipsoid"]
        latitude = (now[:, 1] + before[:, 1]) / 2 * plan
        up = (now[:, 2] + before[:, 2]) / 2 * height
        turn = np.remainder(delta[:, 0] + np.pi, 2 * np.pi) - np.pi  # the short way round
        delta[:, 0] = turn * (prime_vertical_radius(latitude, (a, b)) + up) * np.cos(latitude)
        delta[:, 1] *= meridian_radius(latitude, (a, b)) + up
    return delta


def level(frame: Document, at: Floats) -> Floats:
    """Return east, north and up at points (n, 3) as unit vectors along the axes of the frame, as rows: (n, 3, 3)."""
    names = list(frame["axes"])
    order = [names.index(axis) for axis in (CARTESIAN_AXES if "x" in names else GROUND_AXES)]
    axes = np.eye(3)[order]
    if frame["kind"] != "geocentric":
        return np.broadcast_to(axes, (len(at), 3, 3))
    p = at[:, order]
    a, b = frame["ellipsoid"]
    # latitude of a point on the ellipsoid; a few kilometres above it the normal is off by 1e-6, which is nothing here
    distance = np.hypot(p[:, 0], p[:, 1])
    latitude = np.arctan2(p[:, 2] * a**2, distance * b**2)
    longitude = np.arctan2(p[:, 1], p[:, 0])
    (cl, sl), (cb, sb) = ((np.cos(angle), np.sin(angle)) for angle in (longitude, latitude))
    east, north, up = (-sl, cl, np.zeros_like(sl)), (-sb * cl, -sb * sl, cb), (cb * cl, cb * sl, sb)
    return np.stack([np.stack(each, axis=1) for each in (east, north, up)], axis=1) @ axes


def _along(axes: Floats, delta: Floats) -> Floats:
    return np.asarray(np.einsum("nij,nj->ni", axes, delta), float)
