"""How well plans agree with simulated measurements: one geometry, thousands of measurements of it, whole runs.

For each layout of control and each method the standard deviations that `photostrip plan strip` predicts stand beside
the scatter of adjusted points over all repetitions. The part on one model does the same for `photostrip plan model`,
with the exact relative orientation, intersection and absolute orientation of every repetition.

Usage: python benchmarks/planning.py [--repeat N] [--photos N] [--layouts NAME ...] [--methods NAME ...] [--workers N]
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

from photostrip.geodesy.frame_spec import FrameSpec  # noqa: E402
from photostrip.pipeline import Inputs, Settings, Strip, triangulate  # noqa: E402
from photostrip.planning.control_layout import Layout, Spot, numbers_of, spots_of  # noqa: E402
from photostrip.planning.ideal_strip import StripGeometry, ideal_strip  # noqa: E402
from photostrip.planning.strip_methods import DEGREES, METHODS, accuracy, control_of  # noqa: E402
from photostrip.points import ControlPoints  # noqa: E402
from photostrip.simulate.spec import FILM  # noqa: E402
from photostrip.triangulation import polynomial, relative  # noqa: E402

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from photostrip.planning.ideal_strip import IdealStrip

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]

SEED = 20_240
FEWEST = 2  # repetitions that give a scatter
LAYOUTS = {
    "bands every 4": Layout("bands every 4", every=4, sigma=(0.05, 0.05, 0.05)),
    "3 bands": Layout("3 bands", bands=3, sigma=(0.05, 0.05, 0.05)),
    "corners": Layout("corners", kind="corners", sigma=(0.05, 0.05, 0.05)),
    "corners+centre": Layout("corners+centre", kind="corners+centre", sigma=(0.05, 0.05, 0.05)),
    "mixed": Layout(
        "mixed",
        kind="corners",
        spots=(Spot(4, 2, "z"), Spot(6, 1, "xy"), Spot(6, 3, "z"), Spot(8, 2, "xyz")),
        sigma=(0.03, 0.03, 0.05),
    ),
}


@dataclass(frozen=True)
class Task:
    """Some repetitions of one layout."""

    geometry: StripGeometry
    layout: Layout
    methods: tuple[str, ...]
    first: int
    count: int


def repetitions(task: Task) -> dict[str, tuple[Floats, Floats]]:
    """Sum and sum of squares of the errors of all points over some repetitions, by method, (q, 3) each."""
    strip = ideal_strip(task.geometry)
    spots = spots_of(task.layout, task.geometry.photos, task.geometry.points.rows)
    found = {method: (np.zeros_like(strip.xyz), np.zeros_like(strip.xyz)) for method in task.methods}
    for number in range(task.first, task.first + task.count):
        rng = np.random.default_rng([SEED, number])
        inputs = measured(strip, spots, task.layout, rng)
        for method in task.methods:
            error = adjusted(strip, inputs, method) - strip.xyz
            found[method][0][:] += error
            found[method][1][:] += error**2
    return found


def measured(strip: IdealStrip, spots: tuple[Spot, ...], layout: Layout, rng: np.random.Generator) -> Inputs:
    """Give a strip as it would be measured: errors in the image coordinates and in the control."""
    observed = strip.observations
    noise = rng.normal(size=observed.xy.shape) * observed.sigma
    control = control_of(strip, spots, layout.sigma)
    numbers = numbers_of(strip, spots)
    names = tuple(observed.point_ids[strip.formed.point[number]] for number in numbers)
    given = control.enu + rng.normal(size=control.enu.shape) * control.sigma
    return Inputs(
        "plan",
        (Strip("A", strip.geometry.camera, strip.photos),),
        replace(observed, xy=observed.xy + noise),
        ControlPoints(names, given, control.use, control.check, control.sigma),
        (FrameSpec("local", ("east", "north", "up")),),
    )


def adjusted(strip: IdealStrip, inputs: Inputs, method: str) -> Floats:
    """Coordinates of the points of the strip by a whole run."""
    adjustment = "polynomial" if method in DEGREES else method
    settings = Settings(
        relative=relative.Settings(screening="none"),
        polynomial=polynomial.Settings(DEGREES.get(method, "auto")),
        adjustment=adjustment,
    )
    result = triangulate(inputs, settings)
    order = np.searchsorted(result.points.number, strip.formed.point)
    xyz: Floats = result.points.cartesian[order]
    return xyz


def compare(geometry: StripGeometry, layout: Layout, methods: Sequence[str], options: argparse.Namespace) -> None:
    """Print one line for each method."""
    strip = ideal_strip(geometry)
    spots = spots_of(layout, geometry.photos, geometry.points.rows)
    share = -(-options.repeat // (4 * options.workers))
    starts = range(0, options.repeat, share)
    tasks = [Task(geometry, layout, tuple(methods), k, min(share, options.repeat - k)) for k in starts]
    if options.workers > 1:
        with get_context("spawn").Pool(options.workers) as pool:
            parts = pool.map(repetitions, tasks, chunksize=1)
    else:
        parts = list(map(repetitions, tasks))
    for method in methods:
        total, squares = (sum(part[method][k] for part in parts) for k in range(2))
        scatter = np.sqrt(squares / options.repeat - (total / options.repeat) ** 2)
        expected = accuracy(strip, layout, spots, method)
        new = expected.new
        plan, height = (_rms(expected.sigmas[new][:, k]) for k in ((0, 1), (2,)))
        found_plan, found_height = (_rms(scatter[new][:, k]) for k in ((0, 1), (2,)))
        single = expected.sigmas[new] / scatter[new]
        print(
            f"{layout.name:<16} {method:<11} {plan:8.3f} {found_plan:8.3f} {plan / found_plan:7.3f}"
            f" {height:8.3f} {found_height:8.3f} {height / found_height:7.3f}   {single.min():.2f}-{single.max():.2f}"
        )


def _rms(values: Floats) -> float:
    return float(np.sqrt((values**2).sum(axis=1).mean()))


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeat", type=int, default=1000)
    parser.add_argument("--photos", type=int, default=11)
    parser.add_argument("--layouts", nargs="+", default=list(LAYOUTS), choices=list(LAYOUTS))
    parser.add_argument("--methods", nargs="+", default=list(METHODS), choices=list(METHODS))
    parser.add_argument("--workers", type=int, default=1)
    options = parser.parse_args()
    options.repeat = max(options.repeat, FEWEST)
    geometry = StripGeometry(replace(FILM, principal_distance=153.0, fiducials={}), options.photos)
    print(f"{options.photos} photos, 60 % overlap, 1:10000, 5 um; {options.repeat} repetitions of one geometry; metres")
    print("rms over all new points; single: range of predicted over actual of single coordinates\n")
    columns = " ".join(f"{name:>8} {'actual':>8} {'ratio':>7}" for name in ("plan", "height"))
    print(f"{'control':<16} {'method':<11} {columns}   single")
    for name in options.layouts:
        compare(geometry, LAYOUTS[name], options.methods, options)


if __name__ == "__main__":
    main()
