"""Displacements of all points in all epochs, with covariances, tests, and the turns of the cameras taken out.

The first epoch is the reference. A coordinate measured in epoch e is the sum of the truth, an error that all epochs
share (of the reference photos, when pseudo-parallaxes were measured against them) and an error of its own. Errors of
the base and of the angles of the reference epoch are common to all epochs: they change a displacement by their relative
size (a base wrong by 1:1000 makes every displacement wrong by 1:1000) and are not part of its covariance.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.notes import Note, named
from photostrip.statistics import chi2_quantile
from photostrip.terrestrial.camera_motion import ANGLES, ImagePair, Motion, Turn, find_motion
from photostrip.terrestrial.normal_case import (
    SIDES,
    SPACE,
    Normal,
    StereoPair,
    displacements,
    intersect,
    limit,
    meeting_z,
    small_turn,
    statistic,
    to_normal,
)
from photostrip.units import ARCSECONDS, MICROMETRES

MOVED_CAMERA = ("always", "auto", "never")
MEASURED, ABSENT, NO_REFERENCE, SMALL_PARALLAX, OUTSIDE = range(5)
REASONS = {
    ABSENT: "not measured",
    NO_REFERENCE: "not measured in the reference epoch",
    SMALL_PARALLAX: "x parallax too small or negative",
    OUTSIDE: "ray cannot be brought to the normal case",
}
COLUMNS = (slice(0, 2), slice(2, 4))  # of the left and of the right photo
TURNS_OF_PHOTOS = (slice(0, 3), slice(3, 6))
SURE_PROBABILITY = 0.99  # probability below which a misfit may be chance


@dataclass(frozen=True)
class MonitoringSettings:
    """How displacements are tested."""

    significance: float = 0.05  # probability of calling a point, or a camera, moved that did not move
    # ``"always"`` takes out the turn of a camera whenever the stable points determine it: the tests keep their level
    # whether the camera turned or not. ``"auto"`` takes it out when it is significant: a little more precise with few
    # stable points, but a turn just too small to be found makes up to twice as many points seem to move. ``"never"``
    # only reports it
    moved_camera: str = "always"


@dataclass(frozen=True, eq=False)
class Series:
    """Measurements of all epochs."""

    # points, epochs: ids; the first epoch is the reference
    points: tuple[str, ...]
    epochs: tuple[str, ...]
    # (e, n, 4): x, z of the left and x, z of the right photo in mm, reduced to the principal points. NaN where a point
    # was not measured; the last alone is NaN where z was not measured on the right photo
    coordinates: Floats
    of_epoch: Floats  # (e, n, 4): variances of the errors that an epoch has for itself, mm^2
    shared: Floats  # (n, 4): variances of the errors that all epochs share, mm^2
    stable: Flags  # (n,): points that are taken not to move
    times: Floats | None = None  # (e,), optional: times of the epochs in a unit of the user's choice, ascending


@dataclass(frozen=True, eq=False)
class CameraState:
    """What is known of one camera in one epoch."""

    epoch: int
    side: str  # ``"left"`` or ``"right"``
    turn: Turn | None  # the fitted turn; None where the stable points do not determine it
    moved: bool  # whether it is significant
    removed: bool  # whether it was taken out of the displacements


@dataclass(frozen=True, eq=False)
class Step:
    """Displacements between two epochs, or rates."""

    values: Floats  # (n, 3): on the ground: metres, or metres per unit of time; NaN where not determined
    covariance: Floats  # (n, 3, 3): its covariance; NaN where not determined

    @cached_property
    def statistic(self) -> Floats:
        """Test value, chi-square with three degrees of freedom where nothing moved, shape (n,)."""
        return statistic(self.values, self.covariance)

    @property
    def sigma(self) -> Floats:
        """Standard deviations, shape (n, 3)."""
        return np.asarray(np.sqrt(np.einsum("nii->ni", self.covariance)), float)


@dataclass(frozen=True, eq=False)
class Rates:
    """Uniform motion fitted to the epochs."""

    step: Step  # velocities, metres per unit of time
    # (n,): weighted sum of squares of what the uniform motion leaves; NaN where there are fewer than three epochs
    misfit: Floats
    dof: Numbers  # (n,): its degrees of freedom


@dataclass(frozen=True, eq=False)
class Monitoring:
    """Displacements of all points in all epochs."""

    series: Series
    pair: StereoPair
    settings: MonitoringSettings
    positions: tuple[Step, ...]  # coordinates on the ground in each epoch (``values``), with covariance
    # since_first, since_previous: displacements of each epoch after the first, on the ground
    since_first: tuple[Step, ...]
    since_previous: tuple[Step, ...]
    rates: Rates | None  # uniform motion, when the epochs have times
    reason: Numbers  # (e, n): why a point has no coordinates in an epoch: a key of ``REASONS``; 0 where it has
    # parallax, parallax_sigma: (e, n): vertical parallaxes in mm with their standard deviations; NaN where z was not
    # measured on the right photo
    parallax: Floats
    parallax_sigma: Floats
    # parallax_change, parallax_change_sigma: (e, n): their changes since the first epoch
    parallax_change: Floats
    parallax_change_sigma: Floats
    cameras: tuple[CameraState, ...]  # left and right camera of each epoch after the first
    # what the stable points say in each epoch after the first; None where there are none
    motions: tuple[Motion | None, ...]
    notes: tuple[Note, ...] = ()

    @property
    def limit(self) -> float:
        return limit(self.settings.significance, SPACE)

    def significant(self, step: Step) -> Flags:
        """Tell which displacements are larger than chance allows, shape (n,)."""
        return np.asarray(np.nan_to_num(step.statistic) > self.limit, bool)

    @property
    def rejected(self) -> list[tuple[int, str]]:
        """Epoch number and id of points that were given as stable and moved."""
        names = [name for name, yes in zip(self.series.points, self.series.stable, strict=True) if yes]
        return [
            (number, names[each.row])
            for number, motion in enumerate(self.motions, 1)
            if motion is not None
            for each in motion.rejected
        ]


@dataclass(frozen=True, eq=False)
class _Turns:
    """Turns of both cameras in one epoch as they enter each point.

    A stable point must not testify for itself: it gets the turn that the others give.
    """

    values: Floats  # (n, 6)
    influence: Floats  # (n, 6, m, 4): how they follow the measured coordinates of the m stable points
    known: Flags  # (n,): False where a turn follows the point's own coordinates

    def between(self, other: _Turns, variances: Floats) -> Floats:
        """Covariance of the turns of two epochs, for errors of the stable points that both share, shape (n, 6, 6)."""
        spread = np.nan_to_num(variances)
        return np.asarray(np.einsum("najk,jk,nbjk->nab", self.influence, spread, other.influence), float)


@dataclass(frozen=True, eq=False)
class _Epoch:
    """One epoch under the orientation that it really had."""

    normal: Normal
    xyz: Floats  # (n, 3) in the axes of the normal case, from the left station
    by_measured: Floats  # (n, 3, 4) on the ground
    by_turn: Floats  # (n, 3, 6) on the ground
    turns: _Turns


def monitor(series: Series, pair: StereoPair, settings: MonitoringSettings | None = None) -> Monitoring:
    """Compute the displacements of all points in all epochs; the first epoch is the reference.

    Raises GeometryError when there is no base, or the cameras look along it.
    """
    chosen = settings or MonitoringSettings()
    ground = pair.ground_from_normal()
    series = replace(series, coordinates=_consistent(series.coordinates))
    reference = _epoch(series, pair, 0, _no_turns(series))
    motions = [_motion(series, pair, number) for number in range(1, len(series.epochs))]
    cameras = [state for number, motion in enumerate(motions, 1) for state in _states(number, motion, chosen)]
    epochs = [reference]
    for number, motion in enumerate(motions, 1):
        removed = tuple(state.removed for state in cameras if state.epoch == number)
        epochs.append(_epoch(series, pair, number, _turns(series, motion, removed)))
    covariance = _covariances(series, epochs)
    first, previous = _steps(epochs, covariance, ground, pair)
    positions = [
        Step(each.xyz @ ground.T + pair.centers[0], _position_covariance(series, epochs, number))
        for number, each in enumerate(epochs)
    ]
    sigma, change_sigma = _parallax_precision(series, epochs)
    parallax = np.array([each.normal.parallax for each in epochs])
    result = Monitoring(
        series=series,
        pair=pair,
        settings=chosen,
        positions=tuple(positions),
        since_first=tuple(first),
        since_previous=tuple(previous),
        rates=None if series.times is None else _rates(series.times, first, covariance),
        reason=_reasons(series, epochs),
        parallax=parallax,
        parallax_sigma=sigma,
        parallax_change=parallax - parallax[0],
        parallax_change_sigma=change_sigma,
        cameras=tuple(cameras),
        motions=tuple(motions),
    )
    return replace(result, notes=tuple(remarks(result)))


def _consistent(coordinates: Floats) -> Floats:
    """Use z of the right photo of a point in all of its epochs or in none, so that what is wrong in all cancels."""
    kept = coordinates.copy()
    absent = np.isnan(coordinates[:, :, :3]).any(axis=2)
    kept[absent] = np.nan
    incomplete = (np.isnan(kept[:, :, 3]) & ~absent).any(axis=0)
    kept[:, incomplete, 3] = np.nan
    return kept


def _motion(series: Series, pair: StereoPair, number: int) -> Motion | None:
    """Compare the stable points of an epoch with the reference epoch."""
    rows = np.flatnonzero(series.stable)
    if not len(rows):
        return None
    before = series.coordinates[0, rows].copy()
    rotations = np.broadcast_to(pair.rotations, (len(rows), 2, 3, 3))
    without = np.isnan(before[:, 3])
    if without.any():  # a turn about the axis needs to know roughly where the point stands
        before[without, 3] = meeting_z(before[without], pair, rotations[without])
    after = series.coordinates[number, rows]
    variances = series.of_epoch[0, rows] + series.of_epoch[number, rows]
    left, right = (
        ImagePair(
            before=before[:, columns],
            after=after[:, columns],
            variances=variances[:, columns],
            principal_distance=focal,
        )
        for columns, focal in zip(COLUMNS, pair.principal_distances, strict=True)
    )
    return find_motion(left, right)


def _states(number: int, motion: Motion | None, settings: MonitoringSettings) -> list[CameraState]:
    critical = limit(settings.significance, ANGLES)
    states = []
    for camera, side in enumerate(SIDES):
        turn = motion.turns[camera] if motion is not None else None
        moved = turn is not None and turn.statistic > critical
        wanted = settings.moved_camera == "always" or (moved and settings.moved_camera == "auto")
        states.append(CameraState(epoch=number, side=side, turn=turn, moved=moved, removed=turn is not None and wanted))
    return states


def _no_turns(series: Series) -> _Turns:
    points, stable = len(series.points), int(series.stable.sum())
    return _Turns(np.zeros((points, 6)), np.zeros((points, 6, stable, 4)), np.ones(points, bool))


def _turns(series: Series, motion: Motion | None, removed: tuple[bool, ...]) -> _Turns:
    """Return every point the turns of the cameras, to a stable point those without itself."""
    result = _no_turns(series)
    if motion is None:
        return result
    stable = np.flatnonzero(series.stable)
    for camera, turn in enumerate(motion.turns):
        if turn is None or not removed[camera]:
            continue
        angles, columns = TURNS_OF_PHOTOS[camera], COLUMNS[camera]
        weighted = turn.design * turn.weights[:, :, None]
        result.values[:, angles] = turn.values
        result.influence[:, angles, :, columns] = np.einsum("jk,mik->jmi", turn.covariance, weighted)
        rows = np.flatnonzero(turn.weights.any(axis=1))
        values, normal, known = turn.predict(rows)
        result.known[stable[rows[~known]]] = False
        rows, values, normal = rows[known], values[known], normal[known]
        result.values[stable[rows], angles] = values
        influence = np.einsum("rjk,mik->rjmi", np.linalg.inv(normal), weighted)
        influence[range(len(rows)), :, rows] = 0.0
        result.influence[stable[rows], angles, :, columns] = influence
    return result


def _epoch(series: Series, pair: StereoPair, number: int, turns: _Turns) -> _Epoch:
    angles = turns.values.reshape(-1, 2, 3)
    rotations = pair.rotations @ small_turn(angles)
    weights = series.shared + series.of_epoch[0]
    normal = to_normal(series.coordinates[number], weights, pair, rotations)
    xyz, jacobian = intersect(normal.coordinates, pair.principal_distances[0], pair.base)
    on_ground = pair.ground_from_normal() @ jacobian
    return _Epoch(
        normal=normal,
        xyz=xyz,
        by_measured=on_ground @ normal.by_measured,
        by_turn=on_ground @ normal.by_turn,
        turns=turns,
    )


def _reasons(series: Series, epochs: list[_Epoch]) -> Numbers:
    found = np.full((len(epochs), len(series.points)), MEASURED)
    for number, each in enumerate(epochs):
        found[number, np.isnan(each.xyz[:, 0])] = SMALL_PARALLAX
        found[number, np.isnan(each.normal.coordinates[:, 0])] = OUTSIDE
        found[number, np.isnan(series.coordinates[number, :, 0])] = ABSENT
    later = found[1:]
    later[(later == MEASURED) & (found[0] != MEASURED)] = NO_REFERENCE
    return found


def _covariances(series: Series, epochs: list[_Epoch]) -> Floats:
    """Covariances of the displacements since the first epoch, of all pairs of epochs, shape (e, e, n, 3, 3)."""
    reference = epochs[0]
    common = _sandwich(reference.by_measured, series.of_epoch[0], reference.by_measured)
    changes = [each.by_measured - reference.by_measured for each in epochs]
    count = len(epochs)
    whole = np.zeros((count, count, len(series.points), 3, 3))
    for one in range(1, count):
        for two in range(1, one + 1):
            part = _sandwich(changes[one], series.shared, changes[two]) + common
            if one == two:
                part += _sandwich(epochs[one].by_measured, series.of_epoch[one], epochs[one].by_measured)
            part += _from_turns(series, epochs, one, two)
            whole[one, two] = part
            whole[two, one] = part.transpose(0, 2, 1)
    for number, each in enumerate(epochs):
        whole[number, :, ~each.turns.known] = whole[:, number, ~each.turns.known] = np.nan
    return whole


def _from_turns(series: Series, epochs: list[_Epoch], one: int, two: int) -> Floats:
    """Covariance that comes from the turns: stable points have errors too, those of the first epoch in all turns."""
    first, second = epochs[one], epochs[two]
    variances = series.of_epoch[0, series.stable] + (series.of_epoch[one, series.stable] if one == two else 0.0)
    between = first.turns.between(second.turns, variances)
    return np.asarray(first.by_turn @ between @ second.by_turn.transpose(0, 2, 1))


def _position_covariance(series: Series, epochs: list[_Epoch], number: int) -> Floats:
    each = epochs[number]
    measured = _sandwich(each.by_measured, series.shared + series.of_epoch[number], each.by_measured)
    whole: Floats = measured + (_from_turns(series, epochs, number, number) if number else 0.0)
    whole[~each.turns.known] = np.nan
    return whole


def _sandwich(left: Floats, variances: Floats, right: Floats) -> Floats:
    return np.asarray(np.einsum("nij,nj,nkj->nik", left, variances, right), float)


def _steps(epochs: list[_Epoch], covariance: Floats, ground: Floats, pair: StereoPair) -> tuple[list[Step], list[Step]]:
    """Displacements since the first and since the previous epoch."""

    def between(one: int, two: int, spread: Floats) -> Step:
        moved = displacements(
            epochs[one].normal.coordinates, epochs[two].normal.coordinates, pair.principal_distances[0], pair.base
        )
        moved[np.isnan(epochs[one].xyz + epochs[two].xyz).any(axis=1)] = np.nan
        spread = np.where(np.isnan(moved[:, :, None]), np.nan, spread)
        return Step(moved @ ground.T, spread)

    first = [between(0, number, covariance[number, number]) for number in range(1, len(epochs))]
    previous = []
    for one, two in pairwise(range(len(epochs))):
        spread = covariance[one, one] + covariance[two, two] - covariance[one, two] - covariance[two, one]
        previous.append(between(one, two, spread if one else covariance[two, two]))
    return first, previous


def _parallax_precision(series: Series, epochs: list[_Epoch]) -> tuple[Floats, Floats]:
    """Return the standard deviations of vertical parallaxes and of their changes since the first epoch."""
    gradients = np.array([each.normal.parallax_by_measured for each in epochs])
    unknown = np.array([np.isnan(each.normal.parallax + epochs[0].normal.parallax) for each in epochs])
    total = np.einsum("enj,enj->en", gradients**2, series.shared + series.of_epoch)
    alone = np.einsum("enj,enj->en", gradients**2, series.of_epoch)
    common = np.einsum("enj,nj->en", (gradients - gradients[0]) ** 2, series.shared)
    turned = np.zeros_like(alone)
    for number, each in enumerate(epochs[1:], 1):
        variances = series.of_epoch[0, series.stable] + series.of_epoch[number, series.stable]
        gradient, between = each.normal.parallax_by_turn, each.turns.between(each.turns, variances)
        turned[number] = np.einsum("na,nab,nb->n", gradient, between, gradient)
        turned[number, ~each.turns.known] = np.nan
    change = alone + alone[0] + common + turned
    change[0] = np.nan
    return np.sqrt(np.where(unknown, np.nan, total + turned)), np.sqrt(change)


def _rates(times: Floats, first: list[Step], covariance: Floats) -> Rates:
    """Fit a uniform motion to each point: generalised least squares on its displacements since the first epoch."""
    there = np.isfinite(np.array([step.covariance for step in first])).all(axis=(2, 3)).T  # by point and epoch
    (points, epochs), count = there.shape, there.sum(axis=1)
    used = np.repeat(there, 3, axis=1)
    matrix = covariance[1:, 1:].transpose(2, 0, 3, 1, 4).reshape(points, 3 * epochs, 3 * epochs)
    matrix = np.where(used[:, :, None] & used[:, None, :], matrix, np.eye(3 * epochs))
    design = used[:, :, None] * np.kron((times[1:] - times[0])[:, None], np.eye(3))
    observed = np.where(used, np.concatenate([step.values for step in first], axis=1), 0.0)[:, :, None]
    weighted = np.linalg.solve(matrix, design)
    normal = weighted.transpose(0, 2, 1) @ design
    known = (count > 0)[:, None, None]
    spread = np.where(known, np.linalg.inv(np.where(known, normal, np.eye(3))), np.nan)
    values = spread @ (weighted.transpose(0, 2, 1) @ observed)
    left = observed - design @ values
    dof = np.maximum(3 * (count - 1), 0)
    misfit = (left.transpose(0, 2, 1) @ np.linalg.solve(matrix, left))[:, 0, 0]
    return Rates(Step(values[:, :, 0], spread), np.where(dof > 0, misfit, np.nan), dof)


def remarks(result: Monitoring) -> Iterator[Note]:
    """Give warnings and remarks on displacements: what is missing, what moved that should not, what does not fit."""
    yield from _cameras(result)
    yield from _stable_points(result)
    yield from _parallaxes(result)
    yield from _missing(result)


def _cameras(result: Monitoring) -> Iterator[Note]:
    """Which cameras turned, and which nobody can know of."""
    if not result.series.stable.any():
        message = "no stable points are given: a camera that turned between the epochs shows as displacements"
        yield Note("no-stable-points", message)
        return
    for state in result.cameras:
        where = f"epoch {result.series.epochs[state.epoch]}: the {state.side} camera"
        if state.turn is None:
            message = f"{where} has too few stable points to see whether it turned: two with x and z are needed"
            yield Note("turn-not-determined", message, photos=(state.side,))
        elif state.moved:
            done = "its turn is taken out" if state.removed else "its turn is left in the displacements"
            severity = "note" if state.removed else "warning"
            yield Note(
                "camera-turned", f"{where} turned by {_turned_by(state.turn)}; {done}", severity, photos=(state.side,)
            )


def _turned_by(turn: Turn) -> str:
    words = ("to the right", "up", "counter-clockwise")
    return ", ".join(f"{value:+.0f}″ {word}" for value, word in zip(turn.values * ARCSECONDS, words, strict=True))


def _stable_points(result: Monitoring) -> Iterator[Note]:
    """Which stable points moved, and where they do not fit together."""
    for number, name in result.rejected:
        epoch = result.series.epochs[number]
        message = f"epoch {epoch}: point {name} is given as stable but does not fit the others; it was not used as such"
        yield Note("not-stable", message, points=(name,))
    for state in result.cameras:
        turn = state.turn
        if turn is None or turn.dof <= 0 or turn.weighted_sum <= chi2_quantile(SURE_PROBABILITY, turn.dof):
            continue
        ratio = float(np.sqrt(turn.weighted_sum / turn.dof))
        message = (
            f"epoch {result.series.epochs[state.epoch]}: the stable points of the {state.side} camera scatter"
            f" {ratio:.1f} times as much as the stated standard deviations say, after a turn of the camera is allowed"
            " for: the camera may have been moved from its place, or the standard deviations are too small"
        )
        yield Note("stable-scatter", message, photos=(state.side,))


def _parallaxes(result: Monitoring) -> Iterator[Note]:
    """Where rays of a point do not meet as they should."""
    yield from _misorientation(result)
    for number in range(1, len(result.series.epochs)):
        ratio = np.abs(result.parallax_change[number] / result.parallax_change_sigma[number])
        known = np.isfinite(ratio)
        if not known.any():
            continue
        limit = float(np.sqrt(chi2_quantile(1 - (1 - SURE_PROBABILITY) / known.sum(), 1)))
        for row in np.flatnonzero(known & (np.nan_to_num(ratio) > limit)):
            name = result.series.points[row]
            change = result.parallax_change[number, row] * MICROMETRES
            message = (
                f"epoch {result.series.epochs[number]}: the vertical parallax of point {name} changed by"
                f" {change:+.1f} µm, {ratio[row]:.1f} standard deviations (limit {limit:.1f}): it was measured"
                " wrongly, or another point was"
            )
            yield Note("parallax-change", message, points=(name,))


def _misorientation(result: Monitoring) -> Iterator[Note]:
    """Compare the vertical parallaxes of the first epoch with what the measurements explain."""
    ratio = result.parallax[0] / result.parallax_sigma[0]
    ratio = ratio[np.isfinite(ratio)]
    if len(ratio) and (ratio**2).sum() > chi2_quantile(SURE_PROBABILITY, len(ratio)):
        rms = float(np.sqrt(np.nanmean(result.parallax[0] ** 2))) * MICROMETRES
        message = (
            f"the vertical parallaxes of the first epoch have an rms of {rms:.1f} µm,"
            f" {np.sqrt((ratio**2).mean()):.1f} times what the stated standard deviations say: the orientation of the"
            " cameras is not exact; what it adds to both epochs alike cancels in the displacements"
        )
        yield Note("orientation", message)


def _missing(result: Monitoring) -> Iterator[Note]:
    """Name points without displacements, by epoch and reason."""
    for number, epoch in enumerate(result.series.epochs):
        for code in np.unique(result.reason[number]):
            if code == MEASURED:
                continue
            names = [result.series.points[row] for row in np.flatnonzero(result.reason[number] == code)]
            verb = "has" if len(names) == 1 else "have"
            what = "displacement" if number else "coordinates"
            message = f"epoch {epoch}: {named('point', names)} {verb} no {what}: {REASONS[int(code)]}"
            yield Note("not-determined", message, "note", points=tuple(names))
    untested = [
        result.series.points[row]
        for row in np.flatnonzero(result.series.stable)
        if any(np.isfinite(step.values[row, 0]) and not np.isfinite(step.statistic[row]) for step in result.since_first)
    ]
    if untested:
        message = f"not tested, because the turn of a camera depends on them: {named('point', untested)}"
        yield Note("not-tested", message, "note", points=tuple(untested))
