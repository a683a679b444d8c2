"""A simulation as the pipeline takes it, in memory: what its project file and tables would say."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from photostrip.foreign.simulated import model_strips
from photostrip.pipeline.inputs import Inputs, MeasuredModels, Settings, Strip
from photostrip.points import PhotoPoints
from photostrip.strip.corrections import ImageCorrectionSettings

if TYPE_CHECKING:
    from photostrip.simulation import Simulation


def inputs_of(simulation: Simulation) -> Inputs:
    """Return what a project file and its tables would say of a simulation, without rounding."""
    if (points := simulation.models) is not None:
        if simulation.spec.models is not None and simulation.spec.models.hand == "left-handed":
            points = replace(points, xyz=points.xyz * (1.0, -1.0, 1.0))  # turned over, as a project says it
        return Inputs(
            name=simulation.spec.name,
            strips=(),
            observations=PhotoPoints.naming(points.point_ids),
            control=simulation.control,
            frames=simulation.frames,
            models=MeasuredModels(tuple(model_strips(simulation, points)), points),
        )
    return Inputs(
        name=simulation.spec.name,
        strips=tuple(Strip(name, simulation.camera, photos) for name, photos in simulation.strips),
        observations=simulation.observations,
        control=simulation.control,
        frames=simulation.frames,
        fiducials=simulation.fiducials,
    )


def settings_of(simulation: Simulation) -> Settings:
    """Return the settings that the written project has: defaults, and refraction when it was simulated."""
    return Settings(refinement=ImageCorrectionSettings(refraction=simulation.spec.refraction))
