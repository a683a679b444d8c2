"""Displacements from photos of one station in two epochs, with known distances of the points.

A photo gives the direction of a point, its distance from the perspective centre the rest. Where the distance is known
in the first epoch alone, the point is taken to stay as far away as it was: what is found is the displacement across
the ray. Where it is known in both, the displacement is complete. Points that stand still say how the camera turned.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from photostrip.arrays import Flags, Floats
from photostrip.errors import GeometryError
from photostrip.statistics import chi2_quantile
from photostrip.terrestrial.camera_motion import ImagePair, Turn, fit
from photostrip.terrestrial.frame import rays, small_turn
from photostrip.terrestrial.normal_case import SPACE

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
