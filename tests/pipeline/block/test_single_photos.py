"""Blocks of photos that are strips of their own each: no pairs, no models, and yet every output."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from photostrip.comparison import compare_results
from photostrip.errors import GeometryError
from photostrip.pipeline.inputs import GivenOrientations, Inputs, Strip
from photostrip.pipeline.run import triangulate
from photostrip.points import PhotoPoints
from photostrip.report.html import to_html
from photostrip.report.sections.accuracy_report import sections_of
from photostrip.result.document import document_of
from photostrip.result.trace.trace import trace_of
from photostrip.result.verdict import verdict_of
from photostrip.simulation import Control, Flight, Ground, Points, Simulation, Spec
from tests.pipeline.blocks import adjusted, errors, exact, orientations, positions, simulate, with_control
from tests.results import result_files
from tests.simulated import inputs_of, settings_of

MICROMETRE = 1e-6  # metres
MANY = Control(noise=(0.0, 0.0, 0.0), layout="bands", bands=6, per_band=3)


def singles(simulation: Simulation, inputs: Inputs | None = None) -> Inputs:
    """Cut every strip into its photos."""
    inputs = inputs_of(simulation) if inputs is None else inputs
    strips = [Strip(photo, strip.camera, (photo,)) for strip in inputs.strips for photo in strip.photos]
    return replace(inputs, strips=tuple(strips))


@pytest.mark.parametrize("crs", ["EPSG:32633", "geocentric", "local"])
def test_single_photos_on_full_control_come_back_to_the_truth(crs: str) -> None:
    simulation = simulate(exact(flight=Flight(photos=6), control=MANY, ground=Ground(crs=crs)))
    result = adjusted(simulation, singles(simulation))
    assert np.abs(errors(simulation, result)).max() < MICROMETRE
    document = document_of(result)
    assert document["counts"]["strips"] == 6
    assert document["models"] == document["strips"] == document["parallaxes"] == []
    assert document["summary"]["photo_scale"] == pytest.approx(10_000, rel=0.02)
    assert document["summary"]["flying_height"] == pytest.approx(1530, rel=0.02)
    assert [row["strip"] for row in document["precision"]["basis"]] == [photo["id"] for photo in document["photos"]]


def test_single_photos_hand_points_on_to_the_next() -> None:
    """The last photo sees three control points, and points of the photo before it, which is oriented first."""
    simulation = simulate(exact(flight=Flight(photos=8), control=replace(MANY, bands=3)))
    inputs = inputs_of(simulation)
    (strip,) = inputs.strips
    cut = (strip.photos[:6], strip.photos[6:7], strip.photos[7:])
    strips = tuple(Strip(photos[0], strip.camera, photos) for photos in cut)
    result = adjusted(simulation, replace(inputs, strips=strips))
    assert np.abs(errors(simulation, result)).max() < MICROMETRE


def test_photos_of_a_strip_without_points_on_three_of_them_start_on_points_of_the_other_strip() -> None:
    block = exact(flight=Flight(photos=5, strips=2, side_lap_percent=60.0), points=Points(rows=5))
    simulation = simulate(block)
    seen, names = simulation.observations, simulation.strips[1][1]
    shown = np.zeros((len(seen.photo_ids), len(seen.point_ids)), bool)
    shown[seen.photo, seen.point] = True
    first, middle, last = (seen.photo_index[photo] for photo in names[1:4])
    on_three = shown[first] & shown[middle] & shown[last]
    kept = ~(on_three[seen.point] & (seen.photo == middle))
    columns = {name: getattr(seen, name)[kept] for name in ("photo", "point", "xy", "sigma")}
    result = adjusted(simulation, replace(inputs_of(simulation), observations=replace(seen, **columns)))
    assert np.abs(errors(simulation, result)).max() < MICROMETRE
    assert any(note.code == "not-formed" for note in result.notes)


def test_single_photos_with_three_known_points_each_are_refused_with_a_way_out() -> None:
    simulation = simulate(exact(flight=Flight(photos=6), control=replace(MANY, bands=2)))
    with pytest.raises(GeometryError, match=r"3 known points .*; list photos that overlap as one strip"):
        adjusted(simulation, singles(simulation))


@pytest.mark.slow
def test_every_output_knows_single_photos() -> None:
    simulation = simulate(replace(Spec(), flight=Flight(photos=6), control=replace(MANY, noise=(0.05, 0.05, 0.08))))
    result = adjusted(simulation, singles(simulation))
    document = document_of(result)
    for everything in (False, True):
        titles = [section.title for section in sections_of(document, everything=everything)]
        assert "Bundle adjustment" in titles
        assert "Relative orientation" not in titles
    assert to_html(document).count("<svg") >= 2
    assert set(result_files(document)) > {"points.csv", "photos.csv", "residuals.csv"}
    assert trace_of(result)["strips"] == []
    assert compare_results(document, document)["status"] == "same"


@pytest.mark.slow
def test_refraction_takes_its_heights_from_single_photos_too() -> None:
    simulation = simulate(exact(flight=Flight(photos=6), control=MANY))
    asked = settings_of(simulation)
    asked = replace(asked, adjustment="bundle", refinement=replace(asked.refinement, refraction=True))
    assert np.isfinite(triangulate(singles(simulation), asked).points.cartesian).all()


@pytest.mark.parametrize("screening", ["snooping", "none"])
@pytest.mark.parametrize(("metres", "degrees"), [(50.0, 2.0), (500.0, 8.0)])
def test_approximate_orientations_far_off_are_a_start_and_no_more(
    screening: str, metres: float, degrees: float
) -> None:
    """Photos begin hundreds of metres off; no ray may be left out for that, and control in closed form helps."""
    simulation = simulate(exact(flight=Flight(photos=6), control=MANY))
    given = orientations(simulation, observed=False)
    noise = np.random.default_rng(4)
    given = replace(
        given,
        enu=given.enu + noise.normal(0.0, metres, given.enu.shape),
        angles=given.angles + np.radians(noise.normal(0.0, degrees, given.angles.shape)),
    )
    inputs = replace(singles(simulation), orientations=given)
    result = adjusted(simulation, inputs, screening=screening)
    assert np.abs(errors(simulation, result)).max() < MICROMETRE


@pytest.mark.slow
@pytest.mark.parametrize("screening", ["snooping", "none"])
def test_approximate_heights_below_the_ground_are_a_start_too(screening: str) -> None:
    """The photos are oriented on their control in closed form then."""
    simulation = simulate(exact(flight=Flight(photos=6), control=MANY))
    given = orientations(simulation, observed=False)
    given = replace(given, enu=given.enu - np.array([0.0, 0.0, 2000.0]))
    result = adjusted(simulation, replace(singles(simulation), orientations=given), screening=screening)
    assert np.abs(errors(simulation, result)).max() < MICROMETRE


def test_single_photos_that_nothing_holds_are_refused_by_name() -> None:
    """The search for what the data say against themselves formed pairs of one photo."""
    simulation = simulate(exact(flight=Flight(photos=2), control=replace(MANY, bands=2)))
    names = simulation.control.ids[:1]
    inputs = replace(
        singles(simulation, with_control(simulation, names)), orientations=orientations(simulation, observed=False)
    )
    with pytest.raises(GeometryError, match="does not determine"):
        adjusted(simulation, inputs)


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
    kept = np.ones(len(seen), bool)
    kept[wrong] = False
    cut = PhotoPoints(
        photo_ids=seen.photo_ids,
        point_ids=seen.point_ids,
        photo=seen.photo[kept],
        point=seen.point[kept],
        xy=seen.xy[kept],
        sigma=seen.sigma[kept],
    )
    without = adjusted(simulation, replace(inputs, observations=cut))
    error, least = (np.sqrt((errors(simulation, each) ** 2).sum(axis=1).mean()) for each in (result, without))
    assert error < 1.2 * least
    document = document_of(result)
    verdict = verdict_of(document)
    assert verdict["status"] == "look"
    assert any("start from their given orientations" in text for text in verdict["look_at"])
    assert [section.title for section in sections_of(document, everything=True)]


@pytest.mark.parametrize("seed", [8, 20])
def test_approximate_orientations_hold_against_wrong_images_of_control(seed: int) -> None:
    """Resected on images of which half are wrong a photo lay 320 m off; a strip formed of them did not converge."""
    rng = np.random.default_rng(seed)
    simulation = simulate(Spec(seed=seed, flight=Flight(photos=6), points=Points(extra_per_model=8)))
    seen, pair = simulation.observations, int(rng.integers(5))
    common = np.flatnonzero((seen.photo == pair + 1) & np.isin(seen.point, seen.point[seen.photo == pair]))
    wrong = rng.permutation(common)[: len(common) // 2]
    xy = seen.xy.copy()
    xy[wrong] += rng.uniform(-50.0, 50.0, (len(wrong), 2))
    known = orientations(simulation, observed=False)
    known = replace(
        known,
        enu=known.enu + rng.normal(0.0, 20.0, known.enu.shape),
        angles=known.angles + rng.normal(0.0, 0.01, known.angles.shape),
    )
    result = adjusted(simulation, replace(inputs_of(simulation), observations=replace(seen, xy=xy), orientations=known))
    assert any(note.code == "not-formed" for note in result.notes)
    assert np.sqrt((errors(simulation, result) ** 2).sum(axis=1).mean()) < 0.3


ROUGH = np.radians(2.0)  # standard deviation of angles that are given roughly


def roughly(simulation: Simulation) -> GivenOrientations:
    """Orientations for a start, their angles off by some degrees."""
    given = orientations(simulation, observed=False)
    return replace(given, angles=given.angles + np.random.default_rng(1).normal(0.0, ROUGH, given.angles.shape))


def test_photos_that_their_rough_orientations_miss_are_adjusted() -> None:
    """By its given angles photo 1008 misses all its points; its rays are no worse than those of others."""
    flight = Flight(photos=8, strips=2, side_lap_percent=60.0, attitude_sigma_deg=(1.0, 1.0, 1.0))
    spec = Spec(
        ground=Ground(crs="local"),
        flight=flight,
        points=Points(extra_per_model=8),
        control=Control(layout="bands", bands=2),
    )
    simulation = simulate(spec)
    noise = np.random.default_rng(1).normal(0.0, 0.05, (16, 3))
    inputs = replace(
        singles(simulation), orientations=roughly(simulation), positions=positions(simulation, noise=noise)
    )
    result = adjusted(simulation, inputs)
    assert document_of(result)["counts"]["photos"] == 16
    assert verdict_of(document_of(result))["look_at"] == []


@pytest.mark.parametrize("off", [5.0, 50.0])
def test_control_that_contradicts_the_start_is_still_control(off: float) -> None:
    """Six control points, each metres off for itself: they are named, none is right, and a free network has none."""
    simulation = simulate(
        Spec(
            flight=Flight(photos=4, strips=2, side_lap_percent=40.0),
            points=Points(extra_per_model=8),
            control=Control(layout="corners+centre"),
        )
    )
    inputs = singles(simulation, with_control(simulation, [f"G0{number}" for number in range(1, 7)]))
    control = inputs.control
    shift = np.where(control.check[:, None], 0.0, np.random.default_rng(6).normal(0.0, off, control.enu.shape))
    given = replace(control, enu=control.enu + shift)
    result = adjusted(simulation, replace(inputs, control=given, orientations=orientations(simulation, observed=False)))
    told = {note.code for note in result.notes if note.severity == "warning"}
    assert told == {"control-doubtful"}
