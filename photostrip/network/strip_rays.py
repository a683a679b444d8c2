"""The free network of a formed strip: all its rays, to be adjusted and tested at once."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import GeometryError
from photostrip.network.adjustment import Selection
from photostrip.network.problem import BundleCameras, BundleProblem, BundleSettings, ImageObservations, StartValues
from photostrip.points import PhotoPoints
from photostrip.rejection import Rejection
from photostrip.statistics import normal_quantile
from photostrip.strip.formed_strip import FormedStrip, mean_points
from photostrip.strip.pair_screening import ALPHA, FIFTH_WRONG
from photostrip.strip.relative_orientation import MINIMUM_LEFT, MINIMUM_POINTS, Orientation
from photostrip.strip.robust import MEDIAN_SPREAD, scales


@dataclass(frozen=True, eq=False)
class StripRays:
    observations: PhotoPoints
    position: Numbers  # (n,): place in the strip of the photo of every image point; -1 for photos of other strips
    sigma: Floats  # (p,): standard deviations of a y parallax of weight one in each pair, mm
    weight: Floats  # (m,): weights of the rows of the pairs before anything was rejected
    stated: float  # standard deviation of an image coordinate of weight one, mm
    kept: Numbers  # rows that the user keeps: their points are not tested


STRIP_LEVEL = 0.012  # of a whole strip, and of what is rejected the part that is not wrong


def wrong_rays(oriented: Orientation, formed: FormedStrip, rays: StripRays) -> tuple[Rejection, ...] | None:
    """Test all rays of a strip, and return those that must not be used; rows are those of the observations.

    None where what is left holds the photos too badly for an adjustment.
    """
    from photostrip.network.snooping import screen_bundle

    rows = np.unique(oriented.rows)
    sigma = rays.observations.sigma[rows] * _spread_of_photos(oriented, rays)[rays.position[rows], None]
    problem = free_network(oriented, formed, rays.observations, rays.position, rows, sigma)
    kept = np.isin(rows, rays.kept)
    begin = replace(Selection.everything(problem), images=~_suspected(oriented, formed, rays, rows))
    try:
        found = screen_bundle(problem, begin, BundleSettings(level=STRIP_LEVEL), kept, rough=True)
    except GeometryError:
        return None
    return tuple(replace(each, row=int(rows[each.row])) for each in found.rejections if not each.readmitted)


def _suspected(oriented: Orientation, formed: FormedStrip, rays: StripRays, rows: Numbers) -> Flags:
    """Rays of the points that a pair or a junction rejected, and the user does not keep.

    Not suspected are the points of a pair, or of a junction, that would have too few others.
    """
    point, joined, pairs = rays.observations.point, formed.junctions, oriented.pairs
    suspected = np.zeros(len(rays.observations.point_ids), bool)
    suspected[np.append(oriented.point[~oriented.used], joined.point[~joined.used])] = True
    few = pairs.sums((oriented.used & ~suspected[oriented.point]).astype(float)) < MINIMUM_LEFT
    bare = np.bincount(joined.junction, joined.used & ~suspected[joined.point], pairs.size) == 0
    suspected[oriented.point[oriented.used & few[pairs.pair]]] = False
    suspected[joined.point[joined.used & bare[joined.junction]]] = False
    suspected[point[rays.kept]] = False
    return np.asarray(suspected[point[rows]], bool)


def _spread_of_photos(oriented: Orientation, rays: StripRays) -> Floats:
    """Give standard deviations of the image coordinates of each photo over the stated ones, (p + 1,).

    A photo is worse when the y parallaxes of both its pairs, the rejected ones among them, prove it even if a fifth of
    them are wrong.
    """
    pairs, weight = oriented.pairs, rays.weight
    count = pairs.sums((weight > 0).astype(float))
    redundancy = np.maximum(count - MINIMUM_POINTS, 1)
    found = scales(np.abs(oriented.parallax) * np.sqrt(weight), weight, pairs.pair, pairs.size) / rays.sigma
    found *= np.sqrt(count / redundancy)
    chance = normal_quantile(1 - np.sqrt(ALPHA / pairs.size)) * MEDIAN_SPREAD  # that both pairs show it
    factor = np.where(found > FIFTH_WRONG * (1 + chance / np.sqrt(redundancy)), found, 1.0)
    factor = np.minimum(np.append(factor, factor[-1]), np.append(factor[0], factor))
    # a parallax is that with a good photo
    return np.asarray(np.sqrt(2 * factor**2 - 1) * rays.sigma.max() / (np.sqrt(2.0) * rays.stated), float)


def free_network(
    oriented: Orientation,
    formed: FormedStrip,
    observations: PhotoPoints,
    position: Numbers,
    rows: Numbers,
    sigma: Floats,
) -> BundleProblem:
    """Rays (r,) as a bundle without control, from the formed strip.

    position: (n,): place in the strip of the photo of every image point.
    sigma: (r, 2): standard deviations of the rays, mm.
    """
    point, at = np.unique(observations.point[rows], return_inverse=True)
    xyz = np.full((len(point), 3), np.nan)
    for use in (np.isfinite(formed.model_xyz[:, 0]), oriented.used & np.isfinite(formed.model_xyz[:, 0])):
        mean = mean_points(oriented.point, formed.model_xyz, use)
        xyz[np.searchsorted(point, mean.point)] = mean.xyz
    images = ImageObservations(photo=position[rows], point=at.astype(np.intp), xy=observations.xy[rows], sigma=sigma)
    return BundleProblem(
        images=images,
        cameras=BundleCameras(np.zeros(len(formed.centers), np.intp), np.array([oriented.pairs.focal])),
        start=StartValues(formed.centers, formed.rotations, xyz),
    )
