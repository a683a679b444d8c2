"""How each point is checked, and what may be left in points that nothing checks."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from photostrip.pipeline.inputs import Settings
from photostrip.simulation.simulation import simulate
from photostrip.simulation.spec import Flight, Points, Spec
from tests.results import Document, solved
from tests.simulated import inputs_of


def strip(adjustment: str, *, wrong: float = 0.0) -> Document:
    """Adjust a strip with a share of its rays of new points 0.3 mm off."""
    inputs = inputs_of(simulate(Spec(seed=5, flight=Flight(photos=6), points=Points(extra_per_model=20))))
    seen = inputs.observations
    rng = np.random.default_rng(5)
    given = np.isin(seen.point, [seen.point_ids.index(name) for name in inputs.control.ids])
    off = (rng.random(len(seen)) < wrong) & ~given
    xy = seen.xy + off[:, None] * rng.choice([-0.3, 0.3], seen.xy.shape)
    return solved(replace(inputs, observations=replace(seen, xy=xy)), Settings(adjustment=adjustment)).document


@pytest.mark.parametrize("adjustment", ["polynomial", "bundle"])
def test_two_rays_check_a_new_point_only_across_the_base(adjustment: str) -> None:
    """Their one condition is the y parallax; a third ray and given coordinates check along the base too."""
    document = strip(adjustment)
    found = Counter((row["rays"] > 2 or row["role"] == "control", row["checked"]) for row in document["points"])
    assert set(found) == {(False, "across"), (True, "along")}
    assert document["counts"]["points_checked"] == {
        "along": found[True, "along"],
        "across": found[False, "across"],
        "none": 0,
    }


def test_what_nothing_checks_may_hold_what_was_found_elsewhere() -> None:
    notes = {note["code"]: note["message"] for note in strip("bundle", wrong=0.06)["notes"]}
    assert (
        "points are checked only across the base, 0 not at all: about as many of their rays may be"
        in (notes["unchecked-points"])
    )
    assert "unchecked-points" not in {note["code"] for note in strip("bundle")["notes"]}
