"""The free network of a formed strip: all its rays, to be adjusted and tested at once."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.errors import GeometryError
from photostrip.triangulation.bundle.observations.problem import (
    BundleCameras,
    BundleProblem,
    ImageObservations,
    StartValues,
)
from photostrip.triangulation.bundle.selection import Selection
from photostrip.triangulation.bundle.settings import BundleSettings
from photostrip.triangulation.gross_errors.pairs.zones import MINIMUM_LEFT
from photostrip.triangulation.gross_errors.rays.snooping import screen_bundle
from photostrip.triangulation.resection.collinearity import KnownPhotos, project
from photostrip.triangulation.strip_formation.strip import mean_points

if TYPE_CHECKING:
    from photostrip.arrays import Flags, Numbers
    from photostrip.rejection import Rejection
    from photostrip.triangulation.gross_errors.rays.strip_rays import StripRays
    from photostrip.triangulation.relative_orientation.orientation import Orientation
    from photostrip.triangulation.strip_formation.strip import FormedStrip


FAR = 10.0  # times the median misclosure: points beyond begin outside


def wrong_rays(oriented: Orientation, formed: FormedStrip, rays: StripRays) -> tuple[Rejection, ...] | None:
    """Test all rays of a strip, and return those that must not be used; rows are those of the observations.

    None where what is left holds the photos too badly for an adjustment.
    """
    rows = np.unique(oriented.rows)
    problem, far = _free_network(oriented, formed, rays, rows)
    every = Selection.everything(problem)
    begin = Selection(images=~far, control=every.control, positions=every.positions, attitudes=every.attitudes)
    try:
        found = screen_bundle(problem, begin, BundleSettings(), np.isin(rows, rays.kept), rough=True)
    except GeometryError:
        return None
    return tuple(replace(each, row=int(rows[each.row])) for each in found.rejections if not each.readmitted)


def _free_network(
    oriented: Orientation, formed: FormedStrip, rays: StripRays, rows: Numbers
) -> tuple[BundleProblem, Flags]:
    """Rays as a bundle without control, from the formed strip; and which of them are far from it.

    All rays of a point are far when one of them is. Inside are the nearest pass point of every junction, and all
    points of a pair that would have too few.
    """
    o = rays.observations
    photo = rays.position[rows]
    point, at = np.unique(o.point[rows], return_inverse=True)
    # a photo is as good as the worse of its pairs
    factor = rays.sigma / (np.sqrt(2.0) * rays.stated)
    sigma = o.sigma[rows] * np.maximum(np.append(factor, factor[-1]), np.append(factor[0], factor))[photo, None]
    xyz = np.full((len(point), 3), np.nan)
    for use in (np.isfinite(formed.model_xyz[:, 0]), oriented.used & np.isfinite(formed.model_xyz[:, 0])):
        mean = mean_points(oriented.point, formed.model_xyz, use)
        xyz[np.searchsorted(point, mean.point)] = mean.xyz
    focal = np.array([oriented.pairs.focal])
    photos = KnownPhotos(formed.centers, formed.rotations, np.repeat(focal, len(formed.centers)))
    computed = project(xyz[at], photos, photo)
    size = np.abs((o.xy[rows] - computed) / sigma).max(axis=1)
    limit = FAR * max(1.0, float(np.nanmedian(size)))
    far = np.zeros(len(point), bool)
    far[at[~(size <= limit)]] = True
    joined, worst = formed.junctions, np.zeros(len(point))
    np.maximum.at(worst, at, np.nan_to_num(size, nan=np.inf))
    joining = np.searchsorted(point, joined.point)
    nearest = np.lexsort((worst[joining], joined.junction))
    far[joining[nearest[np.unique(joined.junction[nearest], return_index=True)[1]]]] = False  # they carry the scale
    pair, of_pairs = oriented.pairs.pair, np.searchsorted(point, oriented.point)
    few = oriented.pairs.sums((oriented.used & ~far[of_pairs]).astype(float)) < MINIMUM_LEFT
    far[of_pairs[oriented.used & few[pair]]] = False
    far[at[np.isin(rows, rays.kept)]] = False
    problem = BundleProblem(
        images=ImageObservations(photo=photo, point=at.astype(np.intp), xy=o.xy[rows], sigma=sigma),
        cameras=BundleCameras(np.zeros(len(formed.centers), np.intp), focal),
        start=StartValues(formed.centers, formed.rotations, xyz),
    )
    return problem, far[at]
