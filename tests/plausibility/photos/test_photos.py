"""What image coordinates alone say against themselves: units, order, overlap, photos that are twice or mirrored."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from photostrip.plausibility import flight, mosaic, units
from photostrip.points import PhotoPoints
from photostrip.simulation import Flight, Spec, simulate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from photostrip.notes import Finding
    from photostrip.simulation import Simulation

PHOTOS = 7


@cache
def simulation(heading: float = 70.0, end_lap: float = 62.0) -> Simulation:
    """Give a short strip."""
    return simulate(Spec(seed=3, flight=Flight(photos=PHOTOS, heading_deg=heading, end_lap_percent=end_lap)))


def found(observations: PhotoPoints, photos: Sequence[str]) -> list[Finding]:
    """Examine a strip."""
    return flight.find_wrong_order(observations, "A", photos)[0]


def codes(findings: Sequence[Finding]) -> list[str]:
    """Give the codes of findings."""
    return [each.code for each in findings]


def changed(observations: PhotoPoints, photo: str, by: complex, *, mirror: bool = False) -> PhotoPoints:
    """Multiply the coordinates of one photo, as complex numbers, after mirroring them."""
    rows = observations.photo == observations.photo_ids.index(photo)
    z = observations.xy[rows, 0] + 1j * observations.xy[rows, 1]
    z = by * (np.conj(z) if mirror else z)
    xy = observations.xy.copy()
    xy[rows] = np.column_stack([z.real, z.imag])
    return replace(observations, xy=xy)


@given(heading=st.sampled_from([0.0, 70.0, 200.0]), lap=st.sampled_from([58.0, 62.0, 80.0]), turn=st.floats(-3.1, 3.1))
@settings(max_examples=12, deadline=None)
def test_a_sound_strip_has_no_finding_in_either_direction(heading: float, lap: float, turn: float) -> None:
    made = simulation(heading, lap)
    photos = made.strips[0][1]
    turned = changed(made.observations, photos[2], np.exp(1j * turn))  # a photo turned in the comparator is no mistake
    assert found(turned, photos) == []
    assert found(turned, photos[::-1]) == []
    assert flight.find_wrong_order(turned, "A", photos)[1].photos == photos


@pytest.mark.parametrize(
    ("factor", "word"), [(1e3, "micrometres read as millimetres"), (1e-3, "millimetres read as micrometres"),
                         (10.0, "tenths of a micrometre"), (0.1, "centimetres"), (1 / 25.4, "inches")]
)  # fmt: skip
def test_a_wrong_unit_of_all_coordinates_is_named(factor: float, word: str) -> None:
    made = simulation()
    cameras = dict.fromkeys(made.strips[0][1], made.camera)
    wrong = replace(made.observations, xy=made.observations.xy * factor)
    (finding,), factors = units.find_wrong_units(wrong, cameras)
    assert finding.code == "P101"
    assert word in finding.message
    assert factors == {made.camera.name: pytest.approx(1 / factor)}


def test_one_photo_listed_far_from_its_place_is_named_alone() -> None:
    made = simulation()
    photos = list(made.strips[0][1])
    wrong = [*photos[:1], *photos[2:], photos[1]]
    (finding,) = found(made.observations, wrong)
    assert (finding.code, finding.photos) == ("P201", (photos[1],))
    assert f"between {photos[0]} and {photos[2]}" in finding.message


def test_the_way_to_the_next_photo_is_known_on_the_first_and_last_too() -> None:
    """Four photos, one base apart along x, listed in the order 2, 0, 3, 1; photo 4 is not in the list."""
    links = SimpleNamespace(
        photo=np.array([[2, 0], [0, 3], [3, 1], [4, 2]]),
        bases=(np.array([1.0, 1.0, 1.0, 5.0]) + 0j, -np.array([1.0, 1.0, 1.0, 5.0]) + 0j),
        count=np.array([6, 6, 6, 6]),
    )
    assert flight._steps(cast("mosaic.PhotoLinks", links), [2, 0, 3, 1]) == pytest.approx([1.0] * 4)
