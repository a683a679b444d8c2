"""The unknowns of an adjusted strip: the error components of its models, and small similarities of some of its photos.

From photo to photo the similarity changes by the step of their model, six error components. Adding up steps over a
whole strip would make everything depend on everything; so every few photos one, the *anchor* of a block, has its
similarity as an unknown, too. It is taken about the photo's perspective centre, turns and scale by what they move at
the distance of a base, so that a strip of any length makes a system of the same condition.

Source: derived; see docs/precision.md, eq. 7.
"""

from __future__ import annotations

from typing import Self

import numpy as np

from photostrip.arrays import Floats
from photostrip.frozen import dataclass
from photostrip.geometry.rotation import cross_matrix
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS
from photostrip.triangulation.covariance_adjustment.strip_rows.derivatives import ELEMENTS
from photostrip.triangulation.covariance_adjustment.strip_rows.strip_errors import StripErrors


@dataclass(frozen=True, eq=False)
class PhotoSimilarities:
    """How unknowns of photos and models make similarities about the common origin."""

    # to_common, from_common: (p + 1, 7, 7): from the unknowns of a photo to its similarity about the common origin, and
    # back
    to_common: Floats
    from_common: Floats
    size: Floats  # (p, 6): standard deviations of the error components, in which these are unknowns
    steps: Floats  # (p, 7, 6): step from the similarity of a photo to that of the next by these unknowns

    @classmethod
    def of(cls, errors: StripErrors) -> Self:
        """Take them about the perspective centres C: t_common = t - theta x C - lambda C."""
        centers = errors.centers
        length = float(np.linalg.norm(np.diff(centers, axis=0), axis=1).mean())
        to_common, from_common = np.tile(np.eye(SIMILARITY_PARAMETERS), (2, len(centers), 1, 1))
        to_common[:, :3, 3:6], to_common[:, :3, 6] = cross_matrix(centers), -centers
        from_common[:, :3, 3:6], from_common[:, :3, 6] = -cross_matrix(centers), centers
        size = np.sqrt(np.diagonal(errors.component_covariances[:, 0], axis1=1, axis2=2))
        size = np.where(size > 0, size, 1.0)  # the last model hands no scale on
        steps = errors.steps * size[:, None]
        metres = np.array([1.0] * 3 + [length] * 4)
        moved = from_common[1:] @ steps[:, :, ELEMENTS] * metres[:, None]
        # one unit is what an element of standard size moves: control of any precision leaves the system well scaled
        metres /= np.sqrt(np.square(moved).sum(axis=1).mean())
        return cls(to_common=to_common / metres, from_common=from_common * metres[:, None], size=size, steps=steps)
