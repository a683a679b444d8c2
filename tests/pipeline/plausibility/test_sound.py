"""Sound projects of all layouts, of which nothing must be told."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from benchmarks import causes
from photostrip.pipeline.inputs import Inputs, Settings
from photostrip.pipeline.plausibility import gate, given_control
from photostrip.pipeline.plausibility.given_control import GivenControl, OfStrip
from photostrip.pipeline.run import triangulate
from photostrip.simulation import FILM, Control, Flight, Gnss, Ground, Image, Models, Points, Spec, Terrain, simulate
from tests.pipeline.blocks import orientations, positions, with_control
from tests.simulated import inputs_of, settings_of

if TYPE_CHECKING:
    from photostrip.pipeline.strips.photos import FormedPhotos
    from photostrip.simulation import Simulation

BLOCK = Spec(
    seed=4, flight=Flight(photos=6, strips=4, side_lap_percent=40.0), control=Control(per_band=1, check=4), gnss=Gnss()
)
HILLS = Terrain(relief=60.0)
WIDE = replace(FILM, name="wide", principal_distance=88.0)
BUNDLE = Settings(adjustment="bundle")


def told(inputs: Inputs, settings: Settings) -> list[str]:
    """Collect codes of `check` and of `run`."""
    findings = (*gate.of_inputs(inputs, settings), *triangulate(inputs, settings).findings)
    return sorted({each.code for each in findings})


@pytest.mark.slow
@pytest.mark.parametrize(("photos", "camera_height"), [(40, 1500.0), (110, 4000.0)])
def test_the_bend_of_a_long_strip_is_no_stretch_of_its_heights(photos: int, camera_height: float) -> None:
    """Level ground says nothing of the principal distance, however the strip bends."""
    spec = Spec(
        seed=80,
        flight=Flight(photos=photos, flying_height=camera_height),
        terrain=Terrain(relief=0.0),
        control=Control(every=6, per_band=2),
        image=Image(sigma_um=8.0),
    )
    made = simulate(spec)
    assert told(inputs_of(made), settings_of(made)) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("layout", "seed"),
    [
        ("end lap of 75-85 %", 31040),  # tilts hide a base of 35 mm: no photo twice
        ("film with fiducial marks", 7300006),  # film that shrinks irregularly, by twice the noise
        ("oblique mounts", 31004),  # photos side by side fit no control, the strip does
        ("two lists in two zones", 32009),  # a single point of a list, half the flying height off between photos
    ],
)
def test_photos_laid_side_by_side_prove_little(layout: str, seed: int) -> None:
    made = causes.LAYOUTS[layout][0](seed)
    assert [each.code for each in gate.of_inputs(made.inputs, made.settings)] == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("layout", "seed"),
    [
        ("60-300 photos, bands every 3-20, bundle", 9810048),  # 292 photos bend beyond what their covariance says
        ("two lists in two zones", 9710028),  # level ground: errors of the heights are all its relief, and turn over
    ],
)
def test_what_stretches_no_heights_is_no_principal_distance(layout: str, seed: int) -> None:
    made = causes.LAYOUTS[layout][0](seed)
    assert told(made.inputs, made.settings) == []


@pytest.mark.slow
def test_the_bend_of_a_long_strip_of_models_is_no_slip() -> None:
    spec = Spec(seed=1, flight=Flight(photos=50), control=Control(every=8, per_band=3), models=Models())
    inputs = inputs_of(simulate(spec))
    assert told(inputs, Settings()) == []


@pytest.mark.slow
@pytest.mark.parametrize(("name", "off"), [("G05", -20.0), ("K02", 20.0)])
def test_a_slip_stands_out_against_the_adjustment_of_models(name: str, off: float) -> None:
    """In a strip that bends by metres: one digit of a control point, and of a check point."""
    spec = Spec(seed=1, flight=Flight(photos=50), control=Control(every=8, per_band=3), models=Models())
    inputs = inputs_of(simulate(spec))
    row = inputs.control.ids.index(name)
    step = np.outer(np.arange(len(inputs.control)) == row, [off, 0.0, 0.0])
    wrong = replace(inputs, control=replace(inputs.control, enu=inputs.control.enu + step))
    (finding,) = triangulate(wrong, Settings()).findings
    assert (finding.code, finding.points, finding.evidence["axis"]) == ("P406", (name,), "east")
    assert abs(float(finding.evidence["would_fit"]) - inputs.control.enu[row, 0]) < 1e-6


@pytest.mark.slow
def test_a_strip_that_the_earth_bends_more_than_it_is_broad_is_sound() -> None:
    """550 km: the bend of 6 km is no breadth, and the breadth of 2 km no height."""
    made = simulate(Spec(seed=13, flight=Flight(photos=600), control=Control(every=15, per_band=3)))
    assert told(inputs_of(made), settings_of(made)) == []


@pytest.mark.slow
def test_strips_of_a_bundle_hold_each_other() -> None:
    """One line of control is weak for a strip by itself, and for a block that nothing else holds."""
    made = simulate(BLOCK)
    inputs = inputs_of(made)
    assert told(inputs, Settings(adjustment="polynomial")) == ["P502"]
    assert told(inputs, BUNDLE) == []
    one_strip = with_control(made, [name for name in made.control.ids if name in {"G01", "G02", "G03"}])
    assert told(one_strip, BUNDLE) == ["P502"]
    assert told(replace(one_strip, positions=positions(made)), BUNDLE) == []


@pytest.mark.slow
@pytest.mark.parametrize("role", ["K", "G"])
def test_a_bundle_says_whose_given_points_need_a_closer_look(role: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Strips are laid on their control only where the bundle does not agree with it."""
    looked_at: list[str] = []
    compared = given_control.of_strip

    def seen(control: GivenControl, stage: FormedPhotos, settings: Settings) -> OfStrip:
        looked_at.append(stage.strip.id)
        return compared(control, stage, settings)

    monkeypatch.setattr(given_control, "of_strip", seen)
    made = simulate(replace(BLOCK, control=Control(check=4)))
    inputs = inputs_of(made)
    assert triangulate(inputs, BUNDLE).findings == ()
    assert looked_at == []
    row = [number for number, name in enumerate(inputs.control.ids) if name.startswith(role)][1]
    enu = inputs.control.enu.copy()
    enu[row, 0] += 30.0 if enu[row, 0] // 10 % 10 < 5 else -30.0
    wrong = replace(inputs, control=replace(inputs.control, enu=enu))
    findings = triangulate(wrong, BUNDLE).findings
    assert {(each.code, *each.points) for each in findings} == {("P406", inputs.control.ids[row])}
    assert 0 < len(looked_at) < len(inputs.strips)


@pytest.mark.slow
def test_a_start_may_be_far_off() -> None:
    """Orientations without influence are no observations: what they say of themselves matters where a run fails."""
    made = simulate(BLOCK)
    given = orientations(made, observed=False)
    rng = np.random.default_rng(5)
    far = replace(given, enu=given.enu + rng.normal(0.0, 500.0, given.enu.shape) - [0.0, 0.0, 1500.0])
    assert told(replace(inputs_of(made), orientations=far), BUNDLE) == []
    observed = replace(far, observed=True, sigma=np.full(far.enu.shape, 500.0), sigma_turns=np.full(far.enu.shape, 1.0))
    assert "P204" in told(replace(inputs_of(made), orientations=observed), BUNDLE)


def test_photos_laid_side_by_side_predict_nothing_beyond_their_control() -> None:
    """They curl: a check point at the end of a strip lies half a base away from where `check` would expect it."""
    spec = Spec(
        seed=809380,
        camera=WIDE,
        ground=Ground("local"),
        flight=Flight(photos=8, end_lap_percent=67.78338999, scale=7806.195903629958, heading_deg=168.5663651633,
                      attitude_sigma_deg=(2.5, 2.5, 2.5)),
        terrain=Terrain(relief=68.69452395194364, slope_percent=(4.701872098953423, 0.5976056032583266)),
        points=Points(rows=5, extra_per_model=6),
        control=Control(layout="random", count=9, sigma=(0.0156, 0.0156, 0.0234)),
        image=Image(sigma_um=2.0),
    )  # fmt: skip
    made = simulate(spec)
    assert told(inputs_of(made), settings_of(made)) == []


def long_strip() -> Simulation:
    """Simulate a strip that bends between its bands by more than a low polynomial takes out."""
    return simulate(Spec(seed=8, flight=Flight(photos=60, scale=20000.0), control=Control(every=15), terrain=HILLS))


@pytest.mark.parametrize("adjustment", ["polynomial", "bundle"])
def test_the_bend_of_a_long_strip_is_no_typing_error(adjustment: str) -> None:
    """A check point between two bands lies metres from where a low polynomial puts it."""
    made = simulate(Spec(seed=10, flight=Flight(photos=60), control=Control(every=15), terrain=HILLS))
    assert told(inputs_of(made), replace(settings_of(made), adjustment=adjustment)) == []


@pytest.mark.slow
@pytest.mark.parametrize(("role", "index", "worth"), [("K", 1, 10.0), ("G", 5, 100.0)])
def test_a_typing_error_in_a_long_strip_is_told_as_the_adjustment_sees_it(role: str, index: int, worth: float) -> None:
    made = long_strip()
    inputs = inputs_of(made)
    row = [number for number, name in enumerate(inputs.control.ids) if name.startswith(role)][index]
    enu = inputs.control.enu.copy()
    digit = enu[row, 1] // worth % 10
    enu[row, 1] += worth * ((digit + 5) % 10 - digit)
    result = triangulate(replace(inputs, control=replace(inputs.control, enu=enu)), settings_of(made))
    (finding,) = result.findings
    assert (finding.code, finding.points) == ("P406", (inputs.control.ids[row],))
    assert finding.evidence["would_fit"] == pytest.approx(inputs.control.enu[row, 1], abs=0.01)
    # the same on the ground, where the metres of the map are longer or shorter
    fitting = enu[row] - [0.0, result.control_differences[row, 1], 0.0]
    wrong, right = result.frames[0].cartesian_from_ground(np.array([enu[row], fitting]))
    off = float(finding.evidence["off_m"])
    assert abs(off) == pytest.approx(np.linalg.norm(wrong - right), abs=1e-4)
    assert off * result.control_differences[row, 1] < 0
