"""Simulated terrestrial surveys, in memory and as projects on disk: points that move, cameras that turn."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from photostrip.arrays import Floats
from photostrip.simulation.draws import Draws, Purpose
from photostrip.terrestrial.monitoring import MonitoringSettings, Series, monitor
from photostrip.terrestrial.normal_case import StereoPair

ARCSECOND = np.pi / 180 / 3600
FOCAL = (190.0, 100.0)
CENTERS = np.array([[1000.0, 2000.0, 150.0], [1040.0, 2005.0, 152.0]])
SIGMA = 0.005  # mm


def about(axis: int, angle: float) -> Floats:
    """Give the matrix of a rotation about one axis, right-hand rule, by a library that is not ours."""
    return np.asarray(Rotation.from_rotvec(angle * np.eye(3)[axis]).as_matrix(), float)


def attitude(alpha: float, omega: float, kappa: float) -> Floats:
    """Columns x, optical axis, z of a camera: first it rolls, then it looks up, then it turns to its azimuth.

    The roll is counter-clockwise for the photographer, that is left-handed about the viewing direction; the azimuth is
    clockwise, that is left-handed about the vertical.
    """
    return about(2, -alpha) @ about(0, omega) @ about(1, -kappa)


def photo(points: Floats, center: Floats, columns: Floats, focal: float) -> Floats:
    """Image coordinates by the collinearity equations of a terrestrial photo."""
    x, depth, z = (
        (points - center) @ columns[:, 0],
        (points - center) @ columns[:, 1],
        (points - center) @ columns[:, 2],
    )
    return focal * np.column_stack([x / depth, z / depth])


@dataclass(frozen=True, eq=False)
class World:
    """What is photographed. Points in rows; `stable` points are given as such, whether they move or not.

    `turns` are those of the left and right camera in each epoch, in seconds of arc: right, up, counter-clockwise.
    """

    points: Floats
    velocity: Floats
    stable: int
    epochs: int = 2
    turns: dict[tuple[int, int], tuple[float, float, float]] = field(default_factory=dict)
    shared: float = 0.0  # mm, errors that all epochs share: pseudo-parallaxes are measured
    right_z: bool = True
    shifts: dict[tuple[int, int], Floats] = field(default_factory=dict)  # of the cameras, metres
    attitudes: tuple[tuple[float, float, float], ...] = ((0.15, 0.05, -0.02), (-0.25, 0.03, 0.04))

    @property
    def pair(self) -> StereoPair:
        columns = [attitude(*each) for each in self.attitudes]
        rotations = np.array([np.column_stack([c[:, 0], c[:, 2], -c[:, 1]]) for c in columns])
        return StereoPair(FOCAL, CENTERS, rotations)

    def exact(self, epoch: int) -> Floats:
        """Coordinates without errors, x and z left, x and z right, shape (n, 4)."""
        there = self.points + self.velocity * epoch
        parts = []
        for side in range(2):
            right, up, roll = (angle * ARCSECOND for angle in self.turns.get((epoch, side), (0.0, 0.0, 0.0)))
            columns = attitude(*self.attitudes[side]) @ attitude(right, up, roll)
            center = CENTERS[side] + self.shifts.get((epoch, side), np.zeros(3))
            parts.append(photo(there, center, columns, FOCAL[side]))
        return np.hstack(parts)

    def measure(self, seed: int, sigma: float = SIGMA) -> Series:
        """Measure all epochs with errors of their own and, for pseudo-parallaxes, errors of the first photos."""
        n = len(self.points)
        noise = Draws(seed, Purpose.IMAGE).normal(self.epochs + 1, n, 4)
        shared = self.shared * noise[0]
        exact = np.array([self.exact(epoch) for epoch in range(self.epochs)])
        own = np.full((self.epochs, n, 4), sigma**2)
        errors = sigma * noise[1:]
        if self.shared:
            own[0], errors[0] = 0.0, 0.0
        coordinates = exact + errors + shared
        if not self.right_z:
            coordinates[:, :, 3] = np.nan
        stable = np.arange(n) < self.stable
        epochs = tuple(f"epoch {number}" for number in range(self.epochs))
        names = tuple(f"P{number}" for number in range(n))
        variance = np.full((n, 4), self.shared**2)
        return Series(names, epochs, coordinates, own, variance, stable, np.arange(float(self.epochs)))


def world(number: int = 30, moving: int = 15, stable: int = 6, seed: int = 1, size: float = 0.02) -> World:
    """Give a rock face 90 to 150 m away; the last points move."""
    draws = Draws(seed, Purpose.POINTS)
    spread = draws.uniform(number, 3)
    points = CENTERS[0] + np.array([-5.0, 90.0, -15.0]) + spread * [50.0, 60.0, 40.0]
    velocity = size * draws.normal(number, 3)
    velocity[: number - moving] = 0.0
    return World(points, velocity, stable)


def weighted(error: Floats, covariance: Floats) -> Floats:
    """Squared length of errors in the metric of their covariance, by the inverse itself."""
    return np.asarray(np.einsum("ni,nij,nj->n", error, np.linalg.inv(covariance), error), float)


def repeated(truth: World, runs: int) -> dict[str, Floats]:
    """Measure a survey many times: last displacements of the points that are not stable, and what is called moved.

    ``errors`` in standard deviations; ``plan`` and ``space`` squared, weighted by the inverse covariance; ``false`` and
    ``stable false``: points that stand still and are called moved; ``cameras``: the last left camera is called turned;
    ``squares``: sigma0 of the turns, squared; ``parallax`` and ``change``: vertical parallaxes and their changes, in
    standard deviations.
    """
    found: dict[str, list[Floats]] = {}
    still = ~truth.velocity.any(axis=1)
    for seed in range(1, runs + 1):
        result = monitor(truth.measure(seed), truth.pair, MonitoringSettings())
        step, ordinary = result.since_first[-1], ~result.series.stable
        error, moved = step.values - truth.velocity * (truth.epochs - 1), result.significant(step)
        for name, values in {
            "errors": (error / step.sigma)[ordinary],
            "plan": weighted(error[:, :2], step.covariance[:, :2, :2])[ordinary],
            "space": weighted(error, step.covariance)[ordinary],
            "false": moved[ordinary & still],
            "stable false": moved[~ordinary & still],
            "cameras": np.array([result.cameras[-2].moved]),
            "squares": np.array([each.turn.weighted_sum / each.turn.dof for each in result.cameras if each.turn]),
            "parallax": (result.parallax[-1] / result.parallax_sigma[-1])[ordinary],
            "change": (result.parallax_change[-1] / result.parallax_change_sigma[-1])[ordinary],
        }.items():
            found.setdefault(name, []).append(values)
    return {name: np.concatenate(values) for name, values in found.items()}


def with_turn(truth: World, *arcseconds: float) -> World:
    """Turn the left camera in the last epoch."""
    right, up, roll = arcseconds
    return replace(truth, turns={(truth.epochs - 1, 0): (right, up, roll)})


PROJECT = """\
photostrip_terrestrial: 1
name: quarry
cameras:
  long: {principal_distance: 190.0, format: [160, 120]}
  wide: {preset: UMK 10/1318}
axes: [east, north, up]
stations:
  left: {camera: long, position: [1000.0, 2000.0, 150.0], alpha: LA, omega: LO, kappa: LK}
  right: {camera: wide, position: [1040.0, 2005.0, 152.0], alpha: RA, omega: RO, kappa: RK}
epochs: [{id: epoch 0, time: 0}, {id: epoch 1, time: 1}, {id: epoch 2, time: 2}]
measurements: {coordinates: coordinates.csv, unit: mm, sigma: 0.005}
stable: [P0, P1, P2, P3, P4, P5]
"""
TRUTH = with_turn(replace(world(number=12, moving=4, size=0.05), epochs=3), 60.0, -30.0, 45.0)


def project(unit: str = "deg") -> str:
    """Give the text of the project of ``TRUTH``."""
    per_radian = 180 / np.pi if unit == "deg" else 200 / np.pi
    text = PROJECT
    for letter, angles in zip("LR", TRUTH.attitudes, strict=True):
        for name, angle in zip("AOK", angles, strict=True):
            text = text.replace(f" {letter}{name}", f" {angle * per_radian:.12f}")
    return text


def coordinates(truth: World = TRUTH, seed: int = 1, sigma: float = 0.005, decimals: int = 4) -> str:
    """Give the table of image coordinates of a survey."""
    series = truth.measure(seed, sigma)
    lines = ["epoch,photo,point,x,z"]
    for number, epoch in enumerate(series.epochs):
        for row, point in enumerate(series.points):
            xl, zl, xr, zr = series.coordinates[number, row]
            lines.append(f"{epoch},left,{point},{xl:.{decimals}f},{zl:.{decimals}f}")
            lines.append(f"{epoch},right,{point},{xr:.{decimals}f},{zr:.{decimals}f}")
    return "\n".join(lines) + "\n"


def pseudo_parallaxes(truth: World = TRUTH, seed: int = 1, sigma: float = 0.005, decimals: int = 9) -> str:
    """Give the table of pseudo-parallaxes of a survey."""
    series = truth.measure(seed, sigma)
    first = series.coordinates[0]
    lines = ["point,epoch,x,z,p,q,dx,dz,dx_right,dz_right"]
    for number, epoch in enumerate(series.epochs[1:], 1):
        for row, point in enumerate(series.points):
            xl, zl, xr, zr = first[row]
            values = (xl, zl, xl - xr, zl - zr, *(series.coordinates[number, row] - first[row]))
            lines.append(f"{point},{epoch}," + ",".join(f"{value:.{decimals}f}" for value in values))
    return "\n".join(lines) + "\n"


def write(folder: Path, text: str | None = None, table: str | None = None, name: str = "coordinates.csv") -> Path:
    """Write a project with its table."""
    (folder / name).write_text(coordinates() if table is None else table, encoding="utf-8")
    (path := folder / "survey.yaml").write_text(project() if text is None else text, encoding="utf-8")
    return path
