"""The block of a result on the bundle: kinds of observations of which the search took out all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

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
