"""Arrays as single steps take them, and how well they fit."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Floats, Numbers
from photostrip.errors import InputError

Rays = tuple[ArrayLike, ArrayLike, ArrayLike]  # photo (n,) and point (n,) as numbers from 0, coordinates (n, 2)


def rows(values: ArrayLike, width: int, *, gaps: bool = False) -> Floats:
    """Return coordinates as an array (n, width), or refuse them; `gaps` lets NaN pass."""
    found = np.asarray(values, float)
    if found.ndim != 2 or found.shape[1] != width or not (gaps or np.isfinite(found).all()):
        raise InputError(f"an array of finite numbers with {width} columns is needed, not one of shape {found.shape}")
    return found


def same(one: Floats, other: Floats | Numbers) -> None:
    if len(one) != len(other):
        raise InputError(f"{len(one)} and {len(other)} rows: each point needs a row in both")


def of_rays(rays: Rays) -> tuple[Numbers, Numbers, Floats]:
    """Return photo, point and image coordinates of rays as arrays."""
    photo, point = (np.asarray(each, np.intp) for each in rays[:2])
    xy = rows(rays[2], 2)
    same(xy, photo)
    same(xy, point)
    return photo, point, xy


def sigma0_of(residuals: Floats, redundancy: int) -> float:
    return float(np.sqrt((residuals**2).sum() / redundancy)) if redundancy > 0 else float("nan")
