"""Gross errors in relative orientation: how many are found, how many good points are lost, how long it takes.

Run it as ``python benchmarks/screening.py [repetitions]``, or with ``--growth [PHOTOS ...]`` for the last table alone:
how the time of the search grows with the number of photos. The first table repeats the published experiment: 34 models
of 16 points, 44 errors of 0.1 to 0.5 mm. Reference rates of other programs stand in the last row of each block.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run from anywhere, installed or not

from photostrip.threads import limit_threads

limit_threads()  # as the command does, before numpy is imported

import numpy as np  # noqa: E402

from photostrip.network.gross_errors.strip_rays import StripRays  # noqa: E402
from photostrip.pipeline.strips.screened_formation import form_screened  # noqa: E402
from photostrip.planning.screening import (  # noqa: E402
    PairLayout,
    ScreeningSpec,
    rejected,
    screened,
    screening_experiment,
    spoiled,
    standard_pairs,
)
from photostrip.simulation.simulation import simulate  # noqa: E402
from photostrip.simulation.spec import Flight, GrossError, Points, Spec  # noqa: E402
from photostrip.statistics import chi2_quantile  # noqa: E402
from photostrip.strip.gross_errors.pairs import deletion, screening  # noqa: E402
from photostrip.strip.relative_orientation.orientation import RelativeSettings, orient_unchecked  # noqa: E402
from photostrip.strip.relative_orientation.pairs import collect_pairs  # noqa: E402
from photostrip.strip.relative_orientation.solution import linearised_parallaxes  # noqa: E402
from photostrip.strip.strip_formation.scale_transfer import StripFormationSettings  # noqa: E402
from photostrip.strip.strip_formation.strip import form_from_pairs  # noqa: E402
from tests.simulated import inputs_of  # noqa: E402

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from photostrip.pipeline.inputs import Inputs
    from photostrip.planning.screening import MethodOutcome
    from photostrip.strip.relative_orientation.pairs import Pairs

    Floats = NDArray[np.float64]
    Flags = NDArray[np.bool_]

PUBLISHED = ScreeningSpec()
MODELS, COUNTS, SIGMA_Q = PUBLISHED.models, PUBLISHED.layout.counts, PUBLISHED.layout.parallax_sigma
SOURCE_LIKE = PUBLISHED.settings("parallax+grubbs")
GROWTH = (300, 1000, 3000)  # photos
REPEATED = 15  # measurements of a time
REFERENCE = "reference R3            51.9     41.7      6.4      1.1"
POWER_BOUND = (
    20.0  # noncentrality left by the best wrong explanation: from there any global test at 0.1 % finds a misfit
)


def published_experiment(repetitions: int) -> dict[str, MethodOutcome]:
    """Repeat the published experiment with every method, each repetition of 34 models as one strip."""
    found = screening_experiment(ScreeningSpec(repetitions=repetitions))
    return {each.method: each for each in found.methods}


def searched(pairs: Pairs, settings: RelativeSettings, of_strip: int) -> list[screening.ScreenedPairs]:
    """Orient and search pairs, so many of them as one strip."""
    return screened(pairs, settings, of_strip, SIGMA_Q)


# ------------------------------------------------------------------------------------------------ masked errors


def decidable(pairs: Pairs, errors: Floats) -> Flags:
    """Whether any method could tell: no other set of up to two points explains the errors within the scatter.

    The errors without noise leave a sum of squares lambda after the best other set is taken out. From lambda = 20 on
    that set fails the global test at 0.1 % in at least 60 % of cases, and loses against the right set in 99 %.
    """
    m = len(pairs.pair)
    clean, _ = orient_unchecked(pairs)
    _, jacobian = linearised_parallaxes(clean.elements, pairs)
    n = m // pairs.size
    design = jacobian.T.reshape(pairs.size, n, 5)
    q, _ = np.linalg.qr(design)
    matrix = np.eye(n) - q @ q.transpose(0, 2, 1)
    error = errors.reshape(pairs.size, n) / SIGMA_Q
    residual = np.einsum("gij,gj->gi", matrix, error)
    total = (residual**2).sum(axis=1)
    left = np.full(pairs.size, np.inf)
    for k in (1, 2):
        sets = deletion.subsets(n, k)
        gain = deletion.gains(residual, matrix, sets)
        right = (error[:, sets] != 0).all(axis=2) & (k == 2)
        left = np.minimum(left, np.where(right, np.inf, total[:, None] - gain).min(axis=1))
    return left >= POWER_BOUND


def masked_errors(models: int, seed: int = 2) -> list[str]:
    """Two errors in one zone: found by each method, of the cases that any method could tell."""
    rng = np.random.default_rng(seed)
    lines = []
    for zone, points, sizes in (
        (3, 2, (0.2, 0.2)),
        (3, 3, (0.2, 0.2)),
        (3, 2, (0.2, 0.1)),
        (3, 3, (0.2, 0.1)),
        (3, 3, (0.2, -0.1)),
        (1, 2, (0.2, 0.2)),
        (1, 3, (0.2, 0.2)),
    ):
        counts = [3] * 6
        counts[zone - 1] = points
        pairs = standard_pairs(rng, models, PairLayout(counts=tuple(counts)))
        errors = np.zeros((models, sum(counts)))
        errors[:, sum(counts[: zone - 1]) :][:, :2] = sizes
        can = decidable(pairs, errors.ravel())
        row = f"{zone:4d}{points:8d}   {sizes[0]:+.1f} {sizes[1]:+.1f}{100 * can.mean():11.1f}"
        for method in ("parallax+grubbs", "tau", "auto"):
            settings = SOURCE_LIKE if method == "parallax+grubbs" else RelativeSettings(screening=method)
            out = rejected(searched(spoiled(pairs, errors.ravel()), settings, 1))
            both = (out & (errors != 0)).sum(axis=1) == 2
            row += f"{100 * both[can].mean() if can.any() else float('nan'):12.1f}"
        lost = (out & (errors == 0)).sum(axis=1).mean()
        lines.append(f"{row}{lost:12.2f}")
    return lines


# ------------------------------------------------------------------------------------- many errors, clean pairs


def many_errors(models: int, seed: int = 3) -> list[str]:
    """Spoil a fifth and more of the points, by small and by large errors."""
    rng = np.random.default_rng(seed)
    lines = []
    for counts in ((2,) * 6, COUNTS, (5,) * 6):
        n = sum(counts)
        for share in (0.1, 0.2, 0.3):
            for low, high in ((0.05, 0.5), (0.5, 50.0)):
                pairs = standard_pairs(rng, models, PairLayout(counts=tuple(counts)))
                order = rng.permuted(np.tile(np.arange(n), (models, 1)), axis=1)
                wrong = order < round(share * n)
                sizes = np.exp(rng.uniform(np.log(low), np.log(high), wrong.shape)) * rng.choice([-1, 1], wrong.shape)
                errors = np.where(wrong, sizes, 0.0)
                results = searched(spoiled(pairs, errors.ravel()), RelativeSettings(), 1)
                out = rejected(results)
                found = 100 * (out & wrong).sum() / wrong.sum()
                lost = 100 * (out & ~wrong).sum() / (~wrong).sum()
                whole = 100 * ((out == wrong).all(axis=1)).mean()
                left = 100 * np.mean([result.masked[0] for result in results])
                head = f"{n:6d}{100 * share:9.0f}   {low:5.2f}-{high:<5.2f}"
                lines.append(f"{head}{found:9.1f}{lost:12.2f}{whole:13.1f}{left:10.1f}")
    return lines


def clean_pairs(strips: int, seed: int = 4) -> list[str]:
    """Count false alarms in strips without gross errors."""
    rng = np.random.default_rng(seed)
    pairs = standard_pairs(rng, MODELS * strips, PairLayout())
    lines = []
    for name in ("parallax+grubbs", "tau", "robust", "deletion", "auto"):
        out = rejected(searched(pairs, RelativeSettings(screening=name), MODELS))
        touched = out.any(axis=1).mean(), out.reshape(pairs.size, -1).any(axis=1).mean(), out.mean()
        lines.append(f"{name:16s}" + "".join(f"{100 * share:16.3f}" for share in touched))
    return lines


def times(pairs_of_strip: int = 999, points: int = 30, seed: int = 5) -> list[str]:
    """Seconds of processor time of orientation and screening, the fastest of several."""
    rng = np.random.default_rng(seed)
    lines = []
    for share in (0.0, 0.05):
        pairs = standard_pairs(rng, pairs_of_strip, PairLayout(counts=(points // 6,) * 6))
        m = len(pairs.pair)
        wrong = rng.random(m) < 2 * share  # each point stands on two photos
        errors = np.where(wrong, np.exp(rng.uniform(np.log(5 * SIGMA_Q / np.sqrt(2)), np.log(50), m)), 0.0)
        given = spoiled(pairs, errors * rng.choice([-1, 1], m))
        best = [np.inf, np.inf]
        for _ in range(REPEATED):
            start = time.process_time()
            oriented, _ = orient_unchecked(given)
            middle = time.process_time()
            screening.screen_pairs(oriented, RelativeSettings(), SIGMA_Q / np.sqrt(2))
            best = [min(best[0], middle - start), min(best[1], time.process_time() - middle)]
        each = 1000 * best[1] / pairs_of_strip
        lines.append(f"{100 * share:10.0f}{best[0]:14.3f}{best[1]:14.3f}{best[1] / best[0]:9.2f}{each:15.2f}")
    return lines


def long_strip(photos: int, share: float = 0.0) -> Inputs:
    """Give a strip with 30 points on a photo, a share of the measurements wrong."""
    clean = Spec(
        flight=Flight(photos=photos, end_lap_percent=62.0, heading_deg=0.0, scale=5000.0),
        points=Points(rows=5, extra_per_model=6, reach_percent=75.0),
    )
    count = round(share * len(simulate(clean).observations)) if share else 0
    errors = (GrossError("image", count=count),) if count else ()
    return inputs_of(simulate(replace(clean, gross_errors=errors)))


def fastest(inputs: Inputs, share: float) -> Floats:
    """Milliseconds of the stages; what takes seconds is not repeated so often."""
    repeated = REPEATED if share < 0.01 else 2  # noqa: PLR2004
    return np.asarray(1000 * np.min([stages(inputs) for _ in range(repeated)], axis=0), float)


def strip_times(photos: int = 1000) -> list[str]:
    """Milliseconds of processor time of every part of screening, 30 points on a photo, for shares of wrong points."""
    lines = []
    for share in (0.0, 0.001, 0.01, 0.05):
        orient, *parts = fastest(long_strip(photos, share), share).tolist()
        columns = "".join(f"{part:12.1f}" for part in parts)
        row = f"{100 * share:9.1f}{orient:14.1f}{columns}{sum(parts):10.1f}{sum(parts) / orient:8.2f}"
        lines.append(f"{row}{sum(parts) / (photos - 1):12.2f}")
    return lines


def strip_growth(sizes: Sequence[int]) -> Iterator[str]:
    """Milliseconds of processor time of the search in strips of different lengths, and of it for each photo."""
    for share in (0.0, 0.03):
        stages(long_strip(20, share))  # what is imported first counts for none of them
        for photos in sizes:
            orient, *parts = fastest(long_strip(photos, share), share).tolist()
            row = f"{100 * share:9.1f}{photos:10d}{orient:14.1f}{parts[0]:12.1f}{parts[1]:12.1f}"
            yield f"{row}{sum(parts) / orient:8.2f}{sum(parts) / photos:13.3f}"


def stages(inputs: Inputs) -> Floats:
    """Seconds of relative orientation, of searching its pairs and of judging the rays and forming the strip again."""
    (strip,), observations = inputs.strips, inputs.observations
    sigma, nothing = float(np.median(observations.sigma)), np.zeros(0, np.intp)
    begin = time.process_time()
    pairs = collect_pairs(observations, strip.photos, strip.camera.principal_distance)
    oriented, converged = orient_unchecked(pairs)
    orient = time.process_time() - begin
    begin = time.process_time()
    screened = screening.screen_pairs(oriented, RelativeSettings(), sigma, converged)
    search = time.process_time() - begin
    scatter = screened.scatter.by_pair
    begin = time.process_time()
    form_from_pairs(screened.orientation, StripFormationSettings(), strip.photos, scatter)
    form = time.process_time() - begin
    position = strip.positions(observations)
    rays = StripRays(
        observations=observations, position=position, sigma=scatter, weight=pairs.weight, stated=sigma, kept=nothing
    )
    begin = time.process_time()
    form_screened(screened.orientation, rays, strip.photos, StripFormationSettings(), readmit=True)
    settle = time.process_time() - begin
    return np.array([orient, search, settle - form])


def print_all(repetitions: int) -> None:
    """Print all tables."""
    print(f"Published experiment, 34 models x 16 points, 44 errors of 0.1-0.5 mm, {repetitions} repetitions")
    print("method          parallax %   later % missed % good lost per 44 errors")
    for name, row in published_experiment(repetitions).items():
        shares = "".join(f"{100 * share:9.1f}" for share in (row.parallax, row.later, row.missed))
        print(f"{name:19s}{shares}{44 * row.lost:9.2f}")
    print(REFERENCE)
    print("\nTwo errors in one zone of a single pair, three points in every other: both found, % of the decidable")
    print(f"(decidable: without noise every other set of up to two points leaves a sum of squares of {POWER_BOUND:g};")
    print(f"chi-square at 0.1 % with 11 degrees of freedom is {chi2_quantile(0.999, 11):.1f})")
    print("zone  points  errors mm  decidable %   par+grubbs       tau        auto  good lost/model (auto)")
    print("\n".join(masked_errors(repetitions)))
    print("\nMany wrong points in a single pair, auto")
    print("points  wrong %  errors mm      found %  good lost %  all right %  suspected %")
    print("\n".join(many_errors(repetitions)))
    print("\nStrips of 34 pairs without gross errors")
    print("method          strips touched % pairs touched %   points lost %")
    print("\n".join(clean_pairs(repetitions)))
    print("\n999 pairs of 30 points")
    print("(processor time, the fastest of several)")
    print(" wrong %   orientation s   screening s    ratio   screening ms/pair")
    print("\n".join(times()))
    print("\n1000 photos of 30 points, ms of processor time, the fastest of several: relative orientation; pairs")
    print("searched, rays judged and the strip formed again; both, and over the first")
    print("  wrong %   orientation       pairs        rays       all   ratio   ms a pair")
    print("\n".join(strip_times()))


def print_growth(sizes: Sequence[int]) -> None:
    """Print how the time grows."""
    print(
        "\nstrips with 30 points on a photo, ms of processor time, the fastest of several: relative orientation; pairs"
    )
    print("searched, rays judged and the strip formed again; both over the first, and for each photo")
    print("  wrong %    photos   orientation       pairs        rays   ratio   ms a photo")
    for row in strip_growth(sizes):
        print(row, flush=True)


def main() -> None:
    """Print the tables that are asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("repetitions", type=int, nargs="?", default=200, help="repetitions of each table (default 200)")
    parser.add_argument("--growth", type=int, nargs="*", metavar="PHOTOS", help="the table of the growth alone")
    options = parser.parse_args()
    if options.growth is None:
        print_all(options.repetitions)
    print_growth(options.growth or GROWTH)


if __name__ == "__main__":
    main()
