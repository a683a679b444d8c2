"""What was rejected of the control, how large its errors are, and what seems to have happened."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.special import fdtri

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.rejection import Rejection
from photostrip.statistics import normal_quantile
from photostrip.strip.error_propagation.strip_at_control import StripAtControl
from photostrip.strip.gross_errors.control.control_deletion import (
    ALPHA,
    Columns,
    Deletion,
    JointAdjustment,
    adjust,
)
from photostrip.strip.gross_errors.pairs.deletion import LIKELIER

EXCHANGED, WRONG_IMAGE, EITHER = "exchanged", "image", "image or coordinates"
POWER = 0.8  # an error is called detectable when it is found in this share of cases


class FoundErrors(NamedTuple):
    """What a search took out."""

    whole: JointAdjustment  # with all control
    out: Columns  # coordinates and bends

    @property
    def left(self) -> JointAdjustment:
        """The adjustment without what was taken out."""
        return self.whole.without(self.out)

    @property
    def coordinates(self) -> Columns:
        """What was taken out of the given coordinates."""
        return tuple(column for column in self.out if column < self.whole.coordinates)


def kept_of(strip: StripAtControl, found: FoundErrors) -> Flags:
    """Coordinates that stay (n, 3)."""
    kept = strip.control.use.copy()
    out = list(found.coordinates)
    kept[strip.coordinates.point[out], strip.coordinates.axis[out]] = False
    return kept


def control_rejections(strip: StripAtControl, found: FoundErrors, rows: Numbers) -> list[Rejection]:
    """List the points with rejected coordinates; rows: of the section's control in that of the whole strip."""
    if not found.coordinates:
        return []
    place, partner, rejections = strip.coordinates, _exchanges(strip, found), []
    for point in found.whole.points:
        part = tuple(column for column in point if column in found.coordinates)
        if not part:
            continue
        row = int(place.point[point[0]])
        tested = found.whole.test(found.out, part)
        others = found.whole.without([column for column in found.out if column not in point])
        cause, photo = _wrong_image(strip, others, point, part, found.whole.level)
        size = np.zeros(3)
        size[place.axis[list(point)]] = -others.estimate(point)
        deviation = np.sqrt(tested.spread * others.cofactor(part).diagonal()) / others.size[list(part)]
        single = np.abs(others.estimate(part)) / deviation
        beyond = [
            column for column, value in zip(part, single, strict=True) if value > _limit(tested.freedom, found.whole, 1)
        ]
        rejections.append(
            Rejection(
                kind="control",
                row=int(rows[row]),
                test="left out",
                axes=tuple(place.axis[beyond or list(part)].tolist()),
                value=float(np.sqrt(tested.gain / tested.spread)),
                limit=_limit(tested.freedom, found.whole, len(part)),
                size=tuple(size.tolist()),
                cause=EXCHANGED if row in partner else cause,
                other=int(rows[partner[row]]) if row in partner else photo,
            )
        )
    return rejections


def reliability(strip: StripAtControl, found: FoundErrors) -> tuple[Floats, Floats]:
    """Redundancy numbers M_ii / (D^-1)_ii [Schaffrin 1997], and smallest errors found in 80 % of cases, (n, 3) each."""
    redundancy, detectable = np.full((2, *strip.control.use.shape), np.nan)
    left, place = found.left, strip.coordinates
    redundancy[place.point, place.axis] = left.matrix.diagonal()[: left.coordinates]
    stay = [column for column in range(left.coordinates) if column not in found.coordinates]
    gone = [
        (found.whole.without([other for other in found.out if other != column]), [column])
        for column in found.coordinates
    ]
    for others, columns in [(left, stay), *gone]:
        where = place.point[columns], place.axis[columns]
        gain = others.gains([(column,) for column in columns])
        detectable[where] = np.inf
        if others.freedom > 1 and np.isfinite(gain).any():
            limit = _limit(others.freedom, found.whole, 1) + normal_quantile(POWER)
            with np.errstate(divide="ignore", invalid="ignore"):  # where nothing checks the coordinate
                deviation = np.sqrt(1.0 / others.matrix[columns, columns]) / others.size[columns]
            spread = np.maximum(1.0, (others.squares - gain) / (others.freedom - 1))
            detectable[where] = np.where(np.isfinite(gain), limit * np.sqrt(spread) * deviation, np.inf)
    return redundancy, detectable


def _limit(freedom: int, whole: JointAdjustment, count: int) -> float:
    """Critical value of the length of an error of some coordinates, in standard deviations."""
    return float(np.sqrt(count * fdtri(count, freedom - count, 1 - whole.level)))


def _wrong_image(
    strip: StripAtControl, others: JointAdjustment, point: Columns, part: Columns, level: float
) -> tuple[str, int]:
    """Find the photo whose image of the point is wrong, not its coordinates, or may be; -1 where there is none.

    An error of the image moves the point along its other ray. Where that explains all its misclosures, it is to blame
    when the rejected coordinates do not, and one of both when they do, about as well: a height under a steep ray.
    """
    row = strip.coordinates.point[point[0]]
    columns = [column for column, ray in enumerate(strip.rays, others.first_ray) if ray.point == row]
    if not columns or len(point) == 1:
        return "", -1
    (everything,), (alone,) = others.deletions([point]), others.deletions([part])
    moved = max(others.deletions([(column,) for column in columns]), key=lambda each: each.gain)
    if _beside(everything, moved).probability <= (level if part == point else ALPHA):
        return "", -1
    photo, ahead = strip.rays[moved.columns[0] - others.first_ray].photo, (moved.gain - alone.gain) / everything.spread
    if part == point or _beside(everything, alone).probability <= ALPHA or ahead > LIKELIER:
        return WRONG_IMAGE, photo
    return (EITHER, photo) if ahead > -LIKELIER else ("", -1)


def _beside(everything: Deletion, some: Deletion) -> Deletion:
    """Test what all coordinates of a point explain beside some error of it."""
    return Deletion(
        columns=everything.columns[len(some.columns) :],
        gain=everything.gain - some.gain,
        squares=everything.squares - some.gain,
        freedom=everything.freedom - len(some.columns),
    )


def _exchanges(strip: StripAtControl, found: FoundErrors) -> dict[int, int]:
    """Find pairs of rejected points that the others predict when each has the coordinates of the other."""
    control, whole, place = strip.control, found.whole, strip.coordinates
    kept = kept_of(strip, found)
    wrong, laid = np.flatnonzero((control.use & ~kept)[:, 0]).tolist(), strip.laid_on(kept)
    partner: dict[int, int] = {}
    for one, other in combinations(wrong, 2):
        if control.frame[one] != control.frame[other] or not (control.use[one] == control.use[other]).all():
            continue
        order = np.arange(len(control))
        order[[one, other]] = other, one
        exchanged = laid.misclosures(replace(control, enu=control.enu[order]))
        tried = adjust(laid, exchanged, whole.covariance, bends=whole.first_ray > whole.coordinates)
        both = tuple(np.flatnonzero(np.isin(place.point, (one, other))).tolist())
        before = tried.without([column for column in found.out if column not in both])
        gain = before.squares - before.without(both).squares
        exchange = Deletion(columns=both, gain=gain, squares=before.squares, freedom=before.freedom)
        if exchange.probability > whole.level:
            partner[one], partner[other] = other, one
    return partner
