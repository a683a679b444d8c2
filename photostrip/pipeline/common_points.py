"""Points of all strips together: the mean where strips share a point, and their differences there."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.notes import Note
from photostrip.pipeline.inputs import Settings
from photostrip.pipeline.precision import photo_precision, strip_precision
from photostrip.pipeline.results import Adjusted, AdjustedStrips, StripResult, Ties
from photostrip.pipeline.strips.absolute import OrientedStrip, ScreenedStrip
from photostrip.pipeline.strips.notes import precision_of_long_strip
from photostrip.plausibility.photos.tied_strips import TiesOfStrips
from photostrip.points import ControlPoints, PhotoPoints


def join_strips(
    strips: tuple[StripResult, ...],
    screened: Sequence[ScreenedStrip[Any]],
    observations: PhotoPoints,
    given: ControlPoints,
    output: GroundFrame,
    settings: Settings,
    *,
    of_checks: bool,
) -> AdjustedStrips:
    """Join strips that were adjusted each by itself.

    screened: the same strips before their deformation was corrected.
    given: all given points, check points too.
    of_checks: whether the precision of check points alone is wanted.
    """
    points = _joined(strips, observations.point_ids, output)
    each: list[strip_precision.StripPrecision] = []
    notes: list[Note] = []
    too_long = [strip for strip in strips if photo_precision.too_long(strip) and not of_checks]
    if settings.precision and too_long:
        notes += [precision_of_long_strip(strip.of_photos.strip, photo_precision.MOST_PHOTOS) for strip in too_long]
    elif settings.precision:
        each = [
            _precision_of(strip, before.oriented, observations, given, of_checks=of_checks)
            for strip, before in zip(strips, screened, strict=True)
        ]
    precision = strip_precision.joined(each, strips, points) if each else None
    return AdjustedStrips(
        strips=strips,
        points=points,
        ties=_ties(strips, output),
        observations=observations,
        precision=precision,
        notes=(*notes, *(note for strip in strips for note in strip.notes)),
    )


def _precision_of(
    strip: StripResult,
    oriented: OrientedStrip[Any],
    observations: PhotoPoints,
    given: ControlPoints,
    *,
    of_checks: bool,
) -> strip_precision.StripPrecision:
    if strip.photo_stages is not None:
        return photo_precision.of_photos(strip, oriented, observations, given, of_checks=of_checks)
    from photostrip.pipeline.precision import model_precision  # strips of photos need none of it

    return model_precision.of_models(strip, oriented, observations, given)


class StripMeans(NamedTuple):
    """Points of several strips."""

    number: Numbers  # (n,): as numbered in the observations, ascending
    xyz: Floats  # (n, 3): mean over the strips that hold them, Cartesian frame, metres


def mean_points(strips: Sequence[StripResult], strangers: Mapping[str, AbstractSet[int]] | None = None) -> StripMeans:
    """Mean of every point over the strips that hold it.

    strangers: points by strip that do not count there.
    """
    if len(strips) == 1 and not strangers:  # no copy of the points
        return StripMeans(strips[0].formed.point, strips[0].cartesian)
    none: AbstractSet[int] = frozenset()
    held = [~np.isin(each.formed.point, list((strangers or {}).get(each.strip.id, none))) for each in strips]
    point = np.concatenate([strip.formed.point[rows] for strip, rows in zip(strips, held, strict=True)])
    cartesian = np.concatenate([strip.cartesian[rows] for strip, rows in zip(strips, held, strict=True)])
    number, inverse = np.unique(point, return_inverse=True)
    sums = np.column_stack([np.bincount(inverse, column) for column in cartesian.T])
    return StripMeans(number, np.asarray(sums / np.bincount(inverse)[:, None], float))


def compared_strips(strips: Sequence[StripResult], point_ids: Sequence[str]) -> Iterator[TiesOfStrips]:
    """Compare strips two and two at their common points, before anything joins them."""
    for one, other in combinations(strips, 2):
        number, at_one, at_other = np.intersect1d(one.formed.point, other.formed.point, return_indices=True)
        frame = one.intermediate
        first, second = (
            frame.intermediate_from_cartesian(strip.cartesian[rows])
            for strip, rows in ((one, at_one), (other, at_other))
        )
        yield TiesOfStrips(
            points=number,
            names=tuple(point_ids[each] for each in number.tolist()),
            plan=first[:, :2],
            difference=(second - first)[:, :2],
            rays=np.minimum(one.rays[at_one], other.rays[at_other]),
            sigma=float(np.hypot(one.precision[0], other.precision[0])),
            depth=min(one.depth, other.depth),
            strips=(one.strip.id, other.strip.id),
        )


def _joined(strips: Sequence[StripResult], point_ids: Sequence[str], output: GroundFrame) -> Adjusted:
    number, xyz = mean_points(strips)
    rays = np.zeros(len(number), np.intp)
    for strip in strips:
        rays[np.searchsorted(number, strip.formed.point)] += strip.rays
    ids = [point_ids[n] for n in number]
    return Adjusted(number=number, cartesian=xyz, ground=output.ground_from_cartesian(xyz, ids=ids), rays=rays)


def _ties(strips: Sequence[StripResult], output: GroundFrame) -> Ties:
    if len(strips) == 1:
        return Ties(np.zeros(0, np.intp), np.zeros((0, 2), np.intp), np.zeros((0, 3)))
    strip = np.concatenate([np.full(len(each.formed.point), number) for number, each in enumerate(strips)])
    point = np.concatenate([each.formed.point for each in strips])
    cartesian = np.concatenate([each.cartesian for each in strips])
    order = np.lexsort((strip, point))
    strip, point, cartesian = strip[order], point[order], cartesian[order]
    second = np.flatnonzero(point[1:] == point[:-1]) + 1
    difference = cartesian[second] - cartesian[second - 1]
    if len(second):
        difference = np.einsum("nij,nj->ni", output.axes_at(cartesian[second]), difference)
    return Ties(point[second], np.column_stack([strip[second - 1], strip[second]]), difference)
