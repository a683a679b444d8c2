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
    values = np.empty((len(measured.points), SPACE))
    covariance = np.empty((len(measured.points), SPACE, SPACE))
    components, statistic = [], np.empty(len(measured.points))
    stable = np.cumsum(measured.stable) - 1
    for row in range(len(measured.points)):
        turned, spread = _known_turn(turn, int(stable[row]) if measured.stable[row] else None)
        quantities = np.concatenate([measured.first[row], measured.change[row], measured.distances[row], turned])
        complete = bool(np.isfinite(quantities[5]))
        variances = np.zeros((len(quantities), len(quantities)))
        sigmas = [measured.sigma[row]] * 2 + [measured.sigma_change[row]] * 2 + [measured.sigma_distance[row]] * 2
        variances[range(6), range(6)] = np.square(sigmas)
        variances[6:, 6:] = spread
        values[row], ray = _displacement(quantities, principal_distance, rotation)
        slope = _slope(quantities, principal_distance, rotation)
        covariance[row] = slope @ variances @ slope.T
        components.append(COMPLETE if complete else ACROSS)
        # without a second distance the ray itself is a direction in which nothing is seen
        seen = np.eye(SPACE) if complete else np.linalg.svd(ray[None])[2][1:]
        moved = seen @ values[row]
        statistic[row] = moved @ np.linalg.solve(seen @ covariance[row] @ seen.T, moved)
    return OneStationResult(
        values=values,
        covariance=covariance,
        components=tuple(components),
        statistic=statistic,
        limit=np.array([chi2_quantile(1 - significance, number) for number in components]),
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


def _known_turn(turn: Turn | None, number: int | None) -> tuple[Floats, Floats]:
    """Turn with its covariance; for a stable point that of the others, because it must not testify for itself."""
    if turn is None:
        return np.zeros(SPACE), np.zeros((SPACE, SPACE))
    if number is None:
        return turn.values, turn.covariance
    values, normal, known = turn.predict(np.array([number]))
    if not known.all():
        raise _undetermined(())
    return values[0], np.asarray(np.linalg.inv(normal[0]), float)


def _displacement(quantities: Floats, principal_distance: float, rotation: Floats) -> tuple[Floats, Floats]:
    """Displacement on the ground, and the direction of the second ray.

    quantities: (..., 9): x, z, dx, dz in mm, both distances in metres, the turn of the camera in radians.
    """
    q = np.asarray(quantities, float)
    ray = rays(np.stack([q[..., :2], q[..., :2] + q[..., 2:4]]), principal_distance)
    ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
    second = (rotation @ small_turn(q[..., 6:]) @ ray[1, ..., None])[..., 0]
    first = q[..., 4, None]
    later = np.where(np.isfinite(q[..., 5, None]), q[..., 5, None], first)
    return later * second - first * (ray[0] @ rotation.T), second


def _slope(quantities: Floats, principal_distance: float, rotation: Floats) -> Floats:
    """Differentiate the displacement, (3, 9), by differences; zero by a second distance that is not known."""
    steps = np.diag(DIFFERENCES)
    ahead, behind = (_displacement(quantities + step, principal_distance, rotation)[0] for step in (steps, -steps))
    return np.asarray((ahead - behind).T / (2 * DIFFERENCES), float)
