"""Self-calibration: the parameters of the table are those that the formulas correct by."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from photostrip.camera import Camera
from photostrip.network.adjustment import solve
from photostrip.network.observations import corrections
from photostrip.network.problem import ASKED, CALIBRATION
from photostrip.network.reliability import cofactors_of
from photostrip.simulation import Flight, Spec, simulate
from tests.simulated_bundle import problem_of


def test_corrections_grow_with_the_distance_by_the_powers_of_the_table() -> None:
    xy = np.array([30.0, -50.0])
    powers = [each.power for each in CALIBRATION.values()]
    assert corrections(2 * xy) == pytest.approx(2.0 ** np.array(powers)[:, None] * corrections(xy))


def test_units_make_millimetres_of_what_a_user_asks_for() -> None:
    assert ASKED == ("principal_distance", "principal_point", "k1", "k2", "k3", "p1", "p2", "affinity", "shear")
    units = {name: (each.title, each.unit) for name, each in CALIBRATION.items()}
    assert [units[name] for name in ("c", "y0", "k2", "p1", "b2")] == [
        ("principal_distance", "mm"), ("principal_point y", "mm"), ("k2", "mm^-4"), ("p1", "mm^-1"), ("shear", "1"),
    ]  # fmt: skip


@pytest.mark.parametrize("kind", ["k1", "b1"])
def test_measuring_errors_make_no_distortion(kind: str) -> None:
    """Of the same errors with both signs: what the mean keeps is what their squares have made."""
    wide = Camera("wide", principal_distance=8.8, format=(13.2, 8.8))
    flight = Flight(photos=10, strips=3, end_lap_percent=80.0, side_lap_percent=70.0, flying_height=90.0)
    simulation = simulate(Spec(camera=wide, flight=flight))
    problem, truth = problem_of(simulation, shift=0.01, turn=1e-5), simulation.truth
    free = np.where(np.array(list(CALIBRATION)) == kind, np.inf, 0.0)
    exact = (truth.points.xyz - truth.points.xyz.mean(axis=0))[problem.control.point]
    problem = replace(problem, cameras=replace(problem.cameras, sigma=free[None]))
    problem = replace(problem, control=replace(problem.control, xyz=exact))
    rays = np.bincount(simulation.observations.point)[simulation.observations.point] > 1
    errors = problem.images.sigma * np.random.default_rng(1).normal(size=problem.images.xy.shape)
    both = [
        solve(replace(problem, images=replace(problem.images, xy=truth.image[rays] + sign * errors)))
        for sign in (1.0, -1.0)
    ]
    sigma = np.sqrt(cofactors_of(both[0]).common[0, 0])
    assert np.mean([each.common[0] for each in both]) == pytest.approx(0.0, abs=0.05 * sigma)
