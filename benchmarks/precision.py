"""Stated precision against what repetitions scatter, and the strip adjusted with its covariance against a bundle.

scatter: one geometry, its image coordinates and control drawn anew many times. Printed is the stated standard deviation
divided by the scatter, rms over all points, to the east, to the north and up; then the same of the photos' centres and
rotations, and the smallest and largest ratio of any single coordinate of a point.

bundle: many strips with their own geometry; errors of all points that are not control, divided by those of a rigorous
bundle adjustment of the same measurements (that of benchmarks/accuracy.py, written apart from the program), plan and
height; stated divided by actual errors; the mean of the test of the whole, which is to be 1; the share of strips in
which a right control point is called doubtful.

Usage: python benchmarks/precision.py [scatter] [bundle] [--repetitions N] [--seeds N] [--workers N] [--only NAME ...]
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from multiprocessing.pool import ThreadPool
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run from anywhere, installed or not

from photostrip.threads import limit_threads

limit_threads()  # before numpy is imported, also in the processes that are started here

import numpy as np  # noqa: E402

from benchmarks import accuracy  # noqa: E402
from photostrip.camera import Camera  # noqa: E402
from photostrip.pipeline.inputs import Settings  # noqa: E402
from photostrip.pipeline.run import triangulate  # noqa: E402
from photostrip.pipeline.strips.adjusting import adjust_formed  # noqa: E402
from photostrip.pipeline.strips.photos import form_strip  # noqa: E402
from photostrip.simulation.simulation import simulate  # noqa: E402
from photostrip.simulation.spec import FILM, Control, Flight, Image, Points, Spec, Terrain  # noqa: E402
from photostrip.triangulation.covariance_adjustment.settings import CovarianceSettings  # noqa: E402
from photostrip.triangulation.polynomial import correction  # noqa: E402
from photostrip.triangulation.relative_orientation.orientation import RelativeSettings  # noqa: E402
from tests.simulated import inputs_of  # noqa: E402

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from multiprocessing.pool import Pool

    from numpy.typing import NDArray

    from photostrip.geodesy.local_frame import IntermediateFrame
    from photostrip.pipeline.inputs import Inputs
    from photostrip.pipeline.results import StripResult

    Floats = NDArray[np.float64]

ALONE = "control alone"  # the covariance without the distances of the pass points
METHODS = ("similarity", "1", "2", "3", ALONE, "covariance")
SIGMA_UM = 5.0
CHUNKS = 20
UAV = Camera("uav", 8.8, format=(13.2, 8.8))


@dataclass(frozen=True)
class Case:
    """A kind of strip."""

    name: str
    photos: int
    bands: int = 4
    every: int | None = None
    per_band: int = 3
    lap: float = 62.0
    use: tuple[tuple[str, float], ...] = ()
    sigma: tuple[float, float, float] = (0.05, 0.05, 0.05)
    relief: float = 60.0
    uav: bool = False
    layout: str = "bands"
    extra: int = 2  # points of each model beside the five rows of Gruber points
    methods: tuple[str, ...] = METHODS

    @property
    def spec(self) -> Spec:
        """The same for the simulation."""
        return Spec(
            camera=replace(UAV) if self.uav else replace(FILM, principal_distance=153.0),
            flight=Flight(photos=self.photos, end_lap_percent=self.lap),
            terrain=Terrain(relief=self.relief),
            points=Points(rows=5, reach_percent=75.0, extra_per_model=self.extra),
            control=Control(
                layout=self.layout,
                bands=self.bands,
                every=self.every,
                per_band=self.per_band,
                use=dict(self.use) or {"xyz": 1.0},
                sigma=self.sigma,
            ),
            image=Image(1.0 if self.uav else SIGMA_UM),
        )


MIXED = (("xyz", 0.4), ("xy", 0.3), ("z", 0.3))
MIDDLE = "corners+centre"  # four corners and a point in the middle
GOOD = (0.02, 0.02, 0.02)
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
    Case("30 photos, 3 bands", 30, bands=3, sigma=GOOD, methods=("covariance",)),
    Case("100 photos, every 5", 100, every=5, sigma=GOOD, methods=("covariance",)),
)
BUNDLE = (
    Case("6 photos, 3 bands", 6, bands=3, sigma=GOOD),
    Case("6 photos, middle", 6, layout=MIDDLE, sigma=GOOD),
    Case("10 photos, 4 bands", 10, sigma=GOOD),
    Case("10 photos, middle", 10, layout=MIDDLE, sigma=GOOD),
    Case("20 photos, every 4", 20, every=4, sigma=GOOD),
    Case("20 photos, every 5", 20, every=5, sigma=GOOD),
    Case("20 photos, 3 bands", 20, bands=3, sigma=GOOD),
    Case("20 photos, 2 per band", 20, bands=3, per_band=2, sigma=GOOD),
    Case("20 photos, middle", 20, layout=MIDDLE, sigma=GOOD),
    Case("30 photos, every 5", 30, every=5, sigma=GOOD),
    Case("30 photos, 3 bands", 30, bands=3, sigma=GOOD),
    Case("30 photos, middle", 30, layout=MIDDLE, sigma=GOOD),
    Case("14 photos, 70 %, hills", 14, every=4, lap=70.0, relief=300.0, sigma=GOOD),
    Case("16 photos, 80 %", 16, every=5, lap=80.0, sigma=GOOD),
    Case("16 photos, 80 %, 8.8 mm", 16, every=5, lap=80.0, uav=True, sigma=(0.005, 0.005, 0.005)),
    Case("60 photos, every 5", 60, every=5, sigma=GOOD),
    Case("100 photos, every 5", 100, every=5, sigma=GOOD),
    Case("100 photos, 3 bands", 100, bands=3, sigma=GOOD),
    Case("300 photos, every 5", 300, every=5, sigma=GOOD),
    Case("40 photos, 80 %", 40, every=10, lap=80.0, sigma=GOOD),
    Case("40 photos, 80 %, middle", 40, lap=80.0, layout=MIDDLE, sigma=GOOD),
    Case("20 photos, 94 %", 20, every=6, lap=94.0, sigma=GOOD),
    Case("20 photos, 94 %, dense", 20, every=6, lap=94.0, sigma=GOOD, extra=60),
)


def settings(method: str, *, screening: str = "none", precision: bool = True) -> Settings:
    """Give what is asked for: a method by its name, or a degree."""
    degree = method if method in {"1", "2", "3"} else "auto"
    adjustments = {"similarity": "similarity", "covariance": "covariance", ALONE: "covariance"}
    return Settings(
        adjustment=adjustments.get(method, "polynomial"),
        covariance=CovarianceSettings(distances=method != ALONE),
        relative=RelativeSettings(screening=screening),
        polynomial=correction.PolynomialSettings(degree),
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
    centers = frame.intermediate_from_cartesian(there.cartesian_from_intermediate(strip.of_photos.resection.centers))
    rotations = frame.intermediate_rotations(there.cartesian_rotations(strip.of_photos.resection.rotations))
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
    inputs, wanted = true_inputs(case.spec), {method: settings(method, precision=False) for method in case.methods}
    first = wanted[case.methods[0]]
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
    for method in case.methods:
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


# ------------------------------------------------------------------------------------------------ bundle


def compared(case: Case, seed: int) -> dict[str, Floats]:
    """Mean squares of one strip by the polynomial, the covariance and the bundle, and what the covariance says."""
    simulation = simulate(replace(case.spec, seed=seed + 1))
    inputs = inputs_of(simulation)
    found: dict[str, Floats] = {}
    for method in ("auto", ALONE, "covariance"):
        result = triangulate(inputs, settings(method, screening="auto", precision=method == "covariance"))
        found[method] = accuracy.mean_squares(simulation, result, result.points.cartesian)
    bundle = accuracy.bundle(simulation)[result.points.number]
    found["bundle"] = accuracy.mean_squares(simulation, result, bundle)
    (strip,), precision = result.strips, result.precision
    assert precision is not None  # noqa: S101
    assert strip.of_photos.covariance is not None  # noqa: S101
    fixed = {name for name, check in zip(inputs.control.ids, inputs.control.check, strict=True) if not check}
    free = np.array([inputs.observations.point_ids[n] not in fixed for n in result.points.number])
    axes = strip.intermediate.axes
    found["stated"] = np.diagonal(axes.T @ precision.points[free] @ axes, axis1=1, axis2=2).mean(axis=0)
    tested = strip.of_photos.covariance.tested
    found["test"] = np.array([tested.squares / tested.redundancy, float(len(tested.doubtful) > 0)])
    found["rejected"] = np.array([float(len(strip.wrong_control) > 0)])
    return found


def plan_height(squares: Floats) -> Floats:
    """Root mean squares in plan and height from those along, across and up."""
    return np.asarray(np.sqrt([squares[0] + squares[1], squares[2]]), float)


def against_bundle(pool: Pool, case: Case, seeds: int) -> None:
    """Print one kind of strip."""
    found = pool.map(partial(compared, case), range(seeds), chunksize=1)
    mean = {key: np.mean([each[key] for each in found], axis=0) for key in found[0]}
    bundle = plan_height(mean["bundle"])
    cells = [
        "/".join(f"{value:.{digits}f}" for value in values)
        for values, digits in (
            (plan_height(mean["auto"]) / bundle, 2),
            (plan_height(mean[ALONE]) / bundle, 3),
            (plan_height(mean["covariance"]) / bundle, 3),
            (bundle, 3),
            (plan_height(mean["stated"]) / plan_height(mean["covariance"]), 2),
        )
    ]
    print(
        f"{case.name:24} {cells[0]:11} {cells[1]:13} {cells[2]:13} {cells[3]:13} {cells[4]:11} {mean['test'][0]:.3f}  "
        f"{100 * mean['test'][1]:5.1f} %  {100 * mean['rejected'][0]:5.1f} %",
        flush=True,
    )


def main() -> None:
    """Print the tables that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tables", nargs="*", help="scatter, bundle; both by default")
    parser.add_argument("--repetitions", type=int, default=2000)
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--only", nargs="*", help="words of the names of the strips wanted")
    wanted = parser.parse_args()
    tables: dict[str, tuple[str, Sequence[Case], Callable[[Pool, Case, int], None], int]] = {
        "scatter": (
            f"{'strip':24} {'method':13} {'points: along, across, up':19} {'photos: centre, rotation':44} single",
            SCATTER,
            scatter,
            wanted.repetitions,
        ),
        "bundle": (
            (
                f"{'strip':24} {'polynomial':11} {ALONE} {'covariance':13} {'bundle, m':13} {'stated':11} "
                "test   doubtful rejected"
            ),
            BUNDLE,
            against_bundle,
            wanted.seeds,
        ),
    }
    # one worker needs no other process
    with get_context("spawn").Pool(wanted.workers) if wanted.workers > 1 else ThreadPool(1) as pool:
        for name in wanted.tables or tables:
            head, cases, measure, number = tables[name]
            print(head)
            for case in cases:
                if not wanted.only or any(word in case.name for word in wanted.only):
                    measure(pool, case, number)


if __name__ == "__main__":
    main()
