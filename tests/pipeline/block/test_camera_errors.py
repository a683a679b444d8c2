"""A camera that is not as stated: named, estimated beside what is given, at no cost for sound control."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.stats import chi2, norm

from photostrip.camera import Camera, Distortion
from photostrip.network.hypotheses import log_probability, log_probability_of_any
from photostrip.pipeline.run import triangulate
from photostrip.simulation import FILM, Control, Flight, GrossError, Image, Points, Spec, Terrain, simulate
from tests.pipeline.blocks import errors
from tests.simulated import inputs_of, settings_of

if TYPE_CHECKING:
    from photostrip.pipeline.results import Result
    from photostrip.simulation import Simulation

K1 = -2e-8  # mm^-2: 20 µm at 100 mm
LENS = Distortion("brown", "image_to_ideal", k=(K1, 0.0, 0.0))


def strip(seed: int, photos: int = 30, *wrong: GrossError) -> Spec:
    return Spec(
        seed=seed,
        flight=Flight(photos=photos),
        points=Points(extra_per_model=6),
        control=Control(bands=8),
        gross_errors=wrong,
    )


def adjusted(simulation: Simulation, **settings: object) -> Result:
    """Adjust a simulation as if its camera had no distortion."""
    inputs = inputs_of(simulation)
    strips = tuple(replace(each, camera=replace(each.camera, distortion=None)) for each in inputs.strips)
    asked = replace(settings_of(simulation), adjustment="bundle")
    asked = replace(asked, bundle=replace(asked.bundle, **settings))  # type: ignore[arg-type]
    return triangulate(replace(inputs, strips=strips), asked)


def taken_up(result: Result) -> list[str]:
    assert result.bundle is not None
    return [each.name for each in result.bundle.parameters]


def control_lost(result: Result) -> int:
    assert result.bundle is not None
    return sum(each.kind == "control" and not each.readmitted for each in result.bundle.screened.rejections)


def up(simulation: Simulation, result: Result) -> float:
    """Rms of the errors in height, metres."""
    return float(np.sqrt((errors(simulation, result)[:, 2] ** 2).mean()))


@pytest.mark.slow
def test_an_unstated_lens_is_named_and_costs_nothing() -> None:
    spec = strip(21)
    sound, bent = simulate(spec), simulate(replace(spec, camera=replace(FILM, distortion=LENS)))
    result = adjusted(bent)
    (finding,) = result.findings
    assert finding.code == "P110"
    assert finding.key == "processing.self_calibration"
    assert "[k1]" in finding.fix
    assert finding.evidence["k1"] == pytest.approx(K1, abs=4 * float(finding.evidence["k1_standard_deviation"]))
    assert control_lost(result) == 0
    assert up(bent, result) < 1.1 * up(sound, adjusted(sound))
    left = adjusted(bent, search_cameras=False)
    assert taken_up(left) == []
    assert up(bent, left) > 1.3 * up(bent, result)


@pytest.mark.slow
def test_film_that_shrank_one_way_is_named_and_no_control_is_doubted() -> None:
    sound = simulate(strip(25, 12))
    inputs = inputs_of(sound)
    shrunk = replace(inputs, observations=replace(inputs.observations, xy=inputs.observations.xy * [0.998, 1.0]))
    result = triangulate(shrunk, settings_of(sound))
    (finding,) = result.findings
    assert finding.code == "P112"
    assert "[affinity, shear]" in finding.fix
    assert finding.evidence["x_over_y_percent"] == pytest.approx(-0.2, abs=0.01)
    assert control_lost(result) == 0
    assert up(sound, result) < 1.1 * up(sound, triangulate(inputs, settings_of(sound)))


@pytest.mark.slow
def test_gross_errors_are_no_error_of_a_camera() -> None:
    for seed in range(31, 33):
        wrong = (GrossError("image", count=8, size_um=150.0), GrossError("control", count=2, size_m=3.0))
        assert taken_up(adjusted(simulate(strip(seed, 20, *wrong)))) == []


@pytest.mark.slow
def test_a_lens_that_nobody_calibrated_costs_no_more_than_one_that_is_asked_for() -> None:
    """Two strips of a drone, turned by ten degrees: f 1 % off, the principal point 0.1 mm, k1 and k2 unstated."""
    stated = Camera("uav", principal_distance=8.8, format=(13.2, 8.8), pixel_size=0.0024)
    lens = Distortion("brown", "image_to_ideal", k=(2e-4, -3e-6, 0.0))
    true = replace(stated, principal_distance=8.888, principal_point=(0.1, -0.07), distortion=lens)
    flight = Flight(
        photos=6,
        strips=2,
        end_lap_percent=80.0,
        side_lap_percent=70.0,
        flying_height=60.0,
        attitude_sigma_deg=(10.0, 10.0, 5.0),
    )
    control = Control(layout="random", count=12, check=10, sigma=(0.01, 0.01, 0.015))
    points, terrain = Points(rows=5, extra_per_model=15), Terrain(relief=8.0)
    spec = Spec(camera=true, flight=flight, terrain=terrain, points=points, control=control, image=Image(sigma_um=1.4))
    simulation = simulate(spec)
    inputs, settings = inputs_of(simulation), settings_of(simulation)
    inputs = replace(inputs, strips=tuple(replace(each, camera=stated) for each in inputs.strips))
    found = triangulate(inputs, settings)
    assert [each.code for each in found.findings] == ["P107", "P110", "P111"]
    assert "[k1, k2]" in found.findings[1].fix
    assert control_lost(found) == 0
    free = ("principal_distance", "principal_point", "k1", "k2")
    asked = replace(inputs, strips=tuple(replace(each, calibrate=free) for each in inputs.strips))
    assert errors(simulation, found) == pytest.approx(errors(simulation, triangulate(asked, settings)), abs=1e-6)


def test_probabilities_are_those_of_scipy_and_go_on_where_numbers_end() -> None:
    for squares, freedom in ((3.0, 1), (30.0, 2), (200.0, 12)):
        assert log_probability(squares, freedom) == pytest.approx(chi2.logsf(squares, freedom), rel=1e-9)
    assert log_probability(4000.0, 1) == pytest.approx(norm.logsf(4000.0**0.5) + np.log(2.0), rel=1e-5)
    assert log_probability_of_any(36.0, 1, 100) == pytest.approx(norm.logsf(6.0) + np.log(200.0), rel=1e-9)
    assert log_probability_of_any(0.0, 1, 100) == 0.0
