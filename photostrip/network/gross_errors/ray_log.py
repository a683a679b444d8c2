"""What a search said of rays, in columns: thousands of them are decided on, some several times; records are made once.

Source: derived; bookkeeping.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.network.gross_errors.point_decisions import AGREE, CAUSES, SEVERAL
from photostrip.network.reliability import IMAGE
from photostrip.rejection import Rejection

START, ROBUST = "start", "robust"  # in the place of a test


@dataclass(frozen=True, eq=False)
class WrongRays:
    """Rays that must go, each with what was said of its point."""

    row: Numbers  # (n,): rows of the observations
    # value, limit: (n,): test value of the point and what it is tested against
    value: Floats
    limit: Floats
    size: Floats  # (n, c): estimated errors of the coordinates, mm
    cause: Numbers  # (n,): places in ``CAUSES``

    def __len__(self) -> int:
        return len(self.row)

    def take(self, chosen: Numbers) -> WrongRays:
        return WrongRays(
            row=self.row[chosen],
            value=self.value[chosen],
            limit=self.limit[chosen],
            size=self.size[chosen],
            cause=self.cause[chosen],
        )


class RayLog:
    """What was last said of each ray of a problem, and by which test it went."""

    def __init__(self, begin: Flags, coordinates: int) -> None:
        """Begin with some of the rays (n,), of so many coordinates each; points with others meet somehow."""
        rays = len(begin)
        self.test, self.said = np.full(rays, START, "U8"), np.zeros(rays, bool)
        self.value, self.limit = np.full(rays, np.nan), np.full(rays, np.nan)
        self.size, self.cause = np.full((rays, coordinates), np.nan), np.where(begin, AGREE, SEVERAL)

    def say(self, wrong: WrongRays) -> None:
        for column in ("value", "limit", "size", "cause"):
            getattr(self, column)[wrong.row] = getattr(wrong, column)
        self.said[wrong.row] = True

    def records(self, row: Numbers, holds: Flags) -> dict[int, Rejection]:
        """Make the records of rays (n,), by row; ``holds`` (m,): rays that take part in the end."""
        axis = np.fmax(np.abs(self.size[row]), 0.0).argmax(axis=1)
        columns = (self.test, self.said, self.value, self.limit, self.size, self.cause, holds)
        every = zip(row.tolist(), axis.tolist(), *(each[row].tolist() for each in columns), strict=True)
        return {
            number: Rejection(
                kind=IMAGE,
                row=number,
                test=test,
                value=value,
                limit=limit,
                axes=(worst,) if said else (),
                size=tuple(size) if said else (),
                cause=CAUSES[cause],
                readmitted=back,
            )
            for number, worst, test, said, value, limit, size, cause, back in every
        }
