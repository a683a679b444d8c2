"""A simulated strip as a project: in memory as the pipeline takes it."""

from __future__ import annotations

from photostrip.pipeline import Inputs, Strip
from photostrip.simulate import Simulation  # noqa: TC001


def inputs_of(simulation: Simulation) -> Inputs:
    """Give what a project file and its tables would say of a simulation, without rounding.

    Parameters
    ----------
    simulation : Simulation
        The simulation.

    Returns
    -------
    Inputs
        The same for the pipeline.
    """
    return Inputs(
        simulation.spec.name,
        tuple(Strip(name, simulation.camera, photos) for name, photos in simulation.strips),
        simulation.observations,
        simulation.control,
        simulation.frames,
        fiducials=simulation.fiducials,
    )
