"""Bundle adjustments that Ceres has solved, kept: ``python -m tests.peer`` (with pyceres and pycolmap) renews them.

``python -m tests.peer --print`` solves them anew and prints what it found; a test compares that with what is kept.
"""

from __future__ import annotations

import json
import os
import sys
from typing import TYPE_CHECKING

import numpy as np

from photostrip.simulation import Control, Flight, Points, Spec, simulate
from tests.simulated_bundle import problem_of
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from photostrip.network.problem import BundleProblem

FILE = ROOT / "tests" / "data" / "bundle_by_ceres.json"
TIGHT = 1e-16
SHAPES = {"strip of 6": (6, 1), "block of 3 x 5": (5, 3)}


def problem(name: str) -> BundleProblem:
    """Give one of the problems; they are made, not kept: the simulation always gives the same numbers."""
    photos, strips = SHAPES[name]
    spec = Spec(
        flight=Flight(photos=photos, strips=strips),
        points=Points(rows=3, extra_per_model=3),
        control=Control(bands=2, sigma=(0.05, 0.05, 0.08)),
    )
    return problem_of(simulate(spec))


def solved() -> dict[str, dict[str, list[list[float]]]]:
    """Solve all problems with Ceres, to the last digit."""
    from benchmarks.peers import by_ceres

    found = {}
    for name in SHAPES:
        peer = by_ceres(problem(name), "DENSE_SCHUR", TIGHT)
        found[name] = {"points": np.round(peer.points, 10).tolist(), "centers": np.round(peer.centers, 10).tolist()}
    return found


def main() -> None:
    """Renew the file, or print."""
    text = json.dumps(solved(), separators=(",", ":")).replace("],[", "],\n[").replace("},", "},\n") + "\n"
    if "--print" in sys.argv:
        sys.stdout.write(text)
    else:
        FILE.write_text(text, encoding="utf-8")
    sys.stdout.flush()
    os._exit(0)  # what pyceres and pycolmap own together cannot be freed


if __name__ == "__main__":
    main()
