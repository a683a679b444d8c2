"""What was rejected of the control, how large its errors are, and what seems to have happened.

Wrong control: coordinates that the strip and all other control contradict.

The most significant hypothesis (a point in plan, in height, in both) is deleted and the rest tested again, until
nothing is significant (``control_search``). Where the covariance does not explain what is left, the smallest set is
looked for without which it does: wrong coordinates, and bends of the strip beyond it (``candidates``). Where
there is none, what the tests of single points found is all.

Source: derived; data snooping with correlated observations.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import chain, combinations
from random import Random
from typing import NamedTuple

import numpy as np
from scipy.special import fdtri

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import PhotostripError
from photostrip.geometry.similarity import similar
from photostrip.points import ControlPoints
from photostrip.rejection import Rejection
from photostrip.statistics import normal_quantile
from photostrip.strip.control_search import (
    ALPHA,
    Columns,
    Deletion,
    JointAdjustment,
    StripAtControl,
    adjust,
    independent,
    projected,
)
from photostrip.strip.pair_search import LIKELIER

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


DRAWN, DRAWS = 3, 200  # points of a similarity, and similarities: of half good points, one in eight is of these alone
KEPT = 5.0  # median residuals within which a point goes with the others
BENT = 2.5  # standard deviation of unit weight beyond which more is wrong with a strip than its control


@dataclass(frozen=True, eq=False)
class ScreenedControl:
    """The control of a strip with ``use`` false where a coordinate was rejected."""

    kept: ControlPoints
    rejections: tuple[Rejection, ...]  # rows of the control
    # how far the others check each coordinate (n, 3): redundancy number, and smallest error in metres that is found in
    # 80 % of cases, infinite where none is; NaN without a test
    redundancy: Floats
    detectable: Floats


def screen_control(strip: StripAtControl) -> ScreenedControl:
    """Take wrong coordinates out of the control of a strip."""
    use, rejections = strip.control.use.copy(), []
    redundancy, detectable = np.full((2, *use.shape), np.nan)
    for rows, section in strip.sections:
        found = search(section)
        if found is not None:
            use[rows] = kept_of(section, found)
            rejections += control_rejections(section, found, rows)
            redundancy[rows], detectable[rows] = reliability(section, found)
    rejections.sort(key=lambda each: each.row)
    return ScreenedControl(
        kept=replace(strip.control, use=use),
        rejections=tuple(rejections),
        redundancy=redundancy,
        detectable=detectable,
    )


def not_screened(control: ControlPoints) -> ScreenedControl:
    unknown = np.full(control.use.shape, np.nan)
    return ScreenedControl(kept=control, rejections=(), redundancy=unknown, detectable=unknown)


def search(strip: StripAtControl) -> FoundErrors | None:
    """Search for what is wrong in a section; None where its control does not check itself."""
    count = len(strip.coordinates.point)
    if count <= strip.design.shape[1]:
        return None
    first = found = _found(strip)
    if not first or not first[0].left.explained:  # much may be wrong
        kept, full = strip.control.use.copy(), np.flatnonzero(strip.control.use.all(axis=1))
        kept[full] = majority(strip.xyz[full], strip.targets.of_full[full])[:, None]
        much = (_found(strip, much=True, bends=bends) for bends in (True, False))
        found = [*first, *chain.from_iterable(much), *_found(strip, kept)]
    told = [
        each
        for each in found
        if each.whole.allows(each.out) and each.left.squares <= BENT**2 * max(each.left.freedom, 1)
    ]
    if not told:
        return FoundErrors(first[0].whole, ()) if first else None
    # of two equally small explanations the one that blames less control, or explains more
    best = min(
        told, key=lambda each: (not each.left.explained, len(each.out), len(each.coordinates), each.left.squares)
    )
    # where much is wrong, little is left to check the rest of wrong points, and to be lost
    return FoundErrors(best.whole, best.whole.completed(best.out)) if first and best is first[0] else best


def _found(
    strip: StripAtControl, start: Flags | None = None, *, much: bool = False, bends: bool = False
) -> list[FoundErrors]:
    """Search; nothing where the control leaves the strip free, or would without what is suspected."""
    try:
        return [first_search(strip, start, much=much, bends=bends)]
    except (PhotostripError, np.linalg.LinAlgError):
        return []


def first_search(
    strip: StripAtControl, start: Flags | None = None, *, much: bool = False, bends: bool = False
) -> FoundErrors:
    """Take out one after the other, lay the strip on what is kept, and search from there, until the same is found.

    start: (n, 3), coordinates that are kept at first; all, if not said.
    """
    kept, out = strip.control.use if start is None else start, None
    for _ in strip.coordinates.point:
        laid = strip.laid if kept is strip.control.use else strip.laid_on(kept)
        whole = adjust(laid, laid.misclosures(), strip.joint_covariance, bends=bends)
        if out is None:
            place = strip.coordinates
            out = candidates(whole) if much else tuple(np.flatnonzero(~kept[place.point, place.axis]).tolist())
        out = whole.shrunk(whole.grown(whole.shrunk(out)))
        if much:
            out = whole.shrunk(whole.grown(whole.exchanged(out)))
        found = FoundErrors(whole, out)
        before, kept = kept, kept_of(strip, found)
        if np.array_equal(before, kept):
            break
    return found


def majority(strip: Floats, given: Floats) -> Flags:
    """Points (n,) without those that the similarity which fits half of them best leaves farthest.

    Similarities through three points are drawn, that whose median residual is least is taken. Errors of many points
    turn a similarity of all of them so far that the least sum of squares lies elsewhere.

    strip, given: (n, 3), strip and Cartesian coordinates.
    Source: [Rousseeuw 1984].
    """
    if len(strip) <= DRAWN:
        return np.ones(len(strip), bool)
    draw = Random(len(strip))  # noqa: S311 (the same for the same number)
    triples = np.array([draw.sample(range(len(strip)), DRAWN) for _ in range(DRAWS)])
    off = np.linalg.norm(given - similar(strip[triples], given[triples], strip), axis=2)
    half = np.partition(off, len(strip) // 2, axis=1)[:, len(strip) // 2]
    best = int(half.argmin())
    return np.asarray(off[best] <= KEPT * half[best], bool)


def candidates(whole: JointAdjustment) -> Columns:
    """Columns whose own variance exceeds that with which all others predict them; as many as leave a check.

    Errors that hide each other are found by no test of single points. So plan and height of every point, and every bend
    of the strip, get a variance of their own beside the covariance of the misclosures. All begin as large as the
    largest misclosure, and each is multiplied by its own test value, the root of (M w)_K^T (M w)_K / tr M_KK, as often
    as there are parts (by the square, as in the source, into worse sets). Source: [Förstner 1979].
    """
    part = np.concatenate([np.full(len(columns), number) for number, columns in enumerate(whole.parts)])
    columns = np.concatenate([np.array(columns) for columns in whole.parts])
    errors = whole.errors[:, columns]
    variance = np.full(len(whole.parts), float(np.abs(whole.w).max() ** 2 + whole.covariance.max()))
    for _ in whole.parts:
        covariance = whole.covariance + (errors * variance[part]) @ errors.T
        projector = projected(independent(covariance), whole.design)
        squares = np.bincount(part, (errors.T @ (projector @ whole.w)) ** 2)
        expected = np.bincount(part, np.einsum("ij,ij->j", errors, projector @ errors))
        # of what nothing checks, rounding leaves less than nothing
        variance *= np.sqrt(np.divide(squares, expected, out=np.ones_like(squares), where=expected > 0.0))
    predicted = np.bincount(part, (whole.matrix.diagonal() * whole.size**2)[columns]) / np.bincount(part)
    share = variance * predicted
    found: list[int] = []
    for number in np.argsort(-share, kind="stable").tolist():
        if share[number] <= 1 or len(found) + len(whole.parts[number]) >= whole.freedom:
            break
        found += whole.parts[number]
    return tuple(found)
