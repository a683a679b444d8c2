"""Simulated blocks for tests of the bundle adjustment, and what can be taken from them or added."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.geodesy.tying import tie_frames
from photostrip.geometry.rotation import angles
from photostrip.pipeline.inputs import CameraPositions, GivenOrientations
from photostrip.pipeline.run import triangulate
from photostrip.points import take_rows
from photostrip.simulation import Control, Gnss, Image, Spec
from tests.simulated import inputs_of, settings_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from photostrip.notes import Finding, Note
    from photostrip.pipeline.inputs import Inputs
    from photostrip.pipeline.results import Result
    from photostrip.points import PhotoPoints
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


def rms(simulation: Simulation, result: Result) -> float:
    """Root mean square distance of the adjusted points from their true places, metres."""
    return float(np.sqrt((errors(simulation, result) ** 2).sum(axis=1).mean()))


def centers(result: Result) -> Floats:
    """Perspective centres of all strips, Cartesian, metres."""
    return np.concatenate([s.intermediate.cartesian_from_intermediate(s.placed.centers) for s in result.strips])


def note(result: Result, code: str) -> Note:
    """Give the only note of a code."""
    (one,) = [each for each in result.notes if each.code == code]
    return one


def offset(finding: Finding) -> list[object]:
    """Give the offset that a finding tells, metres east, north, up."""
    return [finding.evidence[f"offset_{axis}_m"] for axis in ("east", "north", "up")]


def lost(result: Result, *kinds: str) -> list[str]:
    """Kinds of what the bundle took out for good, of these alone."""
    assert result.bundle is not None
    return [each.kind for each in result.bundle.screened.rejections if each.kind in kinds and not each.readmitted]


def with_camera(inputs: Inputs, **changes: object) -> Inputs:
    """State the cameras otherwise."""
    strips = [replace(s, camera=replace(s.camera, **changes)) for s in inputs.strips]  # type: ignore[arg-type]
    return replace(inputs, strips=tuple(strips))


def calibrating(inputs: Inputs, *parameters: str) -> Inputs:
    """Ask for a calibration of all cameras."""
    return replace(inputs, strips=tuple(replace(strip, calibrate=parameters) for strip in inputs.strips))


def moved(inputs: Inputs, rows: NDArray[np.intp] | NDArray[np.bool_], by: ArrayLike) -> Inputs:
    """Move some given points, metres east, north, up."""
    enu = inputs.control.enu.copy()
    enu[rows] += np.asarray(by, float)
    return replace(inputs, control=replace(inputs.control, enu=enu))


def used_rows(inputs: Inputs) -> NDArray[np.intp]:
    """Rows of the given points that are no check points."""
    return np.flatnonzero(~inputs.control.check)


def measured(points: PhotoPoints, rows: NDArray[np.intp] | NDArray[np.bool_]) -> PhotoPoints:
    """Give some of the measurements."""
    return take_rows(points, rows, ("photo", "point", "xy", "sigma"))


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
    use, sigmas, times = np.ones((len(photos), 3), bool), np.full((len(photos), 3), sigma), np.full(len(photos), np.nan)
    enu = antennas + shift + noise
    return CameraPositions(photos, simulation.frames[0], enu, use, sigmas, times, lever, correction)


def orientations(simulation: Simulation, *, observed: bool, system: str = "omega-phi-kappa") -> GivenOrientations:
    """True orientations."""
    photos = photos_of(simulation)
    (frame,), _ = tie_frames([simulation.frames[0]])
    truth = simulation.truth
    turned = angles(frame.axes_at(truth.centers) @ truth.rotations, system)
    sigma, sigma_turns = (np.full((len(photos), 3), value) for value in (0.1, 1e-4))
    places = truth.centers_ground
    return GivenOrientations(photos, simulation.frames[0], places, turned, system, sigma, sigma_turns, observed)
