"""Random numbers that are the same on every machine and with every version of numpy.

Numpy promises that the bits of PCG64 stay the same for ever, but not what its ``Generator`` makes of them. So only
the bits are taken: the upper 53 of each word divided by 2^53 are a uniform number, pairs of these give normal numbers
by the formula of Box and Muller.

Each purpose has a stream of its own (``Purpose``), so that asking for a film deformation, say, does not change
the flight, and a strip that is twice as noisy has the same errors twice as large.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from photostrip.arrays import Floats, Numbers


class Purpose(IntEnum):
    """What a stream of random numbers is for; the numbers are part of the promise."""

    TERRAIN = 1
    FLIGHT = 2
    POINTS = 3
    ROLES = 4
    CONTROL = 5
    IMAGE = 6
    FILM = 7
    FIDUCIALS = 8
    GROSS = 9
    GNSS = 10
    MODELS = 11


class Draws:
    """One stream of random numbers; `number` is that of the stream, for purposes that have several."""

    def __init__(self, seed: int, purpose: Purpose, number: int = 0) -> None:
        self._bits = np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(int(purpose), number)))

    def uniform(self, *shape: int) -> Floats:
        """Draw the next uniform numbers of the stream in [0, 1), in rows."""
        words = np.asarray(self._bits.random_raw(int(np.prod(shape))), dtype=np.uint64)
        return np.asarray((words >> np.uint64(11)) * 2.0**-53, float).reshape(shape)

    def between(self, *shape: int) -> Floats:
        """Draw uniform numbers in [-1, 1); see ``uniform``."""
        return 2.0 * self.uniform(*shape) - 1.0

    def normal(self, *shape: int) -> Floats:
        """Draw normal numbers with mean 0 and standard deviation 1.

        Two uniform numbers each give one of them (the cosine of Box and Muller): number i of the stream does not depend
        on how many are asked for.
        """
        pairs = self.uniform(int(np.prod(shape)), 2)
        radius = np.sqrt(-2.0 * np.log1p(-pairs[:, 0]))
        return np.asarray(radius * np.cos(2.0 * np.pi * pairs[:, 1])).reshape(shape)

    def order(self, count: int) -> Numbers:
        """Draw the numbers 0 to count - 1 in random order: that in which `count` uniform numbers are sorted."""
        return np.argsort(self.uniform(count), kind="stable")
