"""Robust adjustment: rays that do not fit lose their weight before anything is tested.

The weights are those of ``strip.robust``: many gross errors at once, also large ones, hardly pull the photos.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from photostrip.arrays import Floats
from photostrip.network.problem import BundleProblem
from photostrip.network.selection import restarted
from photostrip.network.solution import BundleSolution
from photostrip.network.solve import solve
from photostrip.strip.robust import falling_weights

REWEIGHTINGS = 6
NO_WEIGHT = 1e-3  # weight below which a ray is out


def adjust_robustly(problem: BundleProblem) -> tuple[BundleSolution, Floats]:
    """Adjust with weights that fall with the residual, and give the factor of the weight of each ray, 0 to 1.

    The scale of the residuals is taken from their median.
    """
    weight = np.ones(len(problem.images))
    sigma = problem.images.sigma
    normal = float(np.sqrt(chdtri(sigma.shape[1], 0.5)))  # median of the length of standard normal residuals
    for _ in range(REWEIGHTINGS):
        spread = sigma / np.sqrt(weight)[:, None]
        solution = solve(replace(problem, images=replace(problem.images, sigma=spread)))
        problem = restarted(problem, solution)
        size = np.linalg.norm(solution.image_residuals / sigma, axis=1)
        unit = max(np.median(size) / normal, 1e-12)
        weight = falling_weights(size / unit)
    return solution, weight
