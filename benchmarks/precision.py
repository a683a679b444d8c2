"""Stated precision of polynomials against what repetitions scatter.

One geometry, its image coordinates and control drawn anew many times. Printed is the stated standard deviation
divided by the scatter, rms over all points, to the east, to the north and up; then the same of the photos' centres and
rotations, and the smallest and largest ratio of any single coordinate of a point.

Usage: python benchmarks/precision.py [--repetitions N] [--workers N]
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run from anywhere, installed or not

from photostrip.threads import limit_threads

limit_threads()  # before numpy is imported, also in the processes that are started here

import numpy as np  # noqa: E402

from photostrip.pipeline.formed_photos import form_strip  # noqa: E402
from photostrip.pipeline.inputs import Settings  # noqa: E402
from photostrip.pipeline.run import triangulate  # noqa: E402
from photostrip.pipeline.strip_method import adjust_formed  # noqa: E402
from photostrip.simulation.simulation import simulate  # noqa: E402
from photostrip.simulation.spec import FILM, Control, Flight, Image, Points, Spec, Terrain  # noqa: E402
from photostrip.strip import polynomial  # noqa: E402
from photostrip.strip.relative_orientation import RelativeSettings  # noqa: E402
from tests.simulated import inputs_of  # noqa: E402

if TYPE_CHECKING:
    from multiprocessing.pool import Pool

    from numpy.typing import NDArray

    from photostrip.geodesy.local_frame import IntermediateFrame
    from photostrip.pipeline.inputs import Inputs
    from photostrip.pipeline.results import StripResult

    Floats = NDArray[np.float64]

METHODS = ("similarity", "1", "2", "3")
SIGMA_UM = 5.0
CHUNKS = 20


@dataclass(frozen=True)
class Case:
    """A kind of strip."""

    name: str
    photos: int
    bands: int = 4
    per_band: int = 3
    lap: float = 62.0
    use: tuple[tuple[str, float], ...] = ()
    layout: str = "bands"

    @property
    def spec(self) -> Spec:
        """The same for the simulation."""
        return Spec(
            camera=replace(FILM, principal_distance=153.0),
            flight=Flight(photos=self.photos, end_lap_percent=self.lap),
            terrain=Terrain(relief=60.0),
            points=Points(rows=5, reach_percent=75.0, extra_per_model=2),
            control=Control(
                layout=self.layout,
                bands=self.bands,
                per_band=self.per_band,
                use=dict(self.use) or {"xyz": 1.0},
                sigma=(0.05, 0.05, 0.05),
            ),
            image=Image(SIGMA_UM),
        )


MIXED = (("xyz", 0.4), ("xy", 0.3), ("z", 0.3))
MIDDLE = "corners+centre"  # four corners and a point in the middle
SCATTER = (
    Case("5 models, 4 bands", 6),
    Case("10 models, 4 bands", 11),
    Case("10 models, mixed", 11, bands=5, use=MIXED),
    Case("20 models, 5 bands", 21, bands=5),
    Case("20 models, 2 per band", 21, bands=5, per_band=2),
    Case("30 models, 7 bands", 31, bands=7),
    Case("10 models, 80 %", 11, lap=80.0),
    Case("10 models, middle", 11, layout=MIDDLE),
    Case("20 models, middle", 21, layout=MIDDLE),
)


def settings(method: str, *, screening: str = "none", precision: bool = True) -> Settings:
    """Give what is asked for: a method by its name, or a degree."""
    degree = method if method in {"1", "2", "3"} else "auto"
    return Settings(
        adjustment="similarity" if method == "similarity" else "polynomial",
        relative=RelativeSettings(screening=screening),
        polynomial=polynomial.PolynomialSettings(degree),
        precision=precision,
    )


# ----------------------------------------------------------------------------------------------- scatter


def true_inputs(spec: Spec) -> Inputs:
    """Give true coordinates with the standard deviations they would have."""
    inputs = inputs_of(simulate(replace(spec, image=Image(0.0), control=replace(spec.control, noise=(0.0, 0.0, 0.0)))))
    sigma = np.full((len(inputs.observations), 2), spec.image.sigma_um / 1000)
    return replace(inputs, observations=replace(inputs.observations, sigma=sigma))


def placed(strip: StripResult, frame: IntermediateFrame) -> tuple[Floats, Floats, Floats]:
    """Points, centres and rotations in the axes of a frame."""
    there = strip.intermediate
    centers = frame.intermediate_from_cartesian(there.cartesian_from_intermediate(strip.resection.centers))
    rotations = frame.intermediate_rotations(there.cartesian_rotations(strip.resection.rotations))
    return frame.intermediate_from_cartesian(strip.cartesian), centers, rotations


def drawn(inputs: Inputs, rng: np.random.Generator) -> Inputs:
    """Measure image points and control anew."""
    observations, control = inputs.observations, inputs.control
    xy = observations.xy + rng.normal(size=observations.xy.shape) * observations.sigma
    enu = control.enu + rng.normal(size=control.enu.shape) * np.where(control.use, control.sigma, 0.0)
    return replace(inputs, observations=replace(observations, xy=xy), control=replace(control, enu=enu))


def displaced(found: tuple[Floats, Floats, Floats], true: tuple[Floats, Floats, Floats]) -> tuple[Floats, Floats]:
    """Displacements of points, (n, 3), and of centres with small rotations, (m, 6)."""
    turn = found[2] @ true[2].transpose(0, 2, 1)
    vector = (turn - turn.transpose(0, 2, 1))[:, [2, 0, 1], [1, 2, 0]] / 2
    return found[0] - true[0], np.column_stack([found[1] - true[1], vector])


def repeated(task: tuple[Case, int, int]) -> dict[str, list[Floats]]:
    """Add up displacements and their squares of points and photos over some repetitions, each strip formed once."""
    case, number, seed = task
    inputs, wanted = true_inputs(case.spec), {method: settings(method, precision=False) for method in METHODS}
    first = wanted[METHODS[0]]
    truth = triangulate(inputs, first)
    (strip,) = truth.strips
    frame, measured = strip.intermediate, np.isin(inputs.control.ids, strip.control.ids)
    true = placed(strip, frame)
    rng = np.random.default_rng([seed, 7])
    sums = {method: [np.zeros(each.shape) for each in displaced(true, true) for _ in range(2)] for method in wanted}
    for _ in range(number):
        again = drawn(inputs, rng)
        formed = form_strip(strip.of_photos.strip, again.observations, first)
        control = again.control.take(np.flatnonzero(measured))
        for method, asked in wanted.items():
            found = adjust_formed(formed, control, truth.frames, asked)
            points, photos = displaced(placed(found, frame), true)
            for place, value in enumerate((points, points**2, photos, photos**2)):
                sums[method][place] += value
    return sums


def stated(case: Case, method: str) -> tuple[Floats, Floats]:
    """Stated variances of points and photos, along the axes of the intermediate frame."""
    inputs = drawn(true_inputs(case.spec), np.random.default_rng(5))
    (strip,), precision = (result := triangulate(inputs, settings(method))).strips, result.precision
    assert precision is not None  # noqa: S101
    factor = (inputs.observations.sigma[0, 0] / precision.sigma[0]) ** 2  # chance contradicts one strip in a hundred
    axes, both = strip.intermediate.axes, np.zeros((6, 6))
    both[:3, :3] = both[3:, 3:] = axes
    points = axes.T @ precision.points @ axes
    photos = both.T @ precision.photos[0] @ both
    return factor * np.diagonal(points, axis1=1, axis2=2), factor * np.diagonal(photos, axis1=1, axis2=2)


def scatter(pool: Pool, case: Case, repetitions: int) -> None:
    """Print one kind of strip."""
    tasks = [(case, repetitions // CHUNKS, seed) for seed in range(CHUNKS)]
    parts, number = pool.map(repeated, tasks, chunksize=1), repetitions // CHUNKS * CHUNKS
    for method in METHODS:
        sums = [sum(part) for part in zip(*(part[method] for part in parts), strict=True)]
        first, squares, photo_first, photo_squares = sums
        points, photos = stated(case, method)
        actual = squares / number - (first / number) ** 2
        actual_photos = photo_squares / number - (photo_first / number) ** 2
        ratio = np.sqrt(points.mean(axis=0) / actual.mean(axis=0))
        of_photos = np.sqrt(photos.mean(axis=0) / actual_photos.mean(axis=0))
        single = np.sqrt(points / actual)
        name = f"degree {method}" if len(method) == 1 else method
        cells = [" ".join(f"{value:.3f}" for value in ratio), " ".join(f"{value:.3f}" for value in of_photos)]
        print(
            f"{case.name:24} {name:13} {cells[0]}   {cells[1]}   {single.min():.2f} {single.max():.2f}   "
            f"{np.sqrt(actual[:, :2].sum(axis=1).mean()):.3f} {np.sqrt(actual[:, 2].mean()):.3f}",
            flush=True,
        )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repetitions", type=int, default=2000)
    parser.add_argument("--workers", type=int, default=2)
    wanted = parser.parse_args()
    with get_context("spawn").Pool(wanted.workers) as pool:
        print(f"{'strip':24} {'method':13} {'points: along, across, up':19} {'photos: centre, rotation':44} single")
        for case in SCATTER:
            scatter(pool, case, wanted.repetitions)


if __name__ == "__main__":
    main()
