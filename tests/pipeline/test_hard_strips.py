"""Strips that are sound but look degenerate to a careless test."""

from __future__ import annotations

from dataclasses import replace

import pytest

from photostrip.errors import InputError
from photostrip.pipeline.run import triangulate
from photostrip.simulation import Control, Flight, Spec, simulate
from tests.pipeline import blocks
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


@pytest.mark.parametrize("adjustment", ["polynomial", "bundle"])
@pytest.mark.parametrize("table", ["position", "orientation"])
def test_a_table_of_cameras_that_no_strip_has_is_refused_by_name(table: str, adjustment: str) -> None:
    done = simulate(Spec(flight=Flight(photos=5), control=Control(bands=2)))
    inputs = inputs_of(done)
    if table == "position":
        given = blocks.positions(done)
        inputs = replace(inputs, positions=replace(given, photos=("of another flight", *given.photos[1:])))
    else:
        angles = blocks.orientations(done, observed=False)
        inputs = replace(inputs, orientations=replace(angles, photos=("of another flight", *angles.photos[1:])))
    with pytest.raises(InputError, match=f"photo of another flight has a given {table} but belongs to no strip"):
        triangulate(inputs, replace(settings_of(done), adjustment=adjustment))
