"""Strips adjusted with their own covariance, in the result: the test of the whole and of every control coordinate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.geodesy.frame_spec import GROUND_AXES
from photostrip.notes import Document
from photostrip.pipeline.results import Result, StripResult
from photostrip.result.numbers import natural_rank
from photostrip.result.quantities import record, records

if TYPE_CHECKING:
    from photostrip.triangulation.covariance_adjustment.adjust import CovarianceFigures


def covariances_of(result: Result) -> Document:
    """Return a record for each strip that was adjusted with its own covariance, under the key ``covariance``."""
    blocks = [
        _block(strip, strip.of_photos.covariance)
        for strip in result.photo_strips
        if strip.of_photos.covariance is not None
    ]
    return {"covariance": blocks} if blocks else {}


def _block(strip: StripResult, found: CovarianceFigures) -> Document:
    tested = found.tested
    ratio = tested.squares / tested.redundancy if tested.redundancy > 0 else float("nan")
    block = {
        "strip": strip.strip.id,
        "models": len(strip.of_photos.formed.scale),
        "passes": found.formations,
        "control_coordinates": len(found.control.point),
        "distances": tested.distances,
        "squares": tested.squares,
        "redundancy": tested.redundancy,
        "sigma0": np.sqrt(max(ratio, 0.0)),
        "p": tested.probability,
        "limit": tested.limit,
        "control": _control(strip, found),
    }
    return record("covariance", block)


def _control(strip: StripResult, found: CovarianceFigures) -> list[Document]:
    """Return the test values of the control coordinates, in natural order of the points."""
    ids = strip.control.ids
    order = np.lexsort((found.control.axis, natural_rank(ids)[found.control.point]))
    columns = {
        "id": [ids[point] for point in found.control.point[order]],
        "axis": [GROUND_AXES[axis] for axis in found.control.axis[order]],
        "test": found.tested.normalised[order],
        "size": found.tested.size[order],
    }
    return list(records("covariance.control", columns))
