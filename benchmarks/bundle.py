"""How fast the bundle adjustment is, side by side with Ceres (pyceres) and COLMAP (pycolmap) on the very same problems.

Every program gets the same arrays and the same start in the same process, one thread each, one after the other in each
round; times are those of the processor, medians of the rounds. Without the two packages only our own times are printed.

Usage: python benchmarks/bundle.py [--rounds N] [--cases strip large block] [--largest N] [--alone]
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run from anywhere, installed or not

from photostrip.threads import limit_threads

limit_threads()  # before numpy is imported, also in the processes that are started here

import numpy as np  # noqa: E402

from benchmarks import peers  # noqa: E402
from benchmarks.accuracy import table  # noqa: E402
from photostrip.network.adjustment import solve  # noqa: E402
from photostrip.network.reliability import cofactors_of  # noqa: E402
from photostrip.simulation import Control, Flight, Ground, Points, Spec, Terrain, simulate  # noqa: E402
from tests.simulated_bundle import problem_of  # noqa: E402

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from photostrip.network.adjustment import BundleSolution, Cofactors
    from photostrip.network.problem import BundleProblem

LIMITS = {"whole": 0.5, "block": 1.0, "solver": 0.8, "colmap": 0.25, "covariances": 1.0}
EXTRA = {False: 0.41, True: 0.256}  # points of a model for each point of a photo, in a strip and in a block
SHIFT, TURN = 0.5, 1e-3  # metres and radians, of all start values


@dataclass(frozen=True)
class Case:
    """Photos to adjust: strips, photos of a strip, measured points of a photo (about)."""

    strips: int
    photos: int
    each: int

    @property
    def title(self) -> str:
        """Its name."""
        shape = f"{self.strips} x {self.photos}" if self.strips > 1 else f"{self.photos}"
        return f"{shape} x {self.each}"


STRIPS = [Case(1, photos, each) for photos in (100, 300, 1000) for each in (40, 300)]
CASES = {
    "strip": STRIPS[:-1],
    "large": STRIPS[-1:],
    "block": [Case(20, 50, 40)],
}


def problem(case: Case) -> BundleProblem:
    """Make the problem: the real Earth, 5 micrometres, control every five photos, a start off the truth.

    Parameters
    ----------
    case : Case
        Its size.

    Returns
    -------
    BundleProblem
        All points with two rays and more.
    """
    extra = max(round(EXTRA[case.strips > 1] * case.each) - 5, 0)
    spec = Spec(
        ground=Ground(crs="geocentric", axes=("x", "y", "z")),
        flight=Flight(photos=case.photos, strips=case.strips, scale=2500.0),
        terrain=Terrain(relief=20.0),
        points=Points(rows=5, reach_percent=85.0, extra_per_model=extra),
        control=Control(every=5, per_band=3, sigma=(0.05, 0.05, 0.05)),
    )
    return problem_of(simulate(spec), shift=SHIFT, turn=TURN)


def timed(given: BundleProblem) -> tuple[float, float, BundleSolution, Cofactors]:
    """Adjust and find all covariances: seconds of the processor for each, and the results."""
    began = time.process_time()
    solution = solve(given)
    solved = time.process_time()
    cofactors = cofactors_of(solution)
    return solved - began, time.process_time() - solved, solution, cofactors


# ------------------------------------------------------------------------------------------------- side by side


@dataclass(frozen=True)
class Times:
    """Medians of one case, seconds; largest difference of a coordinate to Ceres in standard deviations."""

    solve: float
    covariances: float
    ceres: float
    solver: float
    colmap: float
    difference: float
    steps: tuple[int, int, int]


def measure(given: BundleProblem, rounds: int, *, alone: bool) -> Times:
    """Adjust a problem with all programs, several times."""
    solve(given)  # imports and warms up
    rows = []
    for _ in range(rounds):
        own, more, solution, cofactors = timed(given)
        if alone:
            rows.append((own, more, np.nan, np.nan, np.nan))
            difference, steps = np.nan, (len(solution.steps), 0, 0)
            continue
        ceres, colmap = peers.by_ceres(given), peers.by_colmap(given)
        rows.append((own, more, ceres.whole, ceres.solving, colmap.whole))
        deviation = np.sqrt(np.einsum("nii->ni", cofactors.points))
        difference = float(np.nanmax(np.abs(ceres.points - solution.points) / deviation))
        steps = (len(solution.steps), ceres.steps, colmap.steps)
    own, more, whole, solver, colmap_whole = np.median(rows, axis=0).tolist()
    return Times(own, more, whole, solver, colmap_whole, difference, steps)


def side_by_side(cases: Iterable[Case], rounds: int, *, alone: bool) -> None:
    """Print times and ratios."""
    head = ("photos", "rays", "points", "solve", "covariances", "Ceres", "its solver", "COLMAP", "steps", "difference")
    lines, ratios = [], []
    for case in cases:
        given = problem(case)
        found = measure(given, rounds, alone=alone)
        lines.append(
            (
                case.title,
                str(len(given.images)),
                str(given.points),
                *(
                    f"{1000.0 * value:.0f}" if np.isfinite(value) else "-"
                    for value in (found.solve, found.covariances, found.ceres, found.solver, found.colmap)
                ),
                "/".join(map(str, found.steps)),
                f"{found.difference:.0e}" if np.isfinite(found.difference) else "-",
            )
        )
        ratios.append((case, found))
    print(
        f"milliseconds of the processor, medians of {rounds}, one thread; steps of photostrip/Ceres/COLMAP;\n"
        "difference of coordinates to Ceres, in standard deviations"
    )
    table(head, lines)
    _print_ratios(ratios)


def _print_ratios(ratios: Sequence[tuple[Case, Times]]) -> None:
    """Print ratios with their limits."""
    lines = []
    for case, found in ratios:
        whole = LIMITS["block" if case.strips > 1 else "whole"]
        pairs: list[tuple[float, float | None]] = [(found.solve / found.ceres, whole)]
        pairs += [
            (found.solve / found.solver, LIMITS["solver"] if case.strips == 1 else None),
            (found.solve / found.colmap, LIMITS["colmap"] if case.strips == 1 else None),
            (found.covariances / found.solve, LIMITS["covariances"]),
        ]
        limits = [f" of {limit:.2f}" if limit else "" for _, limit in pairs]
        both = zip((value for value, _ in pairs), limits, strict=True)
        cells = ["-" if np.isnan(value) else f"{value:.2f}{limit}" for value, limit in both]
        good = all(limit is None or value <= limit for value, limit in pairs if np.isfinite(value))
        lines.append((case.title, *cells, "yes" if good else "no"))
    print(
        "ratios with their limits: our solution to the whole call of Ceres, to its solver alone, to the whole call of"
    )
    print("COLMAP; our covariances of all points and photos to our solution")
    table(("photos", "to Ceres", "to its solver", "to COLMAP", "covariances", "within"), lines)


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5, help="rounds of which medians are taken")
    parser.add_argument("--cases", nargs="*", choices=CASES, default=[*CASES], help="which tables to print")
    parser.add_argument("--largest", type=int, default=100_000, help="photos of the largest strip to adjust")
    parser.add_argument("--alone", action="store_true", help="without the other programs")
    wanted = parser.parse_args()
    alone = wanted.alone or not peers.available()
    if not peers.available():
        print("pyceres and pycolmap are not installed (pip install 'photostrip[peer]'): only our own times\n")
    for name, cases in CASES.items():
        if name in wanted.cases:
            fitting = [case for case in cases if case.photos <= wanted.largest]
            side_by_side(fitting, wanted.rounds, alone=alone)
    sys.stdout.flush()
    if peers.KEPT:
        os._exit(0)  # what two libraries own together cannot be freed


if __name__ == "__main__":
    main()
