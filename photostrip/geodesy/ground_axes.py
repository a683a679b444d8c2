"""Directions of ground axes as orthogonal, right-handed unit vectors, rows of (n, 3, 3): east, north, up."""

from __future__ import annotations

import math

import numpy as np

from photostrip.arrays import Floats
from photostrip.errors import GeometryError
from photostrip.geodesy.domain import named_rows

_POLE = 1e-9  # radians: nearer to a pole, east and north are not defined


def true_axes(geodetic: Floats) -> Floats:
    """East, north and the ellipsoid's normal at longitude, latitude (radians), in the geocentric frame."""
    lon, lat = geodetic[:, 0], geodetic[:, 1]
    pole = np.abs(lat) > math.pi / 2.0 - _POLE
    if pole.any():
        raise GeometryError(f"{named_rows(pole, None)}: at a pole there is no east and no north", code="pole")
    (sin_l, cos_l), (sin_b, cos_b) = ((np.sin(angle), np.cos(angle)) for angle in (lon, lat))
    east = np.stack([-sin_l, cos_l, np.zeros_like(lon)], axis=-1)
    north = np.stack([-sin_b * cos_l, -sin_b * sin_l, cos_b], axis=-1)
    up = np.stack([cos_b * cos_l, cos_b * sin_l, sin_b], axis=-1)
    return np.stack([east, north, up], axis=1)


def axes_between(east: Floats, north: Floats) -> Floats:
    """Right angles, shared evenly between two directions; nothing moves where they cross at right angles."""
    east, north = _unit(east), _unit(north)
    up = _unit(np.cross(east, north))
    east = _unit(east + np.cross(north, up))
    return np.stack([east, np.cross(up, east), up], axis=1)


def axes_along_north(east: Floats, north: Floats) -> Floats:
    """Right angles, the second axis along a direction in the plane of two."""
    up = _unit(np.cross(east, north))
    north = _unit(north - np.einsum("nc,nc->n", north, up)[:, None] * up)
    return np.stack([np.cross(north, up), north, up], axis=1)


def _unit(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))
