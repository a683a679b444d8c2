"""Bundle adjustments of photos with known truth: exact recovery, poor starts, what cannot be determined."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from photostrip.errors import GeometryError
from photostrip.geometry.rotation import from_vector
from photostrip.network import problem as bundle
from photostrip.network.adjustment import solve
from photostrip.network.problem import BundleProblem, ControlObservations, ImageObservations, StartValues
from photostrip.simulation import Control as SimulatedControl
from photostrip.simulation import Flight, Points, Spec, simulate
from tests.simulated_bundle import problem_of, truth_of

MICROMETRE = 1e-6  # metres on the ground


@cache
def simulated(photos: int = 8) -> tuple[BundleProblem, StartValues]:
    """Simulate a strip on the real Earth."""
    points, control = Points(rows=3, extra_per_model=4), SimulatedControl(bands=3)
    simulation = simulate(Spec(flight=Flight(photos=photos), points=points, control=control))
    return problem_of(simulation), truth_of(simulation)


@pytest.mark.parametrize("shift", [10.0, 50.0, 200.0])
def test_poor_starts_end_at_the_same_place(shift: float) -> None:
    problem, truth = simulated()
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


def _some(problem: BundleProblem, number: int, sigma: list[float] | None = None) -> ControlObservations:
    """Control at the first few control points, or at all with another sigma."""
    control = problem.control
    given = control.sigma[:number] if sigma is None else np.tile(sigma, (number, 1))
    return ControlObservations(control.point[:number], control.xyz[:number], control.axes[:number], given)


def _on_a_line(problem: BundleProblem) -> ControlObservations:
    """Control in the middle of the strip, along the flight."""
    truth = simulated()[1]
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
    problem, _ = simulated()
    assert callable(control)
    with pytest.raises(GeometryError, match=said) as caught:
        solve(replace(problem, control=control(problem)))
    assert caught.value.code == "bundle-rank"


def test_a_photo_with_too_few_points_is_named() -> None:
    problem, _ = simulated()
    images, keep = problem.images, np.ones(len(problem.images), bool)
    keep[np.flatnonzero(images.photo == 7)[2:]] = False
    keep &= np.bincount(images.point[keep], minlength=problem.points)[images.point] > 1
    images = ImageObservations(images.photo[keep], images.point[keep], images.xy[keep], images.sigma[keep])
    with pytest.raises(GeometryError) as caught:
        solve(replace(problem, images=images))
    assert caught.value.photos == (problem.photo_name(7),)
    assert caught.value.code == "bundle-rank"


@pytest.mark.parametrize(
    ("breadth", "off", "beside", "words"),
    [
        (0.0, 0.0, 0.0, r"did not converge in 1 step$"),
        (0.0, 0.0, 500.0, r"camera positions and control contradict each other by 500 m or more"),
        (0.02, 0.0, 0.0, r"hardly determines roll about the flight line of the whole: .* a given coordinate"),
        (0.0, 5.0, 0.0, r"control point .* m off, .* deviation; are its coordinates or its id wrong"),
    ],
)
def test_steps_without_end_say_what_is_wrong_with_the_control(
    breadth: float, off: float, beside: float, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem, truth = simulated(6)
    if beside:
        given, axes, zeros = truth.centers + np.array([0, 0, beside]), np.tile(np.eye(3), (6, 1, 1)), np.zeros((6, 3))
        observed = (np.arange(6), given, axes, zeros + 0.1, zeros, np.full(6, -1), np.zeros(6))
        problem = replace(problem, positions=bundle.PositionObservations(*observed))
    xyz = problem.control.xyz.copy()
    middle = xyz - xyz.mean(axis=0)
    axis = np.linalg.svd(middle)[2][0]
    xyz -= (1.0 - (breadth or 1.0)) * (middle - np.outer(middle @ axis, axis))
    xyz[0, 0] += off
    monkeypatch.setattr("photostrip.network.adjustment.MOST_STEPS", 1)
    with pytest.raises(GeometryError, match=words) as caught:
        solve(replace(problem, control=replace(problem.control, xyz=xyz)))
    assert caught.value.code == "bundle-diverged"
