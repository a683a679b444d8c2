"""Arrays as single steps take them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from photostrip.arrays import Floats, Numbers


def rows(values: ArrayLike, width: int) -> Floats:
    """Return coordinates as an array (n, width), or refuse them."""
    found = np.asarray(values, float)
    if found.ndim != 2 or found.shape[1] != width or not np.isfinite(found).all():
        raise InputError(f"an array of finite numbers with {width} columns is needed, not one of shape {found.shape}")
    return found


def same(one: Floats, other: Floats | Numbers) -> None:
    if len(one) != len(other):
        raise InputError(f"{len(one)} and {len(other)} rows: each point needs a row in both")
