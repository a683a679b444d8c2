"""A strip of photos: its pairs oriented, its models joined."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.geometry.similarity import Similarity
from photostrip.network.gross_errors.strip_rays import StripRays
from photostrip.pipeline import overruling
from photostrip.pipeline.inputs import Settings, Strip
from photostrip.pipeline.results import PhotoStages
from photostrip.pipeline.strips.screened_formation import form_screened, with_readmitted
from photostrip.points import PhotoPoints
from photostrip.rejection import Rejection
from photostrip.strip import absolute_orientation
from photostrip.strip.error_propagation.strip_errors import StripErrors, differentiate_strip
from photostrip.strip.gross_errors.pairs import screening
from photostrip.strip.relative_orientation.orientation import (
    Orientation,
    RelativeSettings,
    orient_unchecked,
    refuse_unusable,
)
from photostrip.strip.relative_orientation.pairs import collect_pairs
from photostrip.strip.strip_formation.strip import FormedStrip, form_from_pairs, without_points


@dataclass(frozen=True, eq=False)
class FormedPhotos:
    """A strip of photos before it meets its control."""

    strip: Strip
    observations: PhotoPoints  # ideal image coordinates of the whole project
    sigma: float  # median standard deviation of the strip's image coordinates, mm
    screened: screening.ScreenedPairs  # the search for gross errors in its pairs
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
) -> tuple[screening.ScreenedPairs, Floats]:
    """Orient pairs, those among them that cannot be used, without what is wrong in them; and their weights before."""
    pairs = collect_pairs(observations, strip.photos, strip.camera.principal_distance)
    pairs = pairs.without(overruling.touched(settings.drop, observations, pairs.rows))
    first, converged = orient_unchecked(pairs)
    screened = screening.screen_pairs(first, settings, strip.median_sigma(observations), converged)
    kept = overruling.touched(settings.keep, observations, pairs.rows)
    return overruling.restored(screened, pairs.weight, kept), pairs.weight


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
            kept=overruling.rows(settings.relative.keep, observations),
        )
        readmit = settings.relative.screening in screening.SEARCHES
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
