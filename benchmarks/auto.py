"""How well `adjustment: auto` chooses: its errors beside those of the best method, over lengths, control and overlaps.

Simulated film strips with known truth, 1:10 000, 5 µm in the image, control good to 2 cm. Cells differ in photos,
overlap, control (corners, or bands of two or three points) and in what no standard deviation knows: nothing, a lens
error of 5 µm that all photos share, or a film error of 5 µm of each photo by itself, both smooth over the photo. Errors
are those of all points that are not control, the geometric mean of plan and height. Printed are the best of similarity,
polynomial and covariance in the cell, auto divided by it, the same in the worst single strip, and how often auto took
the polynomial; at the end the same with other limits of what left-out errors may exceed, and of how far the results of
two methods that predict the same may be apart.

With --dense there are ten more new points in each model, and a band of three or five control points on every photo.

Usage: python benchmarks/auto.py [--seeds N] [--photos N ...] [--overlap PERCENT ...] [--errors none lens film]
       [--undescribed MICROMETRES] [--dense]
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run from anywhere, installed or not

from photostrip.threads import limit_threads

limit_threads()  # before numpy is imported

import numpy as np  # noqa: E402

from photostrip.pipeline.frames import tie_ground_frames  # noqa: E402
from photostrip.pipeline.given_points import measured_control  # noqa: E402
from photostrip.pipeline.image_coordinates import correct, orient_interior  # noqa: E402
from photostrip.pipeline.strips.absolute import orient_on_control, reject_wrong_control  # noqa: E402
from photostrip.pipeline.strips.adjusting import adjust  # noqa: E402
from photostrip.pipeline.strips.choosing import MOST_EXCESS, decide  # noqa: E402
from photostrip.pipeline.strips.forming import form_strips  # noqa: E402
from photostrip.pipeline.strips.stages import Stages  # noqa: E402
from photostrip.simulation.simulation import simulate  # noqa: E402
from photostrip.simulation.spec import FILM, Control, Flight, Points, Spec  # noqa: E402
from photostrip.triangulation.covariance_adjustment.settings import BETTER  # noqa: E402
from tests.simulated import inputs_of, settings_of  # noqa: E402

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from photostrip.pipeline.choice import Choice
    from photostrip.pipeline.inputs import Inputs
    from photostrip.pipeline.results import StripResult
    from photostrip.simulation.simulation import Simulation

    Floats = NDArray[np.float64]

AUTO = "auto"
METHODS = ("similarity", "polynomial", "covariance")
PHOTOS, OVERLAPS, ERRORS = (6, 10), (60.0, 80.0), ("none", "lens", "film")
BANDS, PER_BAND = (2, 3, 4, 6, 12), (3, 2)
DENSE_PER_BAND, DENSE_EXTRA = (3, 5), 10
LONG = 50  # photos from which on one overlap and fewer strips do
UNDESCRIBED = 5.0  # micrometres, rms over a photo
HALF = 115.0  # mm, half a photo
IN_MEAN, IN_ONE = 1.05, 1.2  # times the errors of the best method that auto may have, in a cell and in a strip
CENTIMETRES = 100.0
LIMITS = (MOST_EXCESS / 2, MOST_EXCESS, 2 * MOST_EXCESS, np.inf)  # of the excess of left-out errors
LEAST = (0.0, 2 * BETTER - 1, BETTER, (1 + BETTER) / 2)  # ratio of errors with which results are taken to agree


@dataclass(frozen=True)
class Cell:
    """A kind of strip."""

    photos: int
    overlap: float
    bands: int
    per_band: int
    error: str
    undescribed: float = UNDESCRIBED  # micrometres
    extra: int = 2  # new points of a model beside those of the rows

    @property
    def control(self) -> str:
        """Its control in words."""
        return "corners" if self.bands == self.per_band == 2 else f"{self.bands} bands of {self.per_band}"

    def spec(self, seed: int) -> Spec:
        """Specify one strip."""
        return Spec(
            seed=seed,
            camera=replace(FILM, principal_distance=153.0),
            flight=Flight(photos=self.photos, end_lap_percent=self.overlap),
            points=Points(rows=5, reach_percent=75.0, extra_per_model=self.extra),
            control=Control(
                bands=self.bands,
                per_band=self.per_band,
                check=0,
                sigma=(0.02, 0.02, 0.02),
            ),
        )


@dataclass(frozen=True)
class Row:
    """Errors of a cell: by method and strip, plan and height, metres; and what auto chose by in each strip."""

    cell: Cell
    errors: dict[str, Floats]
    choices: tuple[Choice | None, ...]

    def of(self, method: str) -> float:
        """Errors of a method over all strips, plan and height as one."""
        mean = np.sqrt((self.errors[method] ** 2).mean(axis=0))
        return float(np.sqrt(mean.prod()))

    @property
    def taken(self) -> tuple[str, ...]:
        """What auto took in each strip."""
        return tuple("polynomial" if choice is None else choice.taken for choice in self.choices)

    def at(self, most: float = MOST_EXCESS, least: float = BETTER) -> Row:
        """Give the cell as it were with other limits of what left-out errors may exceed and of results that agree."""
        cell = self.cell

        def decided(choice: Choice) -> Choice:
            agree = choice.predicted.for_polynomial and not choice.expected.ratio < least
            by_both = "polynomial" if agree else "covariance"
            taken = decide(by_both, choice.left_out, choice.excess, cell.bands, cell.photos - 1, most)
            return replace(choice, taken=taken)

        row = replace(self, choices=tuple(choice and decided(choice) for choice in self.choices))
        chosen = np.array([self.errors[method][number] for number, method in enumerate(row.taken)])
        return replace(row, errors=self.errors | {AUTO: chosen})

    @property
    def best(self) -> str:
        """The method that does best in the cell."""
        return min(METHODS, key=self.of)

    @property
    def ratio(self) -> float:
        """Errors of auto over those of the best method."""
        return self.of(AUTO) / self.of(self.best)

    @property
    def worst(self) -> float:
        """The largest of the same ratio of single strips."""
        return float(np.sqrt((self.errors[AUTO] / self.errors[self.best]).prod(axis=1)).max())


def cells(
    photos: Sequence[int], overlaps: Sequence[float], errors: Sequence[str], undescribed: float = UNDESCRIBED
) -> Iterator[Cell]:
    """Give all cells of the grid."""
    layouts = [(bands, per_band) for per_band in PER_BAND for bands in BANDS]
    for count in photos:
        for overlap in overlaps[:1] if count > LONG else overlaps:
            for bands, per_band in layouts:
                if bands <= count:
                    yield from (Cell(count, overlap, bands, per_band, error, undescribed) for error in errors)


def dense_cells(
    photos: Sequence[int], overlaps: Sequence[float], errors: Sequence[str], undescribed: float = UNDESCRIBED
) -> Iterator[Cell]:
    """Give cells with a band on every photo."""
    for count, overlap, per_band, error in product(photos, overlaps, DENSE_PER_BAND, errors):
        yield Cell(count, overlap, count, per_band, error, undescribed, DENSE_EXTRA)


def smooth_error(xy: Floats, rng: np.random.Generator, size: float) -> Floats:
    """Return image errors (n, 2), mm, of powers of the coordinates, drawn anew at every call; `size` in micrometres."""
    weights = rng.normal(size=(7, 2))
    drawn = np.sqrt(np.square(_powers(_raster()) @ weights).mean())
    found: Floats = _powers(xy / HALF) @ weights * (size / 1000 / drawn)
    return found


def _powers(xy: Floats) -> Floats:
    x, y = xy.T
    return np.column_stack([x * x, x * y, y * y, x**3, x * x * y, x * y * y, y**3])


def _raster() -> Floats:
    x, y = np.meshgrid(np.linspace(-0.9, 0.9, 9), np.linspace(-0.9, 0.9, 9))
    return np.column_stack([x.ravel(), y.ravel()])


def spoiled(inputs: Inputs, cell: Cell, seed: int) -> Inputs:
    """Add what no standard deviation knows."""
    if cell.error == "none":
        return inputs
    rng, measured = np.random.default_rng([seed, 99]), inputs.observations
    xy = measured.xy.copy()
    groups = [np.arange(len(xy))]
    if cell.error == "film":
        groups = [np.flatnonzero(measured.photo == photo) for photo in range(len(measured.photo_ids))]
    for rows in groups:
        xy[rows] += smooth_error(xy[rows], rng, cell.undescribed)
    return replace(inputs, observations=replace(measured, xy=xy))


def errors_of(cell: Cell, seed: int) -> tuple[dict[str, Floats], Choice | None]:
    """Adjust one strip in every way; rms errors in plan (of one coordinate) and in height, and what auto chose by."""
    simulation = simulate(cell.spec(seed))
    inputs, settings = spoiled(inputs_of(simulation), cell, seed), settings_of(simulation)
    ground, photo = tie_ground_frames(inputs, settings, None, None), orient_interior(inputs, settings)
    observations = correct(photo, inputs, settings, ground, Stages()).observations
    (formed,) = form_strips(inputs, observations, settings, Stages())
    oriented = orient_on_control(
        formed, measured_control(inputs.control, observations), ground.control, settings.absolute
    )
    screened = reject_wrong_control(oriented, settings)
    adjusted = {each: adjust(screened, replace(settings, adjustment=each)) for each in (*METHODS, AUTO)}
    errors = {name: _rms(simulation, each, observations.point_ids) for name, each in adjusted.items()}
    return errors, adjusted[AUTO].choice


def _rms(simulation: Simulation, strip: StripResult, point_ids: Sequence[str]) -> Floats:
    number = {name: row for row, name in enumerate(simulation.truth.points.ids)}
    fixed = set(simulation.control.ids)
    ids = [point_ids[point] for point in strip.formed.point]
    rows = [row for row, name in enumerate(ids) if name not in fixed]
    truth = simulation.truth.points.xyz[[number[ids[row]] for row in rows]]
    mean = np.square((strip.cartesian[rows] - truth) @ strip.intermediate.axes).mean(axis=0)
    return np.asarray(np.sqrt([mean[:2].mean(), mean[2]]), float)


def row_of(cell: Cell, seeds: int) -> Row:
    """Adjust the strips of a cell."""
    found = [errors_of(cell, seed) for seed in range(1, 1 + seeds)]
    errors = {name: np.array([errors[name] for errors, _ in found]) for name in (*METHODS, AUTO)}
    return Row(cell, errors, tuple(choice for _, choice in found))


def line_of(row: Row) -> str:
    """Give a cell as a line of the table."""
    cell = row.cell
    size = " / ".join(f"{CENTIMETRES * value:.1f}" for value in np.sqrt((row.errors[AUTO] ** 2).mean(axis=0)))
    polynomial = f"{row.taken.count('polynomial')} of {len(row.taken)}"
    against = f"{row.of('polynomial') / row.of(row.best):.2f}"
    cells_ = (cell.photos, f"{cell.overlap:.0f} %", cell.control, cell.error, size, row.best, f"{row.ratio:.2f}")
    return "| " + " | ".join(map(str, (*cells_, f"{row.worst:.2f}", against, polynomial))) + " |"


HEAD = ("photos", "overlap", "control", "undescribed", "auto, plan / height, cm", "best", "auto / best", "worst strip")
HEADS = (*HEAD, "polynomial / best", "polynomial taken")


def summary_of(rows: Sequence[Row]) -> str:
    """Say how many cells and strips keep the limits."""
    strips = sum(len(row.taken) for row in rows)
    polynomial = sum(row.taken.count("polynomial") for row in rows)
    within = sum(row.ratio <= IN_MEAN for row in rows)
    far = sum(row.worst > IN_ONE for row in rows)
    return (
        f"auto within {IN_MEAN:g} of the best method in {within} of {len(rows)} cells, worst "
        f"{max(row.ratio for row in rows):.2f}; cells with a strip beyond {IN_ONE:g}: {far}, worst "
        f"{max(row.worst for row in rows):.2f}; the polynomial was taken in {polynomial} of {strips} strips"
    )


def limits_of(rows: Sequence[Row]) -> str:
    """Say what other limits of the excess of left-out errors, and of results that agree, would have brought."""
    by_most = [_at(f"{most:g}", [row.at(most) for row in rows]) for most in LIMITS]
    by_least = [_at(f"{least:g}", [row.at(least=least) for row in rows]) for least in LEAST]
    heads = "auto / best, mean | worst cell | worst strip | polynomial taken |\n|---|---|---|---|---|"
    tables = (("most excess", by_most), ("least ratio with the results", by_least))
    return "\n\n".join("\n".join((f"| {name} | {heads}", *lines)) for name, lines in tables)


def _at(limit: str, rows: Sequence[Row]) -> str:
    """Give what all cells come to as a line of the table of a limit."""
    ratios = [row.ratio for row in rows]
    mean, taken = np.exp(np.log(ratios).mean()), sum(row.taken.count("polynomial") for row in rows)
    return f"| {limit} | {mean:.3f} | {max(ratios):.2f} | {max(row.worst for row in rows):.2f} | {taken} |"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=2, help="strips of each cell; a fifth of them of long strips")
    parser.add_argument("--photos", type=int, nargs="+", default=PHOTOS)
    parser.add_argument("--overlap", type=float, nargs="+", default=OVERLAPS)
    parser.add_argument("--errors", nargs="+", choices=ERRORS, default=ERRORS)
    parser.add_argument("--undescribed", type=float, default=UNDESCRIBED, help="rms over a photo, micrometres")
    parser.add_argument("--dense", action="store_true", help="a band on every photo, and more new points")
    asked = parser.parse_args(arguments)
    sys.stdout.write(f"| {' | '.join(HEADS)} |\n|{'---|' * len(HEADS)}\n")
    rows = []
    every = dense_cells if asked.dense else cells
    for cell in every(asked.photos, asked.overlap, asked.errors, asked.undescribed):
        rows.append(row_of(cell, max(1, asked.seeds // 5) if cell.photos > LONG else asked.seeds))
        sys.stdout.write(line_of(rows[-1]) + "\n")
        sys.stdout.flush()
    sys.stdout.write(f"\n{summary_of(rows)}\n\n{limits_of(rows)}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
