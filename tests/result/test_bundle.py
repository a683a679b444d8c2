"""What a result says of a bundle: redundancy of what was given, kinds of which the search took out all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import photostrip
from photostrip.result.bundle import bundle_of
from photostrip.simulation.spec import Control, Flight, Gnss, Spec
from tests.pipeline.blocks import adjusted, simulate


def test_a_kind_of_which_all_was_rejected_has_no_redundancy() -> None:
    result = adjusted(simulate(Spec(flight=Flight(photos=5), gnss=Gnss(), control=Control(bands=2))))
    assert result.bundle is not None
    groups = [
        replace(each, sigma=np.full_like(each.sigma, np.inf)) if each.kind == "control" else each
        for each in result.bundle.groups
    ]
    block = bundle_of(replace(result, bundle=replace(result.bundle, groups=tuple(groups))))["bundle"]
    (control,) = (each for each in block["reliability"]["groups"] if each["group"] == "control")
    assert (control["observations"], control["redundancy"], control["smallest"]) == (0, 0.0, 0.0)
    assert control["detectable"] is None


def test_redundancy_numbers_of_control_and_positions_sum_up_to_those_of_their_group() -> None:
    document = photostrip.simulate({}, flight={"photos": 5}, gnss={"use": True}).project.run().document
    groups = {each["group"]: each["redundancy"] for each in document["bundle"]["reliability"]["groups"]}
    columns = [document["control"][f"redundancy_{k}"].astype(float) for k in (1, 2, 3)]
    assert np.nansum(columns) == pytest.approx(groups["control"], abs=0.02)
    positions = [document["bundle"]["positions"][f"redundancy_{axis}"] for axis in ("east", "north", "up")]
    assert np.sum(positions) == pytest.approx(groups["position"], abs=0.02)
