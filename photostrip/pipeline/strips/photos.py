"""A strip of photos: its pairs oriented, its models joined, its photos oriented on the adjusted points."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from photostrip.arrays import Floats, Numbers, distinct, median, pieces, quantile
from photostrip.errors import GeometryError, InputError
from photostrip.geometry.similarity import Similarity
from photostrip.network.gross_errors.strip_rays import StripRays
from photostrip.pipeline import overruling
from photostrip.pipeline.inputs import Settings, Strip
from photostrip.pipeline.results import PhotoStages, StripResult
from photostrip.pipeline.strips import notes
from photostrip.pipeline.strips.absolute import OrientedStrip, ScreenedStrip
from photostrip.pipeline.strips.screened_formation import form_screened, with_readmitted
from photostrip.pipeline.strips.stages import Stages
from photostrip.points import PhotoPoints
from photostrip.rejection import Rejection
from photostrip.strip.error_propagation import strip_errors
from photostrip.strip.error_propagation.strip_at_control import ControlRay
from photostrip.strip.gross_errors.pairs import screening
from photostrip.strip.polynomial.correction import Polynomial
from photostrip.strip.relative_orientation.orientation import (
    Orientation,
    RelativeSettings,
    orient_unchecked,
    refuse_unusable,
)
from photostrip.strip.relative_orientation.pairs import collect_pairs
from photostrip.strip.resection.resection import Resection, resect
from photostrip.strip.strip_formation.strip import FormedStrip, form_from_pairs, without_points

Oriented = OrientedStrip[strip_errors.StripErrors]
WithControlScreened = ScreenedStrip[strip_errors.StripErrors]


@dataclass(frozen=True, eq=False)
class FormedPhotos:
    """A strip of photos before it meets its control, a ``StripStage``."""

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

    def point_precision(self, scale: float) -> tuple[float, float]:
        """A-priori standard deviation of a point of one model in plan and height, metres.

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
        plan = self.sigma * depth_mean / pairs.focal * scale
        return plan, plan * float(np.sqrt(2.0)) * depth_mean / float(length[good].mean())

    def extent(self, similarity: Similarity) -> tuple[float, float]:
        centers, xyz = similarity(self.formed.centers), similarity(self.formed.xyz)
        spacing = float(np.linalg.norm(np.diff(centers, axis=0), axis=1).mean())
        return spacing, max(quantile(np.abs(xyz[:, 1]), 0.95), 1e-6)

    def differentiate(self, similarity: Similarity) -> strip_errors.StripErrors:
        return strip_errors.differentiate_strip(self.orientation, self.formed, similarity, self.observations.sigma)

    def misclosure_covariance(self, oriented: Oriented) -> Callable[[Numbers], Floats]:
        # image coordinates are taken as good as stated, or as bad as the pairs have proved
        factor = max(1.0, median(self.screened.scatter.by_pair) ** 2 / (2 * self.sigma**2))
        errors = oriented.errors.with_doubt(self.formed.junctions.doubt / np.sqrt(factor))

        def of(some: Numbers) -> Floats:
            found = oriented.misclosures.take(some)
            along = errors.along(found.row, found.direction)
            first, _ = errors.frames(along)  # the test does not depend on what moves the whole section
            return errors.joint_covariance(along, first) * factor + np.diag(found.variance)

        return of

    def control_rays(self, oriented: Oriented) -> list[ControlRay]:
        rows = self._rays_in_use
        point = np.searchsorted(self.formed.point, self.observations.point[rows])
        order = np.argsort(point, kind="stable")
        low = np.searchsorted(point[order], oriented.control_rows)
        twice = np.flatnonzero(np.bincount(point, minlength=len(self.formed.point))[oriented.control_rows] == 2)
        both = self.strip.positions(self.observations)[rows[order[low[twice, None] + np.arange(2)]]]
        ray = self.formed.xyz[oriented.control_rows[twice], None] - self.formed.centers[both]
        ray /= np.linalg.norm(ray, axis=2)[:, :, None]
        return [
            ControlRay(row, other, along)
            for row, others, directions in zip(twice.tolist(), both[:, ::-1].tolist(), ray, strict=True)
            for other, along in zip(others, directions, strict=True)
        ]

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

    def screens_control(self, settings: Settings) -> bool:
        return settings.relative.screening != "none"

    def turned_over(self, refusal: InputError) -> FormedPhotos:
        """Cameras look down: there is no other way up."""
        raise refusal

    def refuse_other_hand(self, oriented: Oriented) -> None:
        """Photos have no other hand."""

    def adjusted(self, screened: WithControlScreened, correction: Polynomial | None, settings: Settings) -> StripResult:
        """Adjust the points, and orient every photo on them."""
        oriented, strip, formed = screened.oriented, self.strip, self.formed
        xyz = oriented.xyz if correction is None else correction(oriented.xyz)
        rows = self._rays_in_use
        photo = strip.positions(self.observations)[rows]
        points = np.searchsorted(formed.point, self.observations.point[rows])
        resection = self._resected(oriented, photo, points, xyz)
        return StripResult(
            precision=oriented.precision,
            intermediate=oriented.intermediate,
            control=oriented.control,
            control_rows=oriented.control_rows,
            absolute=oriented.absolute,
            polynomial=correction,
            xyz=xyz,
            cartesian=oriented.intermediate.cartesian_from_intermediate(xyz),
            rays=np.bincount(points, minlength=len(formed.point)),
            depth=_mean_depth(xyz, points, photo, resection),
            notes=(
                *overruling.notes(settings.relative, strip.id, strip.photos),
                *notes.screening_notes(strip, self.screened, self.sigma),
                *([] if self.rays_tested else [notes.rays_not_tested(strip)]),
                *notes.wrong_control_notes(strip, screened.screened_control),
                *notes.wrong_image_notes(strip, self.observations, self.wrong_rays),
                *notes.pair_notes(strip, self.orientation),
                *notes.junction_notes(strip, formed),
                *notes.control_notes(strip, oriented.absolute),
                *notes.polynomial_notes(strip, correction, xyz),
                *([] if correction is None else notes.network_proposal(strip, correction)),
                *notes.photo_notes(strip, resection),
            ),
            screened_control=screened.screened_control,
            shared=screened.shared,
            photo_stages=PhotoStages(
                strip=strip,
                sigma=self.sigma,
                screened=self.screened,
                formed=formed,
                wrong_rays=self.wrong_rays,
                resection=resection,
                rows=rows,
            ),
        )

    @cached_property
    def _rays_in_use(self) -> Numbers:
        """Rows of image points that are used in a model or place a point without one, in the order of the photos."""
        oriented, formed = self.orientation, self.formed
        in_models = oriented.rows[oriented.used & np.isfinite(formed.model_xyz).all(axis=1)]
        rows = distinct(np.append(in_models, formed.bridging))
        return rows[np.argsort(self.strip.positions(self.observations)[rows], kind="stable")]

    def _resected(self, oriented: Oriented, photo: Numbers, points: Numbers, adjusted: Floats) -> Resection:
        """Orient every photo on its adjusted points, so that orientations and points belong together."""
        strip, formed, similarity = self.strip, self.formed, oriented.absolute.similarity
        # A polynomial can move a long strip by much: a photo starts where its points went, on the average.
        shift = _mean_shifts(adjusted - similarity(formed.xyz), points, photo, len(strip.photos))
        centers = similarity(formed.centers) + shift
        start = strip.oriented(centers, similarity.rotation @ formed.rotations)
        resection = resect(self.observations.xy[self._rays_in_use], adjusted[points], photo, start)
        if not resection.solved.any():
            msg = (
                f"strip {strip.id}: no photo can be oriented on its adjusted points: strip and control do not "
                "belong together"
            )
            raise GeometryError(msg, photos=strip.photos, code="no-photo-oriented")
        return resection


def _mean_shifts(moved: Floats, points: Numbers, photo: Numbers, photos: int) -> Floats:
    """Mean shifts (photos, 3) of the points on each photo, 0 where it has none; moved: (q, 3), shifts of points."""
    count = np.maximum(np.bincount(photo, minlength=photos), 1)
    return np.column_stack([np.bincount(photo, moved[points, axis], photos) / count for axis in range(3)])


def _mean_depth(xyz: Floats, points: Numbers, photo: Numbers, resection: Resection) -> float:
    """Mean depth of points below the photos, metres; points, photo: (m,), of each image point."""
    axes, depth = resection.rotations[:, :, 2], np.empty(len(photo))
    for rows in pieces(len(photo)):  # all at once take 100 bytes an image point
        some = photo[rows]
        depth[rows] = ((xyz[points[rows]] - resection.centers[some]) * axes[some]).sum(axis=1)
    return float(-depth.mean())


def screened_pairs(
    strip: Strip, observations: PhotoPoints, settings: RelativeSettings, stages: Stages | None = None
) -> tuple[screening.ScreenedPairs, Floats]:
    """Orient pairs, those among them that cannot be used, without what is wrong in them; and their weights before."""

    def make() -> tuple[screening.ScreenedPairs, Floats]:
        pairs = collect_pairs(observations, strip.photos, strip.camera.principal_distance)
        pairs = pairs.without(overruling.touched(settings.drop, observations, pairs.rows))
        first, converged = orient_unchecked(pairs)
        screened = screening.screen_pairs(first, settings, strip.median_sigma(observations), converged)
        kept = overruling.touched(settings.keep, observations, pairs.rows)
        return overruling.restored(screened, pairs.weight, kept), pairs.weight

    return make() if stages is None else stages.once("pairs", make, strip, observations, settings)


def form_strip(
    strip: Strip, observations: PhotoPoints, settings: Settings, stages: Stages | None = None
) -> FormedPhotos:
    """Form a strip from its pairs, without any control."""
    sigma = strip.median_sigma(observations)
    screened, weight = screened_pairs(strip, observations, settings.relative, stages)
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
