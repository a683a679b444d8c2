"""How accurate strips are: many simulated strips with known truth, all degrees of polynomial, against limits.

Errors are those of all adjusted points that are not control, root mean square over all strips, in the directions
along the strip (X), across it (Y) and up (Z). Beside the polynomials stands the bundle adjustment of the same
measurements, which tests hold beside Ceres: it shows what the measurements hold.

Usage: python benchmarks/accuracy.py [--seeds N] [--cases a b length] [--workers N]
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections import Counter
from dataclasses import dataclass, replace
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run from anywhere, installed or not

from photostrip.threads import limit_threads

limit_threads()  # before numpy is imported, also in the processes that are started here

import numpy as np  # noqa: E402

from photostrip.pipeline.run import triangulate  # noqa: E402
from photostrip.simulation.simulation import simulate  # noqa: E402
from photostrip.simulation.spec import FILM, Control, Flight, Points, Spec  # noqa: E402
from photostrip.strip import polynomial  # noqa: E402
from tests.simulated import inputs_of, settings_of  # noqa: E402

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from multiprocessing.pool import Pool

    from numpy.typing import NDArray

    from photostrip.pipeline.results import Result
    from photostrip.simulation.simulation import Simulation

    Floats = NDArray[np.float64]

SIGMA = 5e-6 * 10_000  # metres: 5 micrometres at the photo scale 1:10 000
CONTROL_SIGMA = (0.02, 0.02, 0.02)  # metres, stated and real
SIMILARITY, AUTO, BUNDLE = "similarity", "auto", "bundle"
CHOICES = (SIMILARITY, "2", "3", AUTO)
POINTS = Points(5, 75.0, 25.0, 2)  # five rows across the flight at each nadir, and two more in each model
TITLES = {SIMILARITY: "similarity", "2": "degree 2", "3": "degree 3", AUTO: "auto", BUNDLE: "bundle"}


# ------------------------------------------------------------------------------------------- which strips


def strip(models: int, bands: int, *, every: int | None = None) -> Spec:
    """Specify a film strip of case (a): f = 153 mm, 1:10 000, 64 % overlap, bands of three control points."""
    return Spec(
        camera=FILM,
        flight=Flight(photos=models + 1, end_lap_percent=64.0),
        points=POINTS,
        control=Control(bands=bands, every=every, per_band=3, sigma=CONTROL_SIGMA),
    )


def pairs_of_control(photos: int) -> Spec:
    """Specify a film strip of case (b): f = 153.124 mm, 60 % overlap, two control points every five models."""
    return Spec(
        camera=replace(FILM, principal_distance=153.124),
        flight=Flight(photos=photos, end_lap_percent=60.0),
        points=POINTS,
        control=Control(every=5, per_band=2, sigma=CONTROL_SIGMA),
    )


# --------------------------------------------------------------------------------------- one strip at a time


@dataclass(frozen=True)
class Task:
    """One strip to simulate and to adjust in several ways."""

    spec: Spec
    choices: tuple[str, ...]


@dataclass(frozen=True)
class Outcome:
    """What became of one strip: mean squares (3,) and degrees in plan and height of each choice."""

    squares: dict[str, Floats]
    degrees: dict[str, tuple[int, int]]


def run(task: Task) -> Outcome:
    """Simulate one strip and adjust it in every way asked for."""
    simulation = simulate(task.spec)
    inputs, settings = inputs_of(simulation), settings_of(simulation)
    squares, degrees = {}, {}
    for choice in task.choices:
        degree = choice if choice in {"2", "3"} else AUTO
        by = choice if choice in {SIMILARITY, BUNDLE} else "polynomial"
        chosen = replace(settings, adjustment=by, polynomial=polynomial.PolynomialSettings(degree), precision=False)
        result = triangulate(inputs, chosen)
        squares[choice] = mean_squares(simulation, result, result.points.cartesian)
        degrees[choice] = _degrees(result)
    return Outcome(squares, degrees)


def mean_squares(simulation: Simulation, result: Result, found: Floats) -> Floats:
    """Give the mean square error of the points that are not control, along, across and up, in square metres."""
    number = result.points.number
    fixed = {name for name, check in zip(simulation.control.ids, simulation.control.check, strict=True) if not check}
    free = np.array([simulation.observations.point_ids[n] not in fixed for n in number])
    error = (found - simulation.truth.points.xyz[number]) @ result.strips[0].intermediate.axes
    mean: Floats = (error[free] ** 2).mean(axis=0)
    return mean


def _degrees(result: Result) -> tuple[int, int]:
    """Highest powers of X in plan and in height."""
    found = result.strips[0].polynomial
    if found is None:
        return 0, 0
    plan, _, height = ([polynomial.POWERS[term][0] for term in axis.terms] for axis in found.axes)
    return max(plan, default=0), max(height, default=0)


# ------------------------------------------------------------------------------------------ many strips


@dataclass(frozen=True)
class Measured:
    """Errors of one choice over all strips: rms along, across and up, their standard errors, degrees in use."""

    rms: Floats
    doubt: Floats
    degrees: Counter[tuple[int, int]]

    @property
    def plan_height(self) -> Floats:
        """Rms of a plan coordinate and of the height, metres."""
        x, y, z = self.rms
        return np.array([np.hypot(x, y) / np.sqrt(2.0), z])

    @property
    def plan_height_doubt(self) -> Floats:
        """Their standard errors, metres."""
        x, y, z = self.rms * self.doubt
        return np.array([(x + y) / 2.0 / self.plan_height[0], z / self.rms[2]])

    @property
    def degree(self) -> tuple[int, int]:
        """Degrees in plan and height that most strips got."""
        return self.degrees.most_common(1)[0][0] if self.degrees else (0, 0)


def measure(pool: Pool, spec: Spec, seeds: int, choices: Iterable[str]) -> dict[str, Measured]:
    """Adjust strips of one kind with seeds 1, 2, ... and sum up."""
    tasks = [Task(replace(spec, seed=seed), tuple(choices)) for seed in range(1, seeds + 1)]
    outcomes = pool.map(run, tasks, chunksize=4)
    found = {}
    for choice in choices:
        squares = np.array([outcome.squares[choice] for outcome in outcomes])
        rms = np.sqrt(squares.mean(axis=0))
        doubt = squares.std(axis=0, ddof=1) / np.sqrt(seeds) / (2.0 * rms)
        degrees = Counter(outcome.degrees[choice] for outcome in outcomes if choice in outcome.degrees)
        found[choice] = Measured(rms, doubt, degrees)
    return found


# ------------------------------------------------------------------------------------------------ printing


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print columns, the first to the left, the others to the right."""
    lines = [tuple(head), *map(tuple, rows)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    lines.insert(1, tuple("-" * width for width in widths))
    for first, *others in lines:
        cells = [cell.rjust(width) for cell, width in zip(others, widths[1:], strict=True)]
        print("  ".join([first.ljust(widths[0]), *cells]).rstrip())
    print(flush=True)


def slashed(values: Iterable[float], decimals: int = 2) -> str:
    """Write numbers with slashes between them."""
    return "/".join(f"{value:.{decimals}f}" for value in values)


def verdict(values: Floats, doubt: Floats, limits: Floats) -> str:
    """Say whether errors stay below limits."""
    above = values - limits
    if (above <= 0.0).all():
        return "yes"
    return "open" if (above <= 2.0 * doubt).all() else "no"


# --------------------------------------------------------------------------------------------- the cases

CASES_A = (
    (20, 3, "2", (4.8, 4.4, 9.2)),
    (20, 4, "3", (2.9, 2.9, 5.9)),
    (10, 3, "2", (2.1, 2.3, 4.5)),
    (10, 3, SIMILARITY, (3.4, 3.2, 7.0)),
)
LIMITS_B = {SIMILARITY: (0.325, 0.665), "2": (0.152, 0.330), "3": (0.112, 0.230), BUNDLE: (0.062, 0.163)}


def case_a(pool: Pool, seeds: int) -> None:
    """Bands of three control points: X/Y/Z in units of sigma at photo scale, against limits."""
    print(f"(a) f 153 mm, 1:10 000, 64 % overlap, bands of 3 control points (2 cm), 5 um; {seeds} strips of each kind")
    print("    rms along/across/up at points that are not control, in units of 5 um at photo scale = 0.05 m\n")
    rows = []
    for models, bands in dict.fromkeys(case[:2] for case in CASES_A):
        found = measure(pool, strip(models, bands), seeds, (*CHOICES, BUNDLE))
        for _, _, choice, limits in (case for case in CASES_A if case[:2] == (models, bands)):
            of, limit = found[choice], np.array(limits)
            values, doubt = of.rms / SIGMA, of.doubt / SIGMA
            head = (f"{models} models, {bands} bands", TITLES[choice], slashed(limits, 1))
            tail = (slashed(values / limit), verdict(values, doubt, limit))
            rows.append((*head, slashed(values), slashed(doubt), *tail, slashed(found[BUNDLE].rms / SIGMA)))
    table(("strip", "adjustment", "limit", "measured", "s.e.", "ratio", "below", "bundle"), rows)


def case_b(pool: Pool, seeds: int) -> None:
    """Two control points every five models: plan and height in metres, against limits."""
    print("(b) f 153.124 mm, 1:10 000, 60 % overlap, 20 photos, two control points (2 cm) every 5 models, 5 um;")
    print(
        f"    {seeds} strips of each kind; rms in plan (of one coordinate) and height at points that are not control, m"
    )
    print(
        "    the limit of the bundle is what another one reached; on the right both columns divided by their bundle\n"
    )
    rows = []
    found = measure(pool, pairs_of_control(20), seeds, (*CHOICES, BUNDLE))
    for choice, limits in LIMITS_B.items():
        of, limit = found[choice], np.array(limits)
        values, doubt = of.plan_height, of.plan_height_doubt
        below = "-" if choice == BUNDLE else verdict(values, doubt, limit)
        head = (TITLES[choice], slashed(limits, 3), slashed(values, 3), slashed(doubt, 3))
        tail = (slashed(limit / LIMITS_B[BUNDLE]), slashed(values / found[BUNDLE].plan_height))
        rows.append((*head, slashed(values / limit), below, *tail))
    heads = ("adjustment", "limit", "measured", "s.e.", "ratio", "below")
    table((*heads, "limit/bundle", "measured/bundle"), rows)


def case_length(pool: Pool, seeds: int) -> None:
    """Print a table over lengths and bands."""
    print(f"(length) strips as in (a), {seeds} of each kind; rms along/across/up in units of 5 um at photo scale")
    print("    -: the control does not carry that degree; took: degrees in plan/height that auto took most often\n")
    rows = []
    for models, bands in product((6, 10, 14, 20, 30, 40), (2, 3, 4, 5, 0)):
        if models <= 20 and not bands:
            continue  # the same as one of the others
        found = measure(pool, strip(models, bands or 2, every=None if bands else 5), seeds, (*CHOICES, BUNDLE))
        for choice in ("2", "3"):
            if found[choice].degree != (int(choice), int(choice)):
                del found[choice]
        title = f"{models:2d} models, {f'{bands} bands' if bands else 'every 5'}"
        cells = [slashed(found[c].rms / SIGMA, 1) if c in found else "-" for c in (*CHOICES, BUNDLE)]
        ratio = found[AUTO].plan_height / found[BUNDLE].plan_height
        rows.append((title, *cells[:-1], "{}/{}".format(*found[AUTO].degree), cells[-1], slashed(ratio, 1)))
    table(("strip", *(TITLES[c] for c in CHOICES), "took", "bundle", "auto/bundle"), rows)


CASES: dict[str, Callable[[Pool, int], None]] = {
    "a": case_a,
    "b": case_b,
    "length": case_length,
}


def main() -> None:
    """Read the options and print the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--seeds", type=int, default=20, help="strips of each kind (default 20; 200 for firm numbers)")
    parser.add_argument("--cases", nargs="+", choices=CASES, default=["a", "b", "length"], help="tables to print")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="processes (default: one for each core)")
    options = parser.parse_args()
    with get_context("spawn").Pool(options.workers) as pool:
        for case in options.cases:
            start = time.perf_counter()
            CASES[case](pool, options.seeds)
            print(f"case {case}: {time.perf_counter() - start:.0f} s", file=sys.stderr)


if __name__ == "__main__":
    main()
