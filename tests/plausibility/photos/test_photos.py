"""What image coordinates alone say against themselves: units, order, overlap, photos that are twice or mirrored."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from photostrip.plausibility import flight_order, units
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
    return flight_order.find_wrong_order(observations, "A", photos)[0]


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
    assert flight_order.find_wrong_order(turned, "A", photos)[1].photos == photos


@pytest.mark.parametrize("place", range(PHOTOS - 1))
def test_two_photos_in_the_wrong_order_are_both_named(place: int) -> None:
    made = simulation()
    photos = made.strips[0][1]
    wrong = [*photos[:place], photos[place + 1], photos[place], *photos[place + 2 :]]
    findings, arranged = flight_order.find_wrong_order(made.observations, "A", wrong)
    assert codes(findings) == ["P201"]
    assert set(findings[0].photos) == {photos[place], photos[place + 1]}
    assert arranged.photos in {photos, photos[::-1]}


@pytest.mark.parametrize("by", [1.0, -1.0, 1j, -1j, np.exp(0.4j)])
def test_a_mirrored_photo_is_named_however_it_was_mirrored(by: complex) -> None:
    made = simulation()
    photos = made.strips[0][1]
    findings, arranged = flight_order.find_wrong_order(
        changed(made.observations, photos[3], by, mirror=True), "A", photos
    )
    assert codes(findings) == ["P104"]
    assert findings[0].photos == (photos[3],)
    assert arranged.mirrored == {photos[3]}


@pytest.mark.parametrize(("times", "word"), [(1000.0, "micrometres"), (1e-3, "millimetres"), (1 / 25.4, "inches")])
def test_a_photo_in_another_unit_is_named_with_the_unit(times: float, word: str) -> None:
    made = simulation()
    photos = made.strips[0][1]
    (finding,) = found(changed(made.observations, photos[4], times), photos)
    assert (finding.code, finding.photos) == ("P102", (photos[4],))
    assert finding.evidence["times"] == pytest.approx(times, rel=0.1)
    assert word in finding.message


@pytest.mark.parametrize(("rows", "word"), [(1, "up"), (-1, "down")])
def test_ids_of_a_photo_in_the_rows_of_other_points(rows: int, word: str) -> None:
    made = simulation()
    photos = made.strips[0][1]
    o = made.observations
    inside, point = o.photo == o.photo_ids.index(photos[3]), o.point.copy()
    point[inside] = np.roll(point[inside], rows)
    (finding,) = found(replace(o, point=point), photos)
    assert (finding.code, finding.photos) == ("P303", (photos[3],))
    assert f"moved {word} by one row they do" in finding.message


def test_points_numbered_anew_on_each_photo() -> None:
    made = simulation()
    photos = made.strips[0][1]
    point, o = made.observations.point.copy(), made.observations
    for number in range(len(o.photo_ids)):
        inside = np.flatnonzero(o.photo == number)
        point[inside] = np.argsort(np.random.default_rng(number).random(len(inside)))
    findings = [each for each in found(replace(o, point=point), photos) if each.code == "P303"]
    assert [each.photos for each in findings] == [photos]


def test_the_same_photo_twice() -> None:
    made = simulation()
    o, photos = made.observations, made.strips[0][1]
    rows = o.photo == o.photo_ids.index(photos[2])
    count = int(rows.sum())
    noise = np.random.default_rng(1).normal(0.0, 0.005, (count, 2))
    twice = replace(
        o,
        photo_ids=(*o.photo_ids, "copy"),
        photo=np.r_[o.photo, np.full(count, len(o.photo_ids))],
        point=np.r_[o.point, o.point[rows]],
        xy=np.r_[o.xy, o.xy[rows] + noise],
        sigma=np.r_[o.sigma, o.sigma[rows]],
    )
    findings, arranged = flight_order.find_wrong_order(twice, "A", [*photos[:3], "copy", *photos[3:]])
    assert codes(findings) == ["P203"]
    assert set(findings[0].photos) == {photos[2], "copy"}
    assert arranged.photos == photos


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


@pytest.mark.parametrize(("measured", "word"), [(1000.0, "micrometres"), (1e-3, "millimetres"), (1 / 25.4, "inches")])
def test_marks_in_another_unit_are_named_with_the_unit(measured: float, word: str) -> None:
    scales = np.array([1.0, 1.002, 1.0 / measured, 0.998 / measured])  # calibrated over measured distances
    (finding,) = units.find_wrong_mark_units(scales, ["1", "2", "3", "4"])
    assert (finding.code, finding.severity, finding.photos) == ("P106", "warning", ("3", "4"))
    assert finding.evidence["measured_over_calibrated"] == pytest.approx(measured, rel=0.002)
    assert word in finding.message
    assert finding.key == "fiducial_measurements.unit"


@pytest.mark.parametrize("factor", [10.0, 0.1, 1000.0, 1e-3])
def test_a_principal_distance_off_by_a_power_of_ten(factor: float) -> None:
    made = simulation()
    camera = replace(made.camera, principal_distance=made.camera.principal_distance * factor)
    (finding,), _ = units.find_wrong_units(made.observations, dict.fromkeys(made.strips[0][1], camera))
    assert (finding.code, finding.fix) == ("P105", "is it 153 mm?")
