"""Strips of which two fifths of the control are wrong by 5 to 100 m, in plan or in height."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from photostrip.pipeline.run import triangulate
from photostrip.simulation.simulation import simulate
from photostrip.simulation.spec import Control, Flight, Points, Spec
from tests.simulated import inputs_of, settings_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.points import ControlPoints

STRIP = Spec(
    flight=Flight(photos=13, end_lap_percent=62.0),
    points=Points(rows=3, extra_per_model=8),
    control=Control(layout="random", use={"xy": 0.2, "z": 0.2, "xyz": 0.6}, sigma=(0.02, 0.02, 0.02)),
)
SHARE, ERRORS, COUNT = 0.4, (5.0, 100.0), (14, 20)  # of the coordinates; m; control points


class Named(NamedTuple):
    """Coordinates of the control: those that are wrong, the wrong ones left out, sound ones left out."""

    wrong: int
    named: int
    others: int


def two_fifths_wrong(seed: int) -> Named:
    """Adjust a strip with much wrong control."""
    rng = np.random.default_rng(seed)
    spec = replace(STRIP, control=replace(STRIP.control, count=int(rng.integers(*COUNT))), seed=seed)
    simulation = simulate(spec)
    inputs = inputs_of(simulation)
    control, bad = spoiled(inputs.control, rng)
    result = triangulate(replace(inputs, control=control), settings_of(simulation))
    (kept,) = (strip.control for strip in result.strips)
    rows = [control.ids.index(name) for name in kept.ids]
    bad, out = bad[rows], control.use[rows] & ~kept.use
    return Named(int(bad.sum()), int((bad & out).sum()), int((out & ~bad).sum()))


def spoiled(control: ControlPoints, rng: np.random.Generator) -> tuple[ControlPoints, NDArray[np.bool_]]:
    """Spoil two fifths of the plan positions and of the heights; also which coordinates are wrong."""
    given, enu, bad = control.use & ~control.check[:, None], control.enu.copy(), np.zeros(control.use.shape, bool)
    for row in rng.permutation(np.flatnonzero(given.any(axis=1))).tolist():
        axes = [axis for axis in ([0, 1], [2]) if given[row, axis[0]]]
        part = axes[rng.integers(len(axes))]
        if bad[:, part[0]].sum() + 1 <= SHARE * given[:, part[0]].sum():
            error = rng.normal(size=len(part))
            enu[row, part] += error / np.linalg.norm(error) * np.exp(rng.uniform(*np.log(ERRORS)))
            bad[row, part] = True
    return replace(control, enu=enu), bad
