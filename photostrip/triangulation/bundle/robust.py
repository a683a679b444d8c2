"""Robust adjustment: rays that do not fit lose their weight before anything is tested.

Weights fall exponentially with the standardised residual beyond a multiple of its median (the Danish method), so that
many gross errors at once, also large ones, hardly pull the photos.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.triangulation.bundle.selection import restarted
from photostrip.triangulation.bundle.solve import solve

if TYPE_CHECKING:
    from photostrip.arrays import Floats
    from photostrip.triangulation.bundle.observations.problem import BundleProblem
    from photostrip.triangulation.bundle.solution import BundleSolution


REWEIGHTINGS = 6
TUNING = 3.0  # standardised residuals up to which a ray keeps its weight
NORMAL_MEDIAN = 1.1774  # median of the length of two standard normal residuals
NO_WEIGHT = 1e-3  # weight below which a ray is out
SMALLEST = 1e-5  # weight that every ray keeps, so that its point stays determined


def adjust_robustly(problem: BundleProblem) -> tuple[BundleSolution, Floats]:
    """Adjust with weights that fall with the residual, and give the factor of the weight of each ray, 0 to 1.

    p = exp(1 - e^2) where the standardised residual exceeds three times its scale, e times. Source: [Krarup 1980], with
    the scale of the residuals taken from their median.
    """
    weight = np.ones(len(problem.images))
    sigma = problem.images.sigma
    for _ in range(REWEIGHTINGS):
        spread = sigma / np.sqrt(np.maximum(weight, SMALLEST))[:, None]
        solution = solve(replace(problem, images=replace(problem.images, sigma=spread)))
        problem = restarted(problem, solution)
        size = np.linalg.norm(solution.image_residuals / sigma, axis=1)
        unit = max(float(np.median(size)) / NORMAL_MEDIAN, 1e-12)
        excess = size / unit / TUNING
        weight = np.where(excess > 1.0, np.exp(np.maximum(1.0 - excess**2, -50.0)), 1.0)
    return solution, weight
