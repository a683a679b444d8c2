"""Decisions on many rays at once, in columns: points with as many rays and given coordinates are linearised together.

Source: derived; ``point_decisions`` decides.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.network.cofactors import JointCofactors
from photostrip.network.gross_errors.point_decisions import (
    AGREE,
    Decisions,
    PointRays,
    alike,
    decide,
    without_place,
)
from photostrip.network.problem import BundleProblem, ModelObservations
from photostrip.network.rays import in_models
from photostrip.network.reliability import Limit
from photostrip.network.selection import Selection
from photostrip.network.self_calibration import image_shift
from photostrip.network.solution import BundleSolution
from photostrip.strip.resection.collinearity import KnownPhotos, derivatives, project
from photostrip.strip.resection.ray_intersection import two_that_meet


@dataclass(frozen=True, eq=False)
class Adjusted:
    """An adjustment by which rays are decided on."""

    problem: BundleProblem  # with all observations
    selection: Selection  # which of them took part
    control: Flags  # (c, 3): given coordinates that count
    solution: BundleSolution
    joint: JointCofactors


@dataclass(frozen=True, eq=False)
class RayDecisions:
    """What was decided about rays."""

    row: Numbers  # (n,): rows of the observations, the rays of a point side by side
    # place, rays: (n,): which of the points it is, and how many rays of it were decided on
    place: Numbers
    rays: Numbers
    out: Flags  # (n,): that must not be used
    cause: Numbers  # (n,): of the point, place in ``CAUSES``
    value: Floats  # (n,): largest standardised residual of a coordinate of the point
    size: Floats  # (n, c): estimated errors of the coordinates in standard deviations; NaN where nothing can be said


def decide_rays(adjusted: Adjusted, row: Numbers, xyz: Floats, limit: Limit) -> RayDecisions:
    """Decide on rays, given by point and photo, of points linearised at places near them (m, 3).

    What of these places is NaN becomes where the rays meet.
    """
    problem = adjusted.problem
    point = problem.images.point[row]
    numbers = np.unique(point)
    first = np.searchsorted(point, numbers)
    rays = np.diff(first, append=len(row))
    given, axis = np.nonzero(adjusted.control & np.isfinite(problem.control.sigma))
    owner = problem.control.point[given]
    by_owner = np.argsort(owner, kind="stable")
    known, first_known = (
        np.bincount(owner, minlength=problem.points)[numbers],
        np.searchsorted(owner[by_owner], numbers),
    )
    n = len(row)
    out, cause, value, size = (
        np.zeros(n, bool),
        np.full(n, AGREE),
        np.zeros(n),
        np.full(problem.images.xy[row].shape, np.nan),
    )
    for some in alike(rays, known):
        at = first[some, None] + np.arange(rays[some[0]])
        of_control = by_owner[first_known[some, None] + np.arange(known[some[0]])]
        place = xyz[some]
        decided = _decided(adjusted, row[at], (given[of_control], axis[of_control]), place, limit)
        xyz[some], out[at], size[at] = place, decided.out, decided.size
        cause[at], value[at] = decided.cause[:, None], decided.value[:, None]
    of_point = np.repeat(np.arange(len(numbers)), rays)
    return RayDecisions(row=row, place=of_point, rays=rays[of_point], out=out, cause=cause, value=value, size=size)


def _decided(adjusted: Adjusted, rows: Numbers, given: tuple[Numbers, Numbers], xyz: Floats, limit: Limit) -> Decisions:
    """Decide on the r rays (m, r) of each of m points with as many given coordinates."""
    problem, control = adjusted.problem, adjusted.problem.control
    m, r = rows.shape
    seen = _seen(adjusted, rows, xyz)
    off, by_photo, by_point = (each.reshape(m, r, *each.shape[1:]) for each in seen)
    c = problem.images.xy.shape[1]
    sound = np.asarray(np.isfinite(np.concatenate([off[..., None], by_photo], axis=3)).all(axis=(1, 2, 3)))
    for each in (off, by_photo, by_point):
        each[~sound] = 0.0
    spread, axes = control.sigma[given], control.axes[given]
    of_photos = np.zeros((m, c * r + spread.shape[1], c * r + spread.shape[1]))
    of_photos[:, : c * r, : c * r] = adjusted.joint.of(problem.images.photo[rows], by_photo)
    to_given = np.einsum("mci,mci->mc", axes, control.xyz[given[0]] - xyz[:, None]) / spread
    rays = PointRays(
        rays=r,
        coordinates=c,
        misfit=np.hstack([off.reshape(m, -1), np.where(sound[:, None], to_given, 0.0)]),
        by_point=np.hstack([by_point.reshape(m, -1, 3), axes / spread[..., None]]),
        of_photos=of_photos,
        inside=np.hstack([np.repeat(adjusted.selection.images[rows], c, axis=1), adjusted.selection.control[given]]),
    )
    return without_place(decide(rays, limit), ~sound)


class _Seen(NamedTuple):
    """Rays linearised in units of their standard deviations, photos in the Cartesian frame."""

    off: Floats  # (n, c): measured minus computed
    by_photo: Floats  # (n, c, u)
    by_point: Floats  # (n, c, 3)


def _seen(adjusted: Adjusted, rows: Numbers, xyz: Floats) -> _Seen:
    """Linearise the rays (m, r) of points at places (m, 3); what of these is NaN becomes where the rays meet."""
    problem, solution, images = adjusted.problem, adjusted.solution, adjusted.problem.images
    (m, r), photo, own = rows.shape, images.photo[rows], images.photo[rows.ravel()]
    nowhere = np.isnan(xyz[:, 0])
    if isinstance(images, ModelObservations):
        turned = np.einsum("nij,nj->ni", solution.rotations[own], images.xy[rows.ravel()])
        placed = solution.scales[own, None] * turned + solution.centers[own]
        xyz[nowhere] = placed.reshape(m, r, 3)[nowhere].mean(axis=1)
        return _Seen(*in_models(images, rows.ravel(), solution.state, np.repeat(xyz, r, axis=0)))
    photos = KnownPhotos(solution.centers, solution.rotations, problem.cameras.focal[problem.cameras.of_photo])
    flat, sigma = images.xy[rows.ravel()], images.sigma[rows.ravel()]
    xy = flat + image_shift(problem, solution.common, flat, own)
    if r >= problem.least and nowhere.any():
        pairs = xy.reshape(m, r, 2), sigma.reshape(m, r, 2)
        xyz[nowhere] = two_that_meet(pairs[0][nowhere], pairs[1][nowhere], photo[nowhere], photos)
    place = np.repeat(xyz, r, axis=0)
    by_photo, by_point = derivatives(place, photos, own)
    off = xy - project(place, photos, own)
    return _Seen(off / sigma, by_photo / sigma[..., None], by_point / sigma[..., None])
