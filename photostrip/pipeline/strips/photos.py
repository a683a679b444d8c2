"""A strip of photos: its pairs oriented, its models joined, its rays tested all at once.

It is formed again without the wrong rays.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import GeometryError
from photostrip.geometry.similarity import Similarity
from photostrip.network.strip_rays import StripRays
from photostrip.pipeline.overruling import kept_rows, restored, touched
from photostrip.pipeline.inputs import Settings, Strip
from photostrip.pipeline.results import PhotoStages
from photostrip.points import PhotoPoints
from photostrip.rejection import SEVERAL_RAYS, Rejection
from photostrip.strip import absolute_orientation, pair_screening, ray_intersection
from photostrip.strip.formed_strip import (
    NOTHING_GIVEN,
    FirstPhoto,
    FormedStrip,
    form_from_pairs,
    without_points,
    without_rows,
)
from photostrip.strip.relative_orientation.orientation import (
    Orientation,
    RelativeSettings,
    orient_again,
    orient_unchecked,
    refuse_unusable,
)
from photostrip.strip.relative_orientation.pairs import MINIMUM_POINTS, collect_pairs
from photostrip.strip.scale_transfer import StripFormationSettings
from photostrip.strip.strip_errors import StripErrors, differentiate_strip


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
    from photostrip.network.strip_rays import wrong_rays

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
    return ray_intersection.bridge(formed, rays.observations, photos, oriented.pairs.focal, good)


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


@dataclass(frozen=True, eq=False)
class FormedPhotos:
    """A strip of photos before it meets its control."""

    strip: Strip
    observations: PhotoPoints  # ideal image coordinates of the whole project
    sigma: float  # median standard deviation of the strip's image coordinates, mm
    screened: pair_screening.ScreenedPairs  # the search for gross errors in its pairs
    formed: FormedStrip
    wrong_rays: tuple[Rejection, ...]  # rays that the others of their points contradict
    rays_tested: bool = True  # whether those rays could be searched for

    @property
    def orientation(self) -> Orientation:
        """Relative orientation of the pairs, as the strip was formed."""
        return self.screened.orientation

    @property
    def point_ids(self) -> tuple[str, ...]:
        return self.observations.point_ids

    @property
    def point_precision(self) -> absolute_orientation.PointPrecision:
        """A-priori standard deviation of a point of one model, in the unit of the strip.

        Plan: that of an image coordinate at photo scale; height: that of an x parallax times the ratio of depth to
        base.
        """
        formed, pairs = self.formed, self.orientation.pairs
        arm = formed.model_xyz - formed.centers[pairs.pair]
        base = np.diff(formed.centers, axis=0)[pairs.pair]
        length = np.linalg.norm(base, axis=1)
        depth = np.linalg.norm(np.cross(arm, base), axis=1) / length
        good = np.isfinite(depth)
        depth_mean = float(depth[good].mean())
        plan = self.sigma * depth_mean / pairs.focal
        return absolute_orientation.PointPrecision(
            plan, plan * float(np.sqrt(2.0)) * depth_mean / float(length[good].mean())
        )

    @property
    def excess(self) -> float:
        """Variance of an image coordinate over what is stated, at least 1: as large as the pairs have proved."""
        return max(1.0, float(np.median(self.screened.scatter.by_pair)) ** 2 / (2 * self.sigma**2))

    def errors(self, similarity: Similarity) -> StripErrors:
        """Differentiate the strip after a similarity by its image coordinates, and by the doubts about its scales.

        They count in stated standard deviations: covariances are those of the strip when multiplied by ``excess``.
        """
        errors = differentiate_strip(self.orientation, self.formed, similarity, self.observations.sigma)
        return errors.with_doubt(self.formed.junctions.doubt / np.sqrt(self.excess))

    def as_left_by(self, stages: PhotoStages) -> FormedPhotos:
        """Form nothing again: the strip without the wrong images of control that an adjustment found in it."""
        return replace(self, formed=stages.formed, wrong_rays=stages.wrong_rays)

    def without_images(self, wrong: Mapping[str, Rejection]) -> FormedPhotos:
        o, photo = self.observations, self.strip.positions(self.observations)
        points, rays = [], []
        for name, each in wrong.items():
            points.append(o.point_ids.index(name))
            (row,) = np.flatnonzero((o.point == points[-1]) & (photo == each.other))
            rays.append(replace(each, row=int(row)))
        return replace(
            self,
            formed=without_points(self.formed, self.orientation, np.array(points, np.intp)),
            wrong_rays=(*self.wrong_rays, *rays),
        )

    @cached_property
    def rays_in_use(self) -> Numbers:
        """Rows of image points that are used in a model or place a point without one, in the order of the photos."""
        oriented, formed = self.orientation, self.formed
        in_models = oriented.rows[oriented.used & np.isfinite(formed.model_xyz).all(axis=1)]
        rows = np.unique(np.append(in_models, formed.bridging))
        return rows[np.argsort(self.strip.positions(self.observations)[rows], kind="stable")]


def screened_pairs(
    strip: Strip, observations: PhotoPoints, settings: RelativeSettings
) -> tuple[pair_screening.ScreenedPairs, Floats]:
    """Orient pairs, those among them that cannot be used, without what is wrong in them; and their weights before."""
    pairs = collect_pairs(observations, strip.photos, strip.camera.principal_distance)
    pairs = pairs.without(touched(settings.drop, observations, pairs.rows))
    first, converged = orient_unchecked(pairs)
    screened = pair_screening.screen_pairs(first, settings, strip.median_sigma(observations), converged)
    kept = touched(settings.keep, observations, pairs.rows)
    return restored(screened, pairs.weight, kept), pairs.weight


def form_strip(strip: Strip, observations: PhotoPoints, settings: Settings) -> FormedPhotos:
    """Form a strip from its pairs, without any control."""
    sigma = strip.median_sigma(observations)
    screened, weight = screened_pairs(strip, observations, settings.relative)
    # a fresh value: the rays that it finds, 48 bytes for each of its rows, go with it, what is kept of the stages stays
    oriented, scatter = replace(screened.orientation), screened.scatter.by_pair
    refuse_unusable(oriented, screened.converged, strip.photos)
    wrong: tuple[Rejection, ...] = ()
    tested = True
    given = settings.formation.scale_weights
    point_weight = np.array([given.get(name, 1.0) for name in observations.point_ids]) if given else None
    if settings.relative.screening == "none":
        formed = form_from_pairs(
            oriented, settings.formation, strip.photos, scatter, first=strip.first, point_weight=point_weight
        )
    else:  # the strip decides what its pairs could not
        rays = StripRays(
            observations=observations,
            position=strip.positions(observations),
            sigma=scatter,
            weight=weight,
            stated=sigma,
            kept=kept_rows(settings.relative.keep, observations),
        )
        readmit = settings.relative.screening in pair_screening.SEARCHES
        oriented, formed, wrong, tested = form_screened(
            oriented,
            rays,
            strip.photos,
            settings.formation,
            readmit=readmit,
            first=strip.first,
            point_weight=point_weight,
        )
        rejections = with_readmitted(screened.rejections, oriented.used)
        # as a fresh value: the rays of the old one, 48 bytes for each of its rows, are not needed again
        screened = replace(screened, orientation=replace(oriented), rejections=rejections)
    return FormedPhotos(
        strip=strip,
        observations=observations,
        sigma=sigma,
        screened=screened,
        formed=formed,
        wrong_rays=wrong,
        rays_tested=tested,
    )
