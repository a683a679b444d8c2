"""A strip at its control: misclosures of all coordinates with their covariance, in sections of a long strip.

Minimum deletion at the control: what the sum of squares loses without coordinates, and the tests made of it.

All misclosures w have the covariance D; a similarity, derivatives A, takes its part out. With
M = D^-1 - D^-1 A (A^T D^-1 A)^-1 A^T D^-1 the sum of squares is w^T M w, and without coordinates K it is smaller
by (M w)_K^T (M_KK)^-1 (M w)_K, the principle of ``pair_screening``. The same holds for other errors, columns h with
h^T M h and h^T M w: bends of the strip beyond its covariance, and wrong images of a control point.

One multivariate test for each point, plan, height and all, by F in units of the scatter of the others, which is never
taken for less than the covariance says.

Source: derived; data snooping with correlated observations.

What was rejected of the control, how large its errors are, and what seems to have happened.

Wrong control: coordinates that the strip and all other control contradict.

The most significant hypothesis (a point in plan, in height, in both) is deleted and the rest tested again, until
nothing is significant. Where the covariance does not explain what is left, the smallest set is
looked for without which it does: wrong coordinates, and bends of the strip beyond it (``candidates``). Where
there is none, what the tests of single points found is all.

Source: derived; data snooping with correlated observations.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, combinations
from random import Random
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import fdtri

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import GeometryError, PhotostripError
from photostrip.geometry.similarity import Similarity, similar
from photostrip.points import ControlPoints
from photostrip.rejection import Rejection
from photostrip.statistics import chi2_quantile, f_p_value, normal_quantile
from photostrip.strip import absolute_orientation, polynomial
from photostrip.strip.absolute_orientation import Targets
from photostrip.strip.fitted_strip import Misclosures
from photostrip.strip.pair_screening import LIKELIER, gains

ENOUGH = 1e-5  # of half the strip: the adjustment of the misclosures takes out what is left, but for its square
LARGEST_SECTION = 100  # control coordinates of a section: what one adjustment takes


class ControlRay(NamedTuple):
    """The ray of a control point on two photos along which the error of its image in the other photo moves it."""

    point: int
    photo: int  # place in the strip of the other photo, whose image would be wrong
    direction: Floats  # (3,): of the ray, unit vector in strip coordinates


@dataclass(frozen=True, eq=False)
class StripAtControl:
    """Where a strip, or a section of it, stands when its control is tested."""

    targets: Targets  # the control
    xyz: Floats  # (n, 3): strip coordinates of the control points
    similarity: Similarity  # into the intermediate frame, metres
    weight: Floats  # (n, 3): weights of their coordinates in the similarity
    rays: Sequence[ControlRay]
    coordinates: Misclosures  # the w coordinates that count
    design: Floats  # (w, 7): their derivatives by a similarity
    covariance: Callable[[Numbers], Floats]  # of some of them, strip and control together, (w, w), metres^2
    share: float  # of a section in the coordinates of the whole strip

    @property
    def control(self) -> ControlPoints:
        return self.targets.control

    @cached_property
    def placed(self) -> Floats:
        """The control points in the intermediate frame (n, 3), metres."""
        return self.similarity(self.xyz)

    @cached_property
    def joint_covariance(self) -> Floats:
        """Covariance of all misclosures (w, w), metres^2."""
        return self.covariance(np.arange(len(self.coordinates.point)))

    @cached_property
    def sections(self) -> list[tuple[Numbers, StripAtControl]]:
        """Cut the control along the strip into parts of equal size; rows of each, and the strip there."""
        order = np.argsort(self.placed[:, 0], kind="stable")
        before = np.cumsum(self.control.use[order].sum(axis=1)) - 1
        total = len(self.coordinates.point)
        part = before * -(-total // LARGEST_SECTION) // max(total, 1)
        parts = [np.sort(order[part == number]) for number in np.unique(part)]
        return [(rows, self.at(rows)) for rows in parts]  # none of them holds the whole, which holds them

    def at(self, rows: Numbers) -> StripAtControl:
        """Return the strip at some of its control points, numbered anew; covariances stay those of the whole strip."""
        place, targets, covariance = np.full(len(self.control), -1), self.targets, self.covariance
        place[rows] = np.arange(len(rows))
        inside = np.flatnonzero(place[self.coordinates.point] >= 0)
        return replace(
            self,
            targets=replace(targets, control=targets.control.take(rows), known=targets.of_full[rows]),
            xyz=self.xyz[rows],
            weight=self.weight[rows],
            rays=[ray._replace(point=int(place[ray.point])) for ray in self.rays if place[ray.point] >= 0],
            coordinates=replace(self.coordinates.take(inside), point=place[self.coordinates.point[inside]]),
            design=self.design[inside],
            covariance=lambda some: covariance(inside[some]),
            share=len(inside) / len(self.design),
        )

    @cached_property
    def laid(self) -> StripAtControl:
        return self.laid_on(self.control.use)

    def laid_on(self, kept: Flags) -> StripAtControl:
        """Lay the strip on what is kept: a wrong point of 200 m turns it, and its rays, by a hundredth."""
        found, axes = self.coordinates, np.zeros((*kept.shape, 3))
        axes[found.point, found.axis] = found.direction  # PROJ would take half of the time of the screening for them
        targets = self.targets
        if kept is not self.control.use:
            targets = replace(targets, control=replace(self.control, use=kept), known=None)
        laid = absolute_orientation.lay(self.xyz, targets, np.where(kept, self.weight, 0.0), known=axes, enough=ENOUGH)
        return replace(self, similarity=laid.similarity)

    def misclosures(self, control: ControlPoints | None = None) -> Floats:
        """Strip minus given (w,), metres along the ground axes; control: other coordinates than the given ones."""
        given = (replace(self.targets, control=control, known=None) if control else self.targets).of(self.placed)
        found = self.coordinates
        return np.asarray(np.einsum("wi,wi->w", found.direction, (self.placed - given)[found.point]), float)


Columns = tuple[int, ...]


ALPHA = 0.01  # of rejecting anything in a strip without wrong control
SAME_POINT = 0.05  # of rejecting the rest of points of which a part is wrong: one identification makes both wrong
LARGEST_SHARE = 0.5  # of the coordinates of plan or of height: nothing is said against a majority
BENDS = tuple(term for term, (i, j) in polynomial.POWERS.items() if i + j > 1)  # what a similarity leaves
HEIGHT = 2
# The covariance of a strip takes most of a bend; what is left tells it all the same, as far as there are digits.
ROUNDING = float(np.sqrt(np.finfo(float).eps))


@dataclass(frozen=True)
class Deletion:
    """What the sum of squares loses without some columns."""

    columns: Columns
    gain: float
    squares: float  # sum of squares with them
    freedom: int

    @property
    def spread(self) -> float:
        """Variance factor of the others, at least 1: what is not modelled makes misclosures larger, never smaller."""
        rest = self.freedom - len(self.columns)
        return max(1.0, (self.squares - self.gain) / rest) if rest > 0 else np.inf

    @property
    def ratio(self) -> float:
        """Test value, distributed as F."""
        return self.gain / len(self.columns) / self.spread

    @property
    def probability(self) -> float:
        """Probability of a larger test value by chance; 1 where nothing checks the columns."""
        rest = self.freedom - len(self.columns)
        return f_p_value(self.ratio, len(self.columns), rest) if rest > 0 and np.isfinite(self.gain) else 1.0


@dataclass(frozen=True, eq=False)
class JointAdjustment:
    """The misclosures adjusted together; columns are the w coordinates, then the bends, then the rays."""

    w: Floats  # (w,): misclosures, metres
    covariance: Floats  # (w, w): D
    design: Floats  # (w, 7): A
    errors: Floats  # (w, h): H, what the columns do to the misclosures
    size: Floats  # (h,): square root of the diagonal of H^T D^-1 H, by which the columns are divided below
    matrix: Floats  # (h, h): H^T M H
    pull: Floats  # (h,): H^T M w
    squares: float  # w^T M w
    freedom: int
    alpha: float  # of rejecting anything of these
    points: tuple[Columns, ...]  # columns of each control point
    parts: tuple[Columns, ...]  # columns of plan and of height of each, and of each bend
    height: Flags  # (w,)
    first_ray: int  # column of the first ray

    @property
    def coordinates(self) -> int:
        """Number of given coordinates, which are the first columns."""
        return len(self.w)

    @cached_property
    def hypotheses(self) -> list[Columns]:
        """Columns of plan, of height and of all coordinates of every point."""
        return sorted({*self.points, *(part for part in self.parts if part[0] < self.coordinates)})

    @cached_property
    def level(self) -> float:
        """Level of a single test: its share of that of all."""
        return self.alpha / max(len(self.hypotheses), 1)

    @property
    def explained(self) -> bool:
        """Whether the covariance explains the misclosures: the test of the whole."""
        return self.freedom > 0 and self.squares <= chi2_quantile(1 - self.alpha, self.freedom)

    def without(self, out: Sequence[int]) -> JointAdjustment:
        """Delete columns; their rows become zero."""
        if not len(out):
            return self
        rows = list(out)
        cofactor = self.cofactor(rows)
        back = cofactor @ self.matrix[rows]
        matrix, pull = self.matrix - self.matrix[:, rows] @ back, self.pull - self.pull[rows] @ back
        matrix[rows] = matrix[:, rows] = pull[rows] = 0.0
        gain = self.pull[rows] @ cofactor @ self.pull[rows]
        return replace(
            self,
            matrix=matrix,
            pull=pull,
            squares=max(self.squares - float(gain), 0.0),
            freedom=self.freedom - len(rows),
        )

    def estimate(self, columns: Sequence[int]) -> Floats:
        """Errors of some columns together, of strip minus given, metres."""
        rows = list(columns)
        return np.asarray(self.cofactor(rows) @ self.pull[rows], float) / self.size[rows]

    def cofactor(self, columns: Sequence[int]) -> Floats:
        """Inverse of M_KK."""
        rows = list(columns)
        return np.asarray(np.linalg.pinv(self.matrix[np.ix_(rows, rows)], hermitian=True), float)

    def gains(self, sets: Sequence[Columns]) -> Floats:
        """Say what the sum of squares loses without each of k sets of one size, (k,)."""
        return gains(self.pull[None], self.matrix[None], np.array(sets, np.intp), ROUNDING)[0]

    def deletions(self, sets: Iterable[Columns], level: float = 1.0) -> list[Deletion]:
        """Delete each set by itself; below a level of 1 only those are told that chi-square alone finds significant."""
        found = []
        chosen = list(sets)
        for count in sorted({len(each) for each in chosen}):
            same = [each for each in chosen if len(each) == count]
            least = chi2_quantile(1 - level, count) if level < 1.0 else None
            found += [
                Deletion(columns=columns, gain=value, squares=self.squares, freedom=self.freedom)
                for columns, value in zip(same, self.gains(same).tolist(), strict=True)
                if least is None or value > least
            ]
        return found

    def allows(self, out: Sequence[int]) -> bool:
        """Whether what is left is a majority in plan and in height, and checks itself."""
        gone = self.height[[column for column in out if column < self.coordinates]]
        heights, plan = LARGEST_SHARE * self.height.sum(), LARGEST_SHARE * (~self.height).sum()
        return bool(gone.sum() <= heights and (~gone).sum() <= plan and self.freedom > len(out))

    def grown(self, out: Columns = ()) -> Columns:
        """Delete the most significant hypothesis, test the others again, until none is significant."""
        left = self.without(out)
        found = [
            each
            for each in left.deletions(self.hypotheses, self.level)
            # F needs more than chi-square does
            if each.gain > chi2_quantile(1 - self.level, len(each.columns)) * each.spread
        ]
        best = min(found, key=lambda each: (each.probability, -each.ratio), default=None)
        if best is None or best.probability >= self.level:
            return out
        return self.grown((*out, *best.columns))

    def completed(self, out: Columns) -> Columns:
        """Add what else is wrong of a point: an error of its identity is one of plan and height."""
        gone = set(out)
        left = [tuple(column for column in point if column not in gone) for point in self.points if gone & set(point)]
        tests = self.without(out).deletions(rest := [each for each in left if each])
        more = [column for each in tests if each.probability < SAME_POINT / len(rest) for column in each.columns]
        return (*out, *more) if self.allows((*out, *more)) else out

    def shrunk(self, out: Columns) -> Columns:
        """Take back what the others predict after all, the least significant part first."""
        best = max(self.tests(out), key=lambda each: each.probability, default=None) if out else None
        if best is None or best.probability < self.level:
            return out
        return self.shrunk(tuple(column for column in out if column not in best.columns))

    def exchanged(self, out: Columns) -> Columns:
        """Leave a majority, then exchange a part for one of its size while the sum of squares falls [Hawkins 1994]."""
        while not self.allows(out):
            least = min(self.tests(out), key=lambda each: each.ratio).columns
            out = tuple(column for column in out if column not in least)
        best = self.without(out).squares
        for part in [each for each in self.parts if set(each) <= set(out)]:
            rest = tuple(column for column in out if column not in part)
            others = [each for each in self.parts if len(each) == len(part) and not set(each) & set(out)]
            left = self.without(rest).deletions(others)
            found = max(left, key=lambda each: each.gain, default=None)
            if found is None or found.squares - found.gain >= (1 - ROUNDING) * best:
                continue
            other = (*rest, *found.columns)
            if (
                self.without(other).squares < (1 - ROUNDING) * best
            ):  # the gain of columns that nearly depend is rounding
                return self.exchanged(other)
        return out

    def tests(self, out: Columns) -> list[Deletion]:
        """Test every part that was deleted, beside the other deleted ones, against what stays."""
        rows = np.array(out, np.intp)
        cofactor = self.cofactor(out)
        told = np.abs(np.diagonal(cofactor @ self.matrix[np.ix_(rows, rows)]) - 1) < ROUNDING
        error = cofactor @ self.pull[rows]
        left, freedom, found = self.squares - float(self.pull[rows] @ error), self.freedom - len(out), []
        place = {column: number for number, column in enumerate(out)}
        parts = [part for part in self.parts if set(part) <= set(out)]
        for count in sorted({len(part) for part in parts}):  # all of one size at once
            same = [part for part in parts if len(part) == count]
            at = np.array([[place[column] for column in part] for part in same], np.intp)
            weight = np.linalg.pinv(cofactor[at[:, :, None], at[:, None, :]], hermitian=True)
            gain = np.einsum("ni,nij,nj->n", error[at], weight, error[at])
            gain[~told[at].all(axis=1)] = -np.inf
            found += [
                Deletion(columns=part, gain=each, squares=left + each, freedom=freedom + count)
                for part, each in zip(same, gain.tolist(), strict=True)
            ]
        return sorted(found, key=lambda each: each.columns)

    def test(self, out: Columns, part: Columns) -> Deletion:
        """Test a part against what stays, whether it was deleted or not."""
        return self.without([column for column in out if column not in part]).deletions([part])[0]


def adjust(strip: StripAtControl, w: Floats, covariance: Floats, *, bends: bool = False) -> JointAdjustment:
    """Adjust misclosures w (w,) with their covariance.

    bends: whether the strip may be bent more than its covariance says, by polynomials.
    """
    found = strip.coordinates
    count, turn = len(w), strip.similarity.rotation
    position = strip.placed - strip.placed.mean(axis=0)
    columns = polynomial.term_columns(position / np.maximum(np.abs(position).max(axis=0), 1e-9), BENDS if bends else ())
    bent = (columns[found.point][:, :, None] * found.direction[:, None, :]).reshape(count, -1)
    rays = [(found.point == ray.point) * (found.direction @ turn @ ray.direction) for ray in strip.rays]
    others = np.column_stack([bent, *rays])  # errors beside those of the coordinates themselves
    try:
        free = independent(covariance)
    except np.linalg.LinAlgError:
        message = "the strip is too badly determined at its control to be tested against it"
        raise GeometryError(message) from None
    size = np.linalg.norm(np.column_stack([free, free @ others]), axis=0)
    projector = projected(free, strip.design)
    half = np.concatenate([projector, others.T @ projector])  # H^T M
    points, parts = defaultdict(list), defaultdict(list)
    height = found.axis == HEIGHT
    for column, (point, is_height) in enumerate(zip(found.point.tolist(), height.tolist(), strict=True)):
        points[point].append(column)
        parts[point, is_height].append(column)
    pull = half @ w
    return JointAdjustment(
        w=w,
        covariance=covariance,
        design=strip.design,
        errors=np.column_stack([np.eye(count), others]),
        size=size,
        matrix=np.column_stack([half, half @ others]) / size[:, None] / size,
        pull=pull / size,
        squares=float(w @ pull[:count]),
        freedom=count - strip.design.shape[1],
        alpha=ALPHA * strip.share,
        points=tuple(tuple(points[each]) for each in sorted(points)),
        parts=(*(tuple(parts[each]) for each in sorted(parts)), *((count + bend,) for bend in range(bent.shape[1]))),
        height=height,
        first_ray=count + bent.shape[1],
    )


def independent(covariance: Floats) -> Floats:
    """Give the inverse of the triangular root of a covariance (w, w), which makes misclosures independent."""
    return np.asarray(solve_triangular(np.linalg.cholesky(covariance), np.eye(len(covariance)), lower=True), float)


def projected(free: Floats, design: Floats) -> Floats:
    """M: the weight matrix after a similarity has taken what it can; normal equations would lose half the digits.

    free: (w, w), as ``independent`` gives it.
    """
    taken, size, _ = np.linalg.svd(free @ (design / (np.abs(design).max(axis=0) + 1e-300)), full_matrices=False)
    left = free - (taken := taken[:, size > ROUNDING * size[0]]) @ (taken.T @ free)
    return np.asarray(left.T @ left, float)


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

    @property
    def far(self) -> FoundErrors:
        """What is wrong even of a strip that is bent itself."""
        parts = (each.columns for each in self.whole.tests(self.out) if each.ratio > FAR**2) if self.out else ()
        return FoundErrors(self.whole, tuple(chain.from_iterable(parts)))


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
FAR = 100.0  # times what is left at all others: no bend of a strip moves one point so far
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
    allowed = [each for each in found if each.whole.allows(each.out)]
    told = [each for each in allowed if each.left.squares <= BENT**2 * max(each.left.freedom, 1)]
    told = told or [far for each in allowed if (far := each.far).out]
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
