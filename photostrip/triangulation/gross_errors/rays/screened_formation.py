"""The strip formed, tested and formed again, until what is left out no longer changes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.errors import GeometryError
from photostrip.triangulation.gross_errors.pairs.zones import MINIMUM_LEFT
from photostrip.triangulation.gross_errors.rays import strip_screening
from photostrip.triangulation.gross_errors.rays.strip_screening import (
    SEVERAL_RAYS,
    MeasuredStrip,
    RayRejections,
    StripRays,
)
from photostrip.triangulation.relative_orientation.orientation import orient_again
from photostrip.triangulation.strip_formation import non_neighbours
from photostrip.triangulation.strip_formation.strip import form_from_pairs, without_rows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from photostrip.arrays import Flags, Floats, Numbers
    from photostrip.points import PhotoPoints
    from photostrip.triangulation.gross_errors.pairs.screening import PairRejection
    from photostrip.triangulation.relative_orientation.orientation import Orientation
    from photostrip.triangulation.strip_formation.scale_transfer import StripFormationSettings
    from photostrip.triangulation.strip_formation.strip import FormedStrip


MOST_FORMATIONS = 4  # most of the strips end with the second
NOTICEABLE_CHANGE = 5e-4  # rad, and relative: the second order of such a change is 0.04 µm on a photo of 150 mm


@dataclass(frozen=True, eq=False)
class Measurements:
    """What a strip is formed from, beside its oriented pairs."""

    observations: PhotoPoints
    photos: Sequence[str]
    weight: Floats  # (m,): weights of the pairs' rows before anything was rejected
    sigma: Floats  # (p,): standard deviations of a y parallax of weight one in each pair, mm
    stated: float  # stated standard deviation of an image coordinate, mm
    kept: Numbers  # rows of the observations that the user keeps


def form_screened(
    oriented: Orientation, measured: Measurements, settings: StripFormationSettings, *, readmit: bool
) -> tuple[Orientation, FormedStrip, RayRejections]:
    """Form a strip, leave out what its points contradict, take back what they confirm, and form it again.

    ``readmit``: whether points that a pair rejected may be taken back. Gives the pairs with what the strip decided, the
    strip without the points that have no ray left, and the rays; a GeometryError when a junction is broken.
    """
    of_pairs = oriented
    layout = StripRays.of(oriented, measured.observations, measured.photos)
    suspected = np.zeros(0, np.intp)
    verdict: RayRejections | None = None
    aside = np.zeros(len(oriented.point), bool)
    moved: Flags | None = None
    formed = form_from_pairs(oriented, settings, measured.photos, measured.sigma)
    for _ in range(MOST_FORMATIONS):
        scene = MeasuredStrip(oriented, formed, measured.observations, layout, measured.sigma, measured.stated)
        suspected = np.union1d(suspected, strip_screening.suspects(scene)).astype(np.intp)
        verdict = strip_screening.screen_rays(scene, suspected, measured.kept, verdict, moved)
        used, outside = _uses(of_pairs, verdict, readmit=readmit)
        if (used == oriented.used).all() and (outside == aside).all():
            break
        before = oriented, formed
        try:
            oriented, formed = _formed_again(before, used, (aside, outside), measured, settings)
        except GeometryError:
            break  # nothing would join two models: what joined them before stays
        aside, moved = outside, _moved(before, (oriented, formed))
    formed, verdict = without_rows(formed, oriented, aside), verdict or RayRejections()
    return oriented, _bridged(formed, oriented, measured, verdict), verdict


def _formed_again(
    before: tuple[Orientation, FormedStrip],
    used: Flags,
    asides: tuple[Flags, Flags],
    measured: Measurements,
    settings: StripFormationSettings,
) -> tuple[Orientation, FormedStrip]:
    """Orient the pairs whose points changed, and form the strip from there."""
    oriented, formed = before
    aside, outside = asides
    pair = oriented.pairs.pair
    changed = np.unique(pair[used != oriented.used])
    touched = np.zeros(oriented.pairs.size, bool)
    touched[changed] = touched[pair[aside != outside]] = True
    if len(changed):
        oriented = orient_again(oriented, np.where(used, measured.weight, 0.0), changed)
    earlier = formed, touched
    return oriented, form_from_pairs(oriented, settings, measured.photos, measured.sigma, outside, earlier)


def _moved(before: tuple[Orientation, FormedStrip], after: tuple[Orientation, FormedStrip]) -> Flags:
    """Find the models that have been turned or stretched noticeably."""
    (old, formed), (new, again) = before, after
    turned: Flags = np.asarray(np.abs(new.elements - old.elements).max(axis=1) > NOTICEABLE_CHANGE, bool)
    stretched = np.abs(again.junctions.factor / formed.junctions.factor - 1) > NOTICEABLE_CHANGE
    return np.asarray(turned | np.append(stretched, False) | np.append(False, stretched), bool)


def _bridged(formed: FormedStrip, oriented: Orientation, measured: Measurements, verdict: RayRejections) -> FormedStrip:
    """Add the points whose good rays come from photos that are no neighbours."""
    placed = np.zeros(len(measured.observations.point_ids), bool)
    placed[formed.point] = True
    gone = verdict.tested[~placed[verdict.tested]]
    if not len(gone):
        return formed
    missing = np.isin(oriented.point, gone)
    good = np.setdiff1d(oriented.rows[missing], verdict.wrong)
    return non_neighbours.bridge(formed, measured.observations, measured.photos, oriented.pairs.focal, good)


def _uses(of_pairs: Orientation, verdict: RayRejections, *, readmit: bool) -> tuple[Flags, Flags]:
    """Rows of the pairs' table that orient their pair, and those of them that must not place their point.

    Where it cannot be told which of several rays is wrong, those pairs that found nothing wrong keep the point: its
    y parallaxes are good, its place is not.
    """
    if not len(verdict.tested):
        return of_pairs.used, np.zeros(len(of_pairs.point), bool)
    flags = np.zeros(int(of_pairs.point.max()) + 1, bool)
    flags[verdict.tested] = True
    tested = flags[of_pairs.point]
    wrong, unclear = np.zeros((2, int(of_pairs.rows.max()) + 1), bool)
    wrong[verdict.wrong] = True
    several = np.array([kind == SEVERAL_RAYS for kind in verdict.kind], bool)
    unclear[verdict.wrong[several & verdict.across]] = True
    gone, aside = (np.asarray(each[of_pairs.rows].any(axis=1), bool) for each in (wrong, unclear))
    used = np.where(tested, np.where(aside, of_pairs.used, ~gone), of_pairs.used)
    if not readmit:
        used &= of_pairs.used
    return _supported(of_pairs, used), aside


def _supported(of_pairs: Orientation, used: Flags) -> Flags:
    """Let pairs that would lose too many points keep those of their own search."""
    pairs = of_pairs.pairs
    left = pairs.sums(used.astype(float))
    had = pairs.sums(of_pairs.used.astype(float))
    poor = (left < np.minimum(MINIMUM_LEFT, had))[pairs.pair]
    result: Flags = np.where(poor, of_pairs.used, used)
    return result


def with_readmitted(rejections: Sequence[PairRejection], used: Flags) -> tuple[PairRejection, ...]:
    """Mark the rejections of pairs that the strip took back; ``used`` (m,) are the rows used in the end."""
    return tuple(replace(each, readmitted=bool(used[each.row])) for each in rejections)
