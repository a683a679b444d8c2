"""What is said of points beyond the control of a strip.

Local coordinates of a long strip may be plane map coordinates: what they would leave out is said.

Heights that refraction needs: from the strips without it, in the frames of the run.

Two points far apart under one id: a slip that the strip method must survive, and the gate must name.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest

from photostrip.pipeline.frames import orient_interior, tie_ground_frames
from photostrip.pipeline.inputs import Settings
from photostrip.pipeline.results import Result
from photostrip.pipeline.run import heights_of, triangulate
from photostrip.pipeline.strip_notes import polynomial_notes
from photostrip.simulation import Control, Flight, Points, Spec, simulate
from tests.results import spec
from tests.simulated import inputs_of, settings_of

if TYPE_CHECKING:
    from photostrip.pipeline.inputs import Strip
    from photostrip.strip.polynomial import Polynomial


@pytest.mark.parametrize(
    ("begin", "end", "beyond"),
    [(-1000.0, 5000.0, None), (-1200.0, 5000.0, 700), (0.0, 5650.0, 650), (-1600.0, 5600.0, 1100)],
)
def test_points_beyond_the_control_are_told_with_how_far(begin: float, end: float, beyond: int | None) -> None:
    """The control reaches from -500 m to 5000 m; a tenth of that is 550 m: more is told, less is not."""
    correction = cast(
        "Polynomial",
        SimpleNamespace(asked="auto", degree=2, reach=(-500.0, 5000.0), axes=[SimpleNamespace(redundancy=9)]),
    )
    adjusted = np.array([[begin, 0.0, 0.0], [2000.0, 0.0, 0.0], [end, 0.0, 0.0]])
    notes = list(polynomial_notes(cast("Strip", SimpleNamespace(id="A")), correction, adjusted))
    assert [note.code for note in notes] == ([] if beyond is None else ["extrapolation"])
    points = "2 points lie" if begin < -500.0 and end > 5000.0 else "1 point lies"
    words = "" if beyond is None else f"{points} up to {beyond} m beyond the control"
    assert words in " ".join(note.message for note in notes)


def remarks(photos: int, curvature: str = "auto") -> list[str]:
    """Remarks on curvature of a strip whose map coordinates are given as local ones."""
    simulation = simulate(Spec(seed=2, flight=Flight(photos=photos), control=Control(bands=3)))
    inputs, settings = inputs_of(simulation), settings_of(simulation)
    inputs = replace(inputs, frames=(replace(inputs.frames[0], crs="local"),))
    settings = replace(settings, absolute=replace(settings.absolute, earth_curvature=curvature))
    return [note.message for note in triangulate(inputs, settings).notes if note.code == "curvature-left-out"]


def test_what_is_left_out_is_said_with_the_key_that_takes_it_in() -> None:
    """Eleven bases of 920 m: the middle lies 5.1 km from the ends."""
    (message,) = remarks(12)
    assert "2.1" in message
    assert "`earth_curvature: model`" in message


@pytest.mark.parametrize(("photos", "curvature"), [(3, "auto"), (12, "model"), (12, "none")])
def test_nothing_is_said_where_it_is_small_or_decided(photos: int, curvature: str) -> None:
    """A strip of 2 km falls by 0.1 m."""
    assert remarks(photos, curvature) == []


def test_heights_are_those_of_the_whole_run() -> None:
    inputs, settings = inputs_of(simulate(spec())), Settings()
    ground, result = tie_ground_frames(inputs, settings, None), triangulate(inputs, settings)
    found = heights_of(orient_interior(inputs, settings).observations, inputs, settings, ground)
    (strip,) = result.strips
    centers = strip.intermediate.cartesian_from_intermediate(strip.placed.centers)
    flying, terrain = (ground.output.geodetic(xyz)[:, 2].mean() for xyz in (centers, result.points.cartesian))
    assert found.flying == pytest.approx(flying, abs=1e-6)
    assert found.ground == pytest.approx(terrain, abs=1e-6)


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
