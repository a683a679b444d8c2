"""What the gate looks at: strips formed for evidence alone, and given points in the coordinates of strips.

``steps`` everywhere holds, by photo, the centre of the next photo as it lies on that photo, mm.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.camera import Camera
from photostrip.errors import GeometryError, InputError
from photostrip.pipeline.given_points import rows_of_given
from photostrip.pipeline.inputs import Settings, Strip
from photostrip.plausibility.control.straightening import Rays, StripPoints
from photostrip.plausibility.photos import mosaic
from photostrip.points import ControlPoints, PhotoPoints, locate, located
from photostrip.strip.image_coordinates import corrections
from photostrip.strip.relative_orientation.orientation import Orientation, refuse_unusable
from photostrip.strip.strip_formation.strip import FormedStrip, form_from_pairs, mean_points, model_points

MOSAIC_PHOTOS = 10  # of a mosaic that is laid on control: a longer one curls
LONG_STRIP = 40  # photos: a longer one is looked at in stretches
STRETCH_PHOTOS, STRETCHES = 30, 4
BREADTH_SHARE = 0.95  # of the image points lie within the half breadth of a strip
LEAST_OF_PLANE = 4
LEAST_RAYS = 2  # photos that must show a given point
OBLIQUE_DEG = 20.0  # between the cameras and the normal of the ground: more than a tilt, or a slope
MOSAIC_SIGMA = 0.02  # of the flying height: what relief and tilts leave in a mosaic
AT_A_TIME = 256  # given points whose nearest photo is looked for together


@dataclass(frozen=True, eq=False)
class EvidenceStrip:
    """A strip with its oriented pairs, formed by the run or for evidence alone."""

    strip: Strip  # the strip with its photos in the order in which they were formed
    orientation: Orientation
    formed: FormedStrip

    @property
    def up(self) -> Floats:
        """Where the cameras look from, of length one."""
        return _mean_direction(self.formed.rotations[:, :, 2])

    @cached_property
    def axes(self) -> Floats:
        """Upwards at each photo (n, 3): its third axis, or below an oblique mount the normal of the ground for all."""
        axes = self.formed.rotations[:, :, 2]
        points = self.formed.xyz[np.isfinite(self.formed.xyz).all(axis=1)]
        if len(axes) > LONG_STRIP or len(points) < LEAST_OF_PLANE:  # a long strip bends more than it is broad
            return axes
        normal = np.linalg.svd(points - np.median(points, axis=0), full_matrices=False)[2][2]
        looking = float(normal @ self.up)
        is_oblique = abs(looking) < np.cos(np.radians(OBLIQUE_DEG))
        return np.broadcast_to(normal * np.sign(looking), axes.shape) if is_oblique else axes

    @property
    def depth(self) -> Floats:
        """Height of every perspective centre above the points of its models, shape (n,)."""
        up, pair = self.up, self.orientation.pairs.pair
        height = self.formed.model_xyz @ up
        good = np.isfinite(height) & self.orientation.used
        count = np.maximum(np.bincount(pair[good], minlength=self.orientation.pairs.size), 1)
        ground = np.bincount(pair[good], height[good], self.orientation.pairs.size) / count
        centers = self.formed.centers @ up
        return np.concatenate([centers[:1] - ground[:1], centers[1:] - ground])

    @cached_property
    def whole(self) -> EvidenceStrip:
        """The strip with the points that it has no place for, because their rays contradict each other.

        Such a point stands in the middle of where its models put it.
        """
        strip, orientation = self.formed, self.orientation
        gone = np.asarray(~np.isfinite(strip.model_xyz).all(axis=1), bool)
        if not gone.any():
            return self
        models = model_points(orientation, strip.first, left_ray=strip.left_ray)
        pair = orientation.pairs.pair
        turned = np.einsum("mij,mj->mi", strip.rotations[pair], models.vectors)
        back = strip.centers[pair] + strip.scale[pair, None] * turned
        xyz = np.where(gone[:, None], back, strip.model_xyz)
        mean = mean_points(orientation.point, xyz, orientation.used & models.sound)
        lost = np.flatnonzero(~np.isin(mean.point, strip.point))
        point = np.concatenate([strip.point, mean.point[lost]])
        order = np.argsort(point, kind="stable")
        whole = replace(
            strip,
            model_xyz=xyz,
            point=point[order],
            xyz=np.concatenate([strip.xyz, mean.xyz[lost]])[order],
            model_count=np.concatenate([strip.model_count, mean.model_count[lost]])[order],
            home=np.zeros(0, np.intp),  # serves precision, which is not asked of evidence
        )
        return replace(self, formed=whole)


def _mean_direction(axes: Floats) -> Floats:
    mean = axes.mean(axis=0)
    return np.asarray(mean / max(float(np.linalg.norm(mean)), 1e-12), float)


def form(strip: Strip, observations: PhotoPoints, settings: Settings) -> EvidenceStrip | None:
    """Form a strip as far as that goes, for evidence alone; None when a pair or a junction cannot be determined."""
    if len(strip.photos) < 2:
        return None  # a single photo of a block has no pairs
    from photostrip.pipeline.strips.photos import screened_pairs  # a check forms no strips

    try:
        screened, _ = screened_pairs(strip, observations, settings.relative)
        refuse_unusable(screened.orientation, screened.converged, strip.photos)
        scatter = screened.scatter.by_pair
        formed = form_from_pairs(screened.orientation, settings.formation, strip.photos, scatter)
    except (GeometryError, InputError, np.linalg.LinAlgError):
        return None
    return EvidenceStrip(strip, screened.orientation, formed)


def ideal(observations: PhotoPoints, cameras: Mapping[str, Camera], settings: Settings) -> PhotoPoints:
    """Image points free of distortion, without refraction, whose heights are not known; else as they are."""
    try:
        return corrections.refine(observations, cameras, replace(settings.refinement, refraction=False)).observations
    except InputError:
        return observations


def _base_angle(photos: Sequence[str], steps: Mapping[str, complex]) -> float:
    """Mean direction on the photos towards the next one, radians."""
    known = np.array([steps.get(photo, complex("nan")) for photo in photos])
    known = known[np.isfinite(known) & (known != 0)]
    return float(np.angle((known / np.abs(known)).sum())) if len(known) else 0.0


def strip_points(
    formed: EvidenceStrip, observations: PhotoPoints, control: ControlPoints, steps: Mapping[str, complex]
) -> tuple[Numbers, StripPoints]:
    """Rows of the given points that a formed strip holds, and the same points in the strip."""
    strip, depth = formed.formed, np.median(formed.depth)
    row = rows_of_given(control.ids, strip.point, observations.point_ids)
    rows = np.flatnonzero(row >= 0)
    base = np.median(np.linalg.norm(np.diff(strip.centers, axis=0), axis=1))
    share = formed.strip.median_sigma(observations) / formed.strip.camera.principal_distance
    return rows, StripPoints(
        formed.strip.id,
        xyz=strip.xyz[row[rows]],
        axes=formed.axes,
        centers=strip.centers,
        floor=(2.0 * share, 2.0 * np.sqrt(2.0) * share * depth / max(base, 1e-12)),
        depth=depth,
        base_angle=_base_angle(formed.strip.photos, steps),
        rays_of=partial(_rays, formed, observations),
    )


def _rays(formed: EvidenceStrip, observations: PhotoPoints, name: str) -> Rays:
    """Collect what the photos of a strip show of a point."""
    position = formed.strip.positions(observations)
    rows = np.flatnonzero((observations.point == observations.point_ids.index(name)) & (position >= 0))
    strip, photo = formed.formed, position[rows]
    return Rays(
        xy=observations.xy[rows],
        sigma=np.sqrt((observations.sigma[rows] ** 2).mean(axis=1)),
        centers=strip.centers[photo],
        rotations=strip.rotations[photo],
        focal=formed.strip.camera.principal_distance,
    )


def stretches(
    rows: Numbers,
    on_strip: StripPoints,
    *,
    longest: int = LONG_STRIP,
    photos: int = STRETCH_PHOTOS,
    most: int = STRETCHES,
) -> Iterator[tuple[Numbers, StripPoints]]:
    """Cut a long strip into stretches that no low polynomial need bend far.

    longest: photos of a strip that is one stretch; of a longer one stretches of `photos` photos, evenly spread and
        `most` at most, are given: the rows of the given points (some of `rows`, which belong to `on_strip`) with the
        same points in the strip.
    """
    length = len(on_strip.centers)
    if length <= longest:
        yield rows, on_strip
        return
    up = on_strip.axes.mean(axis=0)
    points, centers = (each - np.outer(each @ up, up) for each in (on_strip.xyz, on_strip.centers))
    near = _nearest(points, centers)
    count = min(most, -(-length // photos))
    for start in np.unique(np.linspace(0, length - photos, count).astype(np.intp)).tolist():
        part = slice(start, start + photos)
        inside = (near >= part.start) & (near < part.stop)
        axes, centers = on_strip.axes[part], on_strip.centers[part]
        yield rows[inside], replace(on_strip, xyz=on_strip.xyz[inside], axes=axes, centers=centers)


def _nearest(points: Floats, centers: Floats) -> Numbers:
    middle = centers.mean(axis=0)
    squares, found = ((centers - middle) ** 2).sum(axis=1), np.empty(len(points), np.intp)
    for start in range(0, len(points), AT_A_TIME):
        part = slice(start, start + AT_A_TIME)
        found[part] = (squares - 2 * (points[part] - middle) @ (centers - middle).T).argmin(axis=1)
    return found


def mosaic_points(
    strip: Strip, observations: PhotoPoints, control: ControlPoints, steps: Mapping[str, complex]
) -> tuple[Numbers, StripPoints] | None:
    """Rows of the given points that a mosaic holds, and the same points in the mosaic, without heights.

    The mosaic is that of the ten photos in a row that show most of them; None where it has no point.
    """
    photos = _photos_with_most(strip, observations, control)
    plane = mosaic.lay_out(mosaic.link(observations, photos), len(photos))
    position = locate(observations.photo_ids, photos)[observations.photo]
    rows = np.flatnonzero(position >= 0)
    rows = rows[plane.part[position[rows]] == 0]
    if not len(rows):
        return None
    photo, point = position[rows], observations.point[rows]
    z = observations.xy[rows, 0] + 1j * observations.xy[rows, 1]
    z = plane.factor[photo] * np.where(plane.mirrored[photo], np.conj(z), z) + plane.offset[photo]
    total = np.bincount(point, minlength=len(observations.point_ids))
    count = np.maximum(total, 1)
    x, y = (np.bincount(point, part, len(total)) / count for part in (z.real, z.imag))
    numbers = located(control.ids, observations.point_ids)
    given = np.flatnonzero((numbers >= 0) & (total[numbers] > 0))
    held = numbers[given]
    depth = strip.camera.principal_distance * np.median(np.abs(plane.factor))
    return given, StripPoints(
        strip.id,
        xyz=np.column_stack([x[held], y[held], np.full(len(held), np.nan)]),
        axes=np.array([[0.0, 0.0, 1.0]]),
        centers=np.column_stack([plane.offset.real, plane.offset.imag, np.full(len(photos), depth)]),
        floor=(MOSAIC_SIGMA, MOSAIC_SIGMA),
        depth=depth,
        base_angle=_base_angle(photos, steps),
    )


def _photos_with_most(strip: Strip, observations: PhotoPoints, control: ControlPoints) -> tuple[str, ...]:
    """Photos in a row that show most given points in plan."""
    if len(strip.photos) <= MOSAIC_PHOTOS:
        return strip.photos
    given = {name for name, use in zip(control.ids, control.use[:, 0], strict=True) if use}
    wanted = np.array([name in given for name in observations.point_ids], bool)[observations.point]
    position = strip.positions(observations)[wanted]
    count = np.bincount(position[position >= 0], minlength=len(strip.photos))
    first = int(np.convolve(count, np.ones(MOSAIC_PHOTOS), "valid").argmax())
    return strip.photos[first : first + MOSAIC_PHOTOS]


def places_along_strip(
    strip: Strip, observations: PhotoPoints, control: ControlPoints, steps: Mapping[str, complex]
) -> tuple[Numbers, Floats]:
    """Say where along a strip given points lie.

    Returns rows: (m,), rows of the given points that at least two of its photos show.
    Returns place: (m,), where they lie along the strip in bases, from 0 at the first photo; the mean of what its photos
        say.
    """
    rows, along = places_in_photos(strip, observations, steps)
    size = len(observations.point_ids)
    count = np.bincount(observations.point[rows], minlength=size)
    total = np.bincount(observations.point[rows], along, size)
    numbers = located(control.ids, observations.point_ids)
    given = np.flatnonzero((numbers >= 0) & (count[numbers] >= LEAST_RAYS))
    chosen = numbers[given]
    return given, total[chosen] / count[chosen]


def places_in_photos(strip: Strip, observations: PhotoPoints, steps: Mapping[str, complex]) -> tuple[Numbers, Floats]:
    """Say where each photo of a strip puts its points along the strip.

    Returns rows: (m,), image points of the strip.
    Returns along: (m,), their places in bases, from 0 at the first photo.
    """
    position = strip.positions(observations)
    rows = np.flatnonzero(position >= 0)
    step = np.array([steps.get(photo, complex("nan")) for photo in strip.photos])
    known = np.isfinite(step) & (step != 0)
    usual = complex(np.median(step[known].real), np.median(step[known].imag)) if known.any() else 1.0
    step = np.where(known, step, usual)[position[rows]]
    along = (observations.xy[rows] * np.column_stack([step.real, step.imag])).sum(axis=1) / np.abs(step) ** 2
    return rows, position[rows] + (along if known.any() else 0.0)


def half_breadth(
    strip: Strip,
    observations: PhotoPoints,
    ids: Sequence[str],
    plan: Floats,
    place: Floats,
    steps: Mapping[str, complex],
) -> float:
    """Half the breadth of a strip, metres; 0 where two given points do not tell its scale.

    The scale is that of photos that show two given points or more, or else that of the bases between given points.

    ids, plan, place: given points, their plan coordinates (n, 2), metres, and their places along the strip (n,), bases.
    """
    inside = strip.positions(observations) >= 0
    angle = _base_angle(strip.photos, steps)
    across = observations.xy[inside] @ [-np.sin(angle), np.cos(angle)]
    half = np.quantile(np.abs(across), BREADTH_SHARE)
    given = locate(observations.point_ids, ids)[observations.point]
    rows = np.flatnonzero(inside & (given >= 0))
    rows = rows[np.argsort(observations.photo[rows], kind="stable")]
    one, other = rows[:-1], rows[1:]
    same = (observations.photo[one] == observations.photo[other]) & (given[one] != given[other])
    one, other = one[same], other[same]
    image = np.linalg.norm(observations.xy[one] - observations.xy[other], axis=1)
    ground = np.linalg.norm(plan[given[one]] - plan[given[other]], axis=1)
    if not (image > 0).any():
        order = np.argsort(place, kind="stable")
        base = np.median([abs(step) for photo in strip.photos if (step := steps.get(photo, 0.0))] or [np.nan])
        image = np.diff(place[order]) * float(base)
        ground = np.linalg.norm(np.diff(plan[order], axis=0), axis=1)
    good = image > 0
    return half * np.median(ground[good] / image[good]) if good.any() else 0.0
