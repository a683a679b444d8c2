"""Whole strips with gross errors: what is found, what is lost, and what the new points are worth afterwards.

Run it as ``python benchmarks/gross_errors.py [strips]``; with ``--control`` after it only the search in the control is
looked at: strips with 12 to 19 control points anywhere, in plan only, in height only or in both, two fifths of the
coordinates of plan and of height wrong by 5 to 100 m.

Every simulated strip of 20 photos is adjusted four times: as
it is, with gross errors in 1 to 5 % of its image points, without those measurements and the wrong control (what could
be reached at best), and with the errors and the search switched off. Errors are from 5 standard deviations to 50 mm
(all sizes on a logarithmic scale equally often), along x or y; in a third of the strips one control coordinate is
wrong too.

An error along the base moves a point that stands on two photos along its other ray, and nothing contradicts it; points
with a wrong measurement of their own are therefore counted apart.
"""

from __future__ import annotations

import os
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run from anywhere, installed or not

from photostrip.threads import limit_threads

limit_threads()  # as the command does, before numpy is imported

import numpy as np  # noqa: E402

from photostrip.errors import PhotostripError  # noqa: E402
from photostrip.formats.output.simulation import inputs_of, settings_of  # noqa: E402
from photostrip.pipeline import triangulate  # noqa: E402
from photostrip.simulate.simulation import simulate  # noqa: E402
from photostrip.simulate.spec import Control, Flight, GrossError, Points, Spec  # noqa: E402

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.pipeline import Result, Settings
    from photostrip.simulate.simulation import Simulation

    Floats = NDArray[np.float64]
    Flags = NDArray[np.bool_]

SMALLEST, LARGEST = 5.0, 50_000.0  # standard deviations of an image coordinate; micrometres
WRONG_SHARE = (0.01, 0.05)
CONTROL_ERRORS = (0.5, 50.0)  # m
KINDS = ("without errors", "errors, auto", "errors, none", "errors, known")
MUCH, MUCH_WRONG, CONTROL_POINTS = 0.4, (5.0, 100.0), (12, 20)  # share of wrong control; m; number of points
PASS_POINTS = 2  # good ones at a joint, so that a wrong one can be told from them
CONSPICUOUS = 2.0  # ratio of rms that is printed for a single strip
STRIP = Spec(
    flight=Flight(photos=20, end_lap_percent=62.0),
    points=Points(rows=3, extra_per_model=8),
    control=Control(layout="bands", bands=7, per_band=3),
)


@dataclass(frozen=True, eq=False)
class Run:
    """One strip, adjusted.

    Parameters
    ----------
    errors : ndarray, shape (n, 3)
        Errors of the new points in the intermediate frame, metres.
    own : ndarray of bool, shape (n,)
        Points with a wrong measurement of their own.
    unused : frozenset of tuple
        Photo and point of the good image points that took no part in anything.
    good, alone, other_lost, wrong, found : int
        Good image points, those of them that are alone on their point, unused ones whose point has no wrong ray, wrong
        image points, those of them that place no point.
    control_found : bool or None
        Whether the wrong control coordinate was named; None without one, or when its point has no place in the strip.
    alarms : int
        Control points named beside it.
    supported : bool
        Whether every standard zone of every pair that has points has a good one, and every joint two.
    """

    errors: Floats
    own: Flags
    unused: frozenset[tuple[str, str]]
    good: int
    alone: int
    other_lost: int
    wrong: int
    found: int
    control_found: bool | None
    alarms: int
    supported: bool


def gross_errors(rng: np.random.Generator, image_points: int, sigma_um: float, *, control: bool) -> list[GrossError]:
    """Draw gross errors for one strip."""
    number = round(rng.uniform(*WRONG_SHARE) * image_points)
    sizes = np.exp(rng.uniform(np.log(SMALLEST * sigma_um), np.log(LARGEST), number))
    errors = [GrossError("image", size_um=float(size)) for size in sizes]
    if control:
        errors.append(GrossError("control", size_m=float(np.exp(rng.uniform(*np.log(CONTROL_ERRORS))))))
    return errors


def adjusted(simulation: Simulation, settings: Settings, wrong_rows: set[tuple[str, str]]) -> Run:
    """Adjust one strip and compare it with its truth."""
    result = triangulate(inputs_of(simulation), settings)
    observations = simulation.observations
    given = {name for name, check in zip(simulation.control.ids, simulation.control.check, strict=True) if not check}
    truth = {name: row for row, name in enumerate(simulation.truth.points.ids)}
    names = [observations.point_ids[number] for number in result.points.number]
    errors = result.points.cartesian - simulation.truth.points.xyz[[truth[name] for name in names]]
    new = np.array([name not in given for name in names])
    injected = wrong_measurements(simulation)
    spoiled = {name for _, name in wrong_rows}
    photo = [observations.photo_ids[number] for number in observations.photo]
    point = [observations.point_ids[number] for number in observations.point]
    keys = list(zip(photo, point, strict=True))
    bad = np.array([key in injected for key in keys])
    used, placing = np.zeros(len(bad), bool), np.zeros(len(bad), bool)
    for strip in result.strips:
        oriented = strip.of_photos.orientation
        placing[strip.of_photos.rows] = True
        used[oriented.rows[oriented.used].ravel()] = True
    used |= placing
    own = np.array([name in spoiled for name in names])[new]
    wrong_control = [error.point for error in simulation.truth.errors if error.kind == "control"]
    reported = {name for note in result.notes if note.code == "control-rejected" for name in note.points}
    placed = {name for strip in result.strips for name in strip.control.ids}
    named = wrong_control[0] in reported if wrong_control and wrong_control[0] in placed else None
    alarms = len(reported - set(wrong_control))
    local = (errors @ result.strips[0].intermediate.axes)[new]
    lost = ~bad & ~used
    other = lost & ~np.isin(point, list(spoiled))
    rays = np.bincount(observations.point[~bad], minlength=len(observations.point_ids))
    alone = ~bad & (rays[observations.point] == 1)
    flags = (~bad, alone, other, bad, bad & ~placing)
    good, single, spared, wrong, found = (int(each.sum()) for each in flags)
    enough = supported(result, wrong_rows)
    unused = frozenset(keys[row] for row in np.flatnonzero(lost).tolist())
    return Run(local, own, unused, good, single, spared, wrong, found, named, alarms, enough)


def wrong_measurements(simulation: Simulation) -> set[tuple[str, str]]:
    """Give photo and point of the wrong measurements."""
    return {(error.photo, error.point) for error in simulation.truth.errors if error.kind == "image"}


def supported(result: Result, wrong_rows: set[tuple[str, str]]) -> bool:
    """Whether the strip has enough good points: in each zone of each pair that has any, and two at each joint."""
    observations = result.refined.observations
    for strip in result.strips:
        pairs, rows, photos = strip.of_photos.orientation.pairs, strip.of_photos.orientation.rows, strip.strip.photos
        place = 6 * pairs.pair + strip.of_photos.screened.zone - 1
        names = [observations.point_ids[number] for number in observations.point[rows[:, 0]]]
        good = [
            (photos[pair], name) not in wrong_rows and (photos[pair + 1], name) not in wrong_rows
            for pair, name in zip(pairs.pair, names, strict=True)
        ]
        if not set(place.tolist()) <= set(place[np.array(good)].tolist()):
            return False
        joined = strip.of_photos.formed.junctions
        right = np.array(good)[joined.before] & np.array(good)[joined.after]
        if (np.bincount(joined.junction[right], minlength=len(joined.factor)) < PASS_POINTS).any():
            return False
    return True


@dataclass(eq=False)
class Table:
    """Sums over all strips."""

    squares: dict[str, Floats]
    points: dict[str, int]
    failed: dict[str, int]
    counts: dict[str, int]
    ratios: list[float]

    @classmethod
    def empty(cls) -> Table:
        """Begin with nothing."""
        names = ["good", "lost", "searched away", "alone", "other lost", "wrong", "found", "clean good", "clean lost"]
        names += ["control", "control found", "alarms", "clean alarms"]
        return cls(
            {kind: np.zeros(3) for kind in KINDS},
            dict.fromkeys(KINDS, 0),
            dict.fromkeys(KINDS, 0),
            dict.fromkeys(names, 0),
            [],
        )

    def add(self, kind: str, run: Run) -> float:
        """Add one strip; give its rms at sound points."""
        sound = run.errors[~run.own]
        self.squares[kind] += (sound**2).sum(axis=0)
        self.points[kind] += len(sound)
        if kind == KINDS[1]:
            self.counts["lost"] += len(run.unused)
            for name in ("good", "alone", "other_lost", "wrong", "found", "alarms"):
                self.counts[name.replace("_", " ")] += getattr(run, name)
            self.counts["control"] += run.control_found is not None
            self.counts["control found"] += bool(run.control_found)
        elif kind == KINDS[0]:
            self.counts["clean good"] += run.good
            self.counts["clean lost"] += len(run.unused)
            self.counts["clean alarms"] += run.alarms > 0
        return float(np.sqrt((sound**2).sum(axis=1).mean()))

    def show(self, strips: int) -> None:
        """Print everything."""
        print(f"\n{strips} strips of 20 photos, {STRIP.image.sigma_um:g} um, 1:{STRIP.scale:.0f}")
        print("                  rms along  across      up   plan ratio  height ratio   strips failed")
        base = np.sqrt(self.squares[KINDS[0]] / self.points[KINDS[0]])
        for kind in KINDS:
            value = np.sqrt(self.squares[kind] / max(self.points[kind], 1))
            plan, height = np.hypot(*value[:2]) / np.hypot(*base[:2]), value[2] / base[2]
            row = f"{kind:16s}{value[0]:11.3f}{value[1]:8.3f}{value[2]:8.3f}{plan:13.3f}{height:14.3f}"
            print(f"{row}{self.failed[kind]:16d}")
        middle, most = np.quantile(self.ratios, (0.5, 0.95))
        c = self.counts
        print(f"\nratio of a strip's rms: median {middle:.3f}, 95 % below {most:.3f}, largest {max(self.ratios):.3f}")
        print(f"wrong image points that place no point: {c['found']} of {c['wrong']}")
        percent = {name: 100 * c[name] / c["good"] for name in ("lost", "searched away", "alone", "other lost")}
        print(f"good image points that took no part: {percent['lost']:.2f} %, that is")
        print(f"    {percent['searched away']:.2f} % that would have taken part if the errors were known")
        print(f"    {percent['lost'] - percent['searched away']:.2f} % that knowledge cannot use either")
        print(f"good ones alone on their point: {percent['alone']:.2f} %; lost", end=" ")
        print(f"of points without a wrong ray: {percent['other lost']:.3f} %")
        print(f"the same in strips without errors: {c['clean lost']} of {c['clean good']}")
        print(f"wrong control coordinates named: {c['control found']} of {c['control']}; others named: {c['alarms']}")
        print(f"strips without errors of which control is named: {c['clean alarms']}\n", flush=True)


def four_runs(seed: int) -> tuple[dict[str, Run], list[str]]:
    """Adjust one strip without errors, with errors, without search, and without the errors; give what failed, too."""
    rng = np.random.default_rng(seed)
    clean = replace(STRIP, seed=seed)
    plain = simulate(clean)
    errors = gross_errors(rng, len(plain.observations), clean.image.sigma_um, control=seed % 3 == 0)
    spoiled = simulate(replace(clean, gross_errors=tuple(errors)))
    runs, failed = {}, []
    known = [f"{photo}/{point}" for photo, point in sorted(wrong_measurements(spoiled))]
    for kind, simulation in zip(KINDS, (plain, spoiled, spoiled, plain), strict=True):
        settings = settings_of(simulation)
        if kind == KINDS[2]:
            settings = replace(settings, relative=replace(settings.relative, screening="none"))
        if kind == KINDS[3]:
            settings = replace(settings, relative=replace(settings.relative, drop=known))
        try:
            runs[kind] = adjusted(simulation, settings, wrong_measurements(spoiled))
        except PhotostripError as error:
            failed.append(kind)
            if kind != KINDS[2]:
                print(f"strip {seed}, {kind}: {error}")
    return runs, failed


def _add(tables: tuple[Table, Table], number: list[int], seed: int, runs: dict[str, Run], failed: list[str]) -> None:
    """Count one strip in the table of all and, when it has enough good points, in that of those."""
    enough = KINDS[0] in runs and runs[KINDS[0]].supported
    number[1] += enough
    for table in tables if enough else tables[:1]:
        rms = {kind: table.add(kind, run) for kind, run in runs.items()}
        for kind in failed:
            table.failed[kind] += 1
        if KINDS[1] in runs and KINDS[3] in runs:
            table.counts["searched away"] += len(runs[KINDS[1]].unused - runs[KINDS[3]].unused)
        if KINDS[1] in rms:
            table.ratios.append(rms[KINDS[1]] / rms[KINDS[0]])
    if KINDS[1] in rms and table.ratios[-1] > CONSPICUOUS:
        print(f"strip {seed}: {table.ratios[-1]:.2f} times the rms without errors; enough good points: {enough}")


def much_wrong_control(seed: int) -> tuple[int, int, int]:
    """Adjust a strip with two fifths of its control wrong: wrong and good parts named, wrong ones that were not."""
    rng = np.random.default_rng(seed)
    layout = Control(layout="random", count=int(rng.integers(*CONTROL_POINTS)), use={"xyz": 0.6, "xy": 0.2, "z": 0.2})
    simulation = simulate(replace(STRIP, flight=Flight(photos=13), control=layout, seed=seed))
    inputs = inputs_of(simulation)
    enu, wrong = inputs.control.enu.copy(), np.zeros(inputs.control.use.shape, bool)
    given = inputs.control.use & ~inputs.control.check[:, None]
    for part in (slice(0, 2), slice(2, 3)):
        rows = rng.permutation(np.flatnonzero(given[:, part.start] & ~wrong.any(axis=1)))
        for row in rows[: int(MUCH * given[:, part.start].sum())].tolist():
            error = rng.normal(size=part.stop - part.start)
            size = np.exp(rng.uniform(*np.log(MUCH_WRONG)))
            enu[row, part] += size * error / np.linalg.norm(error)
            wrong[row, part] = True
    result = triangulate(replace(inputs, control=replace(inputs.control, enu=enu)), settings_of(simulation))
    strip = result.strips[0]
    place = {name: row for row, name in enumerate(inputs.control.ids)}
    rows = np.array([place[name] for name in strip.control.ids])
    gone, bad = (given[rows] & ~strip.control.use)[:, [0, 2]], wrong[rows][:, [0, 2]]
    return int((gone & bad).sum()), int((gone & ~bad).sum()), int((bad & ~gone).sum())


def much(strips: int) -> None:
    """Count strips that lose just their wrong control."""
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        found = np.array(list(pool.map(much_wrong_control, range(1, strips + 1))))
    named, others, missed = found.sum(axis=0).tolist()
    print(
        f"{strips} strips with two fifths of the control wrong: {int((found[:, 1:] == 0).all(axis=1).sum())} lose just"
    )
    print(f"    that; {named} of {named + missed} wrong plan positions and heights named, {others} good ones")


def main(strips: int) -> None:
    """Adjust all strips and print the tables: of all, and of those with enough good points."""
    tables = Table.empty(), Table.empty()
    number = [strips, 0]
    seeds = range(1, strips + 1)
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        found = pool.map(four_runs, seeds)
        for seed, (runs, failed) in zip(seeds, found, strict=True):
            _add(tables, number, seed, runs, failed)
    for title, table, count in zip(
        ("All strips", "Strips with a good point in every zone and two at every joint"), tables, number, strict=True
    ):
        print(f"\n{title}")
        table.show(count)


if __name__ == "__main__":
    numbers = [int(word) for word in sys.argv[1:] if word.isdigit()]
    (much if "--control" in sys.argv else main)(numbers[0] if numbers else 300)
