"""Normal draws of which few tell as much as many independent ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from photostrip.arrays import Floats


def orthogonal_normal(rng: np.random.Generator, count: int, values: int) -> Floats:
    """Give standard normal draws in rows, shape (count, values), of which each `values` rows are at right angles.

    Directions of a block are those of a random orthogonal matrix: each row is what it would be alone. The variance of
    what is linear in the values comes from one block to 2.4 / values of itself, from independent rows to
    sqrt(2 / values).
    """
    directions: list[Floats] = []
    for _ in range(-(-count // values)):
        q, r = np.linalg.qr(rng.normal(size=(values, values)))
        directions.append(q * np.sign(np.diagonal(r)))
    lengths = np.sqrt(rng.chisquare(values, count))
    draws: Floats = np.concatenate(directions)[:count] * lengths[:, None]
    return draws
