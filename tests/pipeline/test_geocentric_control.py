"""Control in geocentric coordinates and the same control on a map are one thing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from photostrip.geodesy.frame_spec import FrameSpec
from photostrip.geodesy.tying import tie_frames
from photostrip.pipeline.inputs import Inputs
from photostrip.pipeline.results import Result
from photostrip.pipeline.run import triangulate
from photostrip.simulation import Control, Flight, Ground, Spec, simulate
from tests.simulated import inputs_of, settings_of

MILLIMETRE = 1e-3  # m
SIGMA = (0.05, 0.05, 0.05)  # alike in all directions: turning the axes changes nothing
LOW_LATITUDE = Ground(crs="EPSG:32633", center_deg=(15.0, 5.0))  # up is nearly along X here, not along Z
SPEC = Spec(seed=7, ground=LOW_LATITUDE, flight=Flight(photos=9), control=Control(bands=3, sigma=SIGMA))


def geocentric(inputs: Inputs) -> Inputs:
    """Give the same inputs with X, Y, Z for east, north and height."""
    (frame,), _ = tie_frames(inputs.frames)
    xyz = frame.cartesian_from_ground(inputs.control.enu)
    spec = FrameSpec("geocentric", ("x", "y", "z"))
    return replace(inputs, control=replace(inputs.control, enu=xyz), frames=(spec,), output=inputs.frames[0])


@pytest.fixture(scope="module")
def both() -> tuple[Result, Result]:
    done = simulate(SPEC)
    inputs, settings = inputs_of(done), replace(settings_of(done), adjustment="polynomial")
    return triangulate(inputs, settings), triangulate(geocentric(inputs), settings)


@pytest.mark.slow
def test_points_and_photos_are_the_same(both: tuple[Result, Result]) -> None:
    on_map, in_space = both
    np.testing.assert_allclose(in_space.points.ground, on_map.points.ground, rtol=0, atol=MILLIMETRE)
    first, second = (r.strips[0] for r in both)
    np.testing.assert_allclose(
        second.intermediate.cartesian_from_intermediate(second.resection.centers),
        first.intermediate.cartesian_from_intermediate(first.resection.centers),
        rtol=0,
        atol=MILLIMETRE,
    )
    assert second.absolute.sigma0 == pytest.approx(first.absolute.sigma0, rel=1e-6)


def test_misclosures_are_east_north_and_up(both: tuple[Result, Result]) -> None:
    first, second = (np.linalg.norm(r.strips[0].absolute.misclosures[:, :2], axis=1) for r in both)
    np.testing.assert_allclose(second, first, rtol=0, atol=MILLIMETRE)
    up = [r.strips[0].absolute.misclosures[:, 2] for r in both]
    np.testing.assert_allclose(up[1], up[0], rtol=0, atol=MILLIMETRE)
