"""Displacements of many simulated terrestrial surveys: bias, coverage of ellipses, false and missed movements.

Two convergent cameras (190 and 100 mm, base 40 m) photograph 45 points 90 to 150 m away; image coordinates have a
standard deviation of 5 micrometres. Ten points move, six or fewer of the others are given as stable. In some of the
surveys the left camera turned between the epochs.

Usage: python benchmarks/terrestrial.py [--runs N]
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run from anywhere, installed or not

from photostrip.threads import limit_threads

limit_threads()  # before numpy is imported

import numpy as np  # noqa: E402

from photostrip.terrestrial.monitoring import MonitoringSettings  # noqa: E402
from tests.terrestrial.simulated import repeated, turned, world  # noqa: E402

if TYPE_CHECKING:
    from tests.terrestrial.simulated import World

PLAN_LIMIT, SPACE_LIMIT = 5.9915, 7.8147  # chi-square, 95 %, 2 and 3 degrees of freedom
TURN = (60.0, -30.0, 45.0)  # seconds of arc: right, up, counter-clockwise
FACE = world(number=45, moving=10)


def surveys() -> dict[str, World]:
    """Give the kinds of survey whose statistics are proven."""
    return {
        "nothing turned": FACE,
        "left camera turned": turned(FACE, *TURN),
        "z right not measured": replace(turned(FACE, *TURN), right_z=False),
        "pseudo-parallaxes": replace(turned(FACE, *TURN), shared=0.02),
        "third epoch": turned(replace(FACE, epochs=3), *TURN),
        "three stable points": turned(replace(FACE, stable=3), *TURN),
        "two stable points": turned(replace(FACE, stable=2), *TURN),
    }


def row(name: str, truth: World, settings: MonitoringSettings, runs: int) -> str:
    """Compute one kind of survey many times and give its line."""
    count = repeated(truth, runs, settings)
    errors = np.concatenate(count.errors)
    values = (
        np.abs(errors.mean(axis=0)).max(),
        errors.std(),
        100 * np.mean(np.concatenate(count.plan) < PLAN_LIMIT),
        100 * np.mean(np.concatenate(count.space) < SPACE_LIMIT),
        100 * np.mean(np.concatenate(count.false)),
        100 * np.mean(np.concatenate(count.stable_false)),
        100 * np.mean(count.cameras),
        1000 * np.median(np.concatenate(count.sigma)),
    )
    return f"{name:<28}" + "".join(
        f"{value:>{width}.{places}f}" for value, width, places in zip(values, *FORM, strict=True)
    )


FORM = ((8, 7, 9, 9, 9, 9, 9, 8), (3, 3, 1, 1, 1, 1, 1, 1))
HEAD = f"{'':<28}{'bias':>8}{'error':>7}{'ellipse':>9}{'solid':>9}{'false':>9}{'stable':>9}{'turned':>9}{'sigma':>8}\n"
HEAD += f"{'':<28}{'sigma':>8}{'sigma':>7}{'%':>9}{'%':>9}{'%':>9}{'%':>9}{'found %':>9}{'mm':>8}"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--runs", type=int, default=100, help="surveys of each kind")
    runs: int = parser.parse_args().runs
    print(f"{runs} surveys of each kind\n")
    print(f"The turn of a camera is always taken out\n{HEAD}")
    for name, truth in surveys().items():
        print(row(name, truth, MonitoringSettings(), runs))
    print(f"\nA camera that turned a little, by the way it is treated\n{HEAD}")
    for arcseconds in (0.0, 2.0, 4.0, 6.0, 8.0, 12.0):
        for treatment in ("always", "auto", "never"):
            truth = turned(FACE, arcseconds, -arcseconds / 2, 0.7 * arcseconds)
            print(row(f"{arcseconds:4.0f}″ {treatment}", truth, MonitoringSettings(moved_camera=treatment), runs))


if __name__ == "__main__":
    main()
