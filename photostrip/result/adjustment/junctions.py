"""What neighbouring models have in common: its differences, and the scale transfer at the photos that join them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from photostrip.arrays import Floats
from photostrip.pipeline.results import Result, StripResult
from photostrip.result.table import Table
from photostrip.strip.formed_strip import FormedStrip

DIRECTIONS = ("along", "across", "up")
PPM = 1e6


def discrepancies(strip: StripResult) -> Floats:
    """Differences of what neighbouring models have in common, after minus before.

    Returns (t, 3), metres along the strip, to its left and up, of every pass point of every junction, or of everything
        common to two independent models; NaN where its rays were left out.
    """
    formed = strip.of_photos.formed if strip.model_stages is None else strip.of_models.formed
    common = formed.junctions if isinstance(formed, FormedStrip) else formed.links.shared
    gap = formed.model_xyz[common.after] - formed.model_xyz[common.before]
    similarity = strip.absolute.similarity
    return np.asarray(similarity.scale * gap @ similarity.rotation.T, float)


def junctions_of(result: Result) -> Table:
    """Return the list ``junctions``: the scale transfer at every photo that joins two models."""
    ids = result.refined.observations.point_ids
    return Table.joined("junctions", (_junctions(strip, ids) for strip in result.photo_strips))


def _junctions(strip: StripResult, ids: Sequence[str]) -> Table:
    photos, joined = strip.strip.photos, strip.of_photos.formed.junctions
    count, gap = len(joined.factor), discrepancies(strip)
    known = joined.used & ~np.isnan(gap[:, 0])  # points left out later, for their rays, have no place in the models
    squares = np.column_stack([np.bincount(joined.junction[known], column**2, count) for column in gap[known].T])
    size = np.sqrt(squares / np.maximum(np.bincount(joined.junction[known], minlength=count), 1)[:, None])
    left_out: list[list[str]] = [[] for _ in range(count)]
    for row in np.flatnonzero(~joined.used).tolist():
        left_out[joined.junction[row]].append(ids[joined.point[row]])
    columns = {
        "strip": strip.strip.id,
        "photo": photos[1:-1],
        "points_used": np.bincount(joined.junction, joined.used, count).astype(np.intp),
        "points_rejected": left_out,
        "factor": joined.factor,
        "spread_ppm": joined.spread * PPM,
        **along_the_strip("discrepancy", size),
        **along_the_strip("discrepancy_um", size / strip.scale_number * PPM),
    }
    return Table.of("junctions", columns)


def along_the_strip(name: str, values: Floats) -> dict[str, Floats]:
    """Return columns, or numbers, of values along the strip, across it and up: the last axis of an array."""
    return {f"{name}_{direction}": column for direction, column in zip(DIRECTIONS, values.T, strict=True)}
