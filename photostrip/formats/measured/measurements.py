"""Measured image coordinates as a table gives them."""

from __future__ import annotations

from dataclasses import dataclass

from photostrip.arrays import Floats, Numbers
from photostrip.formats.text.tables import Table


@dataclass(frozen=True, eq=False)
class Measurements:
    """Measured image coordinates as the table gives them: in its unit, with its direction of y."""

    table: Table
    # photo_ids, target_ids: ids of the photos, and of the points or marks, in order of first appearance
    photo_ids: tuple[str, ...]
    target_ids: tuple[str, ...]
    # photo, target: (n,): photo and target of each row
    photo: Numbers
    target: Numbers
    xy: Floats  # (n, 2): coordinates in the unit of the table
    sigma: Floats  # (n, 2): standard deviations in the unit of the table; NaN where the row has none
    times: Numbers  # (n,): number of measurements of which each row is the mean
