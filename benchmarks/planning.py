"""How well plans agree with simulated measurements: one geometry, thousands of measurements of it.

For each layout of control and each method the standard deviations that `photostrip plan strip` predicts stand beside
the scatter of adjusted points over all repetitions of whole runs (the bundle: over repetitions of its adjustment). The
part on one model does the same for `photostrip plan model`, with the exact relative orientation, intersection and
absolute orientation of every repetition. The part on flown strips tells how well the ideal geometry of a plan speaks
for strips with tilts, relief and scattered points.

Usage: python benchmarks/planning.py [--part model strip flown] [--repeat N] [--models N]
       [--layouts NAME ...] [--methods NAME ...] [--workers N]
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
from photostrip.geodesy.tying import tie_frames  # noqa: E402
from photostrip.network.solve import solve  # noqa: E402
from photostrip.pipeline.inputs import Inputs, Settings, Strip  # noqa: E402
from photostrip.pipeline.run import triangulate  # noqa: E402
from photostrip.pipeline.strips.adjusting import adjust_formed  # noqa: E402
from photostrip.pipeline.strips.photos import form_strip  # noqa: E402
from photostrip.planning.model.plan import (  # noqa: E402
    LAYOUTS as MODEL_LAYOUTS,
)
from photostrip.planning.model.plan import (  # noqa: E402
    ControlPoint,
    ModelSpec,
    control_layout,
    plan_model,
    standard_zones,
)
from photostrip.planning.model.single_model import ModelControl, orientation_operator  # noqa: E402
from photostrip.planning.strip.ideal_strip import ControlLayout, Spot, StripGeometry, ideal_strip, numbers_of, spots_of  # noqa: E402  # noqa: E402
from photostrip.planning.strip.methods import (  # noqa: E402
    BUNDLE,
    DEGREES,
    METHODS,
    accuracy,
    bundle_problem,
    control_of,
)
from photostrip.points import ControlPoints  # noqa: E402
from photostrip.simulation import Control as SimulatedControl  # noqa: E402
from photostrip.simulation import Flight, Ground, Image, Spec, simulate  # noqa: E402
from photostrip.simulation.spec import FILM  # noqa: E402
from photostrip.strip.polynomial import correction  # noqa: E402
from photostrip.strip.relative_orientation.orientation import RelativeSettings, orient_unchecked  # noqa: E402
from photostrip.strip.relative_orientation.pairs import Pairs  # noqa: E402
from photostrip.strip.strip_formation.strip import model_points  # noqa: E402
from tests.simulated import inputs_of  # noqa: E402

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from photostrip.planning.strip.ideal_strip import IdealStrip
    from photostrip.planning.strip.ideal_strip import Spot as ControlSpot

    Floats = NDArray[np.float64]

SEED = 20_240
FEWEST = 2  # repetitions that give a scatter
FOCAL = 153.0
MODEL_REPETITIONS = 4000
FLOWN_SHARE = 10  # repetitions for each strip that is flown differently
SIGMA = (0.05, 0.05, 0.05)
GNSS = (0.05, 0.05, 0.08)
OFFSET = (0.3, -0.2, 0.5)  # m, of measured perspective centres, which the bundle is to find
LIMIT = 3.29  # of a test at 0.1 %


def layouts(photos: int) -> dict[str, ControlLayout]:
    """Layouts of control by name, for a strip of so many photos."""
    middle, third, last = (photos + 1) // 2, 1 + (photos - 1) // 3, photos - (photos - 1) // 3
    heights = tuple(Spot(photo, row, "z") for photo in (third, last) for row in (1, 5))
    return {
        "bands every 4": ControlLayout("bands every 4", every=4, sigma=SIGMA),
        "3 bands": ControlLayout("3 bands", bands=3, sigma=SIGMA),
        "corners": ControlLayout("corners", kind="corners", sigma=SIGMA),
        "corners+centre": ControlLayout("corners+centre", kind="corners+centre", sigma=SIGMA),
        "corners, heights": ControlLayout("corners, heights", kind="corners+centre", spots=heights, sigma=SIGMA),
        "mixed": ControlLayout(
            "mixed",
            kind="corners",
            spots=(Spot(third, 3, "z"), Spot(middle, 1, "xy"), Spot(middle, 5, "z"), Spot(last, 3)),
            sigma=(0.03, 0.03, 0.05),
        ),
        "corners, GNSS": ControlLayout("corners, GNSS", kind="corners", sigma=SIGMA, gnss=GNSS),
    }


# ------------------------------------------------------------------------------------------------------- strips


@dataclass(frozen=True)
class Task:
    """Some repetitions of some layouts."""

    geometry: StripGeometry
    layouts: tuple[ControlLayout, ...]
    methods: tuple[str, ...]
    first: int
    count: int


def methods_for(layout: ControlLayout, methods: Sequence[str]) -> tuple[str, ...]:
    """Methods that use what a layout gives: perspective centres are for the bundle alone."""
    return tuple(each for each in methods if layout.gnss is None or each == BUNDLE)


def repetitions(task: Task) -> dict[tuple[str, str], tuple[Floats, Floats]]:
    """Sum and sum of squares of the errors of all points over some repetitions, (q, 3) each, by layout and method.

    Every strip is formed once from its measurements, and taken to the ground by all layouts and methods.
    """
    strip = ideal_strip(task.geometry)
    chosen = [(layout, method) for layout in task.layouts for method in methods_for(layout, task.methods)]
    found = {(layout.name, method): (np.zeros_like(strip.xyz), np.zeros_like(strip.xyz)) for layout, method in chosen}
    spots = {layout.name: spots_of(layout, task.geometry.photos, task.geometry.points.rows) for layout in task.layouts}
    frames, _ = tie_frames([FrameSpec("local", ("east", "north", "up"))])
    for number in range(task.first, task.first + task.count):
        rng = np.random.default_rng([SEED, number])
        noise = rng.normal(size=strip.observations.xy.shape) * strip.observations.sigma
        formed = None
        for layout, method in chosen:
            drawn = np.random.default_rng([SEED, number, 1])  # the control of a layout is the same for all methods
            inputs = measured(strip, spots[layout.name], layout, noise, drawn)
            if method == BUNDLE:
                solved = bundled(strip, layout, inputs, drawn)
            else:
                wanted = run_settings(method)
                formed = formed or form_strip(inputs.strips[0], inputs.observations, wanted)
                solved = adjust_formed(formed, inputs.control, frames, wanted).cartesian
            error = solved - strip.xyz
            found[layout.name, method][0][:] += error
            found[layout.name, method][1][:] += error**2
    return found


def measured(
    strip: IdealStrip, spots: tuple[ControlSpot, ...], layout: ControlLayout, noise: Floats, rng: np.random.Generator
) -> Inputs:
    """Give a strip as it would be measured: errors in the image coordinates and in the control."""
    observed = strip.observations
    control = control_of(strip, spots, layout.sigma)
    names = tuple(observed.point_ids[strip.formed.point[number]] for number in numbers_of(strip, spots))
    given = control.enu + rng.normal(size=control.enu.shape) * control.sigma
    return Inputs(
        "plan",
        (Strip("A", strip.geometry.camera, strip.photos),),
        replace(observed, xy=observed.xy + noise),
        ControlPoints(names, given, control.use, control.check, control.sigma),
        (FrameSpec("local", ("east", "north", "up")),),
    )


def run_settings(method: str) -> Settings:
    """Give settings of a run by one of the methods, without a search for gross errors."""
    return Settings(
        relative=RelativeSettings(screening="none"),
        polynomial=correction.PolynomialSettings(DEGREES.get(method, "auto")),
        adjustment="polynomial" if method in DEGREES else method,
        precision=False,  # it is what the plan says that is compared with the scatter
    )


def bundled(strip: IdealStrip, layout: ControlLayout, inputs: Inputs, rng: np.random.Generator) -> Floats:
    """Coordinates of the points of the strip by a bundle adjustment that starts at the truth."""
    control = inputs.control
    names = [inputs.observations.point_ids[number] for number in strip.formed.point]
    numbers = np.array([names.index(name) for name in control.ids], np.intp)
    problem = bundle_problem(strip, layout, numbers, control)
    seen = np.isin(inputs.observations.point, strip.formed.point)
    given = np.where(control.use, control.enu, strip.xyz[numbers])
    problem = replace(
        problem,
        images=replace(problem.images, xy=inputs.observations.xy[seen]),
        control=replace(problem.control, xyz=given),
    )
    if layout.gnss is not None:
        positions = strip.centers + OFFSET + rng.normal(size=strip.centers.shape) * layout.gnss
        problem = replace(problem, positions=replace(problem.positions, xyz=positions))
    xyz: Floats = solve(problem).points
    return xyz


def compare(geometry: StripGeometry, chosen: tuple[ControlLayout, ...], options: argparse.Namespace) -> None:
    """Print one line for each layout and method."""
    strip = ideal_strip(geometry)
    share = -(-options.repeat // (4 * options.workers))
    starts = range(0, options.repeat, share)
    tasks = [Task(geometry, chosen, tuple(options.methods), k, min(share, options.repeat - k)) for k in starts]
    if options.workers > 1:
        with get_context("spawn").Pool(options.workers) as pool:
            parts = pool.map(repetitions, tasks, chunksize=1)
    else:
        parts = list(map(repetitions, tasks))
    for layout in chosen:
        spots = spots_of(layout, geometry.photos, geometry.points.rows)
        for method in methods_for(layout, options.methods):
            total, squares = (sum(part[layout.name, method][k] for part in parts) for k in range(2))
            scatter = np.sqrt(squares / options.repeat - (total / options.repeat) ** 2)
            expected = accuracy(strip, layout, spots, method)
            print(line(f"{layout.name:<16} {method:<11}", expected.sigmas[expected.new], scatter[expected.new]))


def line(head: str, expected: Floats, scatter: Floats) -> str:
    """Predicted and actual rms in plan and height, their ratios, and the range of the ratios of single coordinates."""
    parts = [head]
    for columns in ((0, 1), (2,)):
        predicted, actual = (_rms(values[:, columns]) for values in (expected, scatter))
        parts.append(f"{predicted:8.3f} {actual:8.3f} {predicted / actual:7.3f}")
    single = expected / scatter
    return f"{' '.join(parts)}   {single.min():.2f}-{single.max():.2f}"


def _rms(values: Floats) -> float:
    return float(np.sqrt((values**2).sum(axis=1).mean()))


def strips(options: argparse.Namespace) -> None:
    """Print the table of strips."""
    geometry = StripGeometry(replace(FILM, principal_distance=FOCAL, fiducials={}), options.models + 1)
    print(f"{options.models} models, 60 % overlap, 1:10000, 5 um; {options.repeat} repetitions; metres")
    print(f"{'control':<16} {'method':<11} {HEAD}")
    known = layouts(options.models + 1)
    compare(geometry, tuple(known[name] for name in options.layouts), options)


# -------------------------------------------------------------------------------------------------- flown strips


def flown(options: argparse.Namespace) -> None:
    """Print how well the ideal geometry speaks for strips as they are flown: tilts, relief, scattered points."""
    count = max(options.repeat // FLOWN_SHARE, FEWEST)
    geometry = StripGeometry(replace(FILM, principal_distance=FOCAL, fiducials={}), options.models + 1)
    strip = ideal_strip(geometry)
    print(f"{options.models} models flown {count} times: tilts 1 deg, relief 60 m, scattered points; metres")
    print(f"{'control':<16} {'method':<11} {HEAD.removesuffix('   single')}")
    for bands in (3, 4):
        layout = ControlLayout(f"{bands} bands", bands=bands, sigma=SIGMA)
        spots = spots_of(layout, geometry.photos, geometry.points.rows)
        for method in [each for each in options.methods if each != BUNDLE]:
            errors = np.vstack([flown_errors(geometry, layout, method, seed) for seed in range(1, count + 1)])
            expected = accuracy(strip, layout, spots, method)
            parts = [f"{layout.name:<16} {method:<11}"]
            for columns in ((0, 1), (2,)):
                predicted, actual = _rms(expected.sigmas[expected.new][:, columns]), _rms(errors[:, columns])
                parts.append(f"{predicted:8.3f} {actual:8.3f} {predicted / actual:7.3f}")
            print(" ".join(parts))


def flown_errors(geometry: StripGeometry, layout: ControlLayout, method: str, seed: int) -> Floats:
    """Errors along, across and up of the new points of one simulated strip."""
    spec = Spec(
        seed=seed,
        camera=geometry.camera,
        ground=Ground(crs="local"),
        flight=Flight(photos=geometry.photos, end_lap_percent=geometry.end_lap_percent, scale=geometry.scale),
        points=replace(geometry.points, scatter_percent=25.0),
        control=SimulatedControl(bands=layout.bands, per_band=layout.per_band, sigma=layout.sigma, check=0),
        image=Image(sigma_um=geometry.image_sigma * 1000),
    )
    simulation = simulate(spec)
    result = triangulate(inputs_of(simulation), run_settings(method))
    number = result.points.number
    fixed = set(simulation.control.ids)
    new = np.array([simulation.observations.point_ids[n] not in fixed for n in number])
    errors: Floats = (result.points.cartesian - simulation.truth.points.xyz[number])[new]
    return errors


# ---------------------------------------------------------------------------------------------------- one model

HEAD = " ".join(f"{name:>8} {'actual':>8} {'ratio':>7}" for name in ("plan", "height")) + "   single"


def models(options: argparse.Namespace) -> None:
    """Print the table of one model."""
    mixed = (
        ControlPoint((0.0, 80.0), use="xyz"),
        ControlPoint((92.0, -80.0), use="xyz"),
        ControlPoint((90.0, 70.0), use="z"),
        ControlPoint((5.0, -75.0), use="xy"),
        ControlPoint((40.0, 0.0), use="z"),
    )
    count = max(MODEL_REPETITIONS, FEWEST) if options.repeat >= 1000 else options.repeat
    print(f"one model, b = a = 92 mm, 1:10000, 5 um, six standard points; {count} repetitions; metres")
    print(f"{'control':<16} {'points':<11} {HEAD}")
    for name in (*MODEL_LAYOUTS, "mixed"):
        points = control_layout(name, 92, 92) if name in MODEL_LAYOUTS else mixed
        spec = ModelSpec(FOCAL, 92.0, 92.0, control=points, control_sigma=SIGMA)
        forecast = plan_model(spec)
        scatter = measured_models(spec, forecast.places, count)
        new = len(forecast.places)
        print(line(f"{name:<16} {'new':<11}", forecast.sigmas, scatter[:new]))
        print(line(f"{name:<16} {'control':<11}", forecast.at_control, scatter[new:]))


def measured_models(spec: ModelSpec, places: Floats, count: int) -> Floats:
    """Scatter in metres of new points and control of a model that is measured, oriented and fitted many times."""
    rng = np.random.default_rng(SEED)
    six, at = np.array(standard_zones(spec.base, spec.width)), np.array([point.at for point in spec.control])
    every = np.vstack([six, places, at])
    n = len(every)
    left = np.tile(every, (count, 1)) + spec.image_sigma * rng.normal(size=(count * n, 2))
    right = np.tile(every - (spec.base, 0.0), (count, 1)) + spec.image_sigma * rng.normal(size=(count * n, 2))
    weight = np.tile(np.arange(n) < len(six), count).astype(float)
    pairs = Pairs(
        starts=np.arange(count) * n,
        pair=np.repeat(np.arange(count), n),
        left=left,
        right=right,
        weight=weight,
        focal=spec.focal,
        point=np.tile(np.arange(n), count),
        rows=np.zeros((count * n, 2), np.intp),
    )
    oriented, _ = orient_unchecked(pairs)
    vectors = model_points(oriented).vectors
    direction, _ = oriented.relative
    model = vectors.reshape(count, n, 3) * (spec.base / direction[:, :1])[:, :, None]
    error = (model - np.column_stack([every, np.full(n, -spec.focal)]))[:, len(six) :]
    control = ModelControl(
        np.column_stack([at, np.full(len(at), spec.focal)]),
        np.array(["xy" in point.use for point in spec.control]),
        np.array(["z" in point.use for point in spec.control]),
        np.zeros((len(at), 3, 3)),
        np.zeros((len(at), 3, 3)),
    )
    where = np.column_stack([every[len(six) :], np.full(n - len(six), spec.focal)])
    given = rng.normal(size=(count, len(at), 3)) * spec.control_sigma / spec.ground_unit
    misclosure = error[:, len(places) :] - given
    fitted = error - np.einsum("qanb,rnb->rqa", orientation_operator(where, control), misclosure)
    scatter: Floats = fitted.std(axis=0) * spec.ground_unit
    return scatter


PARTS = {"model": models, "strip": strips, "flown": flown}


def main() -> None:
    """Print the tables."""
    known = layouts(9)
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--part", nargs="+", default=list(PARTS), choices=list(PARTS))
    parser.add_argument("--repeat", type=int, default=1000)
    parser.add_argument("--models", type=int, default=8)
    parser.add_argument("--layouts", nargs="+", default=list(known), choices=list(known))
    parser.add_argument("--methods", nargs="+", default=list(METHODS), choices=list(METHODS))
    parser.add_argument("--workers", type=int, default=1)
    options = parser.parse_args()
    options.repeat = max(options.repeat, FEWEST)
    print("predicted and actual standard deviations, rms over all points; plan: both coordinates together;")
    print("single: range of predicted over actual of single coordinates\n")
    for part in options.part:
        PARTS[part](options)
        print()


if __name__ == "__main__":
    main()
