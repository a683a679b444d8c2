"""A dense bundle adjustment: residuals written apart from the program, derivatives by differences."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from photostrip.network.adjustment import BundleSolution
    from photostrip.network.problem import BundleProblem, PositionObservations

    Floats = NDArray[np.float64]

# Steps of the differences by parameter.
STEPS = {"c": 1e-2, "x0": 1e-2, "y0": 1e-2, "k1": 1e-9, "k2": 1e-13, "k3": 1e-17, "p1": 1e-7, "p2": 1e-7}
STEPS |= {"b1": 1e-5, "b2": 1e-5}
SUBSTITUTIONS = 12  # each leaves a hundredth of what was left, or less
METRES, RADIANS = 0.1, 1e-5


@dataclass(frozen=True, eq=False)
class Dense:
    """Misfits in units of sigma, their derivatives by all parameters, and the inverse normal matrix."""

    misfit: Floats
    derivatives: Floats
    cofactors: Floats

    def of_misfits(self) -> Floats:
        """Cofactors of the residuals."""
        found: Floats = np.eye(len(self.misfit)) - self.derivatives @ self.cofactors @ self.derivatives.T
        return found


def misfits(problem: BundleProblem, centers: Floats, rotations: Floats, points: Floats, common: Floats) -> Floats:
    """Measured minus computed, of everything, in units of sigma."""
    images, control, attitudes = problem.images, problem.control, problem.attitudes
    names = problem.common_names()
    camera = problem.cameras.of_photo[images.photo]
    ray = np.einsum("mi,mij->mj", points[images.point] - centers[images.photo], rotations[images.photo])
    found = images.xy
    for _ in range(SUBSTITUTIONS if common.any() else 1):  # the image point whose corrected one is computed
        focal, bend = _bent(problem, found, common, camera)
        found = -focal[:, None] * ray[:, :2] / ray[:, 2:] - bend
    image = (images.xy - found) / images.sigma
    ground = np.einsum("nij,nj->ni", control.axes, points[control.point] - control.xyz) / control.sigma
    places = _place_misfits(problem.positions, centers, rotations, common[_calibrated(names) :])
    turn = Rotation.from_matrix(np.swapaxes(attitudes.rotations, 1, 2) @ rotations[attitudes.photo]).as_rotvec()
    return np.concatenate(
        [image.ravel(), -ground.ravel(), -places.ravel(), -(turn / attitudes.sigma).ravel(), -common / prior(problem)]
    )


def prior(problem: BundleProblem) -> Floats:
    """A-priori sigmas of the common parameters."""
    sigma, positions = problem.cameras.sigma, problem.positions
    own = np.zeros(0) if sigma is None else sigma[sigma > 0.0]
    drifts = [s[s > 0.0] for s in (positions.offset_sigma, positions.drift_sigma)]
    return np.concatenate([own, *drifts])


def _calibrated(names: Sequence[str]) -> int:
    return sum(name.startswith("camera") for name in names)


def _bent(problem: BundleProblem, xy: Floats, common: Floats, camera: NDArray[np.intp]) -> tuple[Floats, Floats]:
    """Principal distances of the rays and corrections of image points; distortion is about the principal point."""
    center = np.zeros((len(camera), 2))
    for name, value in zip(problem.common_names(), common, strict=True):
        title, _, kind = name.partition(": ")
        if kind in {"x0", "y0"}:
            center[camera == int(title.rpartition(" ")[2]), "xy".index(kind[0])] = value
    x, y = (xy - center).T
    r2 = x**2 + y**2
    zero = np.zeros_like(x)
    focal = problem.cameras.focal[camera].astype(float)
    bend = np.zeros((len(x), 2))
    kinds = {
        "x0": (zero - 1, zero),
        "y0": (zero, zero - 1),
        "k1": (x * r2, y * r2),
        "k2": (x * r2**2, y * r2**2),
        "k3": (x * r2**3, y * r2**3),
        "p1": (r2 + 2 * x**2, 2 * x * y),
        "p2": (2 * x * y, r2 + 2 * y**2),
        "b1": (x, zero),
        "b2": (y, zero),
    }
    for name, value in zip(problem.common_names(), common, strict=True):
        if name.startswith("camera"):
            title, _, kind = name.partition(": ")
            own = camera == int(title.rpartition(" ")[2])
            if kind == "c":
                focal += value * own
            else:
                bend += value * np.stack(kinds[kind], axis=1) * own[:, None]
    return focal, bend


def _place_misfits(positions: PositionObservations, centers: Floats, rotations: Floats, drifts: Floats) -> Floats:
    if not len(positions):
        return np.zeros((0, 3))
    values = iter(drifts)
    none = [0.0] * 3
    offset = np.array([*([next(values) if s > 0 else 0.0 for s in row] for row in positions.offset_sigma), none])
    drift = np.array([*([next(values) if s > 0 else 0.0 for s in row] for row in positions.drift_sigma), none])
    antenna = centers[positions.photo] + np.einsum("nij,nj->ni", rotations[positions.photo], positions.lever)
    residual = np.einsum("nij,nj->ni", positions.axes, antenna - positions.xyz)
    residual -= offset[positions.group] + drift[positions.group] * positions.time[:, None]
    found: Floats = residual / positions.sigma
    return found


def dense(problem: BundleProblem, solution: BundleSolution) -> Dense:
    """Linearise at a solution by differences, and invert; a free network under inner constraints on the points."""
    photos, points, common = problem.photos, problem.points, len(solution.common)

    def at(step: Floats) -> Floats:
        own = step[: 6 * photos].reshape(photos, 6)
        return misfits(
            problem,
            solution.centers + own[:, :3],
            Rotation.from_rotvec(own[:, 3:]).as_matrix() @ solution.rotations,
            solution.points + step[6 * photos : 6 * photos + 3 * points].reshape(points, 3),
            solution.common + step[6 * photos + 3 * points :],
        )

    lengths = np.concatenate(
        [
            np.tile([METRES] * 3 + [RADIANS] * 3, photos),
            np.full(3 * points, METRES),
            [STEPS.get(name.partition(": ")[2], 1e-2) for name in problem.common_names()],
        ]
    )
    size = 6 * photos + 3 * points + common
    columns = [_difference(at, np.eye(1, size, n)[0] * lengths[n], lengths[n]) for n in range(size)]
    derivatives = np.stack(columns, axis=1)
    scale = 1.0 / np.sqrt((derivatives**2).sum(axis=0))
    normal = (derivatives * scale).T @ (derivatives * scale)
    if solution.free:
        conditions = _similarities(solution) * scale[:, None]
        conditions[: 6 * photos] = 0.0
        conditions /= np.sqrt((conditions**2).sum(axis=0))
        bordered = np.block([[normal, conditions], [conditions.T, np.zeros((7, 7))]])
        inverse = np.linalg.inv(bordered)[:-7, :-7]
    else:
        inverse = np.linalg.inv(normal)
    return Dense(at(np.zeros(size)), derivatives, inverse * np.outer(scale, scale))


def _difference(at: object, step: Floats, length: float) -> Floats:
    """Minus the derivative of misfits, of the computed values that is, by four values: exact to the fourth order."""
    assert callable(at)
    near, far = at(step) - at(-step), at(2 * step) - at(-2 * step)
    found: Floats = -(8 * near - far) / (12 * length)
    return found


def _similarities(solution: BundleSolution) -> Floats:
    """Movements of all parameters by shift, rotation and scale, about the mean of the points."""
    origin = solution.points.mean(axis=0)
    places = np.concatenate([solution.centers, solution.points]) - origin
    moves = np.zeros((len(places), 3, 7))
    moves[:, range(3), range(3)] = 1.0
    for axis in range(3):
        moves[:, :, 3 + axis] = np.cross(np.eye(3)[axis], places)
    moves[:, :, 6] = places
    photos = len(solution.centers)
    turned = np.zeros((photos, 3, 7))
    turned[:, range(3), range(3, 6)] = 1.0
    own = np.concatenate([moves[:photos], turned], axis=1).reshape(-1, 7)
    return np.concatenate([own, moves[photos:].reshape(-1, 7), np.zeros((len(solution.common), 7))])
