"""Points of all strips together: the mean where strips share a point, and their differences there.

Points that were measured and have no coordinates.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.pipeline.precision import MOST_PHOTOS, joined_precision, precision_of_photos, too_long
from photostrip.pipeline.inputs import Inputs, Settings
from photostrip.pipeline.results import Adjusted, AdjustedStrips, StripResult, Ties
from photostrip.pipeline.strips.absolute import ScreenedPhotos
from photostrip.pipeline.strips.notes import precision_of_long_strip
from photostrip.plausibility.ids import TiesOfStrips
from photostrip.points import ControlPoints, PhotoPoints


def join_photos(
    strips: tuple[StripResult, ...],
    screened: Sequence[ScreenedPhotos],
    observations: PhotoPoints,
    given: ControlPoints,
    output: GroundFrame,
    settings: Settings,
    *,
    of_checks: bool,
) -> AdjustedStrips:
    """Join strips of photos that were adjusted each by itself, with their precision.

    screened: the same strips before their deformation was corrected.
    given: all given points, check points too.
    of_checks: whether the precision of check points alone is wanted.
    """
    joined = join_strips(strips, observations, output)
    long_strips = [strip for strip in strips if too_long(strip) and not of_checks]
    if long_strips or not settings.precision:
        notes = (precision_of_long_strip(strip.of_photos.strip, MOST_PHOTOS) for strip in long_strips)
        return replace(joined, notes=(*notes, *joined.notes)) if settings.precision else joined
    each = [
        precision_of_photos(strip, before.photos, observations, given, of_checks=of_checks)
        for strip, before in zip(strips, screened, strict=True)
    ]
    return replace(joined, precision=joined_precision(each, strips, joined.points))


def join_strips(strips: tuple[StripResult, ...], observations: PhotoPoints, output: GroundFrame) -> AdjustedStrips:
    """Join strips that were adjusted each by itself."""
    return AdjustedStrips(
        strips=strips,
        points=_joined(strips, observations.point_ids, output),
        ties=_ties(strips, output),
        observations=observations,
        precision=None,
        notes=tuple(note for strip in strips for note in strip.notes),
    )


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
            sigma=float(np.hypot(one.precision.plan, other.precision.plan)),
            depth=min(one.depth, other.depth),
            strips=(one.strip.id, other.strip.id),
        )


def _joined(strips: Sequence[StripResult], point_ids: Sequence[str], output: GroundFrame) -> Adjusted:
    number, xyz = mean_points(strips)
    rays = np.zeros(len(number), np.intp)
    for strip in strips:
        rays[np.searchsorted(number, strip.formed.point)] += strip.rays
    return in_output(number, xyz, rays, point_ids, output)


def in_output(
    number: Numbers, cartesian: Floats, rays: Numbers, point_ids: Sequence[str], output: GroundFrame
) -> Adjusted:
    """Give adjusted points their coordinates in the output frame; number (n,) counts in ``point_ids``."""
    ground = output.ground_from_cartesian(cartesian, ids=[point_ids[n] for n in number])
    return Adjusted(number=number, cartesian=cartesian, ground=ground, rays=rays)


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


def not_determined(
    observations: PhotoPoints, points: Adjusted, inputs: Inputs, strips: Sequence[StripResult]
) -> dict[str, str]:
    """Points that were measured and have no coordinates, with the reason."""
    done = np.zeros(len(observations.point_ids), bool)
    done[points.number] = True
    if inputs.models is not None:
        why = "coordinates in the models contradict each other, or were left out"
        return {observations.point_ids[number]: why for number in np.flatnonzero(~done).tolist()}
    placed = {photo: (n, k) for n, strip in enumerate(inputs.strips) for k, photo in enumerate(strip.photos)}
    wrong = [each for strip in strips for each in strip.of_photos.wrong_rays]
    contradicted = {int(observations.point[each.row]): each.kind == "control" for each in wrong}
    on_photos: dict[int, list[tuple[int, int]]] = {}
    for row in np.flatnonzero(~done[observations.point]):
        photo = observations.photo_ids[observations.photo[row]]
        if photo in placed:
            on_photos.setdefault(int(observations.point[row]), []).append(placed[photo])
    return {
        observations.point_ids[point]: _reason(places, by_control=contradicted.get(point))
        for point, places in sorted(on_photos.items())
    }


def _reason(places: list[tuple[int, int]], *, by_control: bool | None) -> str:
    """Put it in words; by_control: whether its given coordinates contradict a ray, None where nothing does."""
    if len(places) == 1:
        return "measured on one photo only"
    if by_control is not None:
        return "its given coordinates contradict one of its two rays" if by_control else "rays contradict each other"
    neighbours = any((n, k + 1) in places for n, k in places)
    return "rejected in every pair" if neighbours else "not on two neighbouring photos of one strip"
