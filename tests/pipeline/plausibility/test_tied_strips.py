"""One id for two points in two strips is named; a wrong image coordinate of a tie is not taken for it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.formats.output.simulation import inputs_of, settings_of
from photostrip.pipeline import triangulate
from photostrip.simulation import Control, Flight, GrossError, Points, Spec
from photostrip.simulation.simulation import simulate
from tests.loops import nonempty

if TYPE_CHECKING:
    from photostrip.pipeline import Inputs
    from photostrip.simulation.simulation import Simulation

SPEC = Spec(
    seed=3,
    flight=Flight(photos=8, strips=2),
    control=Control(bands=3),
    points=Points(extra_per_model=20),
)


def with_shared_ids(simulation: Simulation, inputs: Inputs, count: int, distance: float) -> tuple[Inputs, set[str]]:
    """Let two ties near each other have one id, the one in the first strip, the other in the second."""
    o = inputs.observations
    truth = dict(zip(simulation.truth.points.ids, simulation.truth.points.xyz, strict=True))
    first = np.isin(o.photo, [o.photo_ids.index(name) for name in inputs.strips[0].photos])
    in_both = (np.bincount(o.point[first], minlength=len(o.point_ids)) > 1) & (
        np.bincount(o.point[~first], minlength=len(o.point_ids)) > 1
    )
    free = np.array([name in truth and name not in inputs.control.ids for name in o.point_ids])
    ties = np.flatnonzero(in_both & free)
    place = np.array([truth[o.point_ids[each]] for each in ties])
    apart = np.linalg.norm(place[:, None] - place[None], axis=2)
    np.fill_diagonal(apart, np.inf)
    point, keep, names = o.point.copy(), np.ones(len(o), bool), set()
    for _ in range(count):
        pair = np.unravel_index(int(np.abs(apart - distance).argmin()), apart.shape)
        apart[list(pair)] = np.inf
        apart[:, list(pair)] = np.inf
        one, other = ties[list(pair)].tolist()
        keep &= ~((o.point == one) & ~first) & ~((o.point == other) & first)
        point[(o.point == other) & ~first] = one
        names.add(o.point_ids[one])
    changed = replace(o, photo=o.photo[keep], point=point[keep], xy=o.xy[keep], sigma=o.sigma[keep])
    return replace(inputs, observations=changed), names


@pytest.mark.slow
@pytest.mark.parametrize("method", ["polynomial", "bundle"])
def test_ids_that_two_strips_share_by_mistake_are_named(method: str) -> None:
    """Three ids for points 50 m apart: the run was called good, and ties lay 50 m from each other."""
    simulation = simulate(SPEC)
    inputs, names = with_shared_ids(simulation, inputs_of(simulation), 3, 50.0)
    result = triangulate(inputs, replace(settings_of(simulation), adjustment=method))
    found = [each for each in result.findings if each.code == "P301"]
    assert {name for each in found for name in each.points} == names
    assert {each.strips for each in found} == {("A", "B")}
    assert all(40.0 < float(each.evidence["distance_m"]) < 60.0 for each in nonempty(found))


@pytest.mark.parametrize("size", [0.0, 150.0, 400.0])
def test_wrong_image_coordinates_are_no_shared_ids(size: float) -> None:
    """A coordinate along the base that is off moves a point of two rays in one strip only."""
    errors = (GrossError("image", count=8, size_um=size, axis="x"),) if size else ()
    simulation = simulate(replace(SPEC, gross_errors=errors))
    assert triangulate(inputs_of(simulation), settings_of(simulation)).findings == ()
