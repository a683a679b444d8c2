"""One id for two points in two strips is named; a wrong image coordinate of a tie is not taken for it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.pipeline.run import triangulate
from photostrip.simulation import Control, Flight, GrossError, Points, Spec
from photostrip.simulation.simulation import simulate
from tests.loops import nonempty
from tests.simulated import inputs_of, settings_of

if TYPE_CHECKING:
    from photostrip.pipeline.inputs import Inputs
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
@pytest.mark.parametrize(("method", "apart"), [("polynomial", 50.0), ("bundle", 50.0), ("bundle", 800.0)])
def test_ids_that_two_strips_share_by_mistake_are_named(method: str, apart: float) -> None:
    """Three ids for points 50 m apart: the run was called good; 800 m apart, a bundle did not converge."""
    simulation = simulate(SPEC)
    inputs, names = with_shared_ids(simulation, inputs_of(simulation), 3, apart)
    result = triangulate(inputs, replace(settings_of(simulation), adjustment=method))
    found = [each for each in result.findings if each.code == "P301"]
    assert {name for each in found for name in each.points} == names
    of_polynomial, height = method == "polynomial", simulation.spec.flying_height
    for each in nonempty(found):  # a bundle compares photos, whatever strips they form
        far = float(each.evidence["distance_m" if of_polynomial else "apart_over_distance"])
        least, by = (0.8, 1.0) if of_polynomial else (0.6, height)  # the cameras are farther away than high
        assert least < far * by / apart < 1.2
        by_strip = [set(each.photos) & set(strip.photos) for strip in inputs.strips]
        assert each.strips == ("A", "B") if of_polynomial else all(by_strip)


@pytest.mark.slow
@pytest.mark.parametrize("size", [0.0, 150.0, 400.0])
def test_wrong_image_coordinates_are_no_shared_ids(size: float) -> None:
    """A coordinate along the base that is off moves a point of two rays in one strip only, which is told as such."""
    errors = (GrossError("image", count=8, size_um=size, axis="x"),) if size else ()
    simulation = simulate(replace(SPEC, gross_errors=errors))
    settings = replace(settings_of(simulation), adjustment="polynomial")  # a bundle rejects them
    findings = triangulate(inputs_of(simulation), settings).findings
    assert {each.code for each in findings} == ({"P304"} if size > 200 else set())
    assert {name for each in findings for name in each.points} <= {each.point for each in simulation.truth.errors}
