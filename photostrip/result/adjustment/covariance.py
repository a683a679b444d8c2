"""Strips adjusted with their own covariance, in the result: the test of the whole and of every control coordinate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.geodesy.frame_spec import GROUND_AXES
from photostrip.result.numbers import GROUND, Document, natural_rank, rounded, significant

if TYPE_CHECKING:
    from photostrip.pipeline import Result, StripResult
    from photostrip.pipeline.covariance_adjustment import CovarianceAdjustment


def covariances_of(result: Result) -> Document:
    """Return the block ``covariance``: a record for each strip that was adjusted with its own covariance.

    Returns
    -------
    dict
        The block under its key; empty with other adjustments.
    """
    blocks = [_block(strip, strip.covariance) for strip in result.strips if strip.covariance is not None]
    return {"covariance": blocks} if blocks else {}


def _block(strip: StripResult, found: CovarianceAdjustment) -> Document:
    tested = found.tested
    ratio = tested.squares / tested.redundancy if tested.redundancy > 0 else float("nan")
    return {
        "strip": strip.strip.id,
        "models": len(strip.formed.scale),
        "passes": found.passes,
        "control_coordinates": len(found.control.point),
        "distances": tested.distances,
        "squares": significant(tested.squares),
        "redundancy": tested.redundancy,
        "sigma0": significant(np.sqrt(ratio)),
        "p": significant(tested.probability),
        "limit": rounded(tested.limit, 2),
        "control": _control(strip, found),
    }


def _control(strip: StripResult, found: CovarianceAdjustment) -> list[Document]:
    """Test values of the control coordinates, in natural order of the points."""
    ids = strip.control.ids
    order = np.lexsort((found.control.axis, natural_rank(ids)[found.control.point]))
    normalised = rounded(found.tested.normalised, 2)
    sizes = rounded(found.tested.size, GROUND)
    return [
        {
            "id": ids[found.control.point[row]],
            "axis": GROUND_AXES[found.control.axis[row]],
            "test": normalised[row],
            "size": sizes[row],
        }
        for row in order.tolist()
    ]
