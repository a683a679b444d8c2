"""Photos that are listed in no order come out as their strips do, whatever starts them.

Blocks of photos that are strips of their own each: no pairs, no models, and yet every output.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.camera import Camera
from photostrip.comparison import compare_results
from photostrip.errors import GeometryError, InputError
from photostrip.geometry.rotation import from_vector
from photostrip.pipeline import gate
from photostrip.pipeline.inputs import Inputs, Strip
from photostrip.report.html import to_html
from photostrip.report.sections.accuracy_report import sections_of
from photostrip.result.document import document_of
from photostrip.result.verdict import verdict_of
from photostrip.sheets.trace import trace_sheet
from photostrip.simulation import Control, Flight, Gnss, Ground, Image, Points, Simulation, Spec, Terrain, simulate
from tests.pipeline.blocks import (
    adjusted,
    corners,
    errors,
    exact,
    lost,
    measured,
    note,
    orientations,
    positions,
    rms,
    with_camera,
    with_control,
)
from tests.results import result_files
from tests.simulated import inputs_of, settings_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from photostrip.pipeline.inputs import GivenOrientations
    from photostrip.pipeline.results import Result


SAME_MINIMUM = 1e-6  # metres, by which two starts of one adjustment end apart
SENSOR = Camera("uav", 8.8, format=(13.2, 8.8), pixel_size=0.0024)
FLOWN = Flight(
    4, 4, alternate=True, end_lap_percent=80, side_lap_percent=60, scale=None, flying_height=100,
    attitude_sigma_deg=(2, 2, 3), position_sigma=(0.5, 0.5, 0.3),
)  # fmt: skip
UAV = Spec(
    camera=SENSOR,
    flight=FLOWN,
    terrain=Terrain(relief=5, wavelength=60),
    points=Points(rows=3, extra_per_model=12),
    control=Control(layout="corners", sigma=(0.01, 0.01, 0.015)),
    image=Image(sigma_um=1.2),
    gnss=Gnss(sigma=(0.03, 0.03, 0.05)),
)


def in_no_order(inputs: Inputs) -> Inputs:
    """Take the photos of all strips out of their order."""
    singles = [replace(s, id=name, photos=(name,), listed=False) for s in inputs.strips for name in s.photos]
    return replace(inputs, strips=tuple(singles))


def three_corners(simulation: Simulation) -> Inputs:
    """Three control points, and GNSS."""
    noise = np.random.default_rng(4).normal(0.0, 0.03, (16, 3))
    given = positions(simulation, sigma=0.03, noise=noise)
    return replace(with_control(simulation, corners(simulation)[:3]), positions=given)


def five_points(simulation: Simulation) -> Inputs:
    names = [name for name, check in zip(simulation.control.ids, simulation.control.check, strict=True) if not check]
    return with_control(simulation, [*corners(simulation), names[len(names) // 2]])


def rough(simulation: Simulation) -> GivenOrientations:
    """Orientations as a consumer drone has them, to a metre and a degree."""
    given, rng = orientations(simulation, observed=False), np.random.default_rng(5)
    enu = given.enu + rng.normal(0.0, 1.0, given.enu.shape)
    return replace(given, enu=enu, angles=given.angles + rng.normal(0.0, np.radians(1.0), given.angles.shape))


def told(result: Result) -> str:
    return note(result, "photos-in-no-order").message


def apart(one: Result, other: Result) -> float:
    """Largest distance of a point between two results, metres."""
    ids = [[each.refined.observations.point_ids[n] for n in each.points.number] for each in (one, other)]
    assert sorted(ids[0]) == sorted(ids[1])
    place = {name: row for row, name in enumerate(ids[1])}
    return float(np.abs(one.points.cartesian - other.points.cartesian[[place[name] for name in ids[0]]]).max())


@pytest.mark.parametrize("given", [three_corners, five_points])
def test_sixteen_photos_come_out_as_their_strips_do(given: Callable[[Simulation], Inputs]) -> None:
    """Four lines flown to and fro; GNSS and three control points, or five control points alone."""
    simulation = simulate(UAV)
    inputs = given(simulation)
    result = adjusted(simulation, in_no_order(inputs))
    assert told(result) == (
        "16 photos in no given order: 4 strips found among them, 1001-1004 (4 photos), 2001-2004 (4 photos), 3001-3004 "
        "(4 photos), 4001-4004 (4 photos)"
    )
    assert apart(result, adjusted(simulation, inputs)) < SAME_MINIMUM
    assert rms(simulation, result) < 0.05
    assert result.findings == ()
    assert document_of(result)["counts"]["strips"] == 4


MISREAD = {  # what stands in place of positions, by the finding: feet, exchanged axes; without a change another zone
    "P405": lambda enu: enu / [1.0, 1.0, 0.3048],
    "P403": lambda enu: enu / 0.3048,
    "P401": lambda enu: enu[:, [1, 0, 2]],
    "P402": lambda enu: enu,
}


@pytest.mark.parametrize("order", [lambda inputs: inputs, in_no_order])
@pytest.mark.parametrize("code", MISREAD)
def test_positions_that_are_misread_are_named_and_no_control_is_blamed(
    code: str, order: Callable[[Inputs], Inputs]
) -> None:
    simulation = simulate(UAV)
    given = order(three_corners(simulation))
    assert given.positions is not None
    frame = replace(given.positions.frame, crs="EPSG:32632") if code == "P402" else given.positions.frame
    read = replace(given.positions, frame=frame, enu=MISREAD[code](given.positions.enu))
    with pytest.raises(InputError, match="nothing is adjusted") as refused:
        adjusted(simulation, replace(given, positions=read))
    checked = gate.of_inputs(replace(given, positions=read), settings_of(simulation))
    assert [each.code for each in checked] == [each.code for each in refused.value.findings] == [code]
    assert checked[0].key.startswith("camera_positions.")


def test_an_exchange_of_two_positions_is_named_and_costs_neither() -> None:
    """Both were rejected, once by themselves, once beside the offset of an antenna."""
    simulation = simulate(UAV)
    given = in_no_order(three_corners(simulation))
    assert given.positions is not None
    for antenna in (0.0, 1.2):
        enu = given.positions.enu[[0, 3, 2, 1, *range(4, 16)]] + [0.0, 0.0, antenna]
        result = adjusted(simulation, replace(given, positions=replace(given.positions, enu=enu)))
        assert [next(iter(each.evidence)) for each in result.findings] == ["order", "offset_east_m"][
            : 1 + bool(antenna)
        ]
        assert lost(result, "control", "position") == []


def test_oblique_photos_start_from_their_orientations() -> None:
    """Looking aside by 45 degrees, side by side and head to tail."""
    simulation = simulate(UAV)
    truth = simulation.truth
    lean = np.stack([from_vector([0.0, side * np.pi / 4, 0.0]) for side in np.resize([1, -1], len(truth.rotations))])
    rotations = truth.rotations @ lean
    leaning = replace(simulation, truth=replace(truth, rotations=rotations))
    inputs, points = five_points(simulation), simulation.observations
    seen = np.einsum(
        "nij,nj->ni", lean.transpose(0, 2, 1)[points.photo], np.column_stack([points.xy, -8.8 + 0 * points.xy[:, 0]])
    )
    xy = -8.8 * seen[:, :2] / seen[:, 2:]
    kept = np.abs(xy).max(axis=1) < 20.0
    wide = with_camera(inputs, format=(40.0, 40.0))
    inputs = in_no_order(replace(wide, observations=measured(replace(points, xy=xy), kept)))
    result = adjusted(simulation, replace(inputs, orientations=rough(leaning)))
    assert rms(simulation, result) < 0.1


def test_a_photo_that_no_strip_takes_is_resected_on_the_points_of_its_neighbours() -> None:
    simulation = simulate(UAV)
    inputs = five_points(simulation)
    points = inputs.observations
    lost = points.photo_ids.index("2002")
    rows = np.flatnonzero(points.photo == lost)
    gone = rows[np.argsort(np.abs(points.xy[rows, 0] + points.xy[rows, 1]))[:-4]]  # of it four points are left
    table = measured(points, np.setdiff1d(np.arange(len(points)), gone))
    result = adjusted(simulation, in_no_order(replace(inputs, observations=table)))
    assert told(result).endswith("1 photo is oriented one by one, 2002")
    assert rms(simulation, result) < 0.05


def test_a_photo_that_hangs_on_nothing_is_refused_by_name() -> None:
    """Its points bear other names than on the other photos."""
    inputs = five_points(simulate(UAV))
    points = inputs.observations
    own = points.photo == points.photo_ids.index("3003")
    names = (*points.point_ids, *(f"own {name}" for name in points.point_ids))
    table = replace(points, point=points.point + own * len(points.point_ids), point_ids=names)
    with pytest.raises(GeometryError, match=r"photo 3003, which is in no strip, .*give its orientation roughly"):
        adjusted(simulate(UAV), in_no_order(replace(inputs, observations=table)))


MICROMETRE = 1e-6  # metres
MANY = Control(noise=(0.0, 0.0, 0.0), layout="bands", bands=6, per_band=3)


def singles(simulation: Simulation) -> Inputs:
    """Cut every strip into its photos."""
    inputs = inputs_of(simulation)
    strips = [Strip(photo, strip.camera, (photo,)) for strip in inputs.strips for photo in strip.photos]
    return replace(inputs, strips=tuple(strips))


@pytest.mark.parametrize("crs", ["EPSG:32633", "geocentric", "local"])
def test_single_photos_on_full_control_come_back_to_the_truth(crs: str) -> None:
    simulation = simulate(exact(flight=Flight(photos=6), control=MANY, ground=Ground(crs=crs)))
    result = adjusted(simulation, singles(simulation))
    assert np.abs(errors(simulation, result)).max() < MICROMETRE
    document = document_of(result)
    assert document["counts"]["strips"] == 6
    assert document["models"] == document["strips"] == []
    assert document["summary"]["photo_scale"] == pytest.approx(10_000, rel=0.02)
    assert document["summary"]["flying_height"] == pytest.approx(1530, rel=0.02)
    assert [row["strip"] for row in document["precision"]["basis"]] == [photo["id"] for photo in document["photos"]]


@pytest.mark.slow
def test_every_output_knows_single_photos() -> None:
    simulation = simulate(replace(Spec(), flight=Flight(photos=6), control=replace(MANY, noise=(0.05, 0.05, 0.08))))
    result = adjusted(simulation, singles(simulation))
    document = document_of(result)
    titles = [section.title for section in sections_of(document)]
    assert "Bundle adjustment" in titles
    assert "Relative orientation" not in titles
    assert to_html(document).count("<svg") >= 2
    assert set(result_files(document)) > {"points.csv", "photos.csv", "residuals.csv"}
    assert "absolute" not in trace_sheet(result).document()
    assert compare_results(document, document)["status"] == "same"


@pytest.mark.parametrize("given", ["observed", "approximate", "one short"])
def test_a_strip_with_a_pair_that_cannot_be_oriented_starts_from_given_orientations(given: str) -> None:
    """Half of a pair's points were taken for others; what the bundle rejects is just these."""
    simulation = simulate(Spec(flight=Flight(photos=6)))
    seen, noise = simulation.observations, np.random.default_rng(1)
    before = np.isin(seen.point, seen.point[seen.photo == 2])
    wrong = np.flatnonzero((seen.photo == 3) & before)[::2]
    xy = seen.xy.copy()
    xy[wrong] += noise.uniform(-50.0, 50.0, (len(wrong), 2))
    known = orientations(simulation, observed=given == "observed")
    if given == "one short":
        left = slice(0, 5)
        parts = {name: getattr(known, name)[left] for name in ("photos", "enu", "angles", "sigma", "sigma_turns")}
        known = replace(known, **parts)
    inputs = replace(inputs_of(simulation), observations=replace(seen, xy=xy), orientations=known)
    if given == "one short":
        with pytest.raises(GeometryError, match="relative orientation of photos 1003 and 1004"):
            adjusted(simulation, inputs)
        return
    result = adjusted(simulation, inputs)
    assert result.bundle is not None
    used = np.zeros(len(seen), bool)
    used[result.bundle.block.rows[result.bundle.screened.selection.images]] = True
    assert not used[wrong].any()
    assert np.count_nonzero(~used) <= len(wrong) + 3
    right = np.setdiff1d(np.arange(len(seen)), wrong)
    without = adjusted(simulation, replace(inputs, observations=measured(seen, right)))
    assert rms(simulation, result) < 1.2 * rms(simulation, without)
    document = document_of(result)
    verdict = verdict_of(document)
    assert verdict["status"] == "look"
    assert any("start from their given orientations" in text for text in verdict["look_at"])
    assert [section.title for section in sections_of(document)]
