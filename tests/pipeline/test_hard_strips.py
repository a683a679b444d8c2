"""Strips that are sound but look degenerate to a careless test."""

from __future__ import annotations

from dataclasses import replace

import pytest

from photostrip.errors import InputError
from photostrip.pipeline.run import triangulate
from photostrip.simulation import Control, Flight, Spec, simulate
from tests.simulated import inputs_of, settings_of

pytestmark = pytest.mark.usefixtures("_no_findings")


@pytest.mark.slow
def test_control_across_a_very_long_strip_is_no_line() -> None:
    """900 km long and 2 km wide: the control spans the width, which is all that the roll needs."""
    done = simulate(Spec(flight=Flight(photos=1000), control=Control(bands=50)))
    found = triangulate(inputs_of(done), settings_of(done)).strips[0].absolute
    assert found.condition < 10


def test_a_photo_without_a_strip_is_refused_by_name() -> None:
    done = simulate(Spec(flight=Flight(photos=5), control=Control(bands=2)))
    inputs = inputs_of(done)
    strip = replace(inputs.strips[0], photos=inputs.strips[0].photos[:-1])
    with pytest.raises(InputError, match=f"photo {inputs.strips[0].photos[-1]} is measured but belongs to no strip"):
        triangulate(replace(inputs, strips=(strip,)), settings_of(done))
