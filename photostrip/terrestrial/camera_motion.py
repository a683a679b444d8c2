"""Cameras that turned between two epochs: found by points that did not move, and taken into account.

A camera on its station can turn, not walk: the image of a point that stands still moves by an amount that depends on
the turn alone, not on the distance of the point. For each camera and epoch a small turn against the reference epoch is
fitted to the stable points and tested against zero. A stable point that does not fit to the others moved itself.

Displacements from photos of one station in two epochs, with known distances of the points.

A photo gives the direction of a point, its distance from the perspective centre the rest. Where the distance is known
in the first epoch alone, the point is taken to stay as far away as it was: what is found is the displacement across
the ray. Where it is known in both, the displacement is complete. Points that stand still say how the camera turned.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import GeometryError
from photostrip.geometry.rotation import alpha_omega_kappa
from photostrip.rejection import Rejection
from photostrip.statistics import chi2_quantile
from photostrip.terrestrial.normal_case import SPACE, rays, small_turn

ANGLES = 3  # a turn to the right, up, and about the optical axis
MOST_ITERATIONS = 20
CONVERGED_RAD = 1e-12
LEAST_RECIPROCAL = 1e-10  # reciprocal of the squared condition number below which a turn is not determined
FALSE_REJECTION = 0.01  # probability of rejecting any of the stable points of an epoch by chance


@dataclass(frozen=True, eq=False)
class ImagePair:
    """The stable points on two photos of one camera."""

    # before, after: (m, 2): x, z in mm, reduced to the principal point, in the reference epoch and now. NaN in `after`
    # where a coordinate was not measured now
    before: Floats
    after: Floats
    variances: Floats  # (m, 2): variances of the differences, mm^2
    principal_distance: float  # f in mm

    @property
    def measured(self) -> Flags:
        """Which coordinates can be compared, shape (m, 2)."""
        return np.asarray(np.isfinite(self.before + self.after), bool)


class TurnsWithout(NamedTuple):
    """Turns of a camera, each fitted without one of its points."""

    values: Floats  # (r, 3)
    normal: Floats  # (r, 3, 3)
    known: Flags  # (r,): where the other points determine it


@dataclass(frozen=True, eq=False)
class Turn:
    """The fitted turn of one camera in one epoch."""

    values: Floats  # (3,): turn to the right, up, and counter-clockwise about the optical axis, radians
    normal: Floats  # (3, 3): inverse of its covariance, rad^-2
    design: Floats  # (m, 2, 3): derivatives of the coordinates by the turn, mm/rad; zero where a point was not used
    weights: Floats  # (m, 2): weights of the coordinates, mm^-2; zero where a point was not used
    # (m, 2): measured minus computed coordinates of all points, mm; NaN where they cannot be compared
    residuals: Floats

    @property
    def covariance(self) -> Floats:
        """Covariance of the turn, rad^2, shape (3, 3)."""
        return np.asarray(np.linalg.inv(self.normal), float)

    @property
    def sigma(self) -> Floats:
        """Standard deviations of the turn, radians."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def statistic(self) -> float:
        """Test value of the turn: chi-square with three degrees of freedom when the camera stood still."""
        return float(self.values @ self.normal @ self.values)

    @property
    def weighted_sum(self) -> float:
        return float(np.nansum(self.weights * self.residuals**2))

    @property
    def dof(self) -> int:
        return int((self.weights > 0).sum()) - ANGLES

    def predict(self, rows: Numbers) -> TurnsWithout:
        """Fit the turn without each of some points alone."""
        design = self.design[rows]
        weighted = design * self.weights[rows][:, :, None]
        normal = self.normal - weighted.transpose(0, 2, 1) @ design
        known = determined(normal)
        normal = np.where(known[:, None, None], normal, np.eye(ANGLES))
        sums = np.einsum("rik,ri->rk", weighted, np.nan_to_num(self.residuals[rows]))
        return TurnsWithout(self.values - np.linalg.solve(normal, sums[:, :, None])[:, :, 0], normal, known)


def turned(before: Floats, principal_distance: float, turn: Floats) -> Floats:
    """Where points (m, 2), mm from the principal point, stand in the photo after one turn, or each after its own."""
    ray = (rays(before, principal_distance)[:, None, :] @ small_turn(turn))[:, 0]
    return -principal_distance * ray[:, :2] / ray[:, 2:]


def turn_gradient(points: Floats, principal_distance: float) -> Floats:
    """Return the derivatives (m, 2, 3) of coordinates x, z by a small turn to the right, up, counter-clockwise; mm/rad.

    Source: derived; tested against differences.
    """
    x, z = points.T
    f = principal_distance
    across = x * z / f
    return np.stack(
        [np.column_stack([-f - x**2 / f, -across, z]), np.column_stack([-across, -f - z**2 / f, -x])], axis=1
    )


def fit(pair: ImagePair, used: Flags) -> Turn | None:
    """Fit the turn of a camera to the points used; None when they do not determine it.

    Two points with x and z are needed, or three with x.
    """
    there = pair.measured & used[:, None]
    weights = np.where(there, 1.0 / pair.variances, 0.0)
    values = np.zeros(ANGLES)
    for _ in range(MOST_ITERATIONS):
        predicted = turned(pair.before, pair.principal_distance, values)
        design = np.where(there[:, :, None], turn_gradient(np.nan_to_num(predicted), pair.principal_distance), 0.0)
        normal = np.einsum("mij,mi,mik->jk", design, weights, design)
        if not determined(normal):
            return None
        residuals = pair.after - predicted
        step = np.linalg.solve(normal, np.einsum("mij,mi,mi->j", design, weights, np.nan_to_num(residuals)))
        # turned first by `values`, then by the step in the new axes
        values = alpha_omega_kappa(small_turn(values) @ small_turn(step))
        if np.abs(step).max() < CONVERGED_RAD:
            return Turn(values=values, normal=normal, design=design, weights=weights, residuals=residuals)
    return None


def determined(normal: Floats) -> Flags:
    """Whether normal matrices (..., 3, 3) of turns can be inverted."""
    length = np.sqrt(np.diagonal(normal, axis1=-2, axis2=-1))
    length = np.where(length.all(axis=-1, keepdims=True), length, np.inf)  # leaves a matrix of zeros
    size = np.linalg.eigvalsh(normal / (length[..., :, None] * length[..., None, :]))
    return np.asarray(size[..., 0] > LEAST_RECIPROCAL, bool)


@dataclass(frozen=True, eq=False)
class Motion:
    """What the stable points say of both cameras in one epoch."""

    # of the left and the right camera; None where the stable points do not determine it
    turns: tuple[Turn | None, Turn | None]
    used: Flags  # (m,): stable points that fit together
    # stable points that do not fit to the others, in order, by their squared misclosures in units of the variances
    rejected: tuple[Rejection, ...]


def find_motion(left: ImagePair, right: ImagePair) -> Motion:
    """Fit the turns of both cameras to the points that did not move.

    At each step the point that fits worst to the others is taken out, as having moved itself.
    """
    pairs = (left, right)
    used = np.ones(len(left.before), bool)
    rejected: list[Rejection] = []
    while True:
        turns = (fit(left, used), fit(right, used))
        worst = _worst(pairs, turns, used)
        if worst is None:
            return Motion(turns, used, tuple(rejected))
        rejected.append(worst)
        used = used.copy()
        used[worst.row] = False


def _worst(pairs: tuple[ImagePair, ImagePair], turns: tuple[Turn | None, Turn | None], used: Flags) -> Rejection | None:
    """Find the point that fits worst to the turns that the others give, if it fits too badly."""
    rows = np.flatnonzero(used)
    misfits = [_misfits(pair, turn, rows) for pair, turn in zip(pairs, turns, strict=True) if turn is not None]
    if not misfits:
        return None
    values, components = np.sum(misfits, axis=0)
    limits = np.array(
        [chi2_quantile(1 - FALSE_REJECTION / len(rows), count) if count else np.inf for count in components]
    )
    worst = int(np.argmax(values / limits))
    if values[worst] <= limits[worst]:
        return None
    return Rejection(
        kind="stable", row=int(rows[worst]), test="chi-square", value=float(values[worst]), limit=float(limits[worst])
    )


def _misfits(pair: ImagePair, turn: Turn, rows: Numbers) -> tuple[Floats, Floats]:
    """Squared misclosures of points, each against the turn fitted without it, and their degrees of freedom."""
    values, normal, known = turn.predict(rows)
    there = pair.measured[rows] & known[:, None]
    miss = np.where(there, pair.after[rows] - turned(pair.before[rows], pair.principal_distance, values), 0.0)
    design = np.where(there[:, :, None], turn.design[rows], 0.0)
    covariance = np.where(there, pair.variances[rows], 1.0)[:, :, None] * np.eye(2)
    covariance += design @ np.linalg.inv(normal) @ design.transpose(0, 2, 1)
    drops = np.einsum("ri,ri->r", miss, np.linalg.solve(covariance, miss[:, :, None])[:, :, 0])
    return drops, there.sum(axis=1, dtype=float)


DIFFERENCES = np.array([1e-4] * 4 + [1e-3] * 2 + [1e-6] * 3)  # of differences: mm, metres, radians
ACROSS, COMPLETE = 2, 3  # components of a displacement


@dataclass(frozen=True, eq=False)
class OneStation:
    points: tuple[str, ...]
    first: Floats  # (n, 2): x, z of the first epoch, mm, reduced to the principal point
    change: Floats  # (n, 2): pseudo-parallaxes: second minus first
    # sigma, sigma_change: (n,): standard deviations of a coordinate and of a pseudo-parallax, mm
    sigma: Floats
    sigma_change: Floats
    distances: Floats  # (n, 2): of the points from the perspective centre in both epochs, metres; NaN where not known
    sigma_distance: Floats  # (n,): standard deviation of a distance, metres
    stable: Flags  # (n,): points that are taken not to move


@dataclass(frozen=True, eq=False)
class OneStationResult:
    """Displacements of all points."""

    values: Floats  # (n, 3): on the ground, metres
    covariance: Floats  # (n, 3, 3)
    components: tuple[int, ...]  # how many of a displacement are known: 2 across the ray, 3 in space
    # statistic, limit: (n,): test value, chi-square with that many degrees of freedom where nothing moved; its limit
    statistic: Floats
    limit: Floats
    turn: Turn | None  # of the camera since the first epoch, by the stable points; None without any

    @property
    def sigma(self) -> Floats:
        """Standard deviations, shape (n, 3)."""
        return np.asarray(np.sqrt(np.einsum("nii->ni", self.covariance)), float)


def one_station(
    measured: OneStation, principal_distance: float, rotation: Floats, significance: float = 0.05
) -> OneStationResult:
    """Compute displacements from one station.

    rotation: (3, 3), photo to ground in the first epoch.
    significance: probability of calling a point moved that did not move.
    Raises GeometryError when the stable points do not determine how the camera turned.

    Source: derived; [004c] eq. 1, 2 with distances in place of parallaxes.
    """
    turn = _turn(measured, principal_distance)
    turned, spread = _known_turns(turn, measured.stable)
    quantities = np.column_stack([measured.first, measured.change, measured.distances, turned])
    sigmas = np.repeat(np.column_stack([measured.sigma, measured.sigma_change, measured.sigma_distance]), 2, axis=1)
    variances = np.zeros((len(turned), 9, 9))
    variances[:, range(6), range(6)] = sigmas**2
    variances[:, 6:, 6:] = spread
    values, ray = _displacement(quantities, principal_distance, rotation)
    slope = _slope(quantities, principal_distance, rotation)
    covariance = slope @ variances @ slope.transpose(0, 2, 1)
    components = np.where(np.isfinite(measured.distances[:, 1]), COMPLETE, ACROSS)
    statistic = np.empty(len(values))
    # without a second distance the ray itself is a direction in which nothing is seen
    axes = np.where((components == COMPLETE)[:, None, None], np.eye(SPACE), np.linalg.svd(ray[:, None])[2])
    for number in (ACROSS, COMPLETE):
        some = components == number
        seen = axes[some, SPACE - number :]
        moved = seen @ values[some, :, None]
        weighted = np.linalg.solve(seen @ covariance[some] @ seen.transpose(0, 2, 1), moved)
        statistic[some] = (moved * weighted).sum(axis=(1, 2))
    return OneStationResult(
        values=values,
        covariance=covariance,
        components=tuple(components.tolist()),
        statistic=statistic,
        limit=np.array([chi2_quantile(1 - significance, number) for number in components.tolist()]),
        turn=turn,
    )


def _turn(measured: OneStation, principal_distance: float) -> Turn | None:
    """Fit how the camera turned to the points that stand still; None without any."""
    if not measured.stable.any():
        return None
    before = measured.first[measured.stable]
    variances = np.repeat(measured.sigma_change[measured.stable, None] ** 2, 2, axis=1)
    after = before + measured.change[measured.stable]
    pair = ImagePair(before, after, variances=variances, principal_distance=principal_distance)
    turn = fit(pair, np.ones(len(before), bool))
    if turn is None:
        raise _undetermined(measured.points)
    return turn


def _undetermined(points: tuple[str, ...]) -> GeometryError:
    message = "the stable points do not say how the camera turned: three are needed, apart from each other in the photo"
    return GeometryError(message, points=points, code="undetermined")


def _known_turns(turn: Turn | None, stable: Flags) -> tuple[Floats, Floats]:
    """Give each point the turn with its covariance; a stable one that of the others: it must not testify for itself."""
    values, spread = np.zeros((len(stable), SPACE)), np.zeros((len(stable), SPACE, SPACE))
    if turn is not None:
        values[:], spread[:] = turn.values, turn.covariance
        values[stable], normal, known = turn.predict(np.arange(stable.sum()))
        if not known.all():
            raise _undetermined(())
        spread[stable] = np.linalg.inv(normal)
    return values, spread


def _displacement(quantities: Floats, principal_distance: float, rotation: Floats) -> tuple[Floats, Floats]:
    """Displacements on the ground, and the directions of the second rays.

    quantities: (..., 9): x, z, dx, dz in mm, both distances in metres, the turn of the camera in radians.
    """
    image, change, first, later, turn = np.split(quantities, [2, 4, 5, 6], axis=-1)
    ray = rays(np.stack([image, image + change]), principal_distance)
    ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
    second = (rotation @ small_turn(turn) @ ray[1, ..., None])[..., 0]
    return np.where(np.isfinite(later), later, first) * second - first * (ray[0] @ rotation.T), second


def _slope(quantities: Floats, principal_distance: float, rotation: Floats) -> Floats:
    """Differentiate displacements, (n, 3, 9), by differences; zero by a second distance that is not known."""
    steps, at = np.diag(DIFFERENCES), quantities[:, None]
    ahead, behind = (_displacement(at + step, principal_distance, rotation)[0] for step in (steps, -steps))
    return np.asarray((ahead - behind).transpose(0, 2, 1) / (2 * DIFFERENCES), float)
