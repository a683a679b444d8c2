"""Control and check points: where, how many, given how, and with what errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from photostrip.points import locate
from photostrip.simulation import Control, Flight, Ground, Points, Simulation, Spec, simulate
from photostrip.simulation.placement import band_photos
from tests.loops import nonempty


def true_ground(done: Simulation, ids: tuple[str, ...]) -> np.ndarray:
    """True coordinates of points in the output frame."""
    return done.truth.ground.xyz[locate(ids, done.truth.ground.ids)]


def stations(done: Simulation) -> list[list[int]]:
    """Photos on which each control point lies."""
    o = done.observations
    number = {name: k for k, name in enumerate(o.point_ids)}
    control = [name for name, check in zip(done.control.ids, done.control.check, strict=True) if not check]
    return [sorted(o.photo[o.point == number[name]].tolist()) for name in control]


@pytest.mark.parametrize(
    ("photos", "bands", "every", "expected"),
    [
        (21, 3, None, [0, 10, 20]),
        (21, 4, None, [0, 7, 13, 20]),
        (10, 1, None, [4]),
        (10, 2, None, [0, 9]),
        (21, 3, 5, [0, 5, 10, 15, 20]),
        (20, 3, 5, [0, 5, 10, 15, 19]),
        (3, 3, None, [0, 1, 2]),
    ],
)
def test_bands(photos: int, bands: int, every: int | None, expected: list[int]) -> None:
    spec = Spec(flight=Flight(photos=photos), control=Control(bands=bands, every=every))
    assert band_photos(spec) == expected
    done = simulate(spec)
    seen = stations(done)
    assert len(seen) == 3 * len(expected)
    assert all(station in seen[3 * k + i] for k, station in nonempty(enumerate(expected)) for i in range(3))


@pytest.mark.parametrize("crs", ["EPSG:32633", "EPSG:4979", "geocentric", "local"])
def test_noise_is_normal_and_as_large_as_stated(crs: str) -> None:
    sigma = np.array([0.03, 0.06, 0.12])
    spec = Spec(
        flight=Flight(photos=150),
        ground=Ground(crs=crs, center_deg=(15.0, 0.0)),
        points=Points(extra_per_model=9),
        control=Control(layout="random", count=1500, check=0, sigma=(0.03, 0.06, 0.12)),
    )
    done = simulate(spec)
    error = done.control.enu - true_ground(done, done.control.ids)
    if crs == "EPSG:4979":
        error *= np.radians(6_378_000.0), np.radians(6_335_000.0), 1.0  # metres per degree at the equator
    for column, s in nonempty(zip(error.T, sigma, strict=True)):
        assert column.std() == pytest.approx(s, rel=4 / np.sqrt(2 * 1500))
        assert stats.kstest(column / s, "norm").pvalue > 0.01
    assert done.control.sigma == pytest.approx(np.tile(sigma, (1500, 1)))
    double = simulate(replace(spec, control=replace(spec.control, noise=(0.06, 0.12, 0.24))))
    assert double.control.sigma == pytest.approx(done.control.sigma)
    assert double.control.enu - done.control.enu == pytest.approx(
        done.control.enu - true_ground(done, done.control.ids), abs=1e-6
    )
