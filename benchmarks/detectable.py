"""Wrong image points that still place a point, beside those that no test at the level of the search can find.

The strips of ``gross_errors.py``. An error of an image coordinate of e standard deviations shows in the misclosures of
its point, on photos that all other points orient, as d = e sqrt(r), r its redundancy number. A test whose limit is c
misses it with the probability that a normal variable is below c - d. The sum of these, with the limits that the search
along the strip ended with, is what it misses when it makes no mistake.

Usage: python benchmarks/detectable.py [STRIPS] [--first-seed N] [--workers N]
"""

from __future__ import annotations

import argparse
import os
import sys
from collections import Counter
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from statistics import NormalDist, median
from typing import Any, NamedTuple
from unittest.mock import patch

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run from anywhere, installed or not

from photostrip.threads import limit_threads

limit_threads()  # as the command does, before numpy is imported

import numpy as np  # noqa: E402

from benchmarks.gross_errors import STRIP, adjusted, pair_of_projects  # noqa: E402
from photostrip.network.gross_errors import point_decisions, ray_decisions, snooping  # noqa: E402

KINDS = (
    "two photos, along the base",
    "two photos, across",
    "three photos, along the base",
    "three photos, across",
    "another ray wrong too",
)


class Wrong(NamedTuple):
    """A wrong image point."""

    kind: str
    size: float  # standard deviations
    missed: float  # probability that a test at the limit of the search misses it
    placing: bool  # whether it places a point


def wrong_points(seed: int) -> list[Wrong]:
    """Adjust a strip with errors; say of each whether it is found, and how probable that was."""
    searches: list[tuple[snooping.ScreenedBundle, snooping._Search]] = []
    screen_bundle, of_strip = snooping.screen_bundle, 4  # arguments; for a photo that was shifted no ray is kept

    def remembered(*given: Any, **named: Any) -> snooping.ScreenedBundle:  # noqa: ANN401  as ``screen_bundle``
        found = screen_bundle(*given, **named)
        if len(given) == of_strip:
            searches.append((found, snooping._Search(*given, **named)))  # noqa: SLF001
        return found

    _, project = pair_of_projects("strips", seed)
    with patch.object(snooping, "screen_bundle", remembered):
        run = adjusted(project, replace(project.settings, adjustment="polynomial"))
    o, of_point = project.simulation.observations, Counter(name.partition("/")[2] for name in project.wrong)
    place = {name: row for row, name in enumerate(project.names)}
    rays, points = np.bincount(o.point), []
    for error in project.simulation.truth.errors:
        if error.kind != "image":
            continue
        row, axis = place[f"{error.photo}/{error.point}"], "xy".index(error.axis)
        kind = KINDS[4] if of_point[error.point] > 1 else KINDS[2 * (int(rays[o.point[row]]) - 2) + axis]
        sigma = STRIP.image.sigma_um / 1000
        points.append(
            Wrong(
                kind=kind,
                size=abs(error.size) / sigma,
                missed=missed(*searches[-1], row, axis, abs(error.size) / sigma) if searches else 1.0,
                placing=project.names[row] in run.placing,
            )
        )
    return points


def missed(found: snooping.ScreenedBundle, search: Any, row: int, axis: int, size: float) -> float:  # noqa: ANN401
    """Probability that the test of a point misses an error of one of its rays.

    row: of the image points of the project; all of them stand in a pair, and so in the network of the strip.
    """
    point = int(search.problem.images.point[row])
    rows = search.rays_of(np.array([point]))
    placed = found.selection.images[rows].sum() > 1
    place = np.where(placed, found.solution.points[[point]], np.nan)
    with patch.object(ray_decisions, "decide", wraps=point_decisions.decide) as decide:
        search._decided(found, rows, place)  # noqa: SLF001
    _, (weight,), (basis,) = point_decisions._misclosures(decide.call_args.args[0])  # noqa: SLF001
    effect = basis[2 * rows.tolist().index(row) + axis]
    shift = size * np.sqrt(max(effect @ weight @ effect, 0.0)) / found.limit.unit
    return NormalDist().cdf(float(found.limit.of(len(rows))) - float(shift))


def main() -> None:
    """Print a line for each kind of point."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("strips", type=int, nargs="?", default=20, help="number of strips (default 20)")
    parser.add_argument("--first-seed", type=int, default=1, help="number of the first strip (default 1)")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="processes (default: one for each core)")
    options = parser.parse_args()
    with get_context("fork").Pool(options.workers) as pool:
        seeds = range(options.first_seed, options.first_seed + options.strips)
        found = [each for points in pool.imap(wrong_points, seeds) for each in points]
    print("wrong image points                drawn   below the limit   placing a point   their size, median")
    for kind in (*KINDS, "all"):
        some = [each for each in found if kind in {each.kind, "all"}]
        sizes = [each.size for each in some if each.placing]
        cells = f"{kind:30s}{len(some):9d}{sum(each.missed for each in some):18.1f}{len(sizes):18d}"
        print(f"{cells}{median(sizes) if sizes else float('nan'):16.1f} sd")


if __name__ == "__main__":
    main()
