"""A simulation as the problem of a bundle adjustment, with start values off the truth."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.geodesy.tying import tie_frames
from photostrip.geometry.rotation import from_vector
from photostrip.network.problem import BundleCameras, BundleProblem, ControlObservations, ImageObservations, StartValues

if TYPE_CHECKING:
    from photostrip.simulation.simulation import Simulation


def truth_of(simulation: Simulation) -> StartValues:
    """Return the truth of a simulation in the frame of ``problem_of``: Cartesian, origin amid the points, metres."""
    truth = simulation.truth
    origin = truth.points.xyz.mean(axis=0)
    return StartValues(truth.centers - origin, truth.rotations, truth.points.xyz - origin)


def problem_of(simulation: Simulation, *, shift: float = 1.0, turn: float = 1e-3, seed: int = 1) -> BundleProblem:
    """Make a bundle adjustment of a simulation without distortion, film deformation and refraction.

    It has the rays of points with two or more, the control without check points, and a start that is off the truth by
    standard deviations of `shift` metres of centres and points, `turn` radians about each axis of the photos.
    """
    seen, control, truth = simulation.observations, simulation.control, truth_of(simulation)
    rays = np.bincount(seen.point, minlength=len(seen.point_ids))[seen.point] > 1
    random = np.random.default_rng(seed)
    photos = len(truth.centers)
    start = StartValues(
        truth.centers + shift * random.standard_normal(truth.centers.shape),
        from_vector(turn * random.standard_normal((photos, 3))) @ truth.rotations,
        truth.points + shift * random.standard_normal(truth.points.shape),
    )
    frames, _ = tie_frames(list(simulation.frames))
    number = {name: n for n, name in enumerate(simulation.truth.points.ids)}
    rows = [n for n, (name, check) in enumerate(zip(control.ids, control.check, strict=True)) if not check]
    rows = [row for row in rows if control.ids[row] in number]
    point = np.array([number[control.ids[row]] for row in rows], dtype=np.intp)
    given, axes = np.empty((len(rows), 3)), np.empty((len(rows), 3, 3))
    true = simulation.truth.points.xyz[point]
    for n, frame in enumerate(frames):
        own = np.flatnonzero(control.frame[rows] == n)
        enu = np.array(control.enu[rows][own])
        # What is not given is taken from the truth: it has no weight.
        enu = np.where(np.isnan(enu), frame.ground_from_cartesian(true[own]), enu)
        given[own], axes[own] = frame.cartesian_from_ground(enu), frame.axes_at(true[own])
    origin = simulation.truth.points.xyz.mean(axis=0)
    return BundleProblem(
        ImageObservations(seen.photo[rays], seen.point[rays], seen.xy[rays], seen.sigma[rays]),
        BundleCameras(np.zeros(photos, np.intp), np.array([simulation.camera.principal_distance])),
        start,
        ControlObservations(point, given - origin, axes, np.where(control.use[rows], control.sigma[rows], np.inf)),
        photo_ids=simulation.truth.photo_ids,
        point_ids=simulation.truth.points.ids,
    )
