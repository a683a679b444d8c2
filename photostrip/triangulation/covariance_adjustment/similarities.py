"""The unknowns of an adjusted strip: a small similarity at every photo, and what two neighbours say of their model.

Each is taken about the perspective centre of its photo, turns and scale by what they move at the distance of a base, so
that a strip of any length makes a system of the same condition. Those of a model's two photos differ by seven numbers:
six are its error components u, and the seventh, how the length of the base changes beside its scale, is zero.

Source: derived; see docs/precision.md, eq. 7.
"""

from __future__ import annotations

from typing import Self

import numpy as np

from photostrip.arrays import Floats
from photostrip.frozen import dataclass
from photostrip.geometry.rotation import cross_matrix
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS
from photostrip.triangulation.error_propagation.derivatives import ELEMENTS, SCALE
from photostrip.triangulation.error_propagation.strip_errors import StripErrors


@dataclass(frozen=True, eq=False)
class PhotoSimilarities:
    """Similarities of the models about their left photos, and of the last photo about itself."""

    to_common: Floats  # (p + 1, 7, 7): from the unknowns of each photo to the similarity about the common origin
    # shift, turn: by which unknowns are multiplied, metres; radians, and logarithms of scales
    shift: float
    turn: float
    # size: (p, 6): standard deviations of the error components
    # own, following: (p, 7, 7): [u / size; 0] = own y(i) + following y(i + 1)
    size: Floats
    own: Floats
    following: Floats

    @classmethod
    def of(cls, errors: StripErrors) -> Self:
        """Take them about the perspective centres C: t_common = t - theta x C - lambda C."""
        # the step's scale column is minus the centre that joins its model to the next; the origin is the mean of all
        next_centers = -errors.steps[:, :3, SCALE]
        centers = np.concatenate([-next_centers.sum(axis=0)[None], next_centers])
        base = np.diff(centers, axis=0)
        length = float(np.linalg.norm(base, axis=1).mean())
        to_common, from_common = np.tile(np.eye(SIMILARITY_PARAMETERS), (2, len(centers), 1, 1))
        to_common[:, :3, 3:6], to_common[:, :3, 6] = cross_matrix(centers), -centers
        from_common[:, :3, 3:6], from_common[:, :3, 6] = -cross_matrix(centers), centers
        size = np.sqrt(np.diagonal(errors.component_covariances[:, 0], axis1=1, axis2=2))
        size = np.where(size > 0, size, 1.0)  # the last model hands no scale on
        metres = np.array([1.0] * 3 + [length] * 4)
        steps = from_common[1:] @ errors.steps * size[:, None] * metres[:, None]
        # one unit is what a component of standard size moves: control of any precision leaves the system well scaled
        unit = float(np.sqrt(np.square(steps[:, :, ELEMENTS]).sum(axis=1).mean()))
        metres /= unit
        to_common, from_common = to_common / metres, from_common * metres[:, None]
        along_base = np.zeros((len(base), SIMILARITY_PARAMETERS, 1))
        along_base[:, :3, 0] = base / np.linalg.norm(base, axis=1)[:, None]
        following = np.linalg.inv(np.concatenate([steps / unit, along_base], axis=2))
        own = -following @ from_common[1:] @ to_common[:-1]
        return cls(to_common=to_common, shift=unit, turn=unit / length, size=size, own=own, following=following)
