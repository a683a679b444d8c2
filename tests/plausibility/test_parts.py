"""The parts of the gate on their own: slips of digits, units, order, flight, angles, ties, and what tells a cause."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from photostrip.network.hypotheses import DRIFT, LIST, OF_CAMERAS, OF_PHOTOS, OFFSET, ORDER, SIGMAS
from photostrip.network.reliability import CONTROL, IMAGE, POSITION
from photostrip.plausibility import KINDS, flight, units
from photostrip.plausibility.finding import CAUSES
from photostrip.plausibility.given_points import slip
from photostrip.plausibility.ids import TiesOfStrips, odd_ties
from photostrip.points import PhotoPoints
from photostrip.result.description import described
from photostrip.simulation import Flight, Spec, simulate
from tests.source_tree import modules

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    from collections.abc import Sequence

    from photostrip.notes import Finding
    from photostrip.plausibility import mosaic
    from photostrip.simulation import Simulation


@given(st.integers(100_000_000, 999_999_999), st.integers(1, 5), st.integers(0, 9), st.floats(-0.05, 0.05))
@settings(max_examples=60)
def test_any_single_wrong_digit_is_put_right(value: int, place: int, digit: int, noise: float) -> None:
    text = str(value)
    wrong = text[:place] + str(digit) + text[place + 1 :]
    found = slip(int(wrong) / 1000, value / 1000 + noise, 0.05, 0.2)
    if wrong == text:
        assert found is None
    else:
        assert found is not None
        assert found.meant == pytest.approx(value / 1000, abs=1e-6)


@pytest.mark.parametrize(
    ("written", "meant", "words"),
    [
        (434733.71, 443733.71, "the second and the third digit exchanged"),
        (-1203.5, 1203.5, "the sign is wrong"),
        (43473.371, 434733.71, "the decimal point is 1 place"),
        (4733.71, 34733.71, "a leading 3 is missing"),
        (434733.71, 435733.71, "a typing error in the third digit (4 for 5)"),
    ],
)
def test_other_slips_are_named(written: float, meant: float, words: str) -> None:
    found = slip(written, meant + 0.01, 0.05, 0.2)
    assert found is not None
    assert words in found.text
    assert found.meant == pytest.approx(meant, abs=1e-6)


@given(st.floats(-0.29, 0.29))
def test_what_is_within_noise_is_no_slip(off: float) -> None:
    assert slip(434733.71, 434733.71 + off, 0.05, 0.2) is None


@given(st.integers(0, 10_000))
@settings(max_examples=40, deadline=None)
def test_a_usual_flight_has_no_finding(seed: int) -> None:
    """Straight and level, base 100 at height 150; two photos may stand at one place."""
    centers = np.column_stack([100.0 * np.arange(10), np.zeros(10), np.full(10, 150.0)])
    centers += np.random.default_rng(seed).normal(0.0, [5.0, 5.0, 3.0], (10, 3)).clip(-12, 12)
    others = np.full(10, 150.0), np.array([0.0, 0.0, 1.0]), [f"{number}" for number in range(10)], "A"
    assert list(flight.find_odd_centers(centers, *others)) == []
    centers[6] = centers[5]
    assert {each.code for each in flight.find_odd_centers(centers, *others)} <= {"P206", "P207"}


def test_yaw_pitch_roll_of_a_gimbal() -> None:
    """Where a camera that is stated to look down looks ahead, pitch lies about -90 degrees."""
    rng = np.random.default_rng(4)
    values = np.column_stack([rng.normal(0, np.radians(2), (6, 2)), rng.uniform(-3, 3, 6)])
    matrices = Rotation.from_euler("XYZ", values).as_matrix()  # by a library that is not ours
    names = [f"{number}" for number in range(6)]
    gimbal = Rotation.from_matrix(matrices) * Rotation.from_euler("x", -90, degrees=True)
    stated = gimbal.as_euler("ZXY") * [-1, 1, 1]
    (finding,) = flight.find_wrong_angles(stated, "yaw-pitch-roll", matrices, names)
    assert finding.code == "P602"
    assert "of a camera that looks ahead where pitch and roll are zero" in finding.message


@given(st.integers(0, 10_000), st.integers(0, 2))
@settings(max_examples=30, deadline=None)
def test_ties_of_two_points_are_found_beside_the_bend_of_two_strips(seed: int, degree: int) -> None:
    """And none beside them; a tenth of the ties is wrong, by metres or by kilometres."""
    rng = np.random.default_rng(seed)
    count = 30
    plan = rng.uniform(-1000, 1000, (count, 2))
    x, y = (plan / 1000).T
    columns = np.column_stack([np.ones(count), x, y, x**2, x * y, y**2])[:, : (1, 3, 6)[degree]]
    off = columns @ rng.normal(0, 3.0, (columns.shape[1], 2)) + rng.normal(0, 0.1, (count, 2))
    wrong = rng.choice(count, 3, replace=False)
    turned = rng.uniform(0, 2 * np.pi, 3)
    off[wrong] += np.column_stack([np.cos(turned), np.sin(turned)]) * rng.uniform(20, 1e4, 3)[:, None]
    names, rays = tuple(f"T{number}" for number in range(count)), np.full(count, 3)
    ties = TiesOfStrips(np.arange(count), names, plan, off, rays, sigma=0.1, depth=1500.0, strips=("A", "B"))
    odd = odd_ties(ties)
    assert odd is not None
    assert odd.rows.tolist() == sorted(wrong.tolist())
    assert odd.far[wrong].min() > 10.0
    assert np.delete(odd.far, wrong).max() < 1.0


@cache
def simulation(heading: float = 70.0, end_lap: float = 62.0) -> Simulation:
    """Give a short strip."""
    return simulate(Spec(seed=3, flight=Flight(photos=7, heading_deg=heading, end_lap_percent=end_lap)))


def found(observations: PhotoPoints, photos: Sequence[str]) -> list[Finding]:
    """Examine a strip."""
    return flight.find_wrong_order(observations, "A", photos)[0]


@given(heading=st.sampled_from([0.0, 70.0, 200.0]), lap=st.sampled_from([58.0, 62.0, 80.0]), turn=st.floats(-3.1, 3.1))
@settings(max_examples=12, deadline=None)
def test_a_sound_strip_has_no_finding_in_either_direction(heading: float, lap: float, turn: float) -> None:
    made = simulation(heading, lap)
    photos = made.strips[0][1]
    points = made.observations
    z = (points.xy[:, 0] + 1j * points.xy[:, 1]) * np.exp(1j * turn * (points.photo == 2))
    turned = replace(points, xy=np.column_stack([z.real, z.imag]))  # one photo turned in the comparator is no mistake
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
    way = np.array([1.0, 1.0, 1.0, 5.0]) + 0j
    photo = np.array([[2, 0], [0, 3], [3, 1], [4, 2]])
    links = cast("mosaic.PhotoLinks", SimpleNamespace(photo=photo, bases=(way, -way), count=np.full(4, 6)))
    assert flight._steps(links, [2, 0, 3, 1]) == pytest.approx([1.0] * 4)


def test_every_hypothesis_is_described_in_the_order_of_precedence() -> None:
    """Of those that explain alike the first is taken up."""
    observations = [IMAGE, CONTROL, POSITION]
    assert list(CAUSES) == [*observations, OFFSET, DRIFT, ORDER, SIGMAS, LIST, *OF_CAMERAS, *OF_PHOTOS]


def test_a_cause_is_told_by_a_finding_a_note_or_a_key_of_the_result() -> None:
    source = "".join(path.read_text(encoding="utf-8") for path in modules().values())
    told = {code for each in CAUSES.values() for code in each.told} - {*KINDS, *described()}
    assert [code for code in sorted(told) if f'"{code}"' not in source] == []
