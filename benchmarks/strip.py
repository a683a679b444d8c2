"""How long a strip takes and how much memory: whole processes, the parts of the work, growth with the number of photos.

Simulated film strips with about 30 points on a photo and three control points every five models. A whole process is
timed from its start to its end, reading and writing included, by a small process of its own, so that nothing of this
program counts for it. Parts are timed inside one process, as the command runs them, in seconds of computing: other work
on the machine does not count. Of several repetitions the fastest counts. The numbers hold for the machine; ratios say
more.

Usage: python benchmarks/strip.py [--photos N] [--sizes N ...] [--repeat N]
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import wraps
from importlib import import_module
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run from anywhere, installed or not

from photostrip.threads import limit_threads

limit_threads()  # as the command does, before numpy is imported

import numpy as np  # noqa: E402

from photostrip.formats.output.result_files import result_files  # noqa: E402
from photostrip.formats.output.simulation import inputs_of, project_files  # noqa: E402
from photostrip.formats.text.writing import write_files  # noqa: E402
from photostrip.pipeline import triangulate  # noqa: E402
from photostrip.pipeline.plausibility import gate  # noqa: E402
from photostrip.pipeline.precision import photo_precision  # noqa: E402
from photostrip.project.loading import load_project  # noqa: E402
from photostrip.report import chosen_sections, title_of  # noqa: E402
from photostrip.report.page import console  # noqa: E402
from photostrip.result.document import document_of  # noqa: E402
from photostrip.simulate.simulation import simulate  # noqa: E402
from photostrip.simulate.spec import Control, Flight, Points, Spec  # noqa: E402
from photostrip.triangulation import absolute_orientation  # noqa: E402
from photostrip.triangulation.gross_errors.control import control_screening  # noqa: E402
from photostrip.triangulation.gross_errors.pairs import screening  # noqa: E402
from photostrip.triangulation.image_coordinates import corrections  # noqa: E402
from photostrip.triangulation.polynomial import correction  # noqa: E402
from photostrip.triangulation.relative_orientation.orientation import orient_pairs  # noqa: E402
from photostrip.triangulation.relative_orientation.pairs import collect_pairs  # noqa: E402
from photostrip.triangulation.relative_orientation.solution import iterate_elements, start_values  # noqa: E402

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from photostrip.project.loading import Project

MEGABYTE = 1024  # kilobytes, in which the system counts
PAIR_POINTS = 24
FEW_BANDS = 5
TARGETS = {
    "seconds": 1.5,
    "megabytes": 250.0,
    "pair_us": 100.0,
    "exponent": 1.1,
    "short_strip": 0.5,
    "start": 0.25,
}

LAUNCHER = """
import json, resource, subprocess, sys, time
start = time.perf_counter()
code = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode
seconds = time.perf_counter() - start
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(json.dumps([code, seconds, used.ru_utime + used.ru_stime, used.ru_maxrss]))
"""


# ------------------------------------------------------------------------------------------------ what is run


def spec(photos: int, bands: int | None = None) -> Spec:
    """Give a film strip 1:5000 to the north with 30 points on a photo: 3000 photos are 1300 km.

    Bands of three control points stand at every fifth model, or as many bands as are asked for.
    """
    control = Control(every=5) if bands is None else Control(bands=bands)
    return Spec(
        name=f"{photos} photos",
        flight=Flight(photos=photos, end_lap_percent=62.0, heading_deg=0.0, scale=5000.0),
        points=Points(rows=5, extra_per_model=6, reach_percent=75.0),
        control=control,
    )


def write_project(folder: Path, photos: int, bands: int | None = None) -> tuple[Path, float]:
    """Write a simulated project; give its file and the mean number of points on a photo."""
    simulation = simulate(spec(photos, bands))
    write_files(folder, project_files(simulation))
    return folder / "project.yaml", len(simulation.observations) / photos


# ------------------------------------------------------------------------------------------- whole processes


@dataclass(frozen=True)
class Spent:
    """What a process took: seconds on the clock, seconds of computing, megabytes at the peak."""

    wall: float
    computing: float
    megabytes: float


def process(arguments: Sequence[str], repeat: int) -> Spent:
    """Run an interpreter several times; the fastest counts, and its memory."""
    found, environment = [], {**os.environ, "PYTHONPATH": sys.path[0]}
    for _ in range(repeat):
        launch = [sys.executable, "-S", "-c", LAUNCHER, sys.executable, *arguments]
        done = subprocess.run(launch, capture_output=True, text=True, check=True, env=environment)
        code, wall, computing, kilobytes = json.loads(done.stdout)
        if code:
            message = f"{' '.join(arguments)} ended with {code}"
            raise RuntimeError(message)
        found.append(Spent(wall, computing, kilobytes / MEGABYTE))
    return min(found, key=lambda spent: spent.wall)


def run_process(project: Path, repeat: int) -> Spent:
    """Run ``photostrip run PROJECT -o DIR`` as a process of its own."""
    return process(["-m", "photostrip", "run", str(project), "-o", str(project.parent / "result")], repeat)


# ---------------------------------------------------------------------------------------- parts of the work


@dataclass
class Stopwatch:
    """Seconds by name, collected while functions run."""

    seconds: dict[str, float] = field(default_factory=dict)
    inside: bool = False

    @contextmanager
    def on(self, name: str) -> Iterator[None]:
        """Add the time of a block to a name."""
        start = time.process_time()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.process_time() - start

    @contextmanager
    def watching(self, watched: Sequence[tuple[str, Any, str]]) -> Iterator[None]:
        """Time functions of modules for as long as the block runs: name, module, function."""
        before = [(module, function, getattr(module, function)) for _, module, function in watched]
        for (name, module, function), (_, _, real) in zip(watched, before, strict=True):
            setattr(module, function, self._timed(name, real))
        try:
            yield
        finally:
            for module, function, real in before:
                setattr(module, function, real)

    def _timed(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(function)
        def timed(*arguments: Any, **named: Any) -> Any:  # noqa: ANN401 (whatever the function takes and gives)
            if self.inside:  # the time belongs to the stage that calls
                return function(*arguments, **named)
            self.inside = True
            try:
                with self.on(name):
                    return function(*arguments, **named)
            finally:
                self.inside = False

        return timed


pipeline = import_module("photostrip.pipeline.run")  # the module; the package gives the function
# functions imported by name are timed where they are called
of_strips = import_module("photostrip.pipeline.strips.photos")
common = import_module("photostrip.pipeline.common_points")
screened_formation = import_module("photostrip.pipeline.strips.screened_formation")
strip_network = import_module("photostrip.triangulation.gross_errors.rays.strip_network")
STAGES = (
    ("image coordinates", corrections, "refine"),
    ("collecting pairs", of_strips, "collect_pairs"),
    ("relative orientation", of_strips, "orient_unchecked"),
    ("screening of pairs", screening, "screen_pairs"),
    ("strip formation", of_strips, "form_from_pairs"),
    ("strip formation", screened_formation, "form_from_pairs"),
    ("screening of the strip", strip_network, "wrong_rays"),
    ("screening of control", control_screening, "screen_control"),
    ("absolute orientation", absolute_orientation, "orient"),
    ("polynomial", correction, "fit"),
    ("resection", of_strips, "resect"),
    ("points of all strips", common, "_joined"),
    ("differences at given points", pipeline, "compare_with_given"),
    ("points without coordinates", pipeline, "not_determined"),
    ("standard deviations", photo_precision, "of_photos"),
    ("search for mistakes", gate, "of_result"),
)
WHOLE = "triangulate"
FILES = "writing files"


@contextmanager
def no_collector() -> Iterator[None]:
    """Keep the garbage collector away, as the command does."""
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def parts(project: Path) -> dict[str, float]:
    """Do what the command does, once, and time each part."""
    watch = Stopwatch()
    with no_collector():
        with watch.on("reading"):
            loaded = load_project(project)
        with watch.watching(STAGES), watch.on(WHOLE):
            result = triangulate(loaded.inputs, loaded.settings)
        with watch.on("result document"):
            document = document_of(result, loaded.hints)
        with watch.on("result as text"):
            files = result_files(document, loaded.resolved)
        with watch.on(FILES):
            write_files(project.parent / "parts", files)
        with watch.on("report"):
            console.print_report(title_of(document), chosen_sections(document), StringIO(), None)
    return watch.seconds


def fastest(rounds: Sequence[dict[str, float]]) -> dict[str, float]:
    """Give the fastest round of each part."""
    return {name: min(each[name] for each in rounds) for name in rounds[0]}


def triangulation(project: Project, repeat: int) -> float:
    """Give the seconds of the pipeline alone."""
    found = []
    for _ in range(repeat):
        with no_collector():
            start = time.process_time()
            triangulate(project.inputs, project.settings)
            found.append(time.process_time() - start)
    return min(found)


def pairs_in_one_batch(pairs: int, repeat: int) -> tuple[float, float, float]:
    """Orient pairs of 24 points: microseconds a pair for everything, for the iteration alone, and one by one."""
    simulation = simulate(
        Spec(
            flight=Flight(photos=pairs + 1, end_lap_percent=64.0, heading_deg=0.0, scale=5000.0),
            points=Points(rows=6, extra_per_model=13),
        )
    )
    strip = inputs_of(simulation).strips[0]
    found = collect_pairs(simulation.observations, strip.photos, strip.camera.principal_distance)
    kept = np.flatnonzero(np.arange(len(found.pair)) - found.starts[found.pair] < PAIR_POINTS)
    batch = found.without(~np.isin(np.arange(len(found.pair)), kept))
    if np.bincount(batch.pair).min() < PAIR_POINTS:
        raise RuntimeError("a pair has too few points")
    whole, inner = [], []
    for _ in range(repeat):
        start = time.process_time()
        orient_pairs(batch, strip.photos)
        whole.append(time.process_time() - start)
        start = time.process_time()
        iterate_elements(start_values(batch), batch)
        inner.append(time.process_time() - start)
    some = min(pairs, 50)
    start = time.process_time()
    for number in range(some):
        orient_pairs(batch.take(np.array([number])), strip.photos[number : number + 2])
    alone = time.process_time() - start
    return 1e6 * min(whole) / pairs, 1e6 * min(inner) / pairs, 1e6 * alone / some


# ----------------------------------------------------------------------------------------------- printing


def line(title: str, value: str, target: str = "", ratio: float | None = None) -> None:
    """Print one number with its target and their ratio."""
    tail = f"   target {target}, ratio {ratio:.2f}" if ratio is not None else ""
    print(f"{title:<58}{value:>12}{tail}", flush=True)


def print_start(repeat: int) -> float:
    """Print how long it takes until something can happen; give the time of a bare interpreter."""
    bare = process(["-c", "pass"], 3 * repeat)
    line("python -c pass", f"{bare.wall:.3f} s")
    for option in ("--version", "--help"):
        spent = process(["-m", "photostrip", option], 3 * repeat)
        over = spent.wall - bare.wall
        line(f"photostrip {option}, over that", f"{over:.3f} s", "0.25 s", over / TARGETS["start"])
    rooms = ("cli.commands.run", "project.loading", "formats.output.result_files", "report.page.console")
    modules = ", ".join(f"photostrip.{room}" for room in rooms)
    loaded = process(["-c", f"import {modules}"], 3 * repeat)
    line("importing everything that a run needs, over that", f"{loaded.wall - bare.wall:.3f} s")
    print()
    return bare.wall


def print_whole(title: str, spent: Spent, bare: float, limits: tuple[float, float | None]) -> None:
    """Print one run of the command."""
    seconds, megabytes = limits
    line(f"{title}: whole run", f"{spent.wall:.3f} s", f"{seconds} s", spent.wall / seconds)
    line("    of it computing", f"{spent.computing:.3f} s")
    line("    in units of a bare interpreter", f"{spent.wall / bare:.0f}")
    if megabytes is None:
        line("    peak memory", f"{spent.megabytes:.0f} MB")
    else:
        line("    peak memory", f"{spent.megabytes:.0f} MB", f"{megabytes:.0f} MB", spent.megabytes / megabytes)


def print_parts(found: dict[str, float], photos: int) -> None:
    """Print the parts of the work with their shares."""
    inner = [name for name, _, _ in STAGES if name in found]
    rest = found[WHOLE] - sum(found[name] for name in inner)
    outer = [name for name in found if name not in inner]
    total = sum(found[name] for name in outer)
    print(f"\n{'parts, control every 5 models':<40}{'seconds':>10}{'share':>9}{'us a photo':>13}")
    for name in outer:
        rows = [(name, found[name])]
        if name == WHOLE:
            rows += [(f"    {each}", found[each]) for each in inner] + [("    all else", rest)]
        for title, seconds in rows:
            print(f"{title:<40}{seconds:>10.4f}{seconds / total:>8.1%}{1e6 * seconds / photos:>13.1f}")
    print(f"{'sum':<40}{total:>10.4f}{1:>8.1%}{1e6 * total / photos:>13.1f}\n", flush=True)


def exponent(sizes: Sequence[int], seconds: Sequence[float]) -> float:
    """Give the slope of a straight line through the logarithms."""
    return float(np.polyfit(np.log(sizes), np.log(seconds), 1)[0])


def print_growth(folder: Path, sizes: Sequence[int], repeat: int) -> None:
    """Print how the time grows with the number of photos."""
    print(f"{'photos':>8}{'points a photo':>16}{'triangulate':>14}{'ms a photo':>12}{'whole run':>12}{'memory':>10}")
    inside, whole = [], []
    for photos in sizes:
        project, points = write_project(folder / str(photos), photos)
        inside.append(triangulation(load_project(project), repeat))
        spent = run_process(project, repeat)
        whole.append(spent.wall)
        row = f"{photos:>8}{points:>16.1f}{inside[-1]:>12.3f} s{1e3 * inside[-1] / photos:>12.3f}{spent.wall:>10.3f} s"
        print(f"{row}{spent.megabytes:>7.0f} MB", flush=True)
    print()
    for title, seconds in (("triangulate", inside), ("whole run", whole)):
        value = exponent(sizes, seconds)
        name = f"exponent of {title} from {sizes[0]} to {sizes[-1]} photos"
        line(name, f"{value:.2f}", f"{TARGETS['exponent']}", value / TARGETS["exponent"])


def main() -> None:
    """Read the options and print the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--photos", type=int, default=1000, help="photos of the long strip (default 1000)")
    parser.add_argument("--sizes", type=int, nargs="+", default=[100, 300, 1000, 3000], help="sizes for the growth")
    parser.add_argument("--repeat", type=int, default=3, help="repetitions, of which the fastest counts (default 3)")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        bare = print_start(options.repeat)
        short, _ = write_project(folder / "short", 20)
        print_whole("20 photos", run_process(short, options.repeat), bare, (TARGETS["short_strip"], None))
        project, points = write_project(folder / "long", options.photos)
        title = f"{options.photos} photos x {points:.0f} points"
        few, _ = write_project(folder / "few", options.photos, FEW_BANDS)
        limits = TARGETS["seconds"], TARGETS["megabytes"]
        print_whole(f"{title}, {FEW_BANDS} bands of control", run_process(few, options.repeat), bare, limits)
        print_whole(f"{title}, control every 5 models", run_process(project, options.repeat), bare, limits)
        print_parts(fastest([parts(project) for _ in range(options.repeat)]), options.photos)
        whole, inner, alone = pairs_in_one_batch(options.photos, options.repeat)
        text = f"relative orientation, {options.photos} pairs of {PAIR_POINTS} points in one batch"
        line(text, f"{whole:.0f} us", "100 us", whole / TARGETS["pair_us"])
        line("    of it the iteration", f"{inner:.0f} us")
        line("    the same one pair after the other", f"{alone:.0f} us")
        print()
        print_growth(folder, options.sizes, options.repeat)


if __name__ == "__main__":
    main()
