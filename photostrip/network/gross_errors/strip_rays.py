"""What the search along a strip is made with."""

from __future__ import annotations

from dataclasses import dataclass

from photostrip.arrays import Floats, Numbers
from photostrip.points import PhotoPoints


@dataclass(frozen=True, eq=False)
class StripRays:
    observations: PhotoPoints
    position: Numbers  # (n,): place in the strip of the photo of every image point; -1 for photos of other strips
    sigma: Floats  # (p,): standard deviations of a y parallax of weight one in each pair, mm
    weight: Floats  # (m,): weights of the rows of the pairs before anything was rejected
    stated: float  # standard deviation of an image coordinate of weight one, mm
    kept: Numbers  # rows that the user keeps: their points are not tested
