"""Control left out in turn: how far off the same adjustment is where it does not know the ground.

The strips are formed and their control is searched once; what is repeated is absolute orientation, polynomials or
bundle adjustment, and precision.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from photostrip.arrays import Numbers
from photostrip.errors import GeometryError, InputError
from photostrip.pipeline.given_points import rejected_control
from photostrip.pipeline.inputs import Inputs
from photostrip.pipeline.results import Fold, Result

FOLDS = 10  # adjustments that are made at most


def cross_validate(result: Result, adjust: Callable[[Inputs], Result]) -> tuple[Fold, ...]:
    """Adjust again without each point of the control, or without each of so many groups, and compare with it there.

    adjust: adjusts the formed strips with other control.
    """
    control, folds = result.inputs.control, []
    # nothing is searched again in strips: what the whole rejected stays out; a bundle leaves it out by itself
    use = control.use & ~rejected_control(result) if result.bundle is None else control.use
    taken = np.flatnonzero(~control.check & use.any(axis=1))
    for group in _groups(result):
        left_out = np.isin(np.arange(len(control)), group)
        given = replace(control, check=left_out, use=use).take(taken)
        ids = tuple(control.ids[row] for row in np.sort(group))
        try:
            folds.append(Fold(ids, adjust(replace(result.inputs, control=given))))
        except (GeometryError, InputError, np.linalg.LinAlgError) as error:
            folds.append(Fold(ids, None, str(error)))
    return tuple(folds)


def _groups(result: Result) -> list[Numbers]:
    """Return rows of the control to be left out together: single points, or points as far apart as can be.

    Control that was found wrong says nothing about the result and is not among them.
    """
    control = result.inputs.control
    used = control.use.any(axis=1) & ~control.check & ~rejected_control(result).any(axis=1)
    rows = np.flatnonzero(used & (result.control_rows >= 0))
    if len(rows) <= FOLDS:
        return [rows[[number]] for number in range(len(rows))]
    place = result.points.cartesian[result.control_rows[rows]]
    _, _, axes = np.linalg.svd(place - place.mean(axis=0), full_matrices=False)
    along = rows[np.argsort(place @ axes[0], kind="stable")]
    return [along[number::FOLDS] for number in range(FOLDS)]
