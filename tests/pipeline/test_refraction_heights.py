"""Heights that refraction needs: from the strips without it, in the frames of the run."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.pipeline.frames import tie_ground_frames
from photostrip.pipeline.image_coordinates import heights_of, orient_interior
from photostrip.pipeline.inputs import Inputs, Settings
from photostrip.pipeline.run import triangulate
from photostrip.simulation import simulate
from photostrip.strip.image_coordinates.corrections import ImageCorrectionSettings
from tests.geodesy.frames import write_gtx
from tests.results import spec
from tests.simulated import inputs_of

if TYPE_CHECKING:
    from pathlib import Path

UNDULATION = 45.0  # m
GRID = "own_geoid.gtx"
REFRACTED = ImageCorrectionSettings(refraction=True)


def levelled(directory: Path) -> Inputs:
    """Control with heights above a geoid whose grid stands beside the project; the strip lies in zone 33."""
    write_gtx(directory / GRID, np.full((41, 41), UNDULATION), south=30.0, west=0.0, step=1.0)
    inputs = inputs_of(simulate(spec()))
    up = np.array([0.0, 0.0, UNDULATION])
    crs = f"+proj=utm +zone=33 +datum=WGS84 +geoidgrids={GRID}"
    frames = tuple(replace(frame, crs=crs, height="orthometric") for frame in inputs.frames)
    return replace(
        inputs,
        control=replace(inputs.control, enu=inputs.control.enu - up),
        frames=frames,
        output=inputs.output or inputs.frames[0],
    )


@pytest.mark.slow
@pytest.mark.parametrize("adjustment", ["polynomial", "bundle"])
def test_a_geoid_grid_beside_the_project_is_found_with_refraction(adjustment: str, tmp_path: Path) -> None:
    inputs, settings = levelled(tmp_path), Settings(adjustment=adjustment, refinement=REFRACTED)
    levelled_points = triangulate(inputs, settings, directory=tmp_path).points
    ellipsoidal = triangulate(inputs_of(simulate(spec())), settings)
    assert ellipsoidal.refined.largest_um["refraction"] > 1.0
    assert levelled_points.cartesian == pytest.approx(ellipsoidal.points.cartesian, abs=1e-3)


def test_heights_are_those_of_the_whole_run() -> None:
    inputs, settings = inputs_of(simulate(spec())), Settings()
    ground, result = tie_ground_frames(inputs, settings, None), triangulate(inputs, settings)
    found = heights_of(orient_interior(inputs, settings).observations, inputs, settings, ground)
    (strip,) = result.strips
    centers = strip.intermediate.cartesian_from_intermediate(strip.centers)
    flying, terrain = (ground.output.geodetic(xyz)[:, 2].mean() for xyz in (centers, result.points.cartesian))
    assert found.flying == pytest.approx(flying, abs=1e-6)
    assert found.ground == pytest.approx(terrain, abs=1e-6)
