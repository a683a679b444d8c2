"""A strip formed, its rays tested all at once, and formed again without the wrong ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats
from photostrip.errors import GeometryError
from photostrip.network.gross_errors.strip_rays import StripRays
from photostrip.rejection import SEVERAL_RAYS, Rejection
from photostrip.strip.relative_orientation.orientation import Orientation, orient_again
from photostrip.strip.relative_orientation.pairs import MINIMUM_POINTS
from photostrip.strip.strip_formation import non_neighbours
from photostrip.strip.strip_formation.scale_transfer import StripFormationSettings
from photostrip.strip.strip_formation.strip import (
    NOTHING_GIVEN,
    FirstPhoto,
    FormedStrip,
    form_from_pairs,
    without_rows,
)


class ScreenedFormation(NamedTuple):
    """A strip without what its rays contradict."""

    orientation: Orientation
    formed: FormedStrip
    rejections: tuple[Rejection, ...]  # rays that must not be used, rows of the observations
    tested: bool = True  # False where the rays that were left could not be adjusted together


def form_screened(
    of_pairs: Orientation,
    rays: StripRays,
    photos: Sequence[str],
    settings: StripFormationSettings,
    *,
    readmit: bool,
    first: FirstPhoto = NOTHING_GIVEN,
    point_weight: Floats | None = None,
) -> ScreenedFormation:
    """Form a strip, leave out what its rays contradict, take back what they confirm, and form it again.

    Where pairs and junctions had nothing to reject, nothing is looked for.

    readmit: whether points that a pair rejected may be taken back.
    first, point_weight: as in ``form_from_pairs``.
    """
    formed = form_from_pairs(of_pairs, settings, photos, rays.sigma, first=first, point_weight=point_weight)
    if of_pairs.used.all() and formed.junctions.used.all():
        return ScreenedFormation(of_pairs, formed, ())
    from photostrip.network.gross_errors.strip_network import wrong_rays  # needs the bundle adjustment

    found = wrong_rays(of_pairs, formed, rays)
    if found is None:
        return ScreenedFormation(of_pairs, formed, (), tested=False)
    used, aside = _uses(of_pairs, found, readmit=readmit)
    changed = np.unique(of_pairs.pairs.pair[used != of_pairs.used])
    oriented = orient_again(of_pairs, np.where(used, rays.weight, 0.0), changed) if len(changed) else of_pairs
    try:
        formed = form_from_pairs(
            oriented, settings, photos, rays.sigma, aside, searched=True, first=first, point_weight=point_weight
        )
    except GeometryError:
        oriented = of_pairs  # nothing would join two models: what joined them before stays
    formed = without_rows(formed, oriented, aside)
    return ScreenedFormation(oriented, _bridged(formed, oriented, rays, photos, found), found)


def _bridged(
    formed: FormedStrip, oriented: Orientation, rays: StripRays, photos: Sequence[str], found: Sequence[Rejection]
) -> FormedStrip:
    """Add the points whose good rays come from photos that are no neighbours."""
    rows = oriented.rows[~np.isin(oriented.point, formed.point)]
    good = np.unique(rows[~np.isin(rows, np.array([each.row for each in found], np.intp))])
    if not len(good):
        return formed
    return non_neighbours.bridge(formed, rays.observations, photos, oriented.pairs.focal, good)


def _uses(of_pairs: Orientation, found: Sequence[Rejection], *, readmit: bool) -> tuple[Flags, Flags]:
    """Rows of the pairs' table that orient their pair, and those of them that must not place their point.

    Where it cannot be told which of several rays is wrong, those pairs that found nothing wrong keep the point: its
    y parallaxes are good, its place is not. Pairs that would have fewer than five points keep those of their own
    search; the strip has redundancy where a pair of five has none.
    """
    wrong, unclear = np.zeros((2, int(of_pairs.rows.max()) + 1), bool)
    wrong[[each.row for each in found]] = True
    unclear[[each.row for each in found if each.cause == SEVERAL_RAYS]] = True
    gone, aside = (np.asarray(each[of_pairs.rows].any(axis=1), bool) for each in (wrong, unclear))
    used = np.where(aside | (not readmit), of_pairs.used & (aside | ~gone), ~gone)
    pairs = of_pairs.pairs
    left, had = (pairs.sums(each.astype(float)) for each in (used, of_pairs.used))
    poor = (left < np.minimum(MINIMUM_POINTS, had))[pairs.pair]
    return np.where(poor, of_pairs.used, used), aside


def with_readmitted(rejections: Sequence[Rejection], used: Flags) -> tuple[Rejection, ...]:
    """Mark the rejections of pairs that the strip took back; ``used`` (m,) are the rows used in the end."""
    return tuple(replace(each, readmitted=bool(used[each.row])) for each in rejections)
