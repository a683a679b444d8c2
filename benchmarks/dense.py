"""Constants of the searches that count where photos have hundreds of points: what each costs, and what it loses.

Short strips and blocks of 500 to 1500 points a photo, 10 to 33 % of the image points wrong by normal errors of 0.05 to
5 mm, are adjusted with every value of a constant. Lines give the time of all together, the rms errors of the points
that no wrong ray places over those of the first value (geometric mean over the projects, at points of both runs, plan
and height), the wrong rays left in and the good ones lost.

Usage: python benchmarks/dense.py [PROJECTS] [--first-seed N] [--only WORD ...] [--workers N]
"""

from __future__ import annotations

import argparse
import sys
import time
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run from anywhere, installed or not

from photostrip.threads import limit_threads

limit_threads()  # as the command does, before numpy is imported

import numpy as np  # noqa: E402

from benchmarks.ablation import put  # noqa: E402
from benchmarks.gross_errors import Project, adjusted, project_of  # noqa: E402
from photostrip.errors import PhotostripError  # noqa: E402
from photostrip.frozen import replace  # noqa: E402
from photostrip.network.gross_errors import snooping  # noqa: E402
from photostrip.simulation import Control, Flight, Points, Spec, Terrain, simulate  # noqa: E402
from photostrip.strip.gross_errors.pairs import pair_search  # noqa: E402

NEVER = 10**9
CONSTANTS = {  # as it is first
    "AMPLE": (pair_search.__name__, (200, 100, 400, NEVER)),
    "RAYS_TO_DECIDE_AGAIN": (snooping.__name__, (100, 50, 200, NEVER)),
}
SHARES, SIZES = (0.1, 0.2, 0.33), (0.05, 0.1, 5.0)  # of the image points; mm
LAPS, EXTRA = (60.0, 80.0, 90.0), (500, 200, 60)  # per cent; points of a model beside the standard ones


def spoiled(seed: int) -> Project:
    """Simulate a dense strip, or every other time a block, and move a share of its image points."""
    rng, lap = np.random.default_rng(seed), seed % len(LAPS)
    spec = Spec(
        seed=seed,
        flight=Flight(photos=6, strips=2 if seed % 2 else 1, end_lap_percent=LAPS[lap]),
        terrain=Terrain(relief=60.0),
        points=Points(rows=5, extra_per_model=int(EXTRA[lap] * rng.uniform(1.0, 2.0))),
        control=Control(bands=2, per_band=3),
    )
    project = project_of(simulate(spec))
    o = project.inputs.observations
    wrong = np.flatnonzero(rng.random(len(o)) < rng.choice(SHARES))
    xy = o.xy.copy()
    xy[wrong] += rng.normal(0.0, rng.choice(SIZES), (len(wrong), 2))
    inputs = replace(project.inputs, observations=replace(o, xy=xy))
    return replace(project, inputs=inputs, wrong=frozenset(project.names[row] for row in wrong.tolist()))


class Outcome(NamedTuple):
    """What comes of a project with one value of a constant."""

    seconds: float
    errors: dict[str, list[float]]  # of points that no wrong ray places, metres
    left: int  # wrong rays left in
    lost: int  # good rays lost


def outcome(home: str, name: str, values: tuple[int, ...], seed: int) -> list[Outcome | None]:
    """Adjust a project with every value; None where it is refused."""
    project, found = spoiled(seed), list[Outcome | None]()
    for value in values:
        put(home, name, value)
        began = time.process_time()
        try:
            run = adjusted(project, project.settings)
        except PhotostripError:
            found.append(None)
            continue
        seconds, left = time.process_time() - began, run.placing & project.wrong
        touched = {each.partition("/")[2] for each in left}
        errors = dict(zip(run.point, run.errors.tolist(), strict=True))
        lost = len(project.names) - len(project.wrong) - len(run.placing - project.wrong)
        right = {point: error for point, error in errors.items() if point not in touched}
        found.append(Outcome(seconds=seconds, errors=right, left=len(left), lost=lost))
    return found


def line(value: int, found: list[tuple[Outcome, Outcome]]) -> str:
    """Sum up what one value gives, against the first."""
    ratios = []
    for base, other in found:
        common = sorted(base.errors.keys() & other.errors.keys())
        squares = [np.square([each.errors[point] for point in common]) for each in (base, other)]
        plan, height = ([each[:, axes].mean() for each in squares] for axes in (slice(2), slice(2, 3)))
        ratios.append(np.log([plan[1] / plan[0], height[1] / height[0]]) / 2)
    mean, worst = np.exp(np.mean(ratios, axis=0)), np.exp(np.max(ratios, axis=0))
    runs = [other for _, other in found]
    cells = f"{sum(run.seconds for run in runs):7.1f} s   rms {mean[0]:.3f} {mean[1]:.3f}, worst {worst.max():.3f}"
    shown = "never" if value == NEVER else value
    return f"{shown!s:>7}{cells}   {sum(run.left for run in runs)} left in, {sum(run.lost for run in runs)} lost"


def main() -> None:
    """Print a line for every value of every constant."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("projects", type=int, nargs="?", default=48)
    parser.add_argument("--first-seed", type=int, default=7_700_001)
    parser.add_argument("--only", nargs="+", default=("",), metavar="WORD", help="constants whose name has a word")
    parser.add_argument("--workers", type=int, default=1)
    asked = parser.parse_args()
    seeds = range(asked.first_seed, asked.first_seed + asked.projects)
    for name, (home, values) in CONSTANTS.items():
        if not any(word in name for word in asked.only):
            continue
        with get_context("fork").Pool(asked.workers, maxtasksperchild=1) as pool:
            runs = pool.map(partial(outcome, home, name, values), seeds, chunksize=1)
        print(f"{name}, {len(runs)} projects, {sum(None in each for each in runs)} with a value refused", flush=True)
        for place, value in enumerate(values):
            both = [(first, other) for run in runs if (first := run[0]) and (other := run[place])]
            print(line(value, both), flush=True)


if __name__ == "__main__":
    main()
