"""Simulated blocks for tests of the bundle adjustment, and what can be taken from them or added."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.geodesy.tying import tie_frames
from photostrip.geometry.rotation import angles
from photostrip.pipeline.inputs import CameraPositions, GivenOrientations
from photostrip.pipeline.run import triangulate
from photostrip.simulation import Control, Gnss, Image, Spec, simulate
from tests.simulated import inputs_of, settings_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from photostrip.pipeline.inputs import Inputs
    from photostrip.pipeline.results import Result
    from photostrip.simulation import Simulation

    Floats = NDArray[np.float64]

EXACT = {"image": Image(sigma_um=0.0), "control": Control(noise=(0.0, 0.0, 0.0))}


def exact(**parts: object) -> Spec:
    """Strips without any error."""
    return replace(Spec(gnss=Gnss()), **{**EXACT, **parts})  # type: ignore[arg-type]


def adjusted(simulation: Simulation, inputs: Inputs | None = None, **settings: object) -> Result:
    """Bundle adjustment of a simulation; `settings` are those of ``processing.bundle``."""
    asked = settings_of(simulation)
    asked = replace(asked, adjustment="bundle", bundle=replace(asked.bundle, **settings))  # type: ignore[arg-type]
    return triangulate(inputs_of(simulation) if inputs is None else inputs, asked)


def errors(simulation: Simulation, result: Result) -> Floats:
    """Adjusted minus true points, Cartesian, metres."""
    number = {name: row for row, name in enumerate(simulation.truth.points.ids)}
    rows = [number[result.refined.observations.point_ids[n]] for n in result.points.number]
    return np.asarray(result.points.cartesian - simulation.truth.points.xyz[rows])


def with_control(simulation: Simulation, names: Sequence[str]) -> Inputs:
    """Inputs with some of the control points only; check points stay."""
    inputs = inputs_of(simulation)
    control = inputs.control
    keep = np.array([name in names or bool(check) for name, check in zip(control.ids, control.check, strict=True)])
    return replace(inputs, control=control.take(keep))


def corners(simulation: Simulation) -> list[str]:
    """Control points nearest to the four corners of a block."""
    control = simulation.control
    rows = np.flatnonzero(~control.check)
    plan = control.enu[rows, :2]
    return [control.ids[rows[np.argmin(plan @ np.array(way))]] for way in ((1, 1), (1, -1), (-1, 1), (-1, -1))]


def photos_of(simulation: Simulation) -> tuple[str, ...]:
    return tuple(photo for _, photos in simulation.strips for photo in photos)


def positions(
    simulation: Simulation,
    sigma: float = 0.05,
    lever: tuple[float, float, float] = (0.0, 0.0, 0.0),
    shift: Floats | float = 0.0,
    correction: str = "none",
    noise: Floats | float = 0.0,
) -> CameraPositions:
    """True positions of antennas, with an error common to a strip and errors of their own."""
    photos, truth = photos_of(simulation), simulation.truth
    (frame,), _ = tie_frames([simulation.frames[0]])
    antennas = frame.ground_from_cartesian(truth.centers + truth.rotations @ np.array(lever))
    n = len(photos)
    return CameraPositions(
        photos,
        simulation.frames[0],
        antennas + shift + noise,
        np.ones((n, 3), bool),
        np.full((n, 3), sigma),
        np.full(n, np.nan),
        lever,
        correction,
    )


def orientations(simulation: Simulation, *, observed: bool, system: str = "omega-phi-kappa") -> GivenOrientations:
    """True orientations."""
    photos = photos_of(simulation)
    (frame,), _ = tie_frames([simulation.frames[0]])
    truth = simulation.truth
    turned = frame.axes_at(truth.centers) @ truth.rotations
    n = len(photos)
    return GivenOrientations(
        photos,
        simulation.frames[0],
        truth.centers_ground,
        angles(turned, system),
        system,
        np.full((n, 3), 0.1),
        np.full((n, 3), 1e-4),
        observed,
    )


__all__ = ["adjusted", "corners", "errors", "exact", "orientations", "positions", "simulate", "with_control"]
