"""Single photos and further points, with their precision, against a dense solution and against the whole block."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from photostrip.errors import GeometryError
from photostrip.simulate import Flight, Points, Spec, simulate
from photostrip.simulate.bundle import problem_of, truth_of
from photostrip.triangulation.bundle.correlations import correlations
from photostrip.triangulation.bundle.precision import precision
from photostrip.triangulation.bundle.problem import Cameras, Control, Images, Problem, Start
from photostrip.triangulation.bundle.single import intersect, resect
from photostrip.triangulation.bundle.solve import solve


def block() -> tuple[Problem, Start]:
    simulation = simulate(Spec(flight=Flight(photos=6, strips=2), points=Points(rows=3, extra_per_model=3)))
    return problem_of(simulation), truth_of(simulation)


def _rows(images: Images, keep: np.ndarray) -> Images:
    return Images(images.photo[keep], images.point[keep], images.xy[keep], images.sigma[keep])


def test_resection_is_the_bundle_with_points_held() -> None:
    problem, truth = block()
    known = replace(problem, start=replace(problem.start, points=truth.points), control=Control())
    found = resect(known)
    q = problem.points
    held = Control(np.arange(q), truth.points, np.tile(np.eye(3), (q, 1, 1)), np.full((q, 3), 1e-5))
    solution = solve(replace(known, control=held))
    np.testing.assert_allclose(found.centers, solution.centers, atol=1e-5)
    np.testing.assert_allclose(found.residuals, solution.image_residuals, atol=1e-7)
    expected = precision(solution).photos
    deviation = np.sqrt(np.einsum("nii->ni", expected))
    ratio = (found.cofactors - expected) / (deviation[:, :, None] * deviation[:, None, :])
    assert np.abs(ratio).max() < 1e-4
    rays = len(problem.images)
    whole = np.sqrt(
        (found.sigma0**2 * (2 * np.bincount(problem.images.photo) - 6)).sum() / (2 * rays - 6 * problem.photos)
    )
    assert whole == pytest.approx(1.0, abs=4.0 / np.sqrt(4.0 * rays))


def test_a_photo_without_enough_points_is_not_resected() -> None:
    problem, truth = block()
    images = problem.images
    few = (images.photo != 3) | (np.cumsum(images.photo == 3) <= 2)
    lame = replace(problem, images=_rows(images, few), start=replace(problem.start, points=truth.points))
    with pytest.raises(GeometryError, match="fewer than three points") as caught:
        resect(lame)
    assert caught.value.photos == (problem.photo_name(3),)


def test_points_left_out_of_a_block_come_back_by_intersection() -> None:
    problem, _ = block()
    rays = np.bincount(problem.images.point, minlength=problem.points)
    free = np.setdiff1d(np.flatnonzero(rays > 1), problem.control.point)[::7]
    left = np.isin(problem.images.point, free)
    # Weights of a millionth make the points new without changing anything else.
    weak = replace(
        problem, images=replace(problem.images, sigma=np.where(left[:, None], 1e6, 1.0) * problem.images.sigma)
    )
    solution = solve(weak)
    found = intersect(replace(problem, images=_rows(problem.images, left)), solution)
    assert np.isnan(found.points[np.setdiff1d(np.arange(problem.points), free)]).all()
    alone = intersect(
        replace(
            problem,
            images=_rows(problem.images, left),
            start=Start(solution.centers, solution.rotations, problem.start.points),
        )
    )
    np.testing.assert_allclose(found.points[free], alone.points[free], atol=1e-9)
    np.testing.assert_allclose(found.points[free], solution.points[free], atol=1e-6)
    # What the photos add: the weak adjustment's cofactors are those of the rays alone, a million squared, and theirs.
    added = found.cofactors[free] - alone.cofactors[free]
    assert (np.linalg.eigvalsh(added) > 0.0).all()
    gained = np.einsum("nii->n", found.cofactors[free]) / np.einsum("nii->n", precision(solve(problem)).points[free])
    assert (gained > 1.0).all()
    assert np.median(gained) < 1.5


def test_cofactors_of_intersected_points_are_those_of_points_that_carry_no_weight() -> None:
    problem, _ = block()
    rays = np.bincount(problem.images.point, minlength=problem.points)
    free = np.setdiff1d(np.flatnonzero(rays > 1), problem.control.point)[::7]
    left = np.isin(problem.images.point, free)
    solution = solve(replace(problem, images=_rows(problem.images, ~left)))
    found = intersect(replace(problem, images=_rows(problem.images, left)), solution)
    # The same by spreading errors: photos drawn from their joint cofactors, rays from theirs.
    scale = 1e3
    weak = replace(
        problem, images=replace(problem.images, sigma=np.where(left[:, None], scale, 1.0) * problem.images.sigma)
    )
    alone = intersect(
        replace(
            problem,
            images=_rows(problem.images, left),
            start=Start(solution.centers, solution.rotations, problem.start.points),
        )
    )
    whole = precision(solve(weak)).points[free]
    expected = whole - (scale**2 - 1.0) * alone.cofactors[free]
    deviation = np.sqrt(np.einsum("nii->ni", expected))
    ratio = (found.cofactors[free] - expected) / (deviation[:, :, None] * deviation[:, None, :])
    assert np.abs(ratio).max() < 1e-2


def test_photos_farther_apart_than_the_band_still_count() -> None:
    problem, truth = block()
    solution = solve(problem)
    m = problem.photos
    photo = np.array([0, m - 1])
    point = truth.points[problem.control.point[:1]]
    ray = np.einsum("nij,ni->nj", solution.rotations[photo], point - solution.centers[photo])
    xy = -problem.cameras.focal[0] * ray[:, :2] / ray[:, 2:]
    far = Problem(
        Images(photo, np.zeros(2, np.intp), xy, np.full((2, 2), 0.005)),
        Cameras(problem.cameras.of_photo, problem.cameras.focal),
        Start(solution.centers, solution.rotations, point + 5.0),
    )
    found = intersect(far, solution)
    np.testing.assert_allclose(found.points, point, atol=1e-6)
    alone = intersect(far)
    assert (np.linalg.eigvalsh(found.cofactors - alone.cofactors) > 0.0).all()


def test_parallel_rays_are_not_intersected() -> None:
    centers = np.array([[0.0, 0.0, 0.0], [100.0, 0.0, 0.0]])
    far = Problem(
        Images(np.arange(2), np.zeros(2, np.intp), np.zeros((2, 2)), np.full((2, 2), 0.005)),
        Cameras(np.zeros(2, np.intp), np.array([150.0])),
        Start(centers, np.tile(np.eye(3), (2, 1, 1)), np.array([[50.0, 0.0, -1e9]])),
    )
    with pytest.raises(GeometryError, match="do not determine point number 0"):
        intersect(far)


def test_correlations_are_named() -> None:
    problem, _ = block()
    sigma = np.zeros((1, 10))
    sigma[0, [0, 1, 2]] = 0.05
    solution = solve(replace(problem, cameras=replace(problem.cameras, sigma=sigma), camera_ids=("RC30",)))
    found = correlations(solution, precision(solution), 0.8)
    values = [abs(each.value) for each in found]
    assert all(0.8 < value <= 1.0 for value in values)
    # Over flat ground a longer principal distance is a higher flight, a moved principal point a moved photo.
    pairs = {(each.first.partition(": ")[2], each.second) for each in found}
    assert pairs >= {("shift along z", "camera RC30: c"), ("shift along x", "camera RC30: x0")}
    alone = correlations(solve(problem), precision(solve(problem)), 0.6)
    within = {(each.second.partition(": ")[2], each.first.partition(": ")[2]) for each in alone}
    assert within >= {("shift along x", "rotation about y"), ("shift along y", "rotation about x")}
