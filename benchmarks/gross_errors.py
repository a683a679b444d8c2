"""Projects with gross errors: what is found, what is lost, and what the new points are worth afterwards.

Every simulated project is adjusted three times: as it is, with gross errors in 1 to 5 % of its measurements, and
without those measurements and the wrong control (what could be reached at best). Errors are from 5 standard deviations
to 50 mm (all sizes on a logarithmic scale equally often), along one axis; in a third of the projects one control
coordinate is wrong too. Kinds: strips of 20 photos, blocks of 4 strips of 12 photos by bundle (with GNSS and control at
the corners of the strips, or with control along the perimeter), and strips of 19 independent models, with errors of
their points or of their perspective centres, too; ``wrong-control`` are strips with two fifths of the control wrong.

An error along the base moves a point that stands on two photos along its other ray, and nothing contradicts it; points
with a wrong measurement of their own are therefore left out of the errors.

Usage: python benchmarks/gross_errors.py [PROJECTS] [--kind KIND] [--first-seed N] [--workers N]
"""

from __future__ import annotations

import argparse
import os
import sys
from collections import Counter
from dataclasses import dataclass, field, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run from anywhere, installed or not

from photostrip.threads import limit_threads

limit_threads()  # as the command does, before numpy is imported

import numpy as np  # noqa: E402

from photostrip.errors import PhotostripError  # noqa: E402
from photostrip.pipeline.inputs import CameraPositions  # noqa: E402
from photostrip.pipeline.run import triangulate  # noqa: E402
from photostrip.points import locate  # noqa: E402
from photostrip.simulation.simulation import simulate  # noqa: E402
from photostrip.simulation.spec import Control, Flight, Gnss, GrossError, Models, Points, Spec  # noqa: E402
from photostrip.strip.control_screening import EITHER, WRONG_IMAGE  # noqa: E402
from tests.much_wrong_control import two_fifths_wrong  # noqa: E402
from tests.simulated import inputs_of, settings_of  # noqa: E402

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from multiprocessing.pool import Pool

    from numpy.typing import NDArray

    from photostrip.pipeline.inputs import Inputs, Settings
    from photostrip.pipeline.results import Result
    from photostrip.points import ControlPoints
    from photostrip.simulation.simulation import Simulation

    Floats = NDArray[np.float64]
    Flags = NDArray[np.bool_]

SMALLEST, LARGEST = 5.0, 50_000.0  # standard deviations of a measurement; micrometres
WRONG_SHARE = (0.01, 0.05)
CONTROL_ERRORS = (0.5, 50.0)  # m
RUNS = ("without errors", "errors, auto", "errors, known")
CLEAN, AUTO, KNOWN = RUNS

STRIP = Spec(
    flight=Flight(photos=20, end_lap_percent=62.0),
    points=Points(rows=3, extra_per_model=8),
    control=Control(layout="bands", bands=7, per_band=3),
)
BLOCK = replace(STRIP, flight=replace(STRIP.flight, photos=12, strips=4))
WRONG_CONTROL = "wrong-control"
KINDS = {
    "strips": STRIP,
    "gnss": replace(BLOCK, control=Control(layout="corners"), gnss=Gnss()),
    "perimeter": replace(BLOCK, control=Control(bands=4, per_band=3)),
    "models": replace(STRIP, models=Models()),
    "centres": replace(STRIP, models=Models()),  # models with errors in perspective centres, too
}


# -------------------------------------------------------------------------------------------------- projects


@dataclass(frozen=True, eq=False)
class Project:
    """A simulated project with its truth."""

    simulation: Simulation
    inputs: Inputs
    settings: Settings
    names: tuple[str, ...]  # of the measurements, ``photo/point`` or ``model/point``
    wrong: frozenset[str] = frozenset()  # those of them with a gross error

    @property
    def wrong_control(self) -> set[str]:
        """Control points with a wrong coordinate."""
        return {error.point for error in self.simulation.truth.errors if error.kind == "control"}

    def without(self, wrong: Iterable[str]) -> Settings:
        """Leave measurements out."""
        s, names = self.settings, sorted(wrong)
        relative, links = replace(s.relative, drop=names), replace(s.links, drop=tuple(names))
        return replace(s, relative=relative, links=links)


def project_of(simulation: Simulation, wrong: frozenset[str] = frozenset()) -> Project:
    """Give what the program is given: blocks are adjusted by bundle, control counts where it should."""
    spec, inputs, settings = simulation.spec, inputs_of(simulation), settings_of(simulation)
    if spec.flight.strips > 1:
        settings = replace(settings, adjustment="bundle")
        if spec.gnss is None:
            inputs = replace(inputs, control=on_perimeter(simulation))
    if spec.gnss is not None and simulation.gnss is not None:
        photos, shape = simulation.observations.photo_ids, simulation.gnss.shape
        positions = CameraPositions(
            photos=photos,
            frame=simulation.frames[0],
            enu=simulation.gnss,
            use=np.ones(shape, bool),
            sigma=np.broadcast_to(spec.gnss.sigma, shape),
            time=np.full(len(photos), np.nan),
        )
        inputs = replace(inputs, positions=positions)
    return Project(simulation, inputs, settings, measurements(inputs), wrong)


def on_perimeter(simulation: Simulation) -> ControlPoints:
    """Keep control at the ends of all strips and at the outer edges; the rest are check points."""
    control, wanted, strips = simulation.control, simulation.spec.control, simulation.spec.flight.strips
    given = np.flatnonzero(~control.check)  # by strip, along it, then from left to right
    strip, band, row = np.unravel_index(np.arange(len(given)), (strips, wanted.bands, wanted.per_band))
    outer = (band == 0) | (band == wanted.bands - 1)
    outer |= ((strip == 0) & (row == wanted.per_band - 1)) | ((strip == strips - 1) & (row == 0))
    check = control.check.copy()
    check[given[~outer]] = True
    return replace(control, check=check)


def measurements(inputs: Inputs) -> tuple[str, ...]:
    """Name all measurements: image points, or points and centres of models."""
    if inputs.models is None:
        o = inputs.observations
        return tuple(f"{o.photo_ids[i]}/{o.point_ids[k]}" for i, k in zip(o.photo, o.point, strict=True))
    m = inputs.models.points
    nodes = (*m.point_ids, *m.photo_ids)
    return tuple(f"{m.model_ids[i]}/{nodes[k]}" for i, k in zip(m.model, m.node, strict=True))


def gross_errors(rng: np.random.Generator, measured: int, sigma_um: float, *, control: bool) -> list[GrossError]:
    """Draw gross errors for one project."""
    number = round(rng.uniform(*WRONG_SHARE) * measured)
    sizes = np.exp(rng.uniform(np.log(SMALLEST * sigma_um), np.log(LARGEST), number))
    errors = [GrossError("image", size_um=float(size)) for size in sizes]
    if control:
        errors.append(GrossError("control", size_m=float(np.exp(rng.uniform(*np.log(CONTROL_ERRORS))))))
    return errors


def pair_of_projects(kind: str, seed: int) -> tuple[Project, Project]:
    """Simulate a project without errors and the same with errors."""
    spec = replace(KINDS[kind], seed=seed)
    rng, plain, control = np.random.default_rng(seed), simulate(spec), seed % 3 == 0
    if plain.models is None:
        errors = gross_errors(rng, len(plain.observations), spec.image.sigma_um, control=control)
        spoiled = simulate(replace(spec, gross_errors=tuple(errors)))
        wrong = frozenset(f"{error.photo}/{error.point}" for error in spoiled.truth.errors if error.kind == "image")
        return project_of(plain), project_of(spoiled, wrong)
    models = plain.models
    may = np.flatnonzero((models.node < len(models.point_ids)) | (kind == "centres"))
    errors = gross_errors(rng, len(may), 1000 * float(np.median(models.sigma)), control=control)
    sizes = np.array([error.size_um / 1000 for error in errors if error.kind == "image"])
    rows, xyz = rng.permutation(may)[: len(sizes)], models.xyz.copy()
    xyz[rows, rng.integers(3, size=len(rows))] += sizes * rng.choice([-1.0, 1.0], len(rows))
    spoiled = simulate(replace(spec, gross_errors=tuple(error for error in errors if error.kind == "control")))
    project = project_of(replace(spoiled, models=replace(models, xyz=xyz)))
    return project_of(plain), replace(project, wrong=frozenset(project.names[row] for row in rows.tolist()))


# ------------------------------------------------------------------------------------------------ adjustment


@dataclass(frozen=True, eq=False)
class Run:
    """One project, adjusted."""

    errors: Floats  # (n, 3): errors of the new points in the frame of the first strip, metres
    point: tuple[str, ...]  # their names
    used: frozenset[str]  # measurements that take part in anything
    placing: frozenset[str]  # measurements that place a point
    rejected: frozenset[str]  # control points and camera positions named as wrong
    control: frozenset[str]  # control points that count and have a place
    image: frozenset[str]  # control points left out for a wrong image
    either: frozenset[str]  # control points left out for a wrong image or a wrong coordinate, nothing telling which

    def sound(self, wrong: Iterable[str]) -> Floats:
        """Errors of the points without a wrong measurement of their own."""
        spoiled = {name.partition("/")[2] for name in wrong}
        return self.errors[[name not in spoiled for name in self.point]]


def adjusted(project: Project, settings: Settings) -> Run:
    """Adjust a project and compare it with its truth."""
    result = triangulate(project.inputs, settings)
    control, truth = project.inputs.control, project.simulation.truth.points
    given = {name for name, check in zip(control.ids, control.check, strict=True) if not check}
    names = [result.refined.observations.point_ids[number] for number in result.points.number]
    new = [row for row, name in enumerate(names) if name not in given]
    errors = result.points.cartesian - truth.xyz[locate(names, truth.ids)]
    used, placing = taking_part(result, len(project.names))
    notes = [note for note in result.notes if note.code in {"control-rejected", "position-rejected"}]
    return Run(
        errors=(errors @ result.strips[0].intermediate.axes)[new],
        point=tuple(names[row] for row in new),
        used=frozenset(project.names[row] for row in np.flatnonzero(used | placing).tolist()),
        placing=frozenset(project.names[row] for row in np.flatnonzero(placing).tolist()),
        rejected=frozenset(name for note in notes for name in (*note.points, *note.photos)),
        control=frozenset(given.intersection(names)),
        image=left_out_by_control(result, WRONG_IMAGE) - set(names),
        either=left_out_by_control(result, EITHER) - set(names),
    )


def left_out_by_control(result: Result, cause: str) -> frozenset[str]:
    """Control points that were left out of strips of photos for one of their rays."""
    o, strips = result.refined.observations, [strip for strip in result.strips if not strip.is_of_models]
    rays = [each for strip in strips for each in strip.of_photos.wrong_rays if each.cause == cause]
    return frozenset(o.point_ids[o.point[each.row]] for each in rays)


def taking_part(result: Result, count: int) -> tuple[Flags, Flags]:
    """Measurements that take part in an orientation or a link, and those that place a point."""
    used, placing = np.zeros((2, count), bool)
    if result.bundle is not None:
        placing[result.bundle.block.rows[result.bundle.screened.selection.images]] = True
        return used, placing
    for strip in result.strips:
        if strip.is_of_models:
            formed = strip.of_models.formed
            shared, rows = formed.links.shared, formed.models.row
            used[rows[np.union1d(shared.before[formed.links.used], shared.after[formed.links.used])]] = True
            placing[rows[formed.used]] = True
        else:
            oriented = strip.of_photos.orientation
            used[oriented.rows[oriented.used].ravel()] = True
            placing[strip.rows] = True
    return used, placing


def runs_of(kind: str, seed: int) -> tuple[Project, dict[str, Run]]:
    """Adjust one project without errors, with errors, and without the wrong measurements."""
    plain, spoiled = pair_of_projects(kind, seed)
    ways = {
        CLEAN: (plain, plain.settings),
        AUTO: (spoiled, spoiled.settings),
        KNOWN: (plain, plain.without(spoiled.wrong)),
    }
    runs = {}
    for name in RUNS:
        try:
            runs[name] = adjusted(*ways[name])
        except PhotostripError as error:
            print(f"{kind} {seed}, {name}: {error}")
    return spoiled, runs


# -------------------------------------------------------------------------------------------------- counting


WIDTHS = (44, 14, 15, 13, 14, 11, 9, 9)
HEADS = (
    ("", "ratio", "by knowledge", "wrong", "good", "control", "control", "clean"),
    ("", "plan/height", "plan/height", "placing", "lost", "named", "false", "touched"),
)


def line(cells: Sequence[str]) -> str:
    """One line of the table."""
    first, *others = zip(cells, WIDTHS, strict=True)
    return f"{first[0]:{first[1]}s}" + "".join(f"{cell:>{width}s}" for cell, width in others)


HEAD = "\n".join(line(cells) for cells in HEADS)


@dataclass(eq=False)
class Tally:
    """Sums over all projects of a kind."""

    squares: dict[str, Floats] = field(default_factory=lambda: {name: np.zeros(3) for name in RUNS})
    points: Counter[str] = field(default_factory=Counter)
    counts: Counter[str] = field(default_factory=Counter)
    ratios: list[float] = field(default_factory=list)

    def add(self, project: Project, runs: dict[str, Run]) -> None:
        """Count one project with errors."""
        rms = {}
        for name, run in runs.items():
            squares = run.sound(project.wrong) ** 2
            self.squares[name] += squares.sum(axis=0)
            self.points[name] += len(squares)
            rms[name] = float(np.sqrt(squares.sum(axis=1).mean()))
        self.counts.update(f"failed {name}" for name in RUNS if name not in runs)
        self.counts.update(good=len(project.names) - len(project.wrong), wrong=len(project.wrong))
        if CLEAN in runs:
            lost = len(runs[CLEAN].placing) < len(project.names) or bool(runs[CLEAN].rejected)
            self.counts.update(clean=1, touched=lost)
        if AUTO in runs:
            found = runs[AUTO]
            wrong = project.wrong_control & (found.control | found.image | found.either)
            self.counts.update(placing=len(found.placing & project.wrong), control=len(wrong))
            false = found.rejected - project.wrong_control
            self.counts.update(named=len(wrong & found.rejected), false=len(false))
            if KNOWN in runs:
                self.counts.update(lost=len(runs[KNOWN].used - found.used))
            self.ratios += [rms[AUTO] / rms[CLEAN]] if CLEAN in runs else []

    def rms(self, name: str) -> Floats:
        """Errors of points along and across the strip and up, metres."""
        return np.asarray(np.sqrt(self.squares[name] / max(self.points[name], 1)))

    def ratio(self, name: str) -> tuple[float, float]:
        """Errors in plan and in height over those without gross errors."""
        value, base = self.rms(name), self.rms(CLEAN)
        return float(np.hypot(*value[:2]) / np.hypot(*base[:2])), float(value[2] / base[2])

    def row(self, title: str) -> str:
        """One line below ``HEAD``."""
        c = self.counts
        ratios = ["{:.3f}/{:.3f}".format(*self.ratio(name)) for name in (AUTO, KNOWN)]
        found = f"{c['placing']} of {c['wrong']}", f"{c['lost']} of {c['good']}", f"{c['named']} of {c['control']}"
        return line((title, *ratios, *found, str(c["false"]), f"{c['touched']}/{c['clean']}"))


def print_kinds(pool: Pool, kinds: Sequence[str], seeds: range) -> None:
    """Print the errors of the new points of every kind of project, then what was found and lost."""
    tallies = {kind: Tally() for kind in kinds}
    print("project    adjusted         rms along  across      up   plan ratio  height ratio   failed", flush=True)
    for kind, tally in tallies.items():
        for project, runs in pool.imap(partial(runs_of, kind), seeds):
            tally.add(project, runs)
        for name in RUNS:
            (plan, height), value = tally.ratio(name), tally.rms(name)
            row = f"{kind:11s}{name:16s}{value[0]:10.3f}{value[1]:8.3f}{value[2]:8.3f}{plan:13.3f}{height:14.3f}"
            print(f"{row}{tally.counts[f'failed {name}']:9d}", flush=True)
    print(f"\n{HEAD}")
    for kind, tally in tallies.items():
        print(tally.row(kind))
    print("\nproject    ratio of a project's rms: median, 95 % below, largest")
    for kind, tally in tallies.items():
        middle, most, largest = np.quantile(tally.ratios, (0.5, 0.95, 1.0)) if tally.ratios else 3 * (float("nan"),)
        print(f"{kind:11s}{middle:32.3f}{most:12.3f}{largest:9.3f}")
    print(flush=True)


def print_much_wrong(pool: Pool, seeds: range) -> None:
    """Print how many strips with two fifths of the control wrong lose just that."""
    wrong, named, others = np.array(pool.map(two_fifths_wrong, seeds, 1)).T
    print(f"two fifths of the control wrong: {((wrong == named) & (others == 0)).sum()} of {len(seeds)} strips lose")
    print(f"just that; {named.sum()} of {wrong.sum()} wrong coordinates named, {others.sum()} others", flush=True)


def main() -> None:
    """Print the tables that are asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("projects", type=int, nargs="?", default=60, help="projects of each kind (default 60)")
    parser.add_argument("--kind", choices=[*KINDS, WRONG_CONTROL, "all"], default="all")
    parser.add_argument("--first-seed", type=int, default=1, help="number of the first project (default 1)")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="processes (default: one for each core)")
    options = parser.parse_args()
    seeds = range(options.first_seed, options.first_seed + options.projects)
    with get_context("fork").Pool(options.workers, maxtasksperchild=1) as pool:
        if kinds := [kind for kind in KINDS if options.kind in {kind, "all"}]:
            print_kinds(pool, kinds, seeds)
        if options.kind in {WRONG_CONTROL, "all"}:
            print_much_wrong(pool, seeds)


if __name__ == "__main__":
    main()
