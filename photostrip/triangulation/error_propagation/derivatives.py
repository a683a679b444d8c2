"""Sparse rows of derivatives by the image coordinates, and what their columns are.

Source: derived; see docs/precision.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]

UNITS = 6
ELEMENTS, SCALE = slice(0, 5), 5  # units of a model
REACH = 2  # models between which units share image coordinates
SPAN = REACH + 1  # photos on which the image coordinates of a unit lie


@dataclass(frozen=True, eq=False)
class Images:
    """Image points that take part, ordered by photo, and how units depend on them."""

    row: Numbers  # (n,): row in the table of image points
    photo: Numbers  # (n,): place of its photo in the strip, ascending
    sigma: Floats  # (n, 2): stated standard deviations of x and y, mm
    # (n, 3, 6, 2): units of the models photo - 2, photo - 1 and photo by x and y in units of their standard deviations
    units: Floats


@dataclass(frozen=True, eq=False)
class Rows:
    """Errors of things with d coordinates as rows of derivatives, sparse.

    The error is ``frame xi + sum_s core[s] u[first + s] + sum own l`` with xi the similarity of model ``first``, u the
    units of the models and l the errors of image coordinates in units of their standard deviations.
    """

    first: Numbers  # (n,): model whose similarity moves the thing as a whole
    frame: Floats  # (n, d, 7): coefficients of that similarity
    core: Floats  # (n, s, d, 6): coefficients of the units of the models from ``first`` on
    item: Numbers  # (e,): thing of each image point that enters by itself, ascending
    image: Numbers  # (e,): that image point, a row of ``Images``
    own: Floats  # (e, d, 2): its coefficients

    def taken(self, order: Numbers) -> Rows:
        """Return the rows of some things, or of all in another order."""
        back = np.full(len(self.first), -1)
        back[order] = np.arange(len(order))
        item = back[self.item]
        entry = np.argsort(item, kind="stable")[int((item < 0).sum()) :]
        return Rows(
            self.first[order],
            self.frame[order],
            self.core[order],
            item[entry],
            self.image[entry],
            self.own[entry],
        )

    def part(self, start: int, stop: int) -> Rows:
        """Return the rows of the things from start to stop."""
        low, high = np.searchsorted(self.item, [start, stop])
        return Rows(
            self.first[start:stop],
            self.frame[start:stop],
            self.core[start:stop],
            self.item[low:high] - start,
            self.image[low:high],
            self.own[low:high],
        )
