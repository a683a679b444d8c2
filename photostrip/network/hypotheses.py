"""What may be wrong beside single observations: a table of hypotheses, and what each of them explains.

Photos of a camera share its lens, its film or sensor, its principal point and distance; camera positions share a datum
and an antenna; a control list is of one survey. Such a cause contradicts good observations one by one, and taken out
one by one they go. Each hypothesis is a few columns H of the design: with the misfits w of an adjustment and
M = I - A Q A', the sum of squares would fall by w'H (H'M H)^-1 H'w with it. That fall has a probability, with
the number of hypotheses counted, and is compared with those of single observations on one rank.

A line of ``HYPOTHESES`` says who may be wrong, ``_columns`` how it would show, ``taken_up`` what the adjustment then
does. Two are no columns. The order of positions has errors as large as the network, and is asked about without them.
Standard deviations of positions that are k times too small explain by their likelihood: r k^2 of the sum of squares,
r the redundancy of the positions, become r for a price of 2 r log k.
Source: derived, see docs/sources.md.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.special import chdtr, chdtrc, fdtrc, gammaincc, gammaln

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.network import reliability
from photostrip.network.adjustment import BundleSolution, Cofactors
from photostrip.network.normal_equations import Columns, Explained
from photostrip.network.observations import AFFINE, PRINCIPAL_DISTANCE, K, P, by_calibration, values_of
from photostrip.network.observations import POINT as PRINCIPAL_POINT
from photostrip.network.problem import (
    CALIBRATION,
    BundleProblem,
    ControlObservations,
    PositionObservations,
    StartValues,
)
from photostrip.statistics import normal_quantile

ORDER, OFFSET, DRIFT, LIST = "order of positions", "offset", "drift", "control list"
SIGMAS = "standard deviations of positions"
LENS, EDGE, DECENTRED = "lens distortion", "lens distortion at the edge", "decentred lens"
FILM, POINT, DISTANCE = "film", "principal point", "principal distance"
SHIFT, SCALE = "shift of a photo", "scale of a photo"
OF_CAMERAS = {
    LENS: K[:1],
    EDGE: K[:2],
    DECENTRED: P,
    FILM: AFFINE,
    POINT: PRINCIPAL_POINT,
    DISTANCE: [PRINCIPAL_DISTANCE],
}
"""What may be wrong with a camera, with the columns of its parameters."""
OF_LENSES = LENS, EDGE, DECENTRED
PLAINER = {EDGE: LENS, DRIFT: OFFSET}
"""What is asked for less: at the end a hypothesis has to explain more than it."""
OF_PHOTOS = {SHIFT: PRINCIPAL_POINT, SCALE: [PRINCIPAL_DISTANCE]}
"""What may be wrong with one photo: it has a principal point, or a principal distance, of its own."""
OF_IMAGE_COORDINATES = OF_CAMERAS | OF_PHOTOS
ALL = "all"  # positions of all groups share one error
EACH = "each"  # those of every group have one of their own
REVERSED, FORWARDS, BACKWARDS = "reversed", "forwards", "backwards"  # rows of positions that belong to other photos
ORDERS = REVERSED, FORWARDS, BACKWARDS
EXCHANGED = "exchanged"  # two of them
SHARED = 0.1  # of the level of all tests: what an accusation may cost that single observations do not make
MOST_ASKED = 4  # positions of which any two may be exchanged: those that go least with the photos
ASKED_PHOTOS = 8  # photos that are asked about: those whose residuals have most in common
LEAST_SHARE = 1e-9  # of a column that the other unknowns leave to it, for it to be more than rounding
MIDDLE = normal_quantile(0.75)  # of standardised residuals: half of them are smaller
COUNTED = 1.5  # standard deviations that a residual counts as at most, where these are estimated
EXPECTED = float(chdtr(3, COUNTED**2) + COUNTED**2 * chdtrc(1, COUNTED**2))  # of such squares, of good residuals
ROUNDS = 30  # of that estimate: the outermost residuals enter one after the other
ALIKE = 1e-6  # of columns of one hypothesis, from which they are one
SHOWN_SIGMAS = 4.0  # standard deviations from which a component is off
OTHER_HEIGHTS = 0.5, 2.0  # of photos above what they show, from which a principal distance is found, too
UP_AXIS = 2
HEIGHTS_ONLY = -1  # in place of the number of a list: what is given in height only
PARTS = slice(UP_AXIS), slice(UP_AXIS, None)  # of coordinates: plan and height, whose standard deviations differ
UNSCALED = (1.0,) * len(PARTS)


@dataclass(frozen=True)
class Hypothesis:
    """What a group of observations may share beside the truth."""

    kind: str
    number: int = -1  # of a camera, a control list or a photo
    of: str = EACH  # of positions: ``ALL`` or ``EACH``, one of ``ORDERS``, or ``EXCHANGED``
    pair: tuple[int, ...] = ()  # rows of two positions that are exchanged
    rivals: tuple[str, ...] = ()  # kinds of others that explain nearly as much
    # shift, sigma: how a list lies beside everything else, along its axes, metres; NaN where it gives nothing
    shift: tuple[float, ...] = ()
    sigma: tuple[float, ...] = ()
    factors: tuple[float, ...] = UNSCALED  # of the standard deviations of positions, by ``PARTS``

    @property
    def name(self) -> tuple[str, int, str]:
        return self.kind, self.number, self.of


def _offsets(solution: BundleSolution) -> Iterator[Hypothesis]:
    """Ask whether camera positions all lie elsewhere: those of the whole block, or of each group."""
    positions = solution.prepared.problem.positions
    if positions.offset_sigma.any() or positions.drift_sigma.any():
        return
    groups = len(np.unique(positions.group[positions.group >= 0]))
    if groups > 1:
        yield Hypothesis(OFFSET, of=ALL)
    if groups:
        yield Hypothesis(OFFSET)


def _drifts(solution: BundleSolution) -> Iterator[Hypothesis]:
    positions = solution.prepared.problem.positions
    if (positions.group >= 0).any() and not positions.drift_sigma.any():
        yield Hypothesis(DRIFT)


def _lists(solution: BundleSolution) -> Iterator[Hypothesis]:
    """Ask whether a control list lies beside the others, the shortest first, or what is given in height only."""
    control = solution.prepared.problem.control
    given = np.isfinite(control.sigma)
    lists, sizes = np.unique(control.lists[given.any(axis=1)], return_counts=True)
    if len(lists) > 1:
        yield from (Hypothesis(LIST, number) for number in lists[np.argsort(sizes, kind="stable")].tolist())
    alone = _members(control, HEIGHTS_ONLY) & given[:, UP_AXIS]
    if alone.sum() > 1 and (given[:, UP_AXIS] & ~alone).any():
        yield Hypothesis(LIST, HEIGHTS_ONLY)


def _members(control: ControlObservations, number: int) -> Flags:
    """Which rows (c,) a control list gives; or those that are given in height only, of all lists."""
    if number == HEIGHTS_ONLY:
        return np.zeros(len(control), bool) if control.height_only is None else control.height_only
    return np.asarray(control.lists == number, bool)


def _cameras(solution: BundleSolution) -> Iterator[Hypothesis]:
    """Ask what may be wrong with each camera; of a principal distance photos alone say nothing."""
    problem = solution.prepared.problem
    cameras, given = problem.cameras, not solution.free
    used = np.flatnonzero(np.bincount(cameras.of_photo) > min(1, problem.photos - 1))  # of one photo see `_photos`
    for kind, columns in OF_CAMERAS.items():
        for camera in used.tolist():
            if (cameras.unknown[camera, columns] < 0).any() and (given or kind != DISTANCE):
                yield Hypothesis(kind, camera)


def _photos(solution: BundleSolution) -> Iterator[Hypothesis]:
    """Ask whether all image coordinates of a photo are shifted or enlarged: other marks, another lens or scan."""
    problem = solution.prepared.problem
    images, cameras, m = problem.images, problem.cameras, problem.photos
    off, weight = solution.image_residuals / images.sigma**2, images.sigma**-2.0
    alone = np.bincount(cameras.of_photo)[cameras.of_photo] < min(2, m)  # its camera is asked about, or has been
    for kind, parts in ((SHIFT, np.ones((len(images), 2, 1)) * np.eye(2)), (SCALE, images.xy[:, :, None])):
        pull, size = np.zeros((2, m, parts.shape[2]))
        np.add.at(pull, images.photo, np.einsum("ni,nik->nk", off, parts))
        np.add.at(size, images.photo, np.einsum("ni,nik->nk", weight, parts**2))
        asking = (pull**2 / np.maximum(size, np.finfo(float).tiny)).sum(axis=1)
        asking[alone] = 0.0
        most = np.argsort(-asking, kind="stable")[:ASKED_PHOTOS]
        yield from (Hypothesis(kind, photo) for photo in most[asking[most] > 0.0].tolist())


HYPOTHESES: tuple[Callable[[BundleSolution], Iterator[Hypothesis]], ...] = (
    _offsets,
    _drifts,
    _lists,
    _cameras,
    _photos,
)
"""Who may be wrong. Of hypotheses that explain the same the first is taken up: what is given goes before the camera."""
OF_IMAGES = _cameras, _photos


class Likely(NamedTuple):
    """A hypothesis, and how much it explains."""

    hypothesis: Hypothesis
    squares: float  # what the sum of squares falls by with it, for a sigma0 of 1
    freedom: int
    log_p: float  # logarithm of the probability that any of the hypotheses explains so much by chance

    @classmethod
    def of(cls, hypothesis: Hypothesis, squares: float, freedom: int, number: int) -> Likely:
        log_p = log_probability_of_any(max(squares, 0.0), max(freedom, 1), number)
        return cls(hypothesis=hypothesis, squares=squares, freedom=freedom, log_p=log_p)


def log_probability(squares: float, freedom: int) -> float:
    """Logarithm of the probability of a larger chi-square; asymptotic where the probability is too small a number."""
    p = float(gammaincc(freedom / 2, squares / 2))
    if p > np.finfo(float).tiny:
        return float(np.log(p))
    return float(-squares / 2 + (freedom / 2 - 1) * np.log(squares / 2) - gammaln(freedom / 2))


def log_probability_of_any(squares: float, freedom: int, number: int) -> float:
    """Logarithm of the probability that any of a number of hypotheses explains so much by chance."""
    return min(log_probability(squares, freedom) + float(np.log(max(number, 1))), 0.0)


def likeliest(
    solution: BundleSolution, unit: float, level: float, *, cameras: bool, refused: Sequence[Hypothesis] = ()
) -> list[Likely]:
    """Find what each line of the table has to say of a solution: its likeliest hypothesis.

    unit: standard deviation of unit weight in force.
    level: as of ``most_likely``.
    cameras: whether cameras may be taken up. A single photo, which is no matter of calibration, may be in any case, but
        not for what its camera explains better.
    refused: what has been taken up in vain.
    """
    problem, in_vain = solution.prepared.problem, {each.name for each in refused}
    by_photos = not (solution.rough or problem.of_models)
    lines = [line for line in HYPOTHESES if by_photos or line not in OF_IMAGES]
    asked = [[each for each in line(solution) if each.name not in in_vain] for line in lines]
    number = sum(len(line) for line in asked) + (len(OF_PHOTOS) * problem.photos if by_photos else 0)
    found = []
    for line in asked:
        gains = [_gain(each) for each in _explained(solution, line)]
        likely = [
            Likely.of(_with_shift(each, gain, solution), gain.squares / unit**2, len(gain.value), number)
            for each, gain in zip(line, gains, strict=True)
        ]
        if likely:
            found.append(most_likely(sorted(likely, key=lambda each: each.freedom), level))  # the plainest first
    if cameras:
        return found
    best = min((each.log_p for each in found if each.hypothesis.kind in OF_CAMERAS), default=0.0)
    others = (each for each in found if each.hypothesis.kind not in OF_CAMERAS)
    return [each for each in others if each.hypothesis.kind not in OF_PHOTOS or each.log_p < best]


def most_likely(found: Sequence[Likely], level: float) -> Likely:
    """Choose the hypothesis that explains most, and name its rivals; of those that explain alike it is the first.

    level: of the test of what one explains beyond another.
    """
    most = max(found, key=lambda each: each.squares)

    def alike(each: Likely) -> bool:
        more = log_probability(max(most.squares - each.squares, 0.0), max(most.freedom - each.freedom, 1))
        return more > np.log(level)

    first, *others = (each for each in found if alike(each))
    rivals = tuple(dict.fromkeys((*first.hypothesis.rivals, *(each.hypothesis.kind for each in others))))
    return first._replace(hypothesis=replace(first.hypothesis, rivals=rivals))


class _Gain(NamedTuple):
    """What one hypothesis explains."""

    squares: float  # what the sum of squares would fall by; 0 where nothing can be told
    value: Floats  # (k,): the coefficients of its columns
    sigma: Floats  # (k,): their standard deviations, for a sigma0 of 1


def _gain(explained: Explained) -> _Gain:
    """Solve for the coefficients of one hypothesis."""
    pull, normal, size = explained
    if not len(pull) or (np.diag(normal) < LEAST_SHARE * size).any():
        return _Gain(0.0, np.zeros(len(pull)), np.full(len(pull), np.inf))
    unit = 1.0 / np.sqrt(size)  # columns of powers differ by powers of the radius
    inverse = np.linalg.pinv(normal * np.outer(unit, unit), rcond=ALIKE, hermitian=True) * np.outer(unit, unit)
    value = inverse @ pull
    return _Gain(float(pull @ value), value, np.sqrt(np.diag(inverse)))


def _with_shift(hypothesis: Hypothesis, gain: _Gain, solution: BundleSolution) -> Hypothesis:
    """Say of a control list how it lies beside everything else."""
    if hypothesis.kind != LIST:
        return hypothesis
    axes = _given_axes(solution.prepared.problem, hypothesis.number)
    shift, sigma = np.full((2, 3), np.nan)
    shift[axes], sigma[axes] = gain.value, gain.sigma * max(1.0, solution.sigma0)
    return replace(hypothesis, shift=tuple(shift.tolist()), sigma=tuple(sigma.tolist()))


def _explained(solution: BundleSolution, asked: Sequence[Hypothesis]) -> list[Explained]:
    """Lay out the normal equations of each hypothesis alone; columns of the same camera or photo together."""
    groups: dict[tuple[object, ...], list[int]] = {}
    for n, each in enumerate(asked):
        groups.setdefault((each.kind in OF_PHOTOS, each.number) if of_images(each) else each.name, []).append(n)
    found = {}
    for group in groups.values():
        if not of_images(asked[group[0]]):
            found[group[0]] = solution.factored.explained(_columns(solution, asked[group[0]]))
            continue
        every, end = solution.factored.explained(_columns_of_images(solution, [asked[n] for n in group])), 0
        for n in group:
            own = np.arange(end, end + len(_parameters(solution.prepared.problem, asked[n])))
            end += len(own)
            found[n] = Explained(every.pull[own], every.normal[np.ix_(own, own)], every.squares[own])
    return [found[n] for n in range(len(asked))]


def _parameters(problem: BundleProblem, hypothesis: Hypothesis) -> list[int]:
    """Columns of the parameters of a camera, or of a photo, that a hypothesis asks for: those not yet unknown."""
    if hypothesis.kind in OF_PHOTOS:
        return OF_PHOTOS[hypothesis.kind]
    unknown = problem.cameras.unknown[hypothesis.number]
    return [column for column in OF_CAMERAS[hypothesis.kind] if unknown[column] < 0]


def _columns_of_images(solution: BundleSolution, together: Sequence[Hypothesis]) -> Columns:
    """Columns of hypotheses about one camera, or about one photo."""
    problem, number = solution.prepared.problem, together[0].number
    of_photo, of_camera = problem.images.photo, problem.cameras.of_photo
    kinds = [kind for each in together for kind in _parameters(problem, each)]
    alone = together[0].kind in OF_PHOTOS
    among = (of_photo if alone else of_camera[of_photo]) == number
    rays = by_calibration(problem, int(of_camera[number]) if alone else number, among, kinds, solution.state)
    control, positions = (np.zeros((rows, 3, len(kinds))) for rows in (len(problem.control), len(problem.positions)))
    return Columns(among=among, rays=rays, control=control, positions=positions)


def _columns(solution: BundleSolution, hypothesis: Hypothesis) -> Columns:
    """Columns of a hypothesis about what is given, in units of its standard deviations."""
    problem, c = solution.prepared.problem, solution.image_residuals.shape[1]
    control, positions = problem.control, problem.positions
    if hypothesis.kind == LIST:
        weight = np.where(_members(control, hypothesis.number)[:, None], 1.0 / control.sigma, 0.0)
        shifts = weight[:, :, None] * np.eye(3)[:, _given_axes(problem, hypothesis.number)]
    else:
        group = _groups(positions, hypothesis)
        weight = np.where(group >= 0, 1.0, 0.0)[:, None] / positions.sigma
        factors = [np.ones(len(positions))]
        if hypothesis.kind == DRIFT:  # one of an offset that is asked for already is the drift alone
            factors = [positions.time] if positions.offset_sigma.any() else [*factors, positions.time]
        parts = [
            (weight * (group == number)[:, None] * factor[:, None])[:, :, None] * np.eye(3)
            for factor in factors
            for number in np.unique(group[group >= 0]).tolist()
        ]
        shifts = np.concatenate(parts, axis=2)
        shifts = shifts[:, :, shifts.any(axis=(0, 1))]
    k, of_list = shifts.shape[2], hypothesis.kind == LIST
    nothing = np.zeros((len(positions) if of_list else len(control), 3, k))
    on_control, on_positions = (shifts, nothing) if of_list else (nothing, shifts)
    return Columns(np.zeros(len(problem.images), bool), np.zeros((0, c, k)), on_control, on_positions)


def _groups(positions: PositionObservations, hypothesis: Hypothesis) -> Numbers:
    """Return the groups (g,) of positions that share an error; -1 for those of no group."""
    return np.where(positions.group >= 0, 0 if hypothesis.of == ALL else positions.group, -1)


def _given_axes(problem: BundleProblem, number: int) -> Numbers:
    """Axes along which a control list gives anything."""
    control = problem.control
    return np.flatnonzero(np.isfinite(control.sigma[_members(control, number)]).any(axis=0))


def taken_up(problem: BundleProblem, hypothesis: Hypothesis) -> BundleProblem:
    """Give a problem the unknowns of a hypothesis; a control list that is shifted is left out as far as it is off.

    What is given up again is not undone: the given problem takes up all the others anew.
    """
    positions, cameras = problem.positions, problem.cameras
    if hypothesis.kind == LIST:
        off = np.abs(hypothesis.shift) > SHOWN_SIGMAS * np.array(hypothesis.sigma)
        inside = _members(problem.control, hypothesis.number)
        outside = inside[:, None] & (off[:UP_AXIS].any() | (np.arange(3) == UP_AXIS))
        control = replace(problem.control, sigma=np.where(outside, np.inf, problem.control.sigma))
        return replace(problem, control=control)
    if hypothesis.kind == ORDER:
        return replace(problem, positions=_in_order(positions, hypothesis))
    if hypothesis.kind == SIGMAS:
        factor = np.repeat(hypothesis.factors, [UP_AXIS, 1])
        return replace(problem, positions=replace(positions, sigma=positions.sigma * factor))
    if hypothesis.kind in OF_PHOTOS:
        return _with_own_camera(problem, hypothesis.number, OF_PHOTOS[hypothesis.kind])
    if hypothesis.kind in OF_CAMERAS:
        camera = np.array([hypothesis.number])
        return replace(problem, cameras=cameras.with_unknown(camera, OF_CAMERAS[hypothesis.kind]))
    group = _groups(positions, hypothesis)
    count = 1 if hypothesis.of == ALL else len(positions.offset_sigma)
    members = np.zeros((count, 3), np.intp)
    np.add.at(members, group[group >= 0], np.isfinite(positions.sigma[group >= 0]))
    drift = np.where((members > 1) & (hypothesis.kind == DRIFT), np.inf, 0.0)
    changed = replace(positions, group=group, offset_sigma=np.where(members > 0, np.inf, 0.0), drift_sigma=drift)
    names = ("of the block",) if hypothesis.of == ALL else problem.group_ids
    return replace(problem, positions=changed, group_ids=names)


def starts(problem: BundleProblem, hypothesis: Hypothesis) -> Iterator[StartValues]:
    """Yield start values with which to take a hypothesis up: those of the problem, and what else may lead to the end.

    A network that is bent to its control by a principal distance far off is no start for another one: steps do not come
    to an end. With photos at half or twice their height, where they were bent to nothing, they do.
    """
    start, images = problem.start, problem.images
    yield start
    if hypothesis.kind != DISTANCE:
        return
    known = np.asarray(np.isfinite(start.points).all(axis=1), bool)[images.point]
    photo, axis = images.photo[known], start.rotations[:, :, 2]
    arm = start.centers[photo] - start.points[images.point[known]]
    rays = np.bincount(photo, minlength=problem.photos)
    height = np.bincount(photo, np.einsum("ni,ni->n", arm, axis[photo]), problem.photos) / np.maximum(rays, 1)
    own = (problem.cameras.of_photo == hypothesis.number) * height
    for times in OTHER_HEIGHTS:
        yield replace(start, centers=start.centers + ((times - 1.0) * own)[:, None] * axis)


def _with_own_camera(problem: BundleProblem, photo: int, columns: list[int]) -> BundleProblem:
    """Give a photo a camera of its own, which differs from that of the others by some parameters."""
    cameras = problem.cameras
    old, new = int(cameras.of_photo[photo]), len(cameras.focal)
    row = [*range(new), old]
    nothing = np.zeros((1, len(CALIBRATION)))
    changed = replace(
        cameras,
        of_photo=np.where(np.arange(problem.photos) == photo, new, cameras.of_photo),
        focal=cameras.focal[row],
        sigma=None if cameras.sigma is None else np.concatenate([cameras.sigma, nothing]),
        prior=None if cameras.prior is None else np.concatenate([cameras.prior, np.full_like(nothing, np.inf)]),
        distortion=tuple(cameras.distortion[each] for each in row) if cameras.distortion else (),
        like=np.append(np.arange(new) if cameras.like is None else cameras.like, old),
    )
    names = (*problem.camera_ids, f"of photo {problem.photo_name(photo)}") if problem.camera_ids else ()
    return replace(problem, cameras=changed.with_unknown(np.array([new]), columns), camera_ids=names)


def of_images(hypothesis: Hypothesis) -> bool:
    """Whether the parameters of a hypothesis are those of a camera."""
    return hypothesis.kind in OF_IMAGE_COORDINATES


def place(problem: BundleProblem, hypothesis: Hypothesis) -> tuple[int, list[int]]:
    """Return the camera, and the columns of its parameters, that a hypothesis has made unknown."""
    if hypothesis.kind in OF_PHOTOS:
        return int(problem.cameras.of_photo[hypothesis.number]), OF_PHOTOS[hypothesis.kind]
    return hypothesis.number, OF_CAMERAS[hypothesis.kind]


def impossible(solution: BundleSolution) -> bool:
    """Whether a camera came out that cannot be: heights that count downwards, a photo beside all that it shows."""
    problem = solution.prepared.problem
    values = values_of(problem.cameras, solution.common)
    beside = np.abs(values[:, PRINCIPAL_POINT]).max(initial=0.0) > np.abs(problem.images.xy).max(initial=0.0)
    return bool(beside or (problem.cameras.focal + values[:, PRINCIPAL_DISTANCE] <= 0.0).any())


def log_probability_again(without: BundleSolution, hypothesis: Hypothesis, unit: float) -> float:
    """Logarithm of the probability that what was taken up explains so much by chance, in an adjustment without it."""
    (explained,) = _explained(without, [hypothesis])
    gain = _gain(explained)
    return log_probability(max(gain.squares, 0.0) / unit**2, max(len(gain.value), 1))


class Scatter(NamedTuple):
    """How far camera positions scatter about where all else puts them, in plan and in height."""

    factors: Floats  # (2,): in units of their standard deviations; 1 where too little controls them
    redundancy: Floats  # (2,)

    @classmethod
    def of(cls, solution: BundleSolution, cofactors: Cofactors) -> Scatter:
        """Estimate robustly, each residual counting as ``COUNTED`` standard deviations at most.

        A third of them may be wrong. Source: [Huber 1964], proposal 2.
        """
        factors, redundancy = np.ones(len(PARTS)), np.zeros(len(PARTS))
        (group,) = reliability.groups_of(solution.prepared.problem, solution, cofactors, (reliability.POSITION,))
        for n, axes in enumerate(PARTS):
            known = np.isfinite(group.standardised[:, axes])
            squares, share = group.standardised[:, axes][known] ** 2, group.redundancy[:, axes][known]
            redundancy[n] = share.sum()
            if redundancy[n] >= reliability.LEAST_REDUNDANCY:
                variance = float(np.median(squares)) / MIDDLE**2
                for _ in range(ROUNDS):
                    variance = float(share @ np.minimum(squares, COUNTED**2 * variance)) / (EXPECTED * redundancy[n])
                factors[n] = np.sqrt(variance)
        return cls(factors, redundancy)


def factors_of(common: Sequence[Hypothesis]) -> tuple[float, ...]:
    """Return the factors of the standard deviations of positions among what was taken up."""
    return next((each.factors for each in common if each.kind == SIGMAS), UNSCALED)


def price(scatter: Scatter, factors: Floats | Sequence[float]) -> float:
    """Return what standard deviations multiplied with factors cost of the sum of squares that they explain."""
    return float(2.0 * (scatter.redundancy * np.log(factors)).sum())


def of_scatter(scatter: Scatter, unit: float, taken: Floats, level: float) -> Likely | None:
    """Ask whether standard deviations of positions are too small; or too large, after they were multiplied.

    taken: factors by which they were multiplied.
    level: logarithm of the level at which they are multiplied again; of each part by itself.
    """
    factors = np.maximum(scatter.factors / unit, 1.0 / taken)
    squares = scatter.redundancy * (factors**2 - 1.0 - 2.0 * np.log(factors))
    asked = np.array([log_probability_of_any(each, 1, len(PARTS)) <= level for each in squares.tolist()])
    if not asked.any():
        return None
    hypothesis = Hypothesis(SIGMAS, of=ALL, factors=tuple(np.where(asked, factors, 1.0).tolist()))
    return Likely.of(hypothesis, float(squares[asked].sum()), int(asked.sum()), len(PARTS))


def _in_order(positions: PositionObservations, order: Hypothesis) -> PositionObservations:
    """Give photos the positions that other rows state; a photo at an end that loses its own has none."""
    rows = np.arange(len(positions))
    if order.of == EXCHANGED:
        source = rows.copy()
        source[list(order.pair)] = order.pair[::-1]
    else:
        source = {REVERSED: rows[::-1], FORWARDS: rows - 1, BACKWARDS: rows + 1}[order.of]
    inside = (source >= 0) & (source < len(rows))
    source = np.where(inside, source, rows)
    sigma = np.where(inside[:, None], positions.sigma[source], np.inf)
    return replace(positions, xyz=positions.xyz[source], axes=positions.axes[source], sigma=sigma)


def order_of_positions(
    solution: BundleSolution, cofactors: Cofactors, positions: PositionObservations, level: float
) -> Hypothesis | None:
    """Find the order in which given positions are those of the photos; None where it is theirs, or cannot be told.

    solution, cofactors: of an adjustment in which the positions took no part.
    The misfits about their mean are compared, in units of what is stated and what the photos know, by an F test.
    """
    given, rows = _misfit(solution, cofactors, positions), len(positions)
    worst = np.sort(np.argsort(-given.of_row, kind="stable")[:MOST_ASKED]).tolist()
    asked = [Hypothesis(ORDER, of=each) for each in ORDERS]
    asked += [Hypothesis(ORDER, of=EXCHANGED, pair=pair) for pair in combinations(worst, 2)]
    misfits = [_misfit(solution, cofactors, _in_order(positions, each)) for each in asked]
    least, best = min(zip(asked, misfits, strict=True), key=lambda each: each[1].mean)
    if not (given.freedom > 0 and best.freedom > 0 and given.mean > best.mean):
        return None
    number = len(ORDERS) + rows * (rows - 1) // 2
    p = number * fdtrc(given.freedom, best.freedom, given.mean / max(best.mean, 1.0))
    return least if p < SHARED * level else None


class _Misfit(NamedTuple):
    mean: float  # mean square of standardised misfits
    freedom: int
    of_row: Floats  # (g,): their squares


def _misfit(solution: BundleSolution, cofactors: Cofactors, positions: PositionObservations) -> _Misfit:
    """Compare positions with photos that know nothing of them, but for what all of them share."""
    photo, used = positions.photo, np.isfinite(positions.sigma)
    antenna = solution.centers[photo] + np.einsum("nij,nj->ni", solution.rotations[photo], positions.lever)
    off = np.einsum("nij,nj->ni", positions.axes, antenna - positions.xyz)
    known = positions.axes @ cofactors.photos[photo, :3, :3] @ positions.axes.swapaxes(1, 2)
    variance = np.where(used, positions.sigma, 1.0) ** 2 + np.einsum("nii->ni", known)
    weight = np.where(used, 1.0 / variance, 0.0)
    total = weight.sum(axis=0)
    off = off - (weight * off).sum(axis=0) / np.where(total > 0.0, total, 1.0)
    freedom = int(used.sum() - (total > 0.0).sum())
    squares = (weight * off**2).sum(axis=1)
    return _Misfit(mean=float(squares.sum()) / max(freedom, 1), freedom=freedom, of_row=squares)
