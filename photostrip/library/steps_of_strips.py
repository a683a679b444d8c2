"""Steps that take a whole strip: its forming, the ground, its deformation, the bundle."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import compress
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import GeometryError, InputError
from photostrip.geometry.similarity import Similarity, collinearity
from photostrip.library.step_arguments import Rays, of_rays, rows, same, sigma0_of
from photostrip.network.adjustment import IterationStep, solve
from photostrip.network.problem import BundleCameras, BundleProblem, ControlObservations, ImageObservations, StartValues
from photostrip.network.reliability import cofactors_of
from photostrip.points import PhotoPoints
from photostrip.strip.formed_strip import FirstPhoto, StripFormationSettings, form_from_pairs
from photostrip.strip.polynomial import POWERS, term_columns
from photostrip.strip.relative_orientation import collect_pairs, orient_pairs

Names = tuple[Sequence[str], Sequence[str]]

ON_A_LINE = 1e-6  # ratio of the spreads of points that lie on one line


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
    rays: Rays,
    principal_distance: float,
    *,
    base: float = 1.0,
    scale_transfer: Literal["least_squares", "distances"] = "least_squares",
    names: Names | None = None,
) -> Strip:
    """Form a strip from its photos alone: pairs, chain, intersection, scale transfer, without any search for errors.

    rays: photo (n,) in flight order and point (n,) as numbers from 0, and image coordinates (n, 2).
    base: length of the first base, in the unit that the strip shall have.
    scale_transfer: the weights of the pass points.
    names: of photos and points, for messages; without them their numbers.
    Raises GeometryError with one photo, or where a pair or a junction has too few common points or no solution.

    Source: [001] eq. 125-141.
    """
    photo, point, xy = of_rays(rays)
    photos, ids = (tuple(map(str, each)) for each in names or _counted(photo, point))
    if len(photos) < 2:
        raise GeometryError("a strip needs two photos", code="too-few-common-points")
    measured = PhotoPoints(
        photo_ids=photos, point_ids=ids, photo=photo, point=point, xy=xy, sigma=np.full(xy.shape, 1.0)
    )
    oriented = orient_pairs(collect_pairs(measured, photos, principal_distance), photos)
    settings, first = StripFormationSettings(scale_transfer=scale_transfer), FirstPhoto(np.eye(3), base)
    formed = form_from_pairs(oriented, settings, photos, first=first)
    points, models = np.full((len(ids), 3), np.nan), np.zeros(len(ids), np.intp)
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
class Absolute:
    """The similarity from a model to the ground, and how well it fits."""

    similarity: Similarity  # to be called with model coordinates (n, 3)
    residuals: Floats  # (n, 3): transformed minus given, metres
    sigma0: float  # standard deviation of a coordinate, metres; NaN without redundancy
    redundancy: int


def absolute(model: ArrayLike, ground: ArrayLike, weights: ArrayLike | None = None) -> Absolute:
    """Absolute orientation of a model (n, 3) on points known in all three coordinates (n, 3), by seven parameters.

    weights: (n,), of the points.
    Raises GeometryError with fewer than three points, or with all on one line.

    Source: [001] eq. 145-149.
    """
    source, target = rows(model, 3), rows(ground, 3)
    same(source, target)
    weight = np.ones(len(source)) if weights is None else np.asarray(weights, float)
    if collinearity(source[weight > 0]) < ON_A_LINE**2:
        message = "fewer than three points, or all on one line: the rotation about it is not determined"
        raise GeometryError(message, code="control-deficient")
    found = Similarity.from_points(source, target, weight)
    residuals = found.residuals(source, target)
    redundancy = 3 * int(np.count_nonzero(weight)) - 7
    squares = residuals * np.sqrt(weight)[:, None]
    return Absolute(found, residuals, sigma0=sigma0_of(squares, redundancy), redundancy=redundancy)


def polynomial(xyz: ArrayLike, misclosures: ArrayLike, terms: Sequence[str]) -> tuple[Floats, Floats]:
    """Fit the deformation of a strip along one axis by a polynomial.

    xyz: (n, 3), control points in the intermediate frame.
    misclosures: (n,), strip minus given along the axis.
    terms: as the report names them: ``"1"``, ``"X"``, ``"Y"``, ``"XY"``, ``"X^2"``.
    Returns coefficients, one for each term, and residuals (n,). Subtract the polynomial from the strip.
    Raises GeometryError where there are fewer points than terms, or they do not determine them.

    Source: [001] eq. 151.
    """
    if unknown := [each for each in terms if each not in POWERS] or ([] if terms else [""]):
        raise InputError(f"there is no term {unknown[0]!r}: {', '.join(POWERS)}")
    design = term_columns(rows(xyz, 3), list(terms))
    size = np.linalg.norm(design, axis=0)
    values = rows(np.reshape(misclosures, (-1, 1)), 1)[:, 0]
    same(design, values)
    if len(design) < design.shape[1] or np.linalg.matrix_rank(design / np.where(size > 0, size, 1)) < design.shape[1]:
        raise GeometryError(f"{len(design)} points do not determine {len(terms)} terms", code="control-deficient")
    found = np.linalg.lstsq(design / size, values, rcond=None)[0] / size
    return found, values - design @ found


@dataclass(frozen=True, eq=False)
class Bundle:
    """Photos and points adjusted together."""

    centers: Floats  # (p, 3): perspective centres
    rotations: Floats  # (p, 3, 3): photos to the frame of the points
    points: Floats  # (q, 3); NaN for a point that takes no part, as in the next two
    residuals: Floats  # (n, 2): measured minus computed image coordinates, mm
    sigmas: Floats  # (q, 3): standard deviations of the points, for the stated ones of the measurements
    sigma0: float  # standard deviation of unit weight; NaN without redundancy
    redundancy: int
    steps: tuple[IterationStep, ...]

    @property
    def iterations(self) -> int:
        return len(self.steps)


def bundle(
    rays: Rays,
    principal_distance: float,
    start: tuple[ArrayLike, ArrayLike, ArrayLike] | None = None,
    *,
    ground: ArrayLike | None = None,
    base: float = 1.0,
    sigma: float = 0.005,
    ground_sigma: float = 0.05,
    names: Names | None = None,
) -> Bundle:
    """Adjust all photos and points at once, without any search for errors.

    rays: photo (n,) and point (n,) as numbers from 0, and image coordinates (n, 2).
    start: approximate centres (p, 3), rotations (p, 3, 3) and points (q, 3), NaN for a point to be left out; without
        them what ``strip`` forms of the rays, with its first `base`, put on the ground by ``absolute``.
    ground: (q, 3), given coordinates; NaN where none is given. Without any the network is free: it stays as near to the
        points of the start as its shape lets it.
    sigma, ground_sigma: standard deviations of an image coordinate, mm, and of a given one.
    names: of photos and points, for messages; without them their numbers.
    Raises GeometryError where the rays and given coordinates do not determine the photos and points.
    """
    photo, point, xy = of_rays(rays)
    given = None if ground is None else rows(ground, 3, gaps=True)
    begun = start or _formed(rays, principal_distance, base, given, names)
    centers, rotations, points = rows(begun[0], 3), np.asarray(begun[1], float), rows(begun[2], 3, gaps=True)
    if given is None:
        given = np.full(points.shape, np.nan)
    same(points, given)
    if not (np.isin(photo, np.arange(len(centers))).all() and np.isin(point, np.arange(len(points))).all()):
        raise InputError("a ray has a photo or a point that the start does not have")
    placed, known = np.isfinite(points.sum(axis=1)), np.isfinite(given)
    listed, number, seen = np.flatnonzero(known.any(axis=1) & placed), np.cumsum(placed) - 1, placed[point]
    origin = points[placed].mean(axis=0)
    photo_ids, point_ids = names or ((), ())
    problem = BundleProblem(
        images=ImageObservations(
            photo=photo[seen], point=number[point[seen]], xy=xy[seen], sigma=np.full(xy[seen].shape, sigma)
        ),
        cameras=BundleCameras(of_photo=np.zeros(len(centers), np.intp), focal=np.array([principal_distance])),
        start=StartValues(
            centers=centers - origin, rotations=rotations.reshape(-1, 3, 3), points=points[placed] - origin
        ),
        control=ControlObservations(
            point=number[listed],
            xyz=np.where(known, given, points)[listed] - origin,
            axes=np.broadcast_to(np.eye(3), (len(listed), 3, 3)),
            sigma=np.where(known, ground_sigma, np.inf)[listed],
        ),
        photo_ids=tuple(photo_ids),
        point_ids=tuple(compress(point_ids, placed)),
    )
    found = solve(problem)
    return Bundle(
        centers=found.centers + origin,
        rotations=found.rotations,
        points=_spread(found.points + origin, placed),
        residuals=_spread(found.image_residuals, seen),
        sigmas=_spread(np.sqrt(cofactors_of(found).points.diagonal(axis1=1, axis2=2)), placed),
        sigma0=found.sigma0,
        redundancy=found.redundancy,
        steps=found.steps,
    )


def _formed(
    rays: Rays, principal_distance: float, base: float, ground: Floats | None, names: Names | None
) -> tuple[Floats, Floats, Floats]:
    """Return the strip of the rays as approximate values, on the ground where points of it are given."""
    formed = strip(rays, principal_distance, base=base, names=names)
    if ground is None:
        return formed.centers, formed.rotations, formed.points
    same(formed.points, ground)
    known = np.isfinite(ground).all(axis=1) & (formed.models > 0)
    to_ground = absolute(formed.points[known], ground[known]).similarity
    return to_ground(formed.centers), to_ground.rotation @ formed.rotations, to_ground(formed.points)


def _counted(*numbers: Numbers) -> Iterator[range]:
    return (range(int(each.max(initial=-1)) + 1) for each in numbers)


def _spread(values: Floats, taken: Flags) -> Floats:
    """Put values to the rows that took part; NaN to the others."""
    found = np.full((len(taken), values.shape[1]), np.nan)
    found[taken] = values
    return found
