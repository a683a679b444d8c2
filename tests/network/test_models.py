"""Networks of independent models against a general optimiser, and against their own dense normal matrix."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from photostrip.network.adjustment import solve
from photostrip.network.problem import BundleCameras, BundleProblem, ControlObservations, ImageObservations, StartValues
from photostrip.network.reliability import cofactors_of, coordinates_of, joint_cofactors
from tests.models import SIGMA, truth

if TYPE_CHECKING:
    from photostrip.arrays import Floats


def network(models: int = 4, *, free: bool = False, correlated: bool = False) -> BundleProblem:
    """A strip of models with errors, its start beside the truth, control in its corners."""
    given, rng = truth(models, 3, 3, relief=80.0), np.random.default_rng(2)
    rows, across = len(given.model), 3
    root = np.tile(np.eye(3), (rows, 1, 1))
    if correlated:
        mixed = np.eye(3) + np.tril(rng.normal(0, 0.5, (rows, 3, 3)), -1)
        root = mixed / np.linalg.norm(mixed, axis=2)[:, :, None]
    xyz = given.exact + np.einsum("nij,nj->ni", root, rng.normal(size=(rows, 3))) * SIGMA
    control = np.r_[:across, len(given.points) - across : len(given.points)][: 0 if free else None]
    turn = given.rotation.swapaxes(1, 2)
    scale = 1 / given.scale
    middle = np.array([xyz[given.model == k].mean(axis=0) for k in range(models)])
    origin = scale[:, None] * np.einsum("nij,nj->ni", turn, middle - given.shift)
    nudged = Rotation.from_rotvec(rng.normal(0, 1e-3, (models, 3))).as_matrix()
    nodes = np.concatenate([given.points, given.centers])
    return BundleProblem(
        images=ImageObservations(
            photo=given.model,
            point=given.node,
            xy=xyz - middle[given.model],
            sigma=np.tile(SIGMA, (rows, 1)),
            correlation=root @ root.swapaxes(1, 2) if correlated else None,
        ),
        cameras=BundleCameras(of_photo=np.zeros(models, np.intp), focal=np.zeros(0)),
        start=StartValues(origin, turn @ nudged, nodes + rng.normal(0, 1.0, nodes.shape), scale * 1.001),
        control=ControlObservations(
            control,
            nodes[control] + rng.normal(0, 0.02, (len(control), 3)),
            np.tile(np.eye(3), (len(control), 1, 1)),
            np.full((len(control), 3), 0.02),
        ),
    )


def residuals(problem: BundleProblem, unknowns: Floats) -> Floats:
    """Misfits in standard deviations, written out; of each model shift, rotation vector and logarithm of the scale."""
    m, images = problem.photos, problem.images
    assert problem.start.scales is not None
    of_models, points = unknowns[: 7 * m].reshape(m, 7), unknowns[7 * m :].reshape(-1, 3)
    found = []
    for row, (model, point) in enumerate(zip(images.photo, images.point, strict=True)):
        shift, vector, log = of_models[model, :3], of_models[model, 3:6], of_models[model, 6]
        turn = problem.start.rotations[model] @ Rotation.from_rotvec(vector).as_matrix()
        scale = problem.start.scales[model] * np.exp(log)
        off = images.xy[row] - turn.T @ (points[point] - problem.start.centers[model] - shift) / scale
        correlation = np.eye(3) if images.correlation is None else images.correlation[row]
        found.append(np.linalg.inv(np.linalg.cholesky(correlation)) @ (off / images.sigma[row]))
    control = problem.control
    found += list((points[control.point] - control.xyz) / control.sigma)
    return np.concatenate(found)


@pytest.mark.parametrize("correlated", [False, True])
def test_the_estimate_and_its_cofactors_are_those_of_a_general_optimiser(*, correlated: bool) -> None:
    problem = network(3, correlated=correlated)
    solution = solve(problem)
    begin = np.concatenate([np.zeros(7 * problem.photos), problem.start.points.ravel()])
    size = np.concatenate([np.tile([1.0] * 3 + [1e-3] * 4, problem.photos), np.ones(problem.start.points.size)])
    found = least_squares(
        lambda x: residuals(problem, x * size), begin / size, xtol=1e-15, ftol=1e-15, gtol=1e-12, jac="3-point"
    )
    assert solution.chi_square == pytest.approx(2 * found.cost, rel=1e-9)
    points = (found.x * size)[7 * problem.photos :].reshape(-1, 3)
    jacobian = np.asarray(found.jac)
    dense = np.linalg.inv(jacobian.T @ jacobian) * np.outer(size, size)
    sigma = np.sqrt(np.diag(dense))[7 * problem.photos :].reshape(-1, 3)
    assert (np.abs(solution.points - points) / sigma).max() < 1e-4
    cofactors = cofactors_of(solution)
    q = len(points)
    expected = dense[7 * problem.photos :, 7 * problem.photos :]
    own = expected.reshape(q, 3, q, 3)[range(q), :, range(q)]
    np.testing.assert_allclose(cofactors.points, own, rtol=1e-4, atol=1e-5 * expected.max())
    joint = joint_cofactors(solution, coordinates_of(solution, np.arange(q)))
    np.testing.assert_allclose(joint, expected, rtol=1e-3, atol=1e-7 * expected.max())
    if not correlated:  # redundancy numbers of correlated observations do not add up
        rays = np.einsum("nii->ni", cofactors.image_residuals) / problem.images.sigma**2
        given = np.einsum("nii->ni", cofactors.control_residuals) / problem.control.sigma**2
        assert rays.sum() + given.sum() == pytest.approx(solution.redundancy, rel=1e-6)


def test_a_free_network_of_models_keeps_its_place() -> None:
    problem = network(free=True)
    solution = solve(problem)
    assert solution.free
    assert solution.redundancy == 3 * len(problem.images) - 7 * problem.photos - 3 * problem.points + 7
    arms = problem.start.points - problem.start.points.mean(axis=0)
    moved = solution.points - problem.start.points
    assert np.abs(moved.mean(axis=0)).max() < 1e-6
    assert np.abs(np.cross(arms, moved).mean(axis=0)).max() < 1e-1  # of 6 km and metres: second order
    cofactors = cofactors_of(solution).points
    three = np.array([0, 8, 12])
    sigma = np.array([[1e-3, 1e-3, 1e-3], [1e-3, 1e-3, 1e-3], [np.inf, np.inf, 1e-3]])
    control = ControlObservations(three, solution.points[three], np.tile(np.eye(3), (3, 1, 1)), sigma)
    others = cofactors_of(solve(replace(problem, control=control))).points
    assert np.trace(cofactors, axis1=1, axis2=2).sum() < np.trace(others, axis1=1, axis2=2).sum()
