"""Two points far apart under one id: a slip that the strip method must survive, and the gate must name."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from photostrip.pipeline.results import Result
from photostrip.pipeline.run import triangulate
from photostrip.simulation import Control, Flight, Points, Spec, simulate
from tests.simulated import inputs_of, settings_of

SPEC = Spec(
    seed=4,
    flight=Flight(photos=30),
    points=Points(rows=5, extra_per_model=10),
    control=Control(every=8, check=0),
)


@cache
def adjusted(adjustment: str, *, twice: bool) -> tuple[Result, str]:
    """Adjust a strip without a point on its last photos, or with this point under the id of one on the first."""
    simulation = simulate(SPEC)
    inputs, table = inputs_of(simulation), simulation.observations
    new = [number for number, name in enumerate(table.point_ids) if name not in inputs.control.ids]
    on = {number: np.flatnonzero(table.point == number) for number in new}
    first = next(number for number in new if len(on[number]) == 2 and table.photo[on[number]].max() < 3)
    last = next(number for number in new if len(on[number]) == 2 and table.photo[on[number]].min() >= 27)
    point = np.where(table.point == last, first, table.point)
    kept = np.arange(len(point)) if twice else np.flatnonzero(table.point != last)
    measured = replace(table, photo=table.photo[kept], point=point[kept], xy=table.xy[kept], sigma=table.sigma[kept])
    settings = replace(settings_of(simulation), adjustment=adjustment)
    return triangulate(replace(inputs, observations=measured), settings), table.point_ids[first]


@pytest.mark.parametrize("adjustment", ["similarity", "polynomial", "bundle"])
def test_the_strip_is_adjusted_and_the_id_is_named(adjustment: str) -> None:
    sound, _ = adjusted(adjustment, twice=False)
    result, name = adjusted(adjustment, twice=True)
    assert [(found.code, found.points) for found in result.findings] == [("P301", (name,))]
    assert sound.findings == ()
    assert np.array_equal(result.points.number, sound.points.number)
    off = np.linalg.norm(result.points.cartesian - sound.points.cartesian, axis=1)
    assert off.max() < 0.1  # the second place orients one pair by one point more
    assert result.precision is not None
    assert sound.precision is not None
    sigma = [np.sqrt(np.trace(each.points, axis1=1, axis2=2)) for each in (result.precision, sound.precision)]
    assert sigma[0] == pytest.approx(sigma[1], rel=0.05)
