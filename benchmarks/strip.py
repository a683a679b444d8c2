"""How long runs take and how much memory: whole processes, growth with the number of photos, the parts of the work.

Simulated film strips with about 30 points on a photo and, as users have them, one check point for each photo. A whole
process is timed in seconds of computing, reading and writing included, by a small process of its own, so that nothing
of this program counts for it. The unit is L, a bare ``import numpy, yaml, pyproj``, timed in turn with the rows: a busy
machine makes both slower. Of several repetitions the fastest counts.

Usage: python benchmarks/strip.py [--rows NAME ...] [--photos N] [--sizes N ...] [--folds] [--adjustment METHOD]
       [--repeat N]
"""

from __future__ import annotations

import argparse
import csv
import gc
import json
import os
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial, wraps
from importlib import import_module
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run from anywhere, installed or not

from photostrip.threads import limit_threads

limit_threads()  # as the command does, before numpy is imported

import numpy as np  # noqa: E402

from photostrip.formats.output.result_json import read_result  # noqa: E402
from photostrip.formats.output.simulation import project_files  # noqa: E402
from photostrip.formats.text.writing import write_files  # noqa: E402
from photostrip.library.result import Result  # noqa: E402
from photostrip.pipeline import precision  # noqa: E402
from photostrip.pipeline.plausibility import gate  # noqa: E402
from photostrip.pipeline.run import triangulate  # noqa: E402
from photostrip.project.loading import load_project  # noqa: E402
from photostrip.report.page import console  # noqa: E402
from photostrip.report.sections.accuracy_report import chosen_sections, title_of  # noqa: E402
from photostrip.result.document import document_of  # noqa: E402
from photostrip.simulation.simulation import simulate  # noqa: E402
from photostrip.simulation.spec import Control, Flight, Gnss, Points, Spec  # noqa: E402
from photostrip.strip import (  # noqa: E402
    absolute_orientation,
    polynomial,
)
from photostrip.strip.gross_errors import control_screening, pair_screening  # noqa: E402
from photostrip.strip.image_coordinates import corrections  # noqa: E402
from photostrip.strip.relative_orientation.orientation import orient_pairs  # noqa: E402
from photostrip.strip.relative_orientation.pairs import collect_pairs  # noqa: E402
from photostrip.strip.relative_orientation.solution import iterate_elements, start_values  # noqa: E402
from tests.simulated import inputs_of  # noqa: E402

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from photostrip.project.loading import Project

MEGABYTE = 1024  # kilobytes, in which the system counts
PAIR_POINTS = 24
UNIT = "import numpy, yaml, pyproj"
EXPONENT = 1.05  # at most, of whole runs from the first to the last of the sizes
GROWTH_SCALE = 1500.0  # of the strips that grow: 10 000 photos are 1300 km
FAILED = 1  # exit code of a run whose verdict is that: all work is done
MANY_CONTROL = 1300  # points, of which each belongs to one of ten groups left out
METHODS = ("polynomial", "bundle")
POINT_KB = 2.0  # at most, for one more check point

LAUNCHER = """
import json, resource, subprocess, sys
code = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(json.dumps([code, used.ru_utime + used.ru_stime, used.ru_maxrss]))
"""


# ------------------------------------------------------------------------------------------------ what is run


@dataclass(frozen=True)
class Row:
    """A whole process of the table."""

    title: str
    spec: Spec
    most: float | None = None  # units of L at most
    megabytes: float | None = None  # at most
    command: str = "run"
    adjustment: str = "polynomial"
    options: tuple[str, ...] = ()


def strip_spec(photos: int, every: int, *, check: int | None = None, extra: int = 6, scale: float = 5000.0) -> Spec:
    """Give a film strip to the north with 30 points on a photo: 3000 photos 1:5000 are 1300 km.

    every: models from one band of three control points to the next.
    check: check points; one for each photo where that is not said.
    extra: points of each model beside the five rows of Gruber points.
    """
    return Spec(
        name=f"{photos} photos",
        flight=Flight(photos=photos, end_lap_percent=62.0, heading_deg=0.0, scale=scale),
        points=Points(rows=5, extra_per_model=extra, reach_percent=75.0),
        control=Control(every=every, check=photos if check is None else check),
    )


BLOCK = Spec(
    name="block",
    flight=Flight(photos=40, strips=10, end_lap_percent=62.0, heading_deg=0.0, scale=5000.0),
    points=Points(rows=5, extra_per_model=6, reach_percent=90.0),
    control=Control(check=100),
    gnss=Gnss(use=True),
)
DENSE, SPARSE = strip_spec(1000, 5), strip_spec(1000, 200)
LIDAR = {count: strip_spec(300, 60, check=count, extra=extra) for count, extra in ((10_000, 40), (50_000, 180))}
ROWS = {
    "short": Row("20 photos", strip_spec(20, 5), 5.0),
    "dense": Row("1000 photos, band every 5 models, polynomial", DENSE, 8.0, 200.0),
    "sparse": Row("1000 photos, band every 200 models, polynomial", SPARSE, 8.0, 200.0),
    "dense-bundle": Row("1000 photos, every 5, bundle", DENSE, 12.0, 210.0, adjustment="bundle"),
    "sparse-bundle": Row("1000 photos, every 200, bundle", SPARSE, 12.0, 210.0, adjustment="bundle"),
    "long": Row("3000 photos, band every 600 models", strip_spec(3000, 600), 20.0, 400.0),
    "block": Row("bundle block 10 x 40 with GNSS", BLOCK, adjustment="bundle"),
    "check": Row("check of 1000 photos", DENSE, 4.0, command="check"),
    **{
        f"lidar-{count}-{method}": Row(f"300 photos, {count} check points, {method}", spec, adjustment=method)
        for method in ("polynomial", "auto")
        for count, spec in LIDAR.items()
    },
}


def write_project(folder: Path, spec: Spec) -> Path:
    """Write a simulated project; give its file."""
    write_files(folder, project_files(simulate(spec)))
    return folder / "project.yaml"


# ------------------------------------------------------------------------------------------- whole processes


@dataclass(frozen=True)
class Spent:
    """What a process took: seconds of computing, the unit in the same minute, megabytes at the peak."""

    computing: float
    unit: float
    megabytes: float

    @property
    def units(self) -> float:
        """Seconds of computing in units of L."""
        return self.computing / self.unit


def process(arguments: Sequence[str]) -> tuple[float, float]:
    """Run an interpreter: seconds of computing, and megabytes at the peak."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    launch = [sys.executable, "-S", "-c", LAUNCHER, sys.executable, *arguments]
    environment["PYTHONPATH"] = sys.path[0]
    done = subprocess.run(launch, capture_output=True, text=True, check=True, env=environment)
    code, computing, kilobytes = json.loads(done.stdout)
    if code not in {0, FAILED}:
        message = f"{' '.join(arguments)} ended with {code}"
        raise RuntimeError(message)
    return computing, kilobytes / MEGABYTE


def whole_run(project: Path, row: Row, repeat: int) -> Spent:
    """Run the command as processes of their own, in turn with the unit; the fastest of each counts."""
    arguments = ["-m", "photostrip", row.command, str(project), *row.options]
    if row.command == "run":
        arguments += ["-o", str(project.parent / "result"), f"--set=processing.adjustment={row.adjustment}"]
    units, found = [process(["-c", UNIT])[0]], []
    for _ in range(repeat):
        found.append(process(arguments))
        units.append(process(["-c", UNIT])[0])
    computing, megabytes = min(found)
    return Spent(computing, min(units), megabytes)


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
on_control = import_module("photostrip.pipeline.strips.photos_on_control")
common = import_module("photostrip.pipeline.common_points")
screened_formation = import_module("photostrip.pipeline.strips.photos")
strip_network = import_module("photostrip.network.strip_rays")
STAGES = (
    ("image coordinates", corrections, "refine"),
    ("collecting pairs", of_strips, "collect_pairs"),
    ("relative orientation", of_strips, "orient_unchecked"),
    ("screening of pairs", pair_screening, "screen_pairs"),
    ("strip formation", of_strips, "form_from_pairs"),
    ("strip formation", screened_formation, "form_from_pairs"),
    ("screening of the strip", strip_network, "wrong_rays"),
    ("screening of control", control_screening, "screen_control"),
    ("absolute orientation", absolute_orientation, "orient"),
    ("polynomial", polynomial, "fit"),
    ("resection", on_control, "resect"),
    ("points of all strips", common, "_joined"),
    ("differences at given points", pipeline, "compare_with_given"),
    ("points without coordinates", pipeline, "not_determined"),
    ("standard deviations", precision, "of_photos"),
    ("search for mistakes", gate, "of_result"),
)
WHOLE = "triangulate"
FILES = "writing files"
IMPORTS = "start and imports"
ROOMS = ("cli.commands.run", "project.loading", "formats.output.result_files", "report.page.console", "result.document")


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
    watch.seconds[IMPORTS] = process(["-c", f"import {', '.join(f'photostrip.{room}' for room in ROOMS)}"])[0]
    with no_collector():
        with watch.on("reading"):
            loaded = load_project(project)
        with watch.watching(STAGES), watch.on(WHOLE):
            result = triangulate(loaded.inputs, loaded.settings)
        with watch.on("result document"):
            document = document_of(result, loaded.hints)
        with watch.on("result as text"):
            files = Result(document, resolved=loaded.resolved).files()
        with watch.on(FILES):
            write_files(project.parent / "parts", files)
        with watch.on("reading result.json again"):
            read_result(str(project.parent / "parts" / "result.json"))
        with watch.on("report"):
            console.print_report(title_of(document), chosen_sections(document), StringIO(), None)
    return watch.seconds


def near_limits(project: Path, repeat: int) -> dict[str, float]:
    """Seconds that a library alone needs for parts of the work: what they could come near to."""
    tables = [path.read_text() for path in sorted(project.parent.glob("*.csv"))]
    files = {path.name: path.read_text() for path in sorted((project.parent / "parts").iterdir())}
    document = json.loads(files["result.json"])

    work: dict[str, Callable[[], object]] = {
        "reading": lambda: [list(csv.reader(StringIO(text))) for text in tables],
        "result as text": partial(json.dumps, document),
        FILES: lambda: [(project.parent / "copy").write_text(text) for text in files.values()],
        "reading result.json again": partial(json.loads, files["result.json"]),
    }
    found = {IMPORTS: min(process(["-c", UNIT])[0] for _ in range(repeat))}
    for name, once in work.items():
        seconds = []
        for _ in range(repeat):
            start = time.process_time()
            once()
            seconds.append(time.process_time() - start)
        found[name] = min(seconds)
    return found


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


def print_rows(folder: Path, names: Sequence[str], repeat: int) -> dict[str, Spent]:
    """Print the table of whole processes; give what they took."""
    print(f"{'whole processes':<50}{'seconds':>9}{'L':>8}{'at most':>9}{'MB':>7}{'at most':>9}")
    found, projects = {}, {}
    for name in names:
        row = ROWS[name]
        if id(row.spec) not in projects:
            projects[id(row.spec)] = write_project(folder / name, row.spec)
        found[name] = spent = whole_run(projects[id(row.spec)], row, repeat)
        most, megabytes = (f"{limit:g}" if limit else "" for limit in (row.most, row.megabytes))
        numbers = f"{spent.computing:>9.2f}{spent.units:>8.1f}{most:>9}{spent.megabytes:>7.0f}{megabytes:>9}"
        print(f"{row.title:<50}{numbers}", flush=True)
    print(f"{'L: ' + UNIT:<50}{min(spent.unit for spent in found.values()):>9.2f}\n", flush=True)
    for method in ("polynomial", "auto"):
        taken = [found.get(f"lidar-{count}-{method}") for count in LIDAR]
        if None not in taken:
            print_check_points(method, *(spent for spent in taken if spent is not None))
    return found


def print_check_points(method: str, few: Spent, many: Spent) -> None:
    """Print what one more check point takes."""
    first, last = LIDAR
    each = (many.megabytes - few.megabytes) * MEGABYTE / (last - first)
    line(f"memory of one more check point, {method}", f"{each:.2f} KB", f"{POINT_KB} KB", each / POINT_KB)
    growth = exponent((first, last), (few.units, many.units))
    line(f"exponent from {first} to {last} check points, {method}", f"{growth:.2f}")


def print_parts(found: dict[str, float], limits: dict[str, float], photos: int) -> None:
    """Print the parts of the work with their shares, and what a library alone needs for it."""
    inner = [name for name in dict.fromkeys(name for name, _, _ in STAGES) if name in found]
    rest = found[WHOLE] - sum(found[name] for name in inner)
    outer = [name for name in found if name not in inner]
    total = sum(found[name] for name in outer)
    title = f"parts of {photos} photos, control every 5 models"
    print(f"\n{title:<50}{'seconds':>10}{'share':>9}{'us a photo':>13}{'near limit':>13}")
    for name in outer:
        rows = [(name, found[name])]
        if name == WHOLE:
            rows += [(f"    {each}", found[each]) for each in inner] + [("    all else", rest)]
        for each, seconds in rows:
            limit = f"{limits[each]:.4f}" if each in limits else ""
            print(f"{each:<50}{seconds:>10.4f}{seconds / total:>8.1%}{1e6 * seconds / photos:>13.1f}{limit:>13}")
    print(f"{'sum':<50}{total:>10.4f}{1:>8.1%}{1e6 * total / photos:>13.1f}\n", flush=True)


def exponent(sizes: Sequence[int], seconds: Sequence[float]) -> float:
    """Give the slope of a straight line through the logarithms."""
    return float(np.polyfit(np.log(sizes), np.log(seconds), 1)[0])


def print_growth(folder: Path, sizes: Sequence[int], repeat: int, adjustment: str) -> None:
    """Print how the time grows with the number of photos, six bands of control on each."""
    print(f"{'photos':>8}{'triangulate':>14}{'ms a photo':>12}{'whole run':>12}{'memory':>10}")
    inside, whole = [], []
    for photos in sizes:
        spec = strip_spec(photos, max(photos // 5, 1), scale=GROWTH_SCALE)
        project = write_project(folder / str(photos), spec)
        inside.append(triangulation(load_project(project, [f"processing.adjustment={adjustment}"]), repeat))
        spent = whole_run(project, Row("", spec, adjustment=adjustment), repeat)
        whole.append(spent.units)
        row = f"{photos:>8}{inside[-1]:>12.3f} s{1e3 * inside[-1] / photos:>12.3f}{spent.units:>10.1f} L"
        print(f"{row}{spent.megabytes:>7.0f} MB", flush=True)
    print()
    for title, seconds in (("triangulate", inside), ("whole run", whole)):
        value = exponent(sizes, seconds)
        name = f"exponent of {title} from {sizes[0]} to {sizes[-1]} photos"
        line(name, f"{value:.2f}", f"{EXPONENT}", value / EXPONENT)


def print_folds(folder: Path, repeat: int) -> None:
    """Print what a run takes more with every given point left out in turn."""
    specs = {f"{photos} photos": strip_spec(photos, 5) for photos in (20, 100, 300)}
    many = Control(layout="random", count=MANY_CONTROL, check=6)
    specs[f"6 photos, {MANY_CONTROL} control points"] = replace(strip_spec(6, 5, extra=MANY_CONTROL // 3), control=many)
    print(f"{'with --cross-validate':<44}{'method':>12}{'L':>8}{'without':>9}{'ratio':>8}")
    for title, spec in specs.items():
        project = write_project(folder / title, spec)
        for method in METHODS:
            with_folds, without = (
                whole_run(project, Row("", spec, adjustment=method, options=options), repeat).units
                for options in (("--cross-validate",), ())
            )
            print(f"{title:<44}{method:>12}{with_folds:>8.1f}{without:>9.1f}{with_folds / without:>8.2f}", flush=True)
    print()


def main() -> None:
    """Read the options and print the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--rows", nargs="*", choices=ROWS, default=list(ROWS), help="whole processes (default all)")
    parser.add_argument("--photos", type=int, default=1000, help="photos of the strip of the parts (default 1000)")
    parser.add_argument("--sizes", type=int, nargs="*", default=[300, 1000, 3000], help="sizes for the growth")
    parser.add_argument("--folds", action="store_true", help="print what --cross-validate takes beside a plain run")
    parser.add_argument("--adjustment", choices=METHODS, default=METHODS[0], help="method of the strips that grow")
    parser.add_argument("--repeat", type=int, default=3, help="repetitions, of which the fastest counts (default 3)")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if options.rows:
            print_rows(folder, options.rows, options.repeat)
        if options.photos:
            project = write_project(folder / "parts", strip_spec(options.photos, 5))
            rounds = [parts(project) for _ in range(options.repeat)]
            print_parts(fastest(rounds), near_limits(project, options.repeat), options.photos)
            whole, inner, alone = pairs_in_one_batch(options.photos, options.repeat)
            text = f"relative orientation, {options.photos} pairs of {PAIR_POINTS} points in one batch"
            line(text, f"{whole:.0f} us")
            line("    of it the iteration", f"{inner:.0f} us")
            line("    the same one pair after the other", f"{alone:.0f} us")
            print()
        if options.folds:
            print_folds(folder, options.repeat)
        if options.sizes:
            print_growth(folder, options.sizes, options.repeat, options.adjustment)


if __name__ == "__main__":
    main()
