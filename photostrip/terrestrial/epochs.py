"""From the measurements of all epochs to displacements: the walk through ``terrestrial``.

Errors of the base and of the angles of the reference epoch are common to all epochs: they change a displacement by
their relative size (a base wrong by 1:1000 makes every displacement wrong by 1:1000) and are not part of its
covariance.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.terrestrial.camera_motion import ANGLES, ImagePair, Motion, find_motion
from photostrip.terrestrial.displacement import displacements, limit
from photostrip.terrestrial.frame import small_turn
from photostrip.terrestrial.monitoring import (
    ABSENT,
    MEASURED,
    NO_REFERENCE,
    OUTSIDE,
    SMALL_PARALLAX,
    CameraState,
    Monitoring,
    MonitoringSettings,
    Rates,
    Series,
    Step,
)
from photostrip.terrestrial.normal_case import SIDES, Normal, StereoPair, intersect, meeting_z, to_normal
from photostrip.terrestrial.remarks import remarks

COLUMNS = (slice(0, 2), slice(2, 4))  # of the left and of the right photo
TURNS_OF_PHOTOS = (slice(0, 3), slice(3, 6))


@dataclass(frozen=True, eq=False)
class _Turns:
    """Turns of both cameras in one epoch as they enter each point.

    A stable point must not testify for itself: it gets the turn that the others give.
    """

    values: Floats  # (n, 6)
    common: Floats  # (6, m, 4): how the turns follow the measured coordinates of the m stable points
    stable: Floats  # (m, 6, m, 4): the same for each stable point
    known: Flags  # (n,): False where a turn follows the point's own coordinates

    def between(self, other: _Turns, variances: Floats, stable: Flags) -> Floats:
        """Covariance of the turns of two epochs, for errors of the stable points that both share, shape (n, 6, 6)."""
        spread = np.nan_to_num(variances)
        whole = np.empty((len(stable), 6, 6))
        whole[:] = np.einsum("ajk,jk,bjk->ab", self.common, spread, other.common)
        whole[stable] = np.einsum("najk,jk,nbjk->nab", self.stable, spread, other.stable)
        return whole

    def along(self, gradient: Floats, variances: Floats, stable: Flags) -> Floats:
        """Variance of what follows the turns with a gradient (n, 6), shape (n,)."""
        between = self.between(self, variances, stable)
        return np.asarray(np.einsum("na,nab,nb->n", gradient, between, gradient), float)


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
    shape = (6, stable, 4)
    return _Turns(
        values=np.zeros((points, 6)),
        common=np.zeros(shape),
        stable=np.zeros((stable, *shape)),
        known=np.ones(points, bool),
    )


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
        result.common[angles, :, columns] = np.einsum("jk,mik->jmi", turn.covariance, weighted)
        result.stable[:, angles, :, columns] = result.common[angles, :, columns]
        rows = np.flatnonzero(turn.weights.any(axis=1))
        values, normal, known = turn.predict(rows)
        result.known[stable[rows[~known]]] = False
        rows, values, normal = rows[known], values[known], normal[known]
        result.values[stable[rows], angles] = values
        influence = np.einsum("rjk,mik->rjmi", np.linalg.inv(normal), weighted)
        influence[range(len(rows)), :, rows] = 0.0
        for number, each in zip(rows, influence, strict=True):
            result.stable[number, angles, :, columns] = each
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
    between = first.turns.between(second.turns, variances, series.stable)
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
        turned[number] = each.turns.along(each.normal.parallax_by_turn, variances, series.stable)
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
