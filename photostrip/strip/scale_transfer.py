"""Scale transfer: the scale of every model from the one before it, through the pass points of three photos.

Models i and i+1 have photo i+1 in common. The distances of a pass point from its perspective centre, in the model
before and in the model after, have the ratio of the scales of the two; the factor of the junction is the weighted mean
of the ratios of its points. It does not depend on the chain before it, so that all junctions are found in one batch.

Source: [001] eq. 139-141.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import GeometryError
from photostrip.statistics import normal_quantile
from photostrip.strip.relative_orientation.orientation import Orientation
from photostrip.strip.robust import medians, scales

SCALE_TRANSFERS = ("least_squares", "distances")
LEFT_RAY = "left"
INTERSECTIONS = ("mean", LEFT_RAY)
ALPHA = 0.01  # probability that a strip without gross errors loses a pass point
FEWEST_RATIOS = 3  # with two ratios nobody can tell which is wrong
SMALLEST_SIGMA = 1e-3  # mm, of a y parallax, when the pairs' own residuals have to say it


@dataclass(frozen=True)
class StripFormationSettings:
    """How model points are intersected, and models brought to one scale."""

    # ``"least_squares"``: all pass points with their precision; ``"distances"``: the textbook's mean of the ratios of
    # distances from the common centre
    scale_transfer: str = "least_squares"
    # weights of points in that, by name, on top of what the form gives them; 1 for all others
    scale_weights: dict[str, float] = field(default_factory=dict)
    # ``"mean"``: Y is the mean of both rays; ``"left"``: points lie on the left ray, as in the source
    intersection: str = "mean"


@dataclass(frozen=True, eq=False)
class Junctions:
    """Pass points that join neighbouring models, and the ratios of their scales."""

    # junction, before, after: (t,): as in ``PassPoints``
    junction: Numbers
    before: Numbers
    after: Numbers
    point: Numbers  # (t,): point of each row
    ratio: Floats  # (t,): distance from the common centre in the model before, divided by that in the model after
    used: Flags  # (t,): whether the point took part in the scale transfer
    limit: Floats  # (t,): largest relative deviation of each ratio from its junction's factor that is not rejected
    weight: Floats  # (t,): weight of each ratio in the factor; 0 where it was not used
    factor: Floats  # (j,): ratio of the scales of the models, after over before
    spread: Floats  # (j,): relative standard deviation of a single ratio; NaN with one point
    # (j,): relative deviation of the farthest pass point where no majority agrees on the factor, else 0
    doubt: Floats


class PassPoints(NamedTuple):
    """Points that two neighbouring models have in common; junction i lies between models i and i+1, at photo i+1."""

    junction: Numbers  # (t,): junction of each row, ascending
    # before, after: (t,): rows of the point in the pairs' table, in the model before and after the junction
    before: Numbers
    after: Numbers


def transfer_scale(
    orientation: Orientation,
    vectors: Floats,
    settings: StripFormationSettings,
    photos: Sequence[str],
    sigma: Floats | None = None,
    doubtful: Flags | None = None,
    *,
    searched: bool = False,
    point_weight: Floats | None = None,
) -> Junctions:
    """Scale of every model from the one before it, through the pass points at their common photo.

    vectors: (m, 3), model points in the frame of the left photo, base length 1; NaN where there is none.
    sigma: (p,), optional, standard deviation of a y parallax of weight one in each pair, mm; by default from the pairs'
        own residuals.
    doubtful: (m,), optional, rows that must not join models, unless a junction has no other.
    searched: whether the rays have been searched for gross errors: then all pass points count. Before that, those that
        lie far from the median of their junction are left out.
    point_weight: weight of each point on top of that of the form, by number; 0 joins models only where no other does.
    Raises GeometryError when no point is common to three photos in a row.
    """
    junctions = orientation.pairs.size - 1
    every = _pass_points(orientation, vectors)
    _require_pass_points(np.bincount(every.junction, minlength=junctions), photos)
    base, _ = orientation.relative
    # eq. 139-141: distances from the common centre, before over after
    ratios = np.linalg.norm(vectors[every.before] - base[every.junction], axis=1)
    ratios /= np.linalg.norm(vectors[every.after], axis=1)
    if point_weight is not None:
        idle = point_weight[orientation.point] == 0
        doubtful = idle if doubtful is None else doubtful | idle
    joining = _joining(every, junctions, doubtful)
    (junction, before, after), ratio = (each[joining] for each in every), ratios[joining]
    depth = depths(vectors[before], base[junction]), depths(vectors[after], base[junction + 1])
    quality = np.minimum(orientation.pairs.weight[before], orientation.pairs.weight[after])
    weight = np.ones(len(junction))
    if settings.scale_transfer == "least_squares":
        # a distance from the centre is known to sigma_p / p of itself, and p is inverse to the depth along the base
        weight = quality / (depth[0] ** 2 + depth[1] ** 2)
    if point_weight is not None:
        given = point_weight[orientation.point[before]]
        weight = weight * np.where(given > 0, given, 1.0)
    scatter = _scatter(orientation) if sigma is None else sigma
    # an image coordinate has half the variance of a parallax; that of the common photo acts on both distances
    coordinate = (scatter[junction] ** 2 + scatter[junction + 1] ** 2) / 4 / quality
    size = np.sqrt(coordinate * (sum(depth) ** 2 + depth[0] ** 2 + depth[1] ** 2)) / orientation.pairs.focal
    far, limit = contradictions(ratio, weight, size, junction, junctions)
    used = np.ones(len(ratio), bool) if searched else ~far
    factor, spread = mean_ratios(ratio, weight * used, junction, junctions)
    off = np.abs(np.log(ratios / factor[every.junction]))
    agrees = joining.copy()
    agrees[joining] = used & (off[joining] <= limit)
    return Junctions(
        junction=junction,
        before=before,
        after=after,
        point=orientation.point[before],
        ratio=ratio,
        used=used,
        limit=limit,
        weight=weight * used,
        factor=factor,
        spread=spread,
        doubt=_doubt(off, agrees, every.junction, junctions),
    )


def contradictions(
    ratio: Floats, weight: Floats, size: Floats, junction: Numbers, junctions: int
) -> tuple[Flags, Floats]:
    """Find the ratios far from the median of their junction, and the largest relative deviation of each that is not.

    The orientations of the two models deform them and make the ratios scatter more than the image coordinates of the
    points do: how much more, the median deviation in the whole strip tells. Of two ratios none is far, nobody can tell
    which.

    size: (t,), relative standard deviation of each ratio by its own image coordinates.
    junction: (t,), junction of each ratio, ascending.
    """
    value = np.log(ratio)
    many = (np.bincount(junction, minlength=junctions) >= FEWEST_RATIOS)[junction]
    off = np.abs(value - medians(value, weight, junction, junctions)[junction])
    counts = (many & (off > 0)).astype(float)  # the median itself says nothing
    scale = float(scales(off / size, counts, np.zeros(len(off), np.intp), 1)[0])
    limit = normal_quantile(1 - ALPHA / (2 * max(len(off), 1))) * max(1.0, np.nan_to_num(scale)) * size
    return (off > limit) & many, limit


def depths(vectors: Floats, base: Floats) -> Floats:
    """Distances of points from the base line, from vectors to them and unit vectors of the base (t, 3)."""
    (x, y, z), (u, v, w) = vectors.T, base.T
    return np.asarray(np.sqrt((y * w - z * v) ** 2 + (z * u - x * w) ** 2 + (x * v - y * u) ** 2), float)


def _scatter(orientation: Orientation) -> Floats:
    """Estimate the standard deviation of a y parallax from all pairs together."""
    known = orientation.sigma0[np.isfinite(orientation.sigma0)]
    value = np.sqrt(2.0) * np.median(known) if len(known) else 0.0
    return np.full(orientation.pairs.size, max(value, SMALLEST_SIGMA))


def _pass_points(orientation: Orientation, vectors: Floats) -> PassPoints:
    """Points that stand in both models of a junction."""
    rows = np.flatnonzero(orientation.used & np.isfinite(vectors[:, 0]))
    # the table is ordered by pair
    rows = rows[np.argsort(orientation.point[rows], kind="stable")]
    pair, point = orientation.pairs.pair[rows], orientation.point[rows]
    first = np.flatnonzero((point[1:] == point[:-1]) & (pair[1:] == pair[:-1] + 1))
    first = first[np.argsort(pair[first], kind="stable")]
    return PassPoints(pair[first], rows[first], rows[first + 1])


def _joining(points: PassPoints, junctions: int, doubtful: Flags | None) -> Flags:
    """Pass points that are not doubtful; a junction with nothing better keeps what it has."""
    if doubtful is None:
        return np.ones(len(points.junction), bool)
    good = ~(doubtful[points.before] | doubtful[points.after])
    good |= (np.bincount(points.junction, good, junctions) == 0)[points.junction]
    return np.asarray(good, bool)


def _doubt(off: Floats, agrees: Flags, junction: Numbers, junctions: int) -> Floats:
    """Largest deviation of a pass point where those that disagree are as many as those that agree."""
    doubtful = np.bincount(junction, agrees, junctions) <= np.bincount(junction, ~agrees, junctions)
    largest = np.zeros(junctions)
    np.maximum.at(largest, junction, np.where(agrees, 0.0, off))
    return np.where(doubtful, largest, 0.0)


def _require_pass_points(counts: Numbers, photos: Sequence[str]) -> None:
    for number in np.flatnonzero(counts == 0).tolist():
        names = photos[number : number + 3]
        msg = (
            f"no point is common to photos {names[0]}, {names[1]} and {names[2]}: the models on either side of photo "
            f"{names[1]} cannot be brought to one scale; measure at least one pass point on all three (three or more "
            "are recommended)"
        )
        raise GeometryError(msg, photos=names, code="broken-joint")


def mean_ratios(ratio: Floats, weight: Floats, junction: Numbers, junctions: int) -> tuple[Floats, Floats]:
    """Weighted mean ratio of each junction, and the relative standard deviation of a single one."""
    total = np.bincount(junction, weight, junctions)
    factor = np.bincount(junction, weight * ratio, junctions) / total  # eq. 139-141
    deviation = ratio / factor[junction] - 1
    count = np.bincount(junction, weight > 0, junctions)
    with np.errstate(divide="ignore", invalid="ignore"):
        spread = np.sqrt(np.bincount(junction, weight * deviation**2, junctions) / total * count / (count - 1))
    return factor, np.where(count > 1, spread, np.nan)
