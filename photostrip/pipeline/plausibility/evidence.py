"""What the gate looks at: strips formed for evidence alone, and given points as strips see them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from photostrip.errors import PhotostripError
from photostrip.triangulation.gross_errors.pairs import screening
from photostrip.triangulation.image_coordinates import corrections
from photostrip.triangulation.plausibility.control.control_strip import Rays, Seen
from photostrip.triangulation.plausibility.photos import mosaic
from photostrip.triangulation.relative_orientation.orientation import orient_unchecked, refuse_unusable
from photostrip.triangulation.relative_orientation.pairs import collect_pairs
from photostrip.triangulation.strip_formation.strip import form_from_pairs, mean_points, model_points

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from photostrip.pipeline.inputs import Settings, Strip
    from photostrip.points import ControlPoints, PhotoPoints
    from photostrip.triangulation.relative_orientation.orientation import Orientation
    from photostrip.triangulation.strip_formation.strip import FormedStrip

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]

WINDOW = 10  # photos of a mosaic that is laid on control: a longer one curls
LONG, STRETCH, STRETCHES = 40, 30, 4  # photos: a longer strip is examined in so many stretches of so many
BREADTH = 0.95  # of the image points lie within the half breadth of a strip
SEEN_BY = 2  # photos that must show a given point
MOSAIC_SIGMA = 0.02  # of the flying height: what relief and tilts leave in a mosaic


@dataclass(frozen=True, eq=False)
class Formed:
    """A strip, formed for evidence."""

    strip: Strip  # the strip with its photos in the order in which they were formed
    orientation: Orientation
    formed: FormedStrip

    @property
    def up(self) -> Floats:
        """Direction from the ground to the cameras, of length one."""
        axis = self.formed.rotations[:, :, 2].mean(axis=0)
        return np.asarray(axis / max(float(np.linalg.norm(axis)), 1e-12), float)

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
    def whole(self) -> Formed:
        """The strip with the points that it has no place for, because their rays contradict each other.

        Such a point stands in the middle of where its models put it.
        """
        strip, orientation = self.formed, self.orientation
        gone = np.asarray(~np.isfinite(strip.model_xyz).all(axis=1), bool)
        if not gone.any():
            return self
        models = model_points(orientation)
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


def form(strip: Strip, observations: PhotoPoints, settings: Settings) -> Formed | None:
    """Form a strip as far as that goes, for evidence alone.

    Parameters
    ----------
    observations : PhotoPoints
        Image points in the system of the photo, mm.

    Returns
    -------
    Formed or None
        None when a pair or a joint cannot be determined.
    """
    sigma = _sigma(observations, strip)
    try:
        pairs = collect_pairs(observations, strip.photos, strip.camera.principal_distance)
        first, converged = orient_unchecked(pairs)
        screened = screening.screen_pairs(first, settings.relative, sigma, converged)
        refuse_unusable(screened.orientation, screened.converged, strip.photos)
        scatter = screened.scatter.by_pair
        formed = form_from_pairs(screened.orientation, settings.formation, strip.photos, scatter)
    except (PhotostripError, ArithmeticError, ValueError):
        return None
    return Formed(strip, screened.orientation, formed)


def ideal(observations: PhotoPoints, strips: Sequence[Strip], settings: Settings) -> PhotoPoints:
    """Give image points free of distortion, without refraction, whose heights are not known.

    Parameters
    ----------
    observations : PhotoPoints
        Image points in the system of the photo, mm.

    Returns
    -------
    PhotoPoints
        Ideal coordinates; as they are where they cannot be corrected.
    """
    cameras = {photo: strip.camera for strip in strips for photo in strip.photos}
    try:
        return corrections.refine(observations, cameras, replace(settings.refinement, refraction=False)).observations
    except (PhotostripError, LookupError):
        return observations


# ------------------------------------------------------------------------------- given points as a strip sees them


def sighted(
    formed: Formed, observations: PhotoPoints, control: ControlPoints, steps: Mapping[str, complex]
) -> tuple[Numbers, Seen]:
    """Return the points of a formed strip whose ground coordinates are given.

    Parameters
    ----------
    steps : mapping of str to complex
        Centre of the next photo on each photo, mm.

    Returns
    -------
    rows : ndarray of int
        Rows of the given points.
    Seen
        The same points in the strip.
    """
    strip, depth = formed.formed, float(np.median(formed.depth))
    number = {name: n for n, name in enumerate(observations.point_ids)}
    row_of = {int(n): row for row, n in enumerate(strip.point)}
    places = np.array([row_of.get(number.get(name, -1), -1) for name in control.ids], np.intp)
    rows = np.flatnonzero(places >= 0)
    base = float(np.median(np.linalg.norm(np.diff(strip.centers, axis=0), axis=1)))
    share = _sigma(observations, formed.strip) / formed.strip.camera.principal_distance
    seen = Seen(
        formed.strip.id,
        strip.xyz[places[rows]],
        strip.rotations[:, :, 2],
        strip.centers,
        (2.0 * share, 2.0 * np.sqrt(2.0) * share * depth / max(base, 1e-12)),
        depth,
        _base_angle(formed.strip.photos, steps),
        partial(_rays, formed, observations),
    )
    return rows, seen


def _rays(formed: Formed, observations: PhotoPoints, name: str) -> Rays:
    """Return what the photos of a strip show of a point."""
    place = {photo: number for number, photo in enumerate(formed.strip.photos)}
    rows = np.flatnonzero(observations.point == observations.point_ids.index(name))
    here = np.array([place.get(observations.photo_ids[photo], -1) for photo in observations.photo[rows]], np.intp)
    rows, here = rows[here >= 0], here[here >= 0]
    strip, focal = formed.formed, formed.strip.camera.principal_distance
    sigma = np.sqrt((observations.sigma[rows] ** 2).mean(axis=1))
    return Rays(observations.xy[rows], sigma, strip.centers[here], strip.rotations[here], focal)


def stretches(rows: Numbers, seen: Seen) -> Iterator[tuple[Numbers, Seen]]:
    """Cut a long strip into stretches that no low polynomial need bend far.

    Parameters
    ----------
    rows : ndarray of int, shape (n,)
        Rows of given points.

    Yields
    ------
    Seen
        The same points in the strip. A strip of up to 40 photos is one stretch; of a longer one four of 30 photos,
        evenly spread, are given.
    """
    photos = len(seen.centers)
    if photos <= LONG:
        yield rows, seen
        return
    up = seen.axes.mean(axis=0)
    flat = [each - np.outer(each @ up, up) for each in (seen.xyz, seen.centers)]
    near = np.array([int(((flat[1] - point) ** 2).sum(axis=1).argmin()) for point in flat[0]], np.intp)
    starts = np.unique(np.linspace(0, photos - STRETCH, min(STRETCHES, photos // STRETCH)).astype(np.intp))
    for start in starts.tolist():
        inside = (near >= start) & (near < start + STRETCH)
        part = slice(start, start + STRETCH)
        yield rows[inside], replace(seen, xyz=seen.xyz[inside], axes=seen.axes[part], centers=seen.centers[part])


def _sigma(observations: PhotoPoints, strip: Strip) -> float:
    """Median standard deviation of the image coordinates of a strip, mm."""
    names = set(strip.photos)
    members = np.array([photo in names for photo in observations.photo_ids], bool)
    return float(np.median(observations.sigma[members[observations.photo]]))


def _base_angle(photos: Sequence[str], steps: Mapping[str, complex]) -> float:
    """Mean direction on the photos towards the next one, radians."""
    known = np.array([steps.get(photo, complex("nan")) for photo in photos])
    known = known[np.isfinite(known) & (known != 0)]
    return float(np.angle((known / np.abs(known)).sum())) if len(known) else 0.0


def sighted_in_mosaic(
    strip: Strip, observations: PhotoPoints, control: ControlPoints, steps: Mapping[str, complex]
) -> tuple[Numbers, Seen] | None:
    """Return the points of a mosaic of some photos whose ground coordinates are given.

    Parameters
    ----------
    observations : PhotoPoints
        Image points, mm.
    steps : mapping of str to complex
        Centre of the next photo on each photo, mm.

    Returns
    -------
    rows : ndarray of int
        Rows of the given points.
    Seen
        The same points in the mosaic, without heights; of the ten photos in a row that show most of them.
    """
    photos = _richest(strip, observations, control)
    links = mosaic.link(observations, photos)
    layout = mosaic.lay_out(links, len(photos))
    place = {photo: number for number, photo in enumerate(photos)}
    position = np.array([place.get(photo, -1) for photo in observations.photo_ids], np.intp)[observations.photo]
    rows = np.flatnonzero(position >= 0)
    rows = rows[layout.part[position[rows]] == 0]
    if not len(rows):
        return None
    z = observations.xy[rows, 0] + 1j * observations.xy[rows, 1]
    z = np.where(layout.mirrored[position[rows]], np.conj(z), z)
    z = layout.factor[position[rows]] * z + layout.offset[position[rows]]
    total = np.bincount(observations.point[rows], minlength=len(observations.point_ids))
    count = np.maximum(total, 1)
    mean = (
        np.bincount(observations.point[rows], z.real, len(total)) / count
        + 1j * np.bincount(observations.point[rows], z.imag, len(total)) / count
    )
    number = {name: n for n, name in enumerate(observations.point_ids)}
    points = np.array([number.get(name, -1) for name in control.ids], np.intp)
    given = np.flatnonzero((points >= 0) & (total[points] > 0))
    here = mean[points[given]]
    depth = strip.camera.principal_distance * float(np.median(np.abs(layout.factor)))
    xyz = np.column_stack([here.real, here.imag, np.full(len(here), np.nan)])
    centers = np.column_stack([layout.center.real, layout.center.imag, np.full(len(photos), depth)])
    up = np.array([[0.0, 0.0, 1.0]])
    seen = Seen(strip.id, xyz, up, centers, (MOSAIC_SIGMA, MOSAIC_SIGMA), depth, _base_angle(photos, steps))
    return given, seen


def _richest(strip: Strip, observations: PhotoPoints, control: ControlPoints) -> tuple[str, ...]:
    """Photos in a row that show most given points in plan."""
    if len(strip.photos) <= WINDOW:
        return strip.photos
    given = {name for name, use in zip(control.ids, control.use[:, 0], strict=True) if use}
    wanted = np.array([name in given for name in observations.point_ids], bool)[observations.point]
    count = dict.fromkeys(observations.photo_ids, 0)
    for number, hits in enumerate(np.bincount(observations.photo[wanted], minlength=len(observations.photo_ids))):
        count[observations.photo_ids[number]] = int(hits)
    sums = np.convolve([count.get(photo, 0) for photo in strip.photos], np.ones(WINDOW), "valid")
    first = int(sums.argmax())
    return strip.photos[first : first + WINDOW]


def stations(
    strip: Strip, observations: PhotoPoints, control: ControlPoints, steps: Mapping[str, complex]
) -> tuple[Numbers, Floats]:
    """Give where along a strip given points lie.

    Parameters
    ----------
    observations : PhotoPoints
        Image points, mm.
    steps : mapping of str to complex
        Centre of the next photo on each photo, mm.

    Returns
    -------
    rows : ndarray of int, shape (m,)
        Rows of the given points that at least two of its photos show.
    place : ndarray, shape (m,)
        Where they lie along the strip in bases, from 0 at the first photo; the mean of what its photos say.
    """
    rows, along = places(strip, observations, steps)
    size = len(observations.point_ids)
    count = np.bincount(observations.point[rows], minlength=size)
    total = np.bincount(observations.point[rows], along, size)
    number = {name: n for n, name in enumerate(observations.point_ids)}
    points = np.array([number.get(name, -1) for name in control.ids], np.intp)
    seen = np.flatnonzero((points >= 0) & (count[points] >= SEEN_BY))
    chosen = points[seen]
    return seen, total[chosen] / count[chosen]


def places(strip: Strip, observations: PhotoPoints, steps: Mapping[str, complex]) -> tuple[Numbers, Floats]:
    """Give where each photo of a strip puts its points along the strip.

    Parameters
    ----------
    observations : PhotoPoints
        Image points, mm.
    steps : mapping of str to complex
        Centre of the next photo on each photo, mm.

    Returns
    -------
    rows : ndarray of int, shape (m,)
        Image points of the strip.
    along : ndarray, shape (m,)
        Their places in bases, from 0 at the first photo.
    """
    order = {photo: number for number, photo in enumerate(strip.photos)}
    position = np.array([order.get(photo, -1) for photo in observations.photo_ids], np.intp)[observations.photo]
    rows = np.flatnonzero(position >= 0)
    step = np.array([steps.get(photo, complex("nan")) for photo in strip.photos])
    known = np.isfinite(step) & (step != 0)
    usual = complex(np.median(step[known].real), np.median(step[known].imag)) if known.any() else 1.0
    step = np.where(known, step, usual)[position[rows]]
    along = (observations.xy[rows] * np.column_stack([step.real, step.imag])).sum(axis=1) / np.abs(step) ** 2
    return rows, position[rows] + (along if known.any() else 0.0)


def half_breadth(
    strip: Strip, observations: PhotoPoints, ids: Sequence[str], plan: Floats, steps: Mapping[str, complex]
) -> float:
    """Give half the breadth of a strip.

    Parameters
    ----------
    observations : PhotoPoints
        Image points, mm.
    plan : ndarray, shape (n, 2)
        Their plan coordinates in metres.
    steps : mapping of str to complex
        Centre of the next photo on each photo, mm.

    Returns
    -------
    float
        Metres, with the scale of photos that show two given points or more; infinite when there is none.
    """
    members = set(strip.photos)
    inside = np.array([name in members for name in observations.photo_ids], bool)[observations.photo]
    angle = _base_angle(strip.photos, steps)
    across = observations.xy[inside] @ [-np.sin(angle), np.cos(angle)]
    row_of = {name: row for row, name in enumerate(ids)}
    given = np.array([row_of.get(name, -1) for name in observations.point_ids], np.intp)[observations.point]
    rows = np.flatnonzero(inside & (given >= 0))
    rows = rows[np.argsort(observations.photo[rows], kind="stable")]
    one, other = rows[:-1], rows[1:]
    same = (observations.photo[one] == observations.photo[other]) & (given[one] != given[other])
    one, other = one[same], other[same]
    image = np.linalg.norm(observations.xy[one] - observations.xy[other], axis=1)
    ground = np.linalg.norm(plan[given[one]] - plan[given[other]], axis=1)
    good = image > 0
    if not good.any():
        return float("inf")
    return float(np.median(ground[good] / image[good]) * np.quantile(np.abs(across), BREADTH))
