"""Directions of bases by relative orientation, where the photos laid side by side leave their order in doubt.

On a photo, a tilt moves the points of its neighbour as a base does: with an end lap of 80 % and a long lens a tilt of
5 degrees is as large as half a base. The layout of the photos is a cheap screen; what it speaks against is looked at
with the pair oriented, which keeps base and tilt apart.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache

import numpy as np

from photostrip.camera import Camera
from photostrip.errors import GeometryError
from photostrip.pipeline.inputs import Settings, Strip
from photostrip.pipeline.plausibility import evidence
from photostrip.points import PhotoPoints
from photostrip.strip.relative_orientation.orientation import orient_unchecked, unusable_pairs
from photostrip.strip.relative_orientation.pairs import collect_pairs

LEAST_POINTS = 6  # one more than a pair has unknowns
PAIR_SIGMA0 = 0.01  # of a pair, over the principal distance: beyond it the base is no better known than by the layout


def closer_look(
    strip: Strip, observations: PhotoPoints, cameras: Mapping[str, Camera], settings: Settings
) -> Callable[[str, str], tuple[complex, complex] | None]:
    """Return a function that gives the directions in which two photos of a strip lie from each other.

    Returns of two photos, the direction towards the second on the first and towards the first on the second; None where
        the pair cannot be oriented well enough to say.
    """
    points: list[PhotoPoints] = []

    @cache
    def toward(one: str, other: str) -> tuple[complex, complex] | None:
        if not points:
            points.append(evidence.ideal(observations, cameras, settings))
        focal = strip.camera.principal_distance
        try:
            with np.errstate(all="ignore"):
                pairs = collect_pairs(points[0], [one, other], focal)
                if len(pairs.pair) < LEAST_POINTS:
                    return None
                oriented, converged = orient_unchecked(pairs)
                doubtful = unusable_pairs(oriented, converged)
        except (GeometryError, np.linalg.LinAlgError):
            return None
        if doubtful[0] or not oriented.sigma0[0] < PAIR_SIGMA0 * focal:
            return None
        base, turn = (each[0] for each in oriented.relative)
        back = -base @ turn
        return complex(base[0], base[1]), complex(back[0], back[1])

    return toward
