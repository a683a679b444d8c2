"""How closely variance components find factors by which stated standard deviations are wrong.

Blocks of three strips of eight photos: image coordinates with 10 micrometres where 5 are stated, control with 0.15 m in
plan and 0.08 m in height where 0.05 and 0.08 m are, positions with 0.20 m where 0.05 m is. The errors of control and
positions are drawn with just this scatter, so what a factor is off by is the estimate's own error.

Usage: python benchmarks/variance_components.py [BLOCKS] [--first-seed N] [--workers N]
"""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run from anywhere, installed or not

from photostrip.threads import limit_threads

limit_threads()  # as the command does, before numpy is imported

import numpy as np  # noqa: E402

from photostrip.result.document import document_of  # noqa: E402
from photostrip.simulation import Control, Flight, Image, Points, Spec, simulate  # noqa: E402
from tests.pipeline.blocks import adjusted, positions  # noqa: E402
from tests.simulated import inputs_of  # noqa: E402

TRUE = {"image": 2.0, "control plan": 3.0, "control height": 1.0, "positions plan": 4.0, "positions height": 4.0}


def scattered(random: np.random.Generator, number: int) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Draw errors in three coordinates whose mean squares are 1."""
    drawn = random.normal(size=(number, 3))
    return np.asarray(drawn / np.sqrt((drawn**2).mean(axis=0)))


def factors(seed: int) -> tuple[dict[str, float], float]:
    """Give the factors that one block finds by group, without those that are not estimated, and its sigma0."""
    spec = Spec(
        seed=seed,
        flight=Flight(photos=8, strips=3),
        points=Points(extra_per_model=8),
        image=Image(sigma_um=10.0),
        control=Control(bands=5, noise=(0.0, 0.0, 0.0)),
    )
    simulation, random = simulate(spec), np.random.default_rng(seed)
    inputs = inputs_of(simulation)
    used, enu = ~inputs.control.check, inputs.control.enu.copy()
    enu[used] += scattered(random, int(used.sum())) * (0.15, 0.15, 0.08)
    inputs = replace(
        inputs,
        observations=replace(inputs.observations, sigma=np.full_like(inputs.observations.sigma, 0.005)),
        control=replace(inputs.control, enu=enu),
        positions=positions(simulation, noise=0.2 * scattered(random, 24)),
    )
    result = adjusted(simulation, inputs, variance_components=True)
    found = document_of(result)["bundle"]["variance_components"]
    estimated = {each["group"]: float(each["factor"]) for each in found if each["estimated"]}
    return estimated, np.nan if result.bundle is None else result.bundle.screened.solution.sigma0


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("blocks", type=int, nargs="?", default=40)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    asked = parser.parse_args()
    with get_context("spawn").Pool(asked.workers) as pool:
        found = pool.map(factors, range(asked.first_seed, asked.first_seed + asked.blocks))
    print(f"{'group':<18}{'true':>6}{'rms':>8}{'scatter':>9}{'lowest':>8}{'highest':>8}")
    for group, true in TRUE.items():
        values = np.array([each[group] for each, _ in found if group in each])
        scatter = values.std(ddof=1) if len(values) > 1 else np.nan
        print(
            f"{group:<18}{true:>6.2f}{np.sqrt((values**2).mean()):>8.3f}{scatter:>9.3f}"
            f"{values.min():>8.3f}{values.max():>8.3f}"
        )
    print(f"sigma0 with the factors {min(each for _, each in found):.3f} to {max(each for _, each in found):.3f}")


if __name__ == "__main__":
    main()
