"""Wrong rays by the evidence of the whole strip: every point tested by all its rays, on photos that all others orient.

A pair sees y parallaxes only, and an error in a corner zone can make a good point look wrong. A point on three photos
says more: its y parallaxes in two pairs, and whether both models put it at one place. So wherever a pair or a
junction had to reject something, windows of the strip are adjusted with all their measurements, those rejected before
included: first with weights that fall with the misclosure, then with those points that agree. Each point is predicted
by an adjustment without it. What contradicts the prediction is left out, what agrees is taken back.

What a point's rays say of each other is decided in ``ray_decisions``.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.triangulation.gross_errors.rays import window_adjustment, window_points, windows
from photostrip.triangulation.gross_errors.rays.ray_decisions import GOOD, NONE, PAIR, RAY, RAYS, RayDecisions, decide

if TYPE_CHECKING:
    from collections.abc import Sequence

    from photostrip.arrays import Flags, Floats, Numbers
    from photostrip.points import PhotoPoints
    from photostrip.triangulation.gross_errors.rays.window_adjustment import AdjustedWindows
    from photostrip.triangulation.gross_errors.rays.window_points import Group
    from photostrip.triangulation.gross_errors.rays.windows import WindowRays
    from photostrip.triangulation.relative_orientation.orientation import Orientation
    from photostrip.triangulation.strip_formation.strip import FormedStrip


LONGEST_REACH = 8  # photos; windows do not grow for points that reach over more
BATCH = 48  # windows solved together
ABSOLUTE_STEPS, WELSCH_STEPS = 15, 8
WELSCH = 3.0  # standard deviations
ROBUST_CHANGE = 0.3  # standard deviations; the robust start is to find wrong points, not digits
LEAST_WEIGHT = 1e-9  # keeps a photo in its window
DECISION_ROUNDS = 12
WRONG_RAY, TWO_RAYS, SEVERAL_RAYS = "ray", "pair", "rays"
"""What was found at a point: its wrong ray; two rays that contradict each other; several of which any may be wrong."""
KINDS = {GOOD: SEVERAL_RAYS, RAY: WRONG_RAY, PAIR: TWO_RAYS, RAYS: SEVERAL_RAYS, NONE: SEVERAL_RAYS}


@dataclass(frozen=True, eq=False)
class RayRejections:
    """What the strip says about the points it was asked about."""

    tested: Numbers = field(default_factory=lambda: np.zeros(0, np.intp))  # (j,): points that were tested
    # (c,): rows of the observations that must not be used
    wrong: Numbers = field(default_factory=lambda: np.zeros(0, np.intp))
    point: Numbers = field(default_factory=lambda: np.zeros(0, np.intp))  # (c,): their points
    kind: tuple[str, ...] = ()  # why: ``WRONG_RAY``, ``TWO_RAYS`` or ``SEVERAL_RAYS``
    # value, limit: (c,): test value of the point with all its rays, as the root of a sum of squares, and its critical
    # value
    value: Floats = field(default_factory=lambda: np.zeros(0))
    limit: Floats = field(default_factory=lambda: np.zeros(0))
    # (c, 2): estimated errors of the image coordinates, mm; NaN where nothing can be said
    size: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    # (c,): whether the y parallaxes of the point are good: it may orient pairs, but has no place
    across: Flags = field(default_factory=lambda: np.zeros(0, bool))

    def of(self, points: Flags) -> RayRejections:
        """Return what was found of some points, a flag for each point of the observations."""
        rows = points[self.point]
        kind = tuple(each for each, yes in zip(self.kind, rows.tolist(), strict=True) if yes)
        values = (getattr(self, name)[rows] for name in ("value", "limit", "size", "across"))
        return RayRejections(self.tested[points[self.tested]], self.wrong[rows], self.point[rows], kind, *values)

    def joined(self, other: RayRejections) -> RayRejections:
        """Give both together; they know different points."""
        order = np.argsort(np.concatenate([self.wrong, other.wrong]), kind="stable")
        names = ("wrong", "point", "value", "limit", "size", "across")
        rows = {name: np.concatenate([getattr(self, name), getattr(other, name)])[order] for name in names}
        kind = self.kind + other.kind
        return RayRejections(
            np.union1d(self.tested, other.tested), kind=tuple(kind[number] for number in order), **rows
        )


@dataclass(frozen=True, eq=False)
class StripRays:
    """Where the image points of a strip are, whatever becomes of them."""

    position: Numbers  # (n,): place in the strip of the photo of every image point; -1 for photos of other strips
    paired: Flags  # (n,): whether an image point stands in a pair
    # begin, last: (q,): first and last photo of each point in pairs; the last is -1 for points of no pair
    begin: Numbers
    last: Numbers

    @classmethod
    def of(cls, orientation: Orientation, observations: PhotoPoints, photos: Sequence[str]) -> StripRays:
        """Look up where everything is."""
        place = {photo: number for number, photo in enumerate(photos)}
        position = np.array([place.get(photo, -1) for photo in observations.photo_ids], np.intp)[observations.photo]
        paired = np.zeros(len(position), bool)
        paired[orientation.rows] = True
        begin = np.full(len(observations.point_ids), len(photos))
        last = np.full(len(begin), -1)
        # the table is ordered by pair: of several the last one written stays
        begin[orientation.point[::-1]] = orientation.pairs.pair[::-1]
        last[orientation.point] = orientation.pairs.pair + 1
        return cls(position, paired, begin, last)


@dataclass(frozen=True, eq=False)
class MeasuredStrip:
    """A formed strip and its measurements."""

    orientation: Orientation
    formed: FormedStrip
    observations: PhotoPoints
    layout: StripRays  # where they are
    sigma: Floats  # (p,): standard deviations of a y parallax of weight one in each pair, mm
    stated: float  # standard deviation of an image coordinate of weight one, mm

    @property
    def photos(self) -> int:
        """Number of photos of the strip."""
        return len(self.formed.centers)


def suspects(scene: MeasuredStrip) -> Numbers:
    """Points that were rejected in a pair or at a junction, or stand on one of two photos only."""
    oriented, junctions = scene.orientation, scene.formed.junctions
    out = oriented.point[~oriented.used]
    return np.union1d(out, junctions.point[~junctions.used]).astype(np.intp)


def collect(scene: MeasuredStrip, wanted: Flags | None = None) -> WindowRays:
    """Collect and linearise the rays of the points that have a place in the strip, on wanted photos or on all.

    Ordered by point and photo; points with one ray are left out.
    """
    o, layout = scene.observations, scene.layout
    inside = layout.paired if wanted is None else layout.paired & np.append(wanted, False)[layout.position]
    row = np.flatnonzero(inside)
    row = row[np.lexsort((layout.position[row], o.point[row]))]
    photo, point = layout.position[row], np.asarray(o.point[row], np.intp)
    factor = scene.sigma / (np.sqrt(2.0) * scene.stated)
    by_photo = np.maximum(np.append(factor, factor[-1]), np.append(factor[0], factor))
    image = o.xy[row], o.sigma[row] * by_photo[photo, None], scene.orientation.pairs.focal
    rays = _best_start(scene, (row, photo, point), image)
    sound = np.isfinite(rays.misfit).all(axis=1) & np.isfinite(rays.by_photo).all(axis=(1, 2))
    several = np.bincount(rays.point[sound], minlength=len(o.point_ids)) > 1
    return rays.take(np.flatnonzero(sound & several[rays.point]))


def _best_start(
    scene: MeasuredStrip, place: tuple[Numbers, Numbers, Numbers], image: tuple[Floats, Floats, float]
) -> WindowRays:
    """Linearise at that of the places of each point, one from each model, with which most of its rays agree."""
    oriented, formed = scene.orientation, scene.formed
    photos = formed.centers, formed.rotations
    new = np.diff(place[2], prepend=-1) > 0
    number = np.full(len(scene.observations.point_ids), -1)
    number[place[2][new]] = np.arange(new.sum())
    known = np.flatnonzero((number[oriented.point] >= 0) & np.isfinite(formed.model_xyz[:, 0]))
    known = known[np.argsort(oriented.point[known], kind="stable")]  # the table is ordered by pair
    point, of_ray = number[oriented.point[known]], number[place[2]]
    slot = np.arange(len(known)) - np.searchsorted(point, point)
    best = np.full((int(new.sum()), 3), np.nan)
    cost = np.full(len(best), np.inf)
    for count in range(int(slot.max(initial=-1)) + 1):
        of_slot = known[slot == count]
        candidate = np.full(best.shape, np.nan)
        candidate[point[slot == count]] = formed.model_xyz[of_slot]
        rays = windows.linearise(place, image, photos, candidate[of_ray])
        size = np.minimum(np.nan_to_num(np.abs(rays.misfit).max(axis=1), nan=np.inf), 1e6)
        total = np.bincount(of_ray, np.sqrt(size), len(best))
        better = np.isfinite(candidate[:, 0]) & (total < cost)
        best[better], cost[better] = candidate[better], total[better]
    return windows.linearise(place, image, photos, best[of_ray])


def screen_rays(
    scene: MeasuredStrip,
    points: Numbers,
    kept: Numbers,
    earlier: RayRejections | None = None,
    moved: Flags | None = None,
) -> RayRejections:
    """Test all points near some suspected ones, and say which rays must not be used.

    kept: rows of the observations that the user keeps: their points are not tested.
    earlier: what was found in the same strip before its last small change.
    moved: (p,), optional, models that this change has turned or stretched by more than the adjustment of a window is
        linear for; what was found where there is none stands. All by default.
    """
    if not len(points):
        return RayRejections()
    begin, last = scene.layout.begin, scene.layout.last
    in_pairs = last >= 0
    reach = int(min((last - begin)[in_pairs].max(initial=1), LONGEST_REACH)) + 1
    first = windows.starts(scene.photos, reach)
    length = min(windows.size_of(reach)[0], scene.photos)
    home = np.full(len(begin), -1)
    home[in_pairs] = windows.homes((begin + last)[in_pairs] / 2, first, reach)
    at = np.unique(home[points])
    if earlier is None:
        return _tested(scene, (first[at], length), (home, at), kept, None)
    if moved is not None:
        before = np.concatenate([[0], np.cumsum(moved)])
        quiet = before[first + length - 1] == before[first]
        at = at[~(quiet[at] & np.isin(at, home[earlier.tested]))]
    if not len(at):
        return earlier
    fresh = _tested(scene, (first[at], length), (home, at), kept, earlier)
    return earlier.of(~np.isin(home, at)).joined(fresh)


def _tested(
    scene: MeasuredStrip,
    place: tuple[Numbers, int],
    homes: tuple[Numbers, Numbers],
    kept: Numbers,
    earlier: RayRejections | None,
) -> RayRejections:
    """Test the points at home in some windows, given by first photos and length."""
    first, length = place
    home, at = homes
    wanted = np.zeros(scene.photos, bool)
    wanted[np.minimum(first[:, None] + np.arange(length), len(wanted) - 1)] = True
    rays = collect(scene, wanted)
    out = np.zeros(len(scene.observations), bool)
    if earlier is not None:
        out[earlier.wrong] = True
    found: list[RayDecisions] = []
    for part in range(0, len(at), BATCH):
        groups = window_points.groups(rays, first[part : part + BATCH], length)
        start = None if earlier is None else [np.where(out[rays.row[group.ray]], 0.0, 1.0) for group in groups]
        batch = at[part : part + BATCH]
        decisions = _adjusted(groups, len(batch), length, start)
        found += [each.take(home[rays.point[each.group.ray[:, 0]]] == batch[each.group.window]) for each in decisions]
    return _verdict(scene, rays, found, kept)


def _adjusted(groups: list[Group], count: int, length: int, start: list[Floats] | None) -> list[RayDecisions]:
    """Adjust windows and test their points, until the points that take part are those that agree.

    Without weights of the rays to start from, which an earlier decision gives, the start is a robust one.
    """
    number = np.sum([np.bincount(group.window, minlength=count) for group in groups], axis=0)
    if start is None:
        solved = _robust(groups, count, length)
        found = [decide(group, window_adjustment.expected(group, solved), number) for group in groups]
    else:
        found = _decided(groups, start, number, length)
        if all((each.weight == weight).all() for each, weight in zip(found, start, strict=True)):
            return found  # those that were left out before are left out again
    state = [_State(each, each.weight, *(np.zeros(each.weight.shape, bool) for _ in range(2))) for each in found]
    for _ in range(DECISION_ROUNDS):
        decided = _decided(groups, [each.weight for each in state], number, length)
        worst = np.zeros(count)
        for old, new in zip(state, decided, strict=True):
            np.maximum.at(worst, old.group.window, np.where(old.loses(new), new.value / new.limit, 0.0))
        fresh = [old.after(new, worst) for old, new in zip(state, decided, strict=True)]
        unchanged = all((new.weight == old.weight).all() for new, old in zip(fresh, state, strict=True))
        state = fresh
        if unchanged:
            break
    return [each.decided for each in state]


def _decided(groups: list[Group], weights: list[Floats], number: Numbers, length: int) -> list[RayDecisions]:
    """Adjust windows with the rays that count, and decide on each point by an adjustment without it."""
    solved = _least_squares(groups, weights, len(number), length)
    parts = zip(groups, weights, strict=True)
    return [decide(group, window_adjustment.without(group, weight, solved), number) for group, weight in parts]


@dataclass(frozen=True, eq=False)
class _State:
    """Decisions on the points of a group from round to round.

    Wrong points that take part make good ones look wrong: of the points that should go only the worst of a window goes
    in a round. Two wrong points can each agree with all others and not with each other: what came back once
    and had to go again stays out.
    """

    decision: RayDecisions
    weight: Floats
    returned: Flags
    barred: Flags

    @property
    def group(self) -> Group:
        return self.decision.group

    @property
    def decided(self) -> RayDecisions:
        return replace(self.decision, weight=self.weight)

    def loses(self, fresh: RayDecisions) -> Flags:
        """Whether points lose a ray that takes part."""
        return np.asarray((fresh.weight < self.weight).any(axis=1), bool)

    def after(self, fresh: RayDecisions, worst: Floats) -> _State:
        """Return the state after one more round."""
        spared = np.asarray(self.loses(fresh) & (fresh.value / fresh.limit < worst[self.group.window]), bool)
        barred = self.barred | (self.returned & (fresh.weight < self.weight) & ~spared[:, None])
        weight = np.where(barred, 0.0, np.where(spared[:, None], self.weight, fresh.weight))
        # what stays as it was against the new decision keeps the reason for which it was
        old = np.asarray((weight != fresh.weight).any(axis=1) & (self.weight == weight).all(axis=1), bool)
        merged = replace(
            fresh,
            value=np.where(old, self.decision.value, fresh.value),
            size=np.where(old[:, None, None], self.decision.size, fresh.size),
            kind=np.where(old, self.decision.kind, fresh.kind),
        )
        return _State(merged, weight, self.returned | (weight > self.weight), barred)


def _robust(groups: list[Group], count: int, length: int) -> AdjustedWindows:
    """Adjust windows with weights of the conditions that fall with their misclosures."""
    parts = [(group, group.design, group.closing) for group in groups]
    conditions = window_adjustment.stacked(parts, count, length)
    left = conditions.left(conditions.estimate(np.ones(conditions.misfit.shape)))
    for steps, weights in ((ABSOLUTE_STEPS, _absolute), (WELSCH_STEPS, _welsch)):
        going, part = np.arange(count), conditions
        for _ in range(steps):
            now = part.left(part.estimate(weights(left[going])))
            moving = np.abs(now - left[going]).max(axis=1) >= ROBUST_CHANGE
            left[going] = now
            going, part = going[moving], part.take(moving)
            if not len(going):
                break
    return conditions.solved(_welsch(left))


def _absolute(left: Floats) -> Floats:
    """Weights that minimise absolute misclosures beyond one standard deviation."""
    return np.asarray(1 / np.maximum(left, 1.0), float)


def _welsch(left: Floats) -> Floats:
    """Weights that forget what lies far away."""
    return np.asarray(np.exp(-((left / WELSCH) ** 2)) + LEAST_WEIGHT, float)


def _least_squares(groups: list[Group], weights: list[Floats], count: int, length: int) -> AdjustedWindows:
    """Adjust windows with the rays that count."""
    parts = []
    for group, weight in zip(groups, weights, strict=True):
        whole = np.asarray(weight.all(axis=1), bool)
        some = np.asarray(~whole & weight.any(axis=1), bool)
        if whole.any():
            conditions = group.independent[whole]  # of points that lack a ray too: they change from round to round
            parts.append((group.take(whole), conditions[:, :, :-1], conditions[:, :, -1]))
        if some.any():
            part = group.take(some)
            parts.append((part, *window_adjustment.projected(part, weight[some])))
    found = window_adjustment.stacked(parts, count, length)
    return found.solved(np.ones(found.misfit.shape))


def _verdict(scene: MeasuredStrip, rays: WindowRays, found: list[RayDecisions], kept: Numbers) -> RayRejections:
    """Put what was found about all points into one list, by rows of the observations."""
    spared = np.unique(scene.observations.point[kept])
    tested, columns = [], []
    for each in found:
        point = rays.point[each.group.ray[:, 0]]
        free = ~np.isin(point, spared)
        tested.append(point[free])
        place, number = np.nonzero((each.weight == 0) & free[:, None])
        ray = each.group.ray[place, number]
        size = each.size[place, number] * rays.sigma[ray]
        columns.append((rays.row[ray], each.kind[place], each.value[place], each.limit[place], size))
    rows, kind, value, limit, size = (np.concatenate(each) for each in zip(*columns, strict=True))
    order = np.argsort(rows, kind="stable")
    rows = np.asarray(rows[order], np.intp)
    return RayRejections(
        np.unique(np.concatenate(tested)).astype(np.intp),
        rows,
        np.asarray(scene.observations.point[rows], np.intp),
        tuple(KINDS[int(each)] for each in kind[order]),
        value[order],
        limit[order],
        size[order],
        kind[order] == RAYS,
    )
