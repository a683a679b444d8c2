"""Scale transfer: the scale of every model from the one before it, through the pass points of three photos.

Models i and i+1 have photo i+1 in common. The distances of a pass point from its perspective centre, in the model
before and in the model after, have the ratio of the scales of the two; the factor of the junction is the weighted mean
of the ratios of its points. It does not depend on the chain before it, so that all junctions are found in one batch.

Source: [001] eq. 139-141.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.errors import GeometryError
from photostrip.triangulation.strip_formation import scale_ratios
from photostrip.triangulation.strip_formation.scale_ratios import PassPoints

if TYPE_CHECKING:
    from collections.abc import Sequence

    from photostrip.arrays import Flags, Floats, Numbers
    from photostrip.triangulation.relative_orientation.orientation import Orientation


SCALE_TRANSFERS = ("least_squares", "distances")


@dataclass(frozen=True)
class StripFormationSettings:
    """How models are brought to one scale."""

    # ``"least_squares"``: all pass points with their precision; ``"distances"``: the textbook's mean of the ratios of
    # distances from the common centre
    scale_transfer: str = "least_squares"


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

    def with_new(self, fresh: Junctions, renewed: Flags) -> Junctions:
        """Put junctions that were made anew, shape (j,), in the place of these."""
        kept = ~renewed[self.junction]
        order = np.argsort(np.concatenate([self.junction[kept], fresh.junction]), kind="stable")
        rows = {
            name: np.concatenate([getattr(self, name)[kept], getattr(fresh, name)])[order]
            for name in ("junction", "before", "after", "point", "ratio", "used", "limit", "weight")
        }
        by_junction = {
            name: np.where(renewed, getattr(fresh, name), getattr(self, name)) for name in ("factor", "spread")
        }
        return Junctions(**rows, **by_junction)


def transfer_scale(
    orientation: Orientation,
    vectors: Floats,
    settings: StripFormationSettings,
    photos: Sequence[str],
    sigma: Floats | None = None,
    doubtful: Flags | None = None,
    renewed: Flags | None = None,
) -> Junctions:
    """Scale of every model from the one before it, through the pass points at their common photo.

    vectors: (m, 3), model points in the frame of the left photo, base length 1; NaN where there is none.
    sigma: (p,), optional, standard deviation of a y parallax of weight one in each pair, mm; by default from the pairs'
        own residuals.
    doubtful: (m,), optional, rows that must not join models, unless a junction has no other.
    renewed: (p - 1,), optional, junctions that are wanted; all by default. The others have no rows and the factor NaN.
    Raises GeometryError when no point is common to three photos in a row.
    """
    junctions = orientation.pairs.size - 1
    wanted = np.ones(junctions, bool) if renewed is None else renewed
    joined = _pass_points(orientation, vectors, wanted, doubtful)
    _require_pass_points(joined.junction, wanted, photos)
    junction, before, after = joined
    base, _ = orientation.relative
    # eq. 139-141: distances from the common centre, before over after
    ratio = np.linalg.norm(vectors[before] - base[junction], axis=1) / np.linalg.norm(vectors[after], axis=1)
    weight = _weights(orientation, vectors, joined, settings)
    spreads = scale_ratios.spreads(orientation, vectors, joined, sigma)
    count = int(wanted.sum())
    number = (np.cumsum(wanted) - 1)[junction]
    used, limit = scale_ratios.screen(ratio, weight, spreads, number, count)
    factor, spread = np.full((2, junctions), np.nan)
    factor[wanted], spread[wanted] = mean_ratios(ratio, weight * used, number, count)
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
    )


def _pass_points(orientation: Orientation, vectors: Floats, wanted: Flags, doubtful: Flags | None) -> PassPoints:
    """Points that stand in both models of the wanted junctions."""
    left_of = np.append(wanted, False)  # (p,): models with a wanted junction behind them
    near = left_of | np.append(False, wanted)
    rows = np.flatnonzero(orientation.used & np.isfinite(vectors[:, 0]) & near[orientation.pairs.pair])
    pair, point = orientation.pairs.pair[rows], orientation.point[rows]
    # the table is ordered by pair
    order = np.argsort(point, kind="stable")
    rows, pair, point = rows[order], pair[order], point[order]
    both = (point[1:] == point[:-1]) & (pair[1:] == pair[:-1] + 1) & left_of[pair[:-1]]
    first = np.flatnonzero(both)
    before, after, junction = rows[first], rows[first + 1], pair[first]
    if doubtful is not None:
        good = ~(doubtful[before] | doubtful[after])
        # a junction with nothing better keeps what it has
        good |= (np.bincount(junction, good, orientation.pairs.size) == 0)[junction]
        before, after, junction = before[good], after[good], junction[good]
    order = np.argsort(junction, kind="stable")
    return PassPoints(junction[order], before[order], after[order])


def _require_pass_points(junction: Numbers, wanted: Flags, photos: Sequence[str]) -> None:
    counts = np.bincount(junction, minlength=len(wanted))
    for number in np.flatnonzero((counts[: len(wanted)] == 0) & wanted).tolist():
        names = photos[number : number + 3]
        msg = (
            f"no point is common to photos {names[0]}, {names[1]} and {names[2]}: the models on either side of photo "
            f"{names[1]} cannot be brought to one scale; measure at least one pass point on all three (three or more "
            "are recommended)"
        )
        raise GeometryError(msg, photos=names, code="broken-joint")


def _weights(orientation: Orientation, vectors: Floats, joined: PassPoints, settings: StripFormationSettings) -> Floats:
    """Weights of the ratios: 1 in the textbook form, otherwise by the parallaxes that made the distances."""
    junction, before, after = joined
    if settings.scale_transfer == "distances":
        return np.ones(len(before))
    base, _ = orientation.relative
    # A distance from the centre is known to sigma_p / p of itself, and p is inverse to the depth along the base.
    depth_before = scale_ratios.depths(vectors[before], base[junction])
    depth_after = scale_ratios.depths(vectors[after], base[junction + 1])
    quality = np.minimum(orientation.pairs.weight[before], orientation.pairs.weight[after])
    return quality / (depth_before**2 + depth_after**2)


def mean_ratios(ratio: Floats, weight: Floats, junction: Numbers, junctions: int) -> tuple[Floats, Floats]:
    """Weighted mean ratio of each junction, and the relative standard deviation of a single one."""
    total = np.bincount(junction, weight, junctions)
    factor = np.bincount(junction, weight * ratio, junctions) / total  # eq. 139-141
    deviation = ratio / factor[junction] - 1
    count = np.bincount(junction, weight > 0, junctions)
    with np.errstate(divide="ignore", invalid="ignore"):
        spread = np.sqrt(np.bincount(junction, weight * deviation**2, junctions) / total * count / (count - 1))
    return factor, np.where(count > 1, spread, np.nan)
