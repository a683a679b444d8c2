"""Bundle adjustments of photos with known truth: exact recovery, poor starts, what cannot be determined."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.errors import GeometryError
from photostrip.geometry.rotation import from_vector
from photostrip.network.problem import (
    BundleProblem,
    ControlObservations,
    ImageObservations,
    PositionObservations,
    StartValues,
)
from photostrip.network.solve import solve
from photostrip.simulation import Control as SimulatedControl
from photostrip.simulation import Flight, Image, Points, Spec, simulate
from tests.simulated_bundle import problem_of, truth_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

MICROMETRE = 1e-6  # metres on the ground


@cache
def simulated(
    photos: int, strips: int, sigma_um: float = 5.0, noise: float | None = None
) -> tuple[BundleProblem, StartValues]:
    """Simulate a strip or block on the real Earth."""
    simulation = simulate(
        Spec(
            flight=Flight(photos=photos, strips=strips),
            points=Points(rows=3, extra_per_model=4),
            control=SimulatedControl(bands=min(3, photos - 1), noise=None if noise is None else (noise, noise, noise)),
            image=Image(sigma_um=sigma_um),
        )
    )
    return problem_of(simulation), truth_of(simulation)


def seen_points(problem: BundleProblem) -> NDArray[np.bool_]:
    """Points with rays."""
    return np.bincount(problem.images.point, minlength=problem.points) > 0


@pytest.mark.parametrize("shift", [10.0, 50.0, 200.0])
def test_poor_starts_end_at_the_same_place(shift: float) -> None:
    problem, truth = simulated(8, 1)
    random = np.random.default_rng(2)
    start = StartValues(
        truth.centers + random.normal(0.0, shift, truth.centers.shape),
        from_vector(random.normal(0.0, shift / 1500.0, (problem.photos, 3))) @ truth.rotations,
        truth.points + random.normal(0.0, shift, truth.points.shape),
    )
    found, expected = solve(replace(problem, start=start)), solve(problem)
    np.testing.assert_allclose(found.points, expected.points, atol=10 * MICROMETRE)
    falls = [step.chi_square for step in found.steps if step.damping == 0.0]
    assert falls[-1] <= falls[0]


def test_positions_with_lever_arm_offset_and_drift_replace_control() -> None:
    problem, truth = simulated(10, 2, 0.0, 0.0)
    m = problem.photos
    time = np.tile(np.arange(-4.5, 5.0), 2)
    lever = np.tile([0.3, -0.2, 1.5], (m, 1))
    axes = np.tile(problem.control.axes[0], (m, 1, 1))
    group = np.repeat([0, 1], 10)
    offset, drift = np.array([[2.0, -1.0, 0.5], [0.0, 3.0, -2.0]]), np.array([[0.1, 0.0, -0.2], [0.0, 0.0, 0.0]])
    antenna = truth.centers + np.einsum("nij,nj->ni", truth.rotations, lever)
    wrong = -np.einsum("nij,ni->nj", axes, offset[group] + drift[group] * time[:, None])
    positions = PositionObservations(
        photo=np.arange(m),
        xyz=antenna + wrong,
        axes=axes,
        sigma=np.full((m, 3), 0.05),
        lever=lever,
        group=group,
        time=time,
        offset_sigma=np.full((2, 3), np.inf),
        drift_sigma=np.array([[np.inf] * 3, [0.0] * 3]),
    )
    solution = solve(replace(problem, positions=positions, control=_some(problem, 4)))
    np.testing.assert_allclose(solution.common, np.concatenate([offset.ravel(), drift[0]]), atol=1e-5)
    assert np.abs(solution.points - truth.points)[seen_points(problem)].max() < 10 * MICROMETRE
    names = replace(problem, positions=positions, group_ids=("A", "B")).common_names()
    assert names[:2] == ("positions A: offset east", "positions A: offset north")
    assert names[-1] == "positions A: drift up"


def test_the_camera_comes_out_of_the_measurements() -> None:
    problem, truth = simulated(10, 3, 0.0, 0.0)
    x, y = problem.images.xy.T
    r2 = x**2 + y**2
    k1, x0 = 2e-8, 0.03
    given_xy = np.column_stack([x - k1 * x * r2 + x0, y - k1 * y * r2])
    sigma = np.zeros((1, 10))
    sigma[0, [1, 2, 3]] = np.inf
    wrong = replace(
        problem,
        images=replace(problem.images, xy=given_xy),
        cameras=replace(problem.cameras, sigma=sigma),
        camera_ids=("RC30",),
    )
    solution = solve(wrong)
    assert wrong.common_names() == ("camera RC30: x0", "camera RC30: y0", "camera RC30: k1")
    assert solution.common[0] == pytest.approx(x0, abs=2e-4)
    assert solution.common[2] == pytest.approx(k1, rel=2e-3)
    assert np.abs(solution.points - truth.points)[seen_points(problem)].max() < 0.01
    assert np.abs(solve(replace(wrong, cameras=problem.cameras)).points - truth.points).max() > 0.05


# ------------------------------------------------------------------------------------------ what is not determined


def _some(problem: BundleProblem, number: int, sigma: list[float] | None = None) -> ControlObservations:
    """Control at the first few control points, or at all with another sigma."""
    control = problem.control
    rows = np.arange(number)
    wanted = control.sigma[rows] if sigma is None else np.tile(sigma, (number, 1))
    return ControlObservations(control.point[rows], control.xyz[rows], control.axes[rows], wanted)


def _on_a_line(problem: BundleProblem) -> ControlObservations:
    """Control in the middle of the strip, along the flight."""
    truth = simulated(8, 1)[1]
    flight = truth.centers[-1] - truth.centers[0]
    flight /= np.linalg.norm(flight)
    control = _some(problem, 3)
    place = control.xyz[0] + np.array([0.0, 2000.0, 5000.0])[:, None] * flight
    return replace(control, xyz=place)


@pytest.mark.parametrize(
    ("control", "said"),
    [
        (_on_a_line, "does not determine roll about the flight line: all of it lies on one line"),
        (lambda p: _some(p, 1), "roll about the flight line, pitch, heading, scale: one given position only"),
        (lambda p: _some(p, 9, [np.inf, np.inf, 0.1]), "shift along the flight, shift across the flight, heading"),
        (lambda p: _some(p, 9, [0.1, 0.1, np.inf]), "height"),
    ],
)
def test_a_datum_that_is_not_determined_is_named(control: object, said: str) -> None:
    problem, _ = simulated(8, 1)
    assert callable(control)
    with pytest.raises(GeometryError, match=said) as caught:
        solve(replace(problem, control=control(problem)))
    assert caught.value.code == "bundle-rank"


def _without(problem: BundleProblem, rays: NDArray[np.bool_]) -> BundleProblem:
    images = problem.images
    several = np.bincount(images.point[~rays], minlength=problem.points)[images.point] > 1
    keep = ~rays & several
    return replace(
        problem, images=ImageObservations(images.photo[keep], images.point[keep], images.xy[keep], images.sigma[keep])
    )


def test_a_photo_with_too_few_points_is_named() -> None:
    problem, _ = simulated(8, 1)
    rays = np.flatnonzero(problem.images.photo == 7)
    drop = np.zeros(len(problem.images), bool)
    drop[rays[2:]] = True
    with pytest.raises(GeometryError) as caught:
        solve(_without(problem, drop))
    assert caught.value.photos == (problem.photo_name(7),)
    assert caught.value.code == "bundle-rank"


def test_points_that_rays_do_not_determine_are_named() -> None:
    problem, _ = simulated(6, 1)
    two = np.flatnonzero(np.bincount(problem.images.point, minlength=problem.points) == 2)
    two = two[~np.isin(two, problem.control.point)][:2]
    keep = np.ones(len(problem.images), bool)
    keep[[np.flatnonzero(problem.images.point == point)[0] for point in two]] = False
    images = problem.images
    lame = ImageObservations(images.photo[keep], images.point[keep], images.xy[keep], images.sigma[keep])
    with pytest.raises(GeometryError) as caught:
        solve(replace(problem, images=lame))
    assert set(caught.value.points) == {problem.point_name(int(point)) for point in two}
    assert caught.value.code == "bundle-rays"


def test_a_point_with_one_ray_and_a_given_height_is_adjusted() -> None:
    problem, truth = simulated(6, 1, 0.0, 0.0)
    two = np.flatnonzero(np.bincount(problem.images.point, minlength=problem.points) == 2)
    point = two[~np.isin(two, problem.control.point)][0]
    keep = np.ones(len(problem.images), bool)
    keep[np.flatnonzero(problem.images.point == point)[0]] = False
    images, control = problem.images, problem.control
    lame = replace(
        problem,
        images=ImageObservations(images.photo[keep], images.point[keep], images.xy[keep], images.sigma[keep]),
        control=ControlObservations(
            np.append(control.point, point),
            np.concatenate([control.xyz, truth.points[[point]]]),
            np.concatenate([control.axes, control.axes[:1]]),
            np.concatenate([control.sigma, [[np.inf, np.inf, 0.05]]]),
        ),
    )
    assert np.abs(solve(lame).points[point] - truth.points[point]).max() < 10 * MICROMETRE


@pytest.mark.parametrize(
    ("breadth", "off", "words"),
    [
        (0.0, 0.0, "step$"),
        (
            0.02,
            0.0,
            r"hardly determines roll about the flight line: the points move by .* m .*, and a given coordinate has",
        ),
        (
            0.0,
            5.0,
            r"control point .* is .* m off, .* times its standard deviation; are its coordinates or its id wrong",
        ),
    ],
)
def test_steps_without_end_say_what_is_wrong_with_the_control(
    breadth: float, off: float, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem, _ = simulated(6, 1)
    xyz = problem.control.xyz.copy()
    if breadth:
        middle = xyz - xyz.mean(axis=0)
        axis = np.linalg.svd(middle)[2][0]
        along = np.outer(middle @ axis, axis)
        xyz = xyz.mean(axis=0) + along + breadth * (middle - along)
    xyz[0, 0] += off
    monkeypatch.setattr("photostrip.network.solve.MOST_STEPS", 1)
    with pytest.raises(GeometryError, match=words) as caught:
        solve(replace(problem, control=replace(problem.control, xyz=xyz)))
    assert caught.value.code == "bundle-diverged"


def test_steps_without_end_are_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, _ = simulated(6, 1)
    monkeypatch.setattr("photostrip.network.solve.MOST_STEPS", 1)
    with pytest.raises(GeometryError, match=r"did not converge in 1 step$") as caught:
        solve(problem)
    assert caught.value.code == "bundle-diverged"
