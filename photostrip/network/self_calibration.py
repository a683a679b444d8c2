"""Self-calibration: what its parameters do to image coordinates, and which of them mean anything."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.network.adjustment import BundleSolution, Cofactors
from photostrip.network.observations import PRINCIPAL_DISTANCE, corrected, values_of
from photostrip.network.problem import BundleProblem
from photostrip.network.settings import CALIBRATION
from photostrip.statistics import t_p_value

SIGNIFICANCE = 0.05
KEPT = 0.3  # of a loose a-priori standard deviation that a parameter keeps which is not determined
INSEPARABLE = 0.9999  # correlations of what cannot be told apart


@dataclass(frozen=True)
class Parameter:
    # camera, name, unit: which it is
    camera: str
    name: str
    unit: str
    # value, sigma: correction of the given calibration, and its standard deviation with the sigma0 found
    value: float
    sigma: float
    p: float  # probability of a value so large or larger when the true one is zero
    prior: float  # a-priori standard deviation; infinite for a free parameter
    redundancy: float  # share of the a-priori value that the measurements control; NaN for a free parameter

    @property
    def significant(self) -> bool:
        return self.p < SIGNIFICANCE


def sigmas(asked: Sequence[Sequence[str]], prior: dict[str, float]) -> Floats | None:
    """A-priori standard deviations (cameras, 10) as a problem takes them; None when nothing is asked for.

    ``prior`` holds those by name; a parameter without one is free (infinite). 0: not a parameter.
    """
    found = np.zeros((len(asked), len(CALIBRATION)))
    for row, names in enumerate(asked):
        for column, each in enumerate(CALIBRATION.values()):
            if each.asked in names:
                found[row, column] = prior.get(each.asked, np.inf)
    return found if found.any() else None


def millimetre(xy: Floats) -> Floats:
    """Values of the parameters that move a point at the edge of the measured part of a photo by 1 mm, shape (10,)."""
    edge = max(float(np.hypot(xy[:, 0], xy[:, 1]).max(initial=1.0)), 1e-3)
    return np.array([edge**-each.power for each in CALIBRATION.values()])


def image_shift(problem: BundleProblem, common: Floats, xy: Floats, photo: Numbers) -> Floats:
    """Correction (n, 2) that makes ideal image coordinates of the given principal distance, to be added to them, mm.

    A change of the principal distance is turned into a change of scale of the photo.
    """
    values = values_of(problem.cameras, common)
    if not values.any():
        return np.zeros_like(xy)
    camera = problem.cameras.of_photo[photo]
    focal = problem.cameras.focal[camera]
    shifted = corrected(problem.cameras, values, xy, camera)
    return np.asarray(shifted * (focal / (focal + values[camera, PRINCIPAL_DISTANCE]))[:, None] - xy, float)


def parameters_of(problem: BundleProblem, solution: BundleSolution, precision: Cofactors) -> tuple[Parameter, ...]:
    """Test whether each parameter is there at all: t = value / standard deviation, with the redundancy of the bundle.

    ``redundancy`` of a parameter with a prior: the part of it that the rays decide.
    """
    sigma = problem.cameras.sigma
    if sigma is None:
        return ()
    unit = solution.sigma0 if solution.redundancy > 0 else 1.0
    found, kinds = [], list(CALIBRATION.values())
    for number, (camera, column) in enumerate(np.argwhere(sigma > 0.0).tolist()):
        value, cofactor = float(solution.common[number]), float(precision.common[number, number])
        deviation = float(np.sqrt(cofactor)) * unit
        p = t_p_value(value / deviation, solution.redundancy) if deviation > 0 and solution.redundancy > 0 else 1.0
        prior = float(sigma[camera, column])
        share = float(precision.common_residuals[number]) / prior**2 if np.isfinite(prior) else float("nan")
        found.append(
            Parameter(
                camera=problem.camera_ids[camera] if problem.camera_ids else str(camera),
                name=kinds[column].title,
                unit=kinds[column].unit,
                value=value,
                sigma=deviation,
                p=p,
                prior=prior,
                redundancy=share,
            )
        )
    return tuple(found)
