"""Steps that take all photos at once: a strip in model coordinates, and the bundle."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from photostrip.errors import InputError
from photostrip.frozen import dataclass
from photostrip.library.step_arguments import rows, same
from photostrip.points import PhotoPoints
from photostrip.triangulation.bundle.observations.problem import (
    BundleCameras,
    BundleProblem,
    ControlObservations,
    ImageObservations,
    StartValues,
)
from photostrip.triangulation.bundle.quality.cofactors import cofactors_of
from photostrip.triangulation.bundle.solve import solve
from photostrip.triangulation.relative_orientation.orientation import orient_pairs
from photostrip.triangulation.relative_orientation.pairs import collect_pairs
from photostrip.triangulation.strip_formation.scale_transfer import StripFormationSettings
from photostrip.triangulation.strip_formation.strip import FirstPhoto, form_from_pairs

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from photostrip.arrays import Floats, Numbers


@dataclass(frozen=True, eq=False)
class Strip:
    """A strip in model coordinates: the frame of its first photo."""

    centers: Floats  # (p, 3): perspective centres, in the unit of the base
    rotations: Floats  # (p, 3, 3): photos to the frame of the first
    points: Floats  # (q, 3): means over the models that hold the point; NaN for a point of no model
    models: Numbers  # (q,): number of those models
    factors: Floats  # (p - 1,): scale factor k of each model; 1 for the first
    sigma0: Floats  # (p - 1,): standard deviation of an image coordinate by pair, mm; NaN without redundancy


def strip(
    rays: tuple[ArrayLike, ArrayLike, ArrayLike],
    principal_distance: float,
    *,
    base: float = 1.0,
    scale_transfer: Literal["least_squares", "distances"] = "least_squares",
) -> Strip:
    """Form a strip from its photos alone: pairs, chain, intersection, scale transfer, without any search for errors.

    rays: photo (n,) in flight order and point (n,) as numbers from 0, and image coordinates (n, 2).
    base: length of the first base, in the unit that the strip shall have.
    scale_transfer: the weights of the pass points.
    Raises GeometryError where a pair or a junction has too few common points, or cannot be oriented.

    Source: [001] eq. 125-141.
    """
    photo, point = (np.asarray(each, np.intp) for each in rays[:2])
    xy = rows(rays[2], 2)
    same(xy, photo)
    same(xy, point)
    photos = tuple(map(str, range(int(photo.max(initial=0)) + 1)))
    names = tuple(map(str, range(int(point.max(initial=0)) + 1)))
    measured = PhotoPoints(
        photo_ids=photos, point_ids=names, photo=photo, point=point, xy=xy, sigma=np.full(xy.shape, 1.0)
    )
    oriented = orient_pairs(collect_pairs(measured, photos, principal_distance), photos)
    settings, first = StripFormationSettings(scale_transfer=scale_transfer), FirstPhoto(np.eye(3), base)
    formed = form_from_pairs(oriented, settings, photos, first=first)
    points, models = np.full((len(names), 3), np.nan), np.zeros(len(names), np.intp)
    points[formed.point], models[formed.point] = formed.xyz, formed.model_count
    return Strip(
        centers=formed.centers,
        rotations=formed.rotations,
        points=points,
        models=models,
        factors=formed.scale_factor,
        sigma0=oriented.sigma0,
    )


@dataclass(frozen=True, eq=False)
class Bundle:
    """Photos and points adjusted together."""

    centers: Floats  # (p, 3): perspective centres
    rotations: Floats  # (p, 3, 3): photos to the frame of the points
    points: Floats  # (q, 3)
    residuals: Floats  # (n, 2): measured minus computed image coordinates, mm
    sigmas: Floats  # (q, 3): standard deviations of the points, for the stated ones of the measurements
    sigma0: float  # standard deviation of unit weight; NaN without redundancy
    redundancy: int
    iterations: int


def bundle(
    rays: tuple[ArrayLike, ArrayLike, ArrayLike],
    principal_distance: float,
    start: tuple[ArrayLike, ArrayLike, ArrayLike],
    *,
    ground: ArrayLike | None = None,
    sigma: float = 0.005,
    ground_sigma: float = 0.05,
) -> Bundle:
    """Adjust all photos and points at once, from approximate values and without any search for errors.

    rays: photo (n,) and point (n,) as numbers from 0, and image coordinates (n, 2).
    start: centres (p, 3), rotations (p, 3, 3) and points (q, 3), near the truth: from ``resection``, ``intersection``.
    ground: (q, 3), given coordinates; NaN where none is given. Without any the network is free: it stays as near to the
        points of the start as its shape lets it.
    sigma, ground_sigma: standard deviations of an image coordinate, mm, and of a given one.
    Raises GeometryError where the rays and given coordinates do not determine the photos and points.
    """
    photo, point = (np.asarray(each, np.intp) for each in rays[:2])
    xy, points, centers = rows(rays[2], 2), rows(start[2], 3), rows(start[0], 3)
    same(xy, photo)
    same(xy, point)
    if not (np.isin(photo, np.arange(len(centers))).all() and np.isin(point, np.arange(len(points))).all()):
        raise InputError("a ray has a photo or a point that the start does not have")
    given = np.full(points.shape, np.nan) if ground is None else np.asarray(ground, float)
    known = np.isfinite(given)
    same(points, given)
    listed = np.flatnonzero(known.any(axis=1))
    origin = points.mean(axis=0)
    problem = BundleProblem(
        images=ImageObservations(photo=photo, point=point, xy=xy, sigma=np.full(xy.shape, sigma)),
        cameras=BundleCameras(of_photo=np.zeros(len(centers), np.intp), focal=np.array([principal_distance])),
        start=StartValues(
            centers=centers - origin,
            rotations=np.asarray(start[1], float).reshape(-1, 3, 3),
            points=points - origin,
        ),
        control=ControlObservations(
            point=listed,
            xyz=np.where(known, given, points)[listed] - origin,
            axes=np.broadcast_to(np.eye(3), (len(listed), 3, 3)),
            sigma=np.where(known, ground_sigma, np.inf)[listed],
        ),
    )
    found = solve(problem)
    variances = cofactors_of(found).points.diagonal(axis1=1, axis2=2)
    return Bundle(
        centers=found.centers + origin,
        rotations=found.rotations,
        points=found.points + origin,
        residuals=found.image_residuals,
        sigmas=np.sqrt(variances),
        sigma0=found.sigma0,
        redundancy=found.redundancy,
        iterations=len(found.steps),
    )
