"""Heights that refraction needs: from the strips without it, in the frames of the run."""

from __future__ import annotations

import pytest

from photostrip.pipeline.frames import orient_interior, tie_ground_frames
from photostrip.pipeline.inputs import Settings
from photostrip.pipeline.run import heights_of, triangulate
from photostrip.simulation import simulate
from tests.results import spec
from tests.simulated import inputs_of


def test_heights_are_those_of_the_whole_run() -> None:
    inputs, settings = inputs_of(simulate(spec())), Settings()
    ground, result = tie_ground_frames(inputs, settings, None), triangulate(inputs, settings)
    found = heights_of(orient_interior(inputs, settings).observations, inputs, settings, ground)
    (strip,) = result.strips
    centers = strip.intermediate.cartesian_from_intermediate(strip.placed.centers)
    flying, terrain = (ground.output.geodetic(xyz)[:, 2].mean() for xyz in (centers, result.points.cartesian))
    assert found.flying == pytest.approx(flying, abs=1e-6)
    assert found.ground == pytest.approx(terrain, abs=1e-6)
