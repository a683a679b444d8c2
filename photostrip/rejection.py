"""One observation that a test took out: the same value for y parallaxes, rays, control, links and directions."""

from __future__ import annotations

from dataclasses import dataclass
from math import fabs, nan

UNCONTROLLED = 0.01  # redundancy number below which an observation cannot be tested
WRONG_RAY, TWO_RAYS, SEVERAL_RAYS = "ray", "pair", "rays"
"""What was found at a point: its wrong rays; two rays that contradict each other; several of which any may be wrong."""


@dataclass(frozen=True)
class Rejection:
    """What was taken out, by which test, and what would explain it."""

    # ``parallax``, ``image``, ``control``, ``position``, ``attitude``, ``link``, ``direction`` or ``stable``
    kind: str
    row: int  # which observation of its kind, as the search that tested it numbers them
    test: str
    # value, limit: test value and critical value; NaN where there was no test
    value: float
    limit: float
    axes: tuple[int, ...] = ()  # coordinates that are wrong; empty: all of the observation
    # estimated errors of its coordinates: mm, metres or radians; empty where nothing can be said
    size: tuple[float, ...] = ()
    # of a ray: whether it is known to be the wrong one of its point; of control: ``image`` or ``exchanged``
    cause: str = ""
    other: int = -1  # of control: place of the photo whose image of it is wrong, or the point it was exchanged with
    readmitted: bool = False  # whether it came back in the end

    @property
    def worst(self) -> float:
        """The largest estimated error of the coordinates that are wrong; NaN where nothing can be said."""
        sizes = [self.size[axis] for axis in self.axes or range(len(self.size))] if self.size else []
        return max(sizes, key=fabs, default=nan)
