"""Which adjustment a strip needs: errors of polynomial and bundle at points that are not control.

Simulated strips with known truth, 1:10 000, five micrometres in the image, 60 % end lap, six points across every nadir;
bands of three control points (2 cm) spread evenly over the strip. Errors are those of all points that are not control,
root mean square over all strips, in plan and in height, in centimetres; beside them how many times larger they are than
those of the bundle.

Usage: python benchmarks/methods.py [--seeds N] [--models 5 10 ...] [--bands 2 3 ...]
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run from anywhere, installed or not

from photostrip.threads import limit_threads

limit_threads()  # before numpy is imported

import numpy as np  # noqa: E402

from photostrip.pipeline.run import triangulate  # noqa: E402
from photostrip.simulation import Control, Flight, Points, Spec, simulate  # noqa: E402
from tests.simulated import inputs_of, settings_of  # noqa: E402

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from photostrip.pipeline.results import Result
    from photostrip.simulation import Simulation

    Floats = NDArray[np.float64]

METHODS = ("polynomial", "bundle")
MODELS, BANDS, SEEDS = (5, 10, 15, 20, 25, 30, 40), (2, 3, 4, 5), 8
SUFFICES = 1.5  # times the errors of the bundle up to which the polynomial is good enough
CENTIMETRES = 100.0


@dataclass(frozen=True)
class Row:
    """Errors of one kind of strip.

    Parameters
    ----------
    models, bands : int
        Length of the strip and bands of control.
    rms : dict of str to tuple of float
        Root mean square in plan (of one coordinate) and in height by method, metres.
    """

    models: int
    bands: int
    rms: dict[str, tuple[float, float]]

    def ratio(self, method: str) -> tuple[float, float]:
        """Errors against those of the bundle, in plan and in height."""
        best = self.rms["bundle"]
        return self.rms[method][0] / best[0], self.rms[method][1] / best[1]


def spec_of(models: int, bands: int, seed: int) -> Spec:
    """Give one strip."""
    return Spec(
        seed=seed,
        flight=Flight(photos=models + 1),
        points=Points(rows=6, extra_per_model=6),
        control=Control(bands=bands, per_band=3, sigma=(0.02, 0.02, 0.02), check=0),
    )


def squares(simulation: Simulation, result: Result) -> Floats:
    """Squares of the errors east, north and up at all points that are not control, shape (n, 3)."""
    number = {name: row for row, name in enumerate(simulation.truth.points.ids)}
    control = set(simulation.control.ids)
    names = [result.refined.observations.point_ids[n] for n in result.points.number]
    rows = np.array([row for row, name in enumerate(names) if name not in control], np.intp)
    truth = simulation.truth.points.xyz[[number[names[row]] for row in rows]]
    place = result.points.cartesian[rows]
    turned = np.einsum("nij,nj->ni", result.output.level_axes_at(place), place - truth)
    return np.asarray(turned**2)


def row_of(models: int, bands: int, seeds: int) -> Row:
    """Adjust some strips of one kind in every way."""
    found: dict[str, list[Floats]] = {method: [] for method in METHODS}
    for seed in range(seeds):
        simulation = simulate(spec_of(models, bands, seed))
        inputs, settings = inputs_of(simulation), settings_of(simulation)
        for method in METHODS:
            found[method].append(squares(simulation, triangulate(inputs, replace(settings, adjustment=method))))
    rms = {}
    for method, parts in found.items():
        mean = np.concatenate(parts).mean(axis=0)
        rms[method] = (float(np.sqrt(mean[:2].mean())), float(np.sqrt(mean[2])))
    return Row(models, bands, rms)


def lines_of(rows: Sequence[Row]) -> list[str]:
    """Give the table as Markdown."""
    heads = [f"{method} {part}" for method in METHODS for part in ("plan", "height")]
    lines = [
        f"| models | bands | {' | '.join(heads)} | polynomial / bundle |",
        f"|---|---|{'---|' * (len(heads) + 1)}",
    ]
    for row in rows:
        cells = [f"{CENTIMETRES * value:.1f}" for method in METHODS for value in row.rms[method]]
        ratio = "{:.2f} / {:.2f}".format(*row.ratio("polynomial"))
        lines.append(f"| {row.models} | {row.bands} | {' | '.join([*cells, ratio])} |")
    return lines


def verdict_of(rows: Sequence[Row]) -> str:
    """Say up to how many models the polynomial suffices, for each number of bands."""
    parts = []
    for bands in sorted({row.bands for row in rows}):
        enough = 0
        for row in sorted((row for row in rows if row.bands == bands), key=lambda row: row.models):
            if max(row.ratio("polynomial")) > SUFFICES:
                break
            enough = row.models
        parts.append(f"{bands} bands: {f'up to {enough} models' if enough else 'never'}")
    return f"polynomial within {SUFFICES:g} times the errors of the bundle: {'; '.join(parts)}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=SEEDS, help="strips of each kind")
    parser.add_argument("--models", type=int, nargs="+", default=MODELS)
    parser.add_argument("--bands", type=int, nargs="+", default=BANDS)
    asked = parser.parse_args(arguments)
    rows = [row_of(models, bands, asked.seeds) for bands in asked.bands for models in asked.models]
    sys.stdout.write("\n".join([*lines_of(rows), "", verdict_of(rows)]) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
